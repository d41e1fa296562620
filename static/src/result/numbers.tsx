// SPDX-License-Identifier: GPL-3.0-or-later
//
// Everything entered and computed, one column an assessment, and the difference of two.
import { format, format_fixed, format_signed, t } from '../i18n.js';
import { Symbol_ } from '../form/field.js';
import type { Assessment, ParameterInfo, Result } from '../types.js';
import { column_names } from '../ui.js';
import { quantities, quantity_name, type Finished, type Quantity } from './quantities.js';

const unit_suffix = (unit: string): string => (unit ? `\u00a0${unit}` : '');

/* Decimals of a number as it was entered. */
const decimals_of = (value: number | undefined): number =>
  String(value ?? '').split('.')[1]?.length ?? 0;

function difference_text(
  a: number | null | undefined,
  b: number | null | undefined,
  decimals: number,
): string {
  return typeof a === 'number' && typeof b === 'number' ? format_signed(b - a, decimals) : '–';
}

function InputRows(props: { documents: Assessment[]; inputs: ParameterInfo[] }) {
  const { documents, inputs } = props;
  return (
    <>
      {inputs.map((info) => {
        const values = documents.map((d) => d.parameters[info.key]);
        return (
          <tr key={info.key}>
            <th scope="row">
              <Symbol_ of={info.key} /> {info.name}
            </th>
            {values.map((v, i) => (
              <td key={i}>{v === undefined ? '–' : format(v) + unit_suffix(info.unit)}</td>
            ))}
            {documents.length === 2 && (
              <td class="difference">
                {difference_text(values[0], values[1], Math.max(...values.map(decimals_of)))}
              </td>
            )}
          </tr>
        );
      })}
    </>
  );
}

function cell(q: Quantity, value: number | null | undefined): string {
  if (value === undefined || value === null) return q.absent ? t(q.absent) : '–';
  return format_fixed(value, q.decimals) + unit_suffix(q.unit);
}

function ResultRow(props: { q: Quantity; documents: Finished[] }) {
  const { q, documents } = props;
  const values = documents.map((d) => q.of(d.result));
  const first = documents[0];
  if (!first || values.every((v) => v === undefined)) return null;
  return (
    <tr>
      <th scope="row">{quantity_name(q, first.result)}</th>
      {values.map((v, i) => (
        <td key={i}>{cell(q, v)}</td>
      ))}
      {documents.length === 2 && (
        <td class="difference">{difference_text(values[0], values[1], q.decimals)}</td>
      )}
    </tr>
  );
}

function Heading(props: { text: string; columns: number }) {
  return (
    <tr class="heading">
      <th scope="colgroup" colSpan={props.columns}>
        {props.text}
      </th>
    </tr>
  );
}

function numerics_text(r: Result): string {
  const n = r.numerics;
  return [
    `${format(n.elements)} ${t('numbers.elements')}`,
    `${format(n.dof)} ${t('numbers.dof')}`,
    `${format(n.load_steps)} ${t('numbers.steps')}`,
    `${format(n.newton_iterations)} ${t('numbers.newton')}`,
    `${t('numbers.force_residual')} ${n.force_residual.toExponential(1)}`,
    `${t('numbers.energy_residual')} ${n.energy_residual.toExponential(1)}`,
    `${t('numbers.wall')} ${format_fixed(n.wall_s, 2)} s`,
    `${r.model.name} ${r.model.version}`,
  ].join(' · ');
}

export function Numbers(props: { documents: Finished[]; inputs: ParameterInfo[] }) {
  const { documents, inputs } = props;
  const names = column_names(documents);
  const columns = 1 + documents.length + (documents.length === 2 ? 1 : 0);
  return (
    <section class="panel-box" aria-labelledby="numbers">
      <h2 id="numbers">{t('numbers.title')}</h2>
      <div class="scroll" tabIndex={0} role="group" aria-labelledby="numbers">
        <table class="numbers">
          <thead>
            <tr>
              <th scope="col">{t('numbers.metric')}</th>
              {names.map((name) => (
                <th scope="col" key={name}>
                  {name}
                </th>
              ))}
              {documents.length === 2 && <th scope="col">{t('numbers.difference')}</th>}
            </tr>
          </thead>
          <tbody>
            <Heading text={t('numbers.inputs')} columns={columns} />
            <InputRows documents={documents} inputs={inputs} />
          </tbody>
          <tbody>
            <Heading text={t('numbers.results')} columns={columns} />
            {quantities.map((q) => (
              <ResultRow key={q.key} q={q} documents={documents} />
            ))}
          </tbody>
        </table>
      </div>
      <details>
        <summary>{t('numbers.numerics')}</summary>
        {documents.map((d, i) => (
          <p key={d.id} class="hint">{`${names[i]}: ${numerics_text(d.result)}`}</p>
        ))}
      </details>
    </section>
  );
}
