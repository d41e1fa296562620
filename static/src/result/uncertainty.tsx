// SPDX-License-Identifier: GPL-3.0-or-later
//
// How certain a result is when its measurements are not exact: quantiles, the share of samples over
// each threshold, what to measure better, and beside it what no measurement can mend.
import { format, format_fixed, format_percent, t, type Key } from '../i18n.js';
import { Symbol_ } from '../form/field.js';
import type { ParameterInfo, Quantiles, Uncertainty } from '../types.js';
import type { Finished } from './quantities.js';

const columns = [0.05, 0.25, 0.5, 0.75, 0.95];
const worth = 0.05; /* of the variance: less is not worth measuring better */

interface Row {
  key: Key;
  unit: string;
  decimals: number;
  of: (u: Uncertainty) => Quantiles;
  absent?: Key; /* what a missing number means; else the emulator does not know it */
}

const rows: readonly Row[] = [
  { key: 'what_if.eps', unit: '', decimals: 3, of: (u) => u.strain.eps_max },
  {
    key: 'numbers.v_shear',
    unit: 'mm³',
    decimals: 0,
    of: (u) => u.clusters.shear.volume_mm3,
  },
  {
    key: 'numbers.v_comp',
    unit: 'mm³',
    decimals: 0,
    of: (u) => u.clusters.compression.volume_mm3,
  },
  { key: 'numbers.v_both', unit: 'mm³', decimals: 0, of: (u) => u.clusters.both.volume_mm3 },
  {
    key: 'numbers.f_shear',
    unit: 'N',
    decimals: 1,
    of: (u) => u.threshold_force_N.shear,
    absent: 'uncertain.not_reached',
  },
  {
    key: 'numbers.f_comp',
    unit: 'N',
    decimals: 1,
    of: (u) => u.threshold_force_N.compression,
    absent: 'uncertain.not_reached',
  },
];

function Table(props: { of: Uncertainty; label: string }) {
  const cell = (v: number | null, row: Row): string => {
    if (v === null) return row.absent ? t(row.absent) : '–';
    return format_fixed(v, row.decimals);
  };
  return (
    <div class="scroll" tabIndex={0} role="group" aria-label={props.label}>
      <table class="numbers small">
        <thead>
          <tr>
            <th scope="col">{t('numbers.metric')}</th>
            {columns.map((p) => (
              <th scope="col" key={p}>{`${format(100 * p)}\u202f%`}</th>
            ))}
          </tr>
        </thead>
        <tbody>
          {rows.map((row) => (
            <tr key={row.key}>
              <th scope="row">{t(row.key) + (row.unit && `, ${row.unit}`)}</th>
              {row.of(props.of).map((v, i) => (
                <td key={i}>{cell(v, row)}</td>
              ))}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

/* The inputs by their total Sobol' index, largest first. */
export function by_share(u: Uncertainty): [string, number][] {
  return Object.entries(u.sensitivity.total)
    .flatMap(([key, v]) => (v !== null && v >= worth ? [[key, v] as [string, number]] : []))
    .sort((a, b) => b[1] - a[1]);
}

function Better(props: { of: Uncertainty; inputs: ParameterInfo[] }) {
  const shares = by_share(props.of);
  if (shares.length === 0) return null;
  return (
    <>
      <h3>{t('uncertain.better')}</h3>
      <p class="hint">{t('uncertain.better.note')}</p>
      <ol class="better">
        {shares.map(([key, share]) => (
          <li key={key}>
            <span>
              <Symbol_ of={key} /> {props.inputs.find((i) => i.key === key)?.name}
            </span>
            <svg class="bar" viewBox="0 0 100 10" preserveAspectRatio="none" aria-hidden="true">
              <rect class="band" x="0" y="1" width={100 * Math.min(1, share)} height="8" />
            </svg>
            <strong>{format_percent(share)}</strong>
          </li>
        ))}
      </ol>
    </>
  );
}

/* "R2 6 mm, F 25 N": those that are not exact. */
function deviations(u: Uncertainty, inputs: ParameterInfo[]): string {
  const unit = (key: string): string => inputs.find((i) => i.key === key)?.unit ?? '';
  return Object.entries(u.sd)
    .filter(([, v]) => v > 0)
    .map(([key, v]) => `${key} ${format(v, 3)}\u00a0${unit(key)}`)
    .join(', ');
}

const keys_outside = (u: Uncertainty): string =>
  Object.entries(u.outside)
    .filter(([, share]) => share > 0)
    .map(([key]) => key)
    .join(', ');

/* Why there is no interval. Without a sample the measurement itself is outside. */
export function why_none(u: Uncertainty): string {
  const outside = u.status === 'outside_training' && u.samples === 0;
  const key = outside ? 'uncertain.none.outside_itself' : (`uncertain.none.${u.status}` as Key);
  return t(key, { keys: keys_outside(u) });
}

function Checks(props: { of: Uncertainty }) {
  const { checks } = props.of;
  if (checks.length === 0) return null;
  const good = checks.filter(
    (c) => c.eps_max !== null && c.low <= c.eps_max && c.eps_max <= c.high,
  );
  return (
    <p class={good.length < checks.length ? 'warning' : 'hint'}>
      {t('uncertain.checks', { good: good.length, n: checks.length })}
    </p>
  );
}

function Given(props: { of: Uncertainty; inputs: ParameterInfo[]; label: string }) {
  const { of: u, inputs } = props;
  const { shear, compression } = u.share_crossing;
  return (
    <>
      <p class="hint">{t('uncertain.note', { list: deviations(u, inputs), n: u.samples })}</p>
      <Table of={u} label={props.label} />
      {shear !== null && compression !== null && (
        <p>
          {t('uncertain.share', {
            shear: format_percent(shear),
            compression: format_percent(compression),
          })}
        </p>
      )}
      <p>{t('uncertain.model_form', { error: u.model_form_error.eps_max })}</p>
      {u.inside < u.samples && (
        <p class="warning">
          {t('uncertain.outside', {
            share: format_percent(1 - u.inside / u.samples),
            keys: keys_outside(u),
          })}
        </p>
      )}
      <Better of={u} inputs={inputs} />
      <Checks of={u} />
    </>
  );
}

export function UncertaintyCard(props: { of: Finished; inputs: ParameterInfo[]; side: string }) {
  const u = props.of.result.uncertainty;
  if (!u) return null;
  const heading = t('uncertain.title', { side: props.side });
  return (
    <section class={`card uncertain ${props.of.side ?? ''}`} aria-label={heading}>
      <h2>{heading}</h2>
      {u.trial && <p class="warning">{t('uncertain.trial')}</p>}
      {u.status === 'given' ? (
        <Given of={u} inputs={props.inputs} label={heading} />
      ) : (
        <p>{why_none(u)}</p>
      )}
    </section>
  );
}
