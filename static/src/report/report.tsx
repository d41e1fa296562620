// SPDX-License-Identifier: GPL-3.0-or-later
//
// The report: one A4 page a side, on paper only. The daemon's GET .../report says the same in
// English; this one is in the language of the page.
import { useEffect, useState } from 'preact/hooks';
import { get_version, section_path, type Parameters } from '../api.js';
import { format, format_fixed, format_percent, format_time, t } from '../i18n.js';
import { Symbol_ } from '../form/field.js';
import { general_caveats, warning_text } from '../result/caveats.js';
import { interval_text } from '../result/interval.js';
import { by_share, why_none } from '../result/uncertainty.js';
import { share_of_muscle, tip_height, type Finished } from '../result/quantities.js';
import { options_text, resolution_text } from '../result/settings.js';
import type { ClusterSet } from '../types.js';
import { column_names, Shape } from '../ui.js';

function Inputs(props: { of: Finished; parameters: Parameters }) {
  return (
    <table>
      <caption>{t('report.inputs')}</caption>
      <tbody>
        {props.parameters.inputs.map((info) => (
          <tr key={info.key}>
            <th scope="row">{info.name}</th>
            <td>
              <Symbol_ of={info.key} />
            </td>
            <td class="n">{format(props.of.parameters[info.key] ?? NaN)}</td>
            <td>{info.unit}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

function Strain(props: { of: Finished }) {
  const { strain, numerics, clusters, seat } = props.of.result;
  const depth = format_fixed(strain.eps_max_depth_mm, 1);
  const threshold = (set: ClusterSet): string =>
    t('curve.threshold', { value: set.threshold ?? '' });
  const rows: [string, string, string, string][] = [
    [
      t('curve.col.eps'),
      t('report.engineering'),
      `${format_fixed(strain.eps_max, 3)} ± ${format_fixed(numerics.eps_max_error, 3)}`,
      t('report.depth', { depth }),
    ],
    [
      t('curve.col.shear'),
      t('report.green_lagrange'),
      format_fixed(strain.E_shear_max, 3),
      threshold(clusters.shear),
    ],
    [
      t('curve.col.comp'),
      t('report.green_lagrange'),
      format_fixed(strain.E_comp_max, 3),
      threshold(clusters.compression),
    ],
    [t('numbers.travel'), '', `${format_fixed(seat.displacement_mm, 1)} mm`, ''],
    [t('numbers.peak_pressure'), '', `${format_fixed(seat.peak_pressure_kPa, 1)} kPa`, ''],
  ];
  return (
    <table>
      <caption>{t('report.strain')}</caption>
      <tbody>
        {rows.map(([name, measure, value, note]) => (
          <tr key={name}>
            <th scope="row" colSpan={measure ? 1 : 2}>
              {name}
            </th>
            {measure && <td>{measure}</td>}
            <td class="n">{value}</td>
            <td>{note}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

function Clusters(props: { of: Finished; skin_mm: number }) {
  const { result, parameters } = props.of;
  const tip = tip_height(props.of, props.skin_mm);
  const largest = ({ largest: body }: ClusterSet): string => {
    if (!body) return '–';
    const below = tip - body.centroid_mm[2];
    const volume = format_fixed(body.volume_mm3, 0);
    const depth = format_fixed(Math.abs(below), 1);
    return below < 0 ? t('report.largest.above', { volume, depth }) : `${volume} mm³, ${depth} mm`;
  };
  const { clusters, threshold_force_N: force } = result;
  const first = (N: number | null | undefined): string => {
    if (N === undefined) return '';
    return N === null ? t('numbers.never') : `${format_fixed(N, 0)} N`;
  };
  const rows: [string, ClusterSet, number | null | undefined][] = [
    [t('glance.shear', { threshold: clusters.shear.threshold ?? '' }), clusters.shear, force.shear],
    [
      t('glance.compression', { threshold: clusters.compression.threshold ?? '' }),
      clusters.compression,
      force.compression,
    ],
    [t('glance.both'), clusters.both, undefined],
  ];
  return (
    <table>
      <caption>{`${t('report.clusters')} (${t('report.green_lagrange')})`}</caption>
      <thead>
        <tr>
          <th scope="col">{t('report.criterion')}</th>
          <th scope="col" class="n">
            {t('report.volume')}
          </th>
          <th scope="col" class="n">
            {t('report.share')}
          </th>
          <th scope="col" class="n">
            {t('report.count')}
          </th>
          <th scope="col" class="n">
            {t('report.largest')}
          </th>
          <th
            scope="col"
            class="n"
          >{`${t('report.first_at')} (F = ${format(parameters['F'] ?? NaN)} N)`}</th>
        </tr>
      </thead>
      <tbody>
        {rows.map(([name, set, N]) => {
          const share = share_of_muscle(result, set.volume_mm3);
          return (
            <tr key={name}>
              <th scope="row">{name}</th>
              <td class="n">{format_fixed(set.volume_mm3, 0)}</td>
              <td class="n">{share === null ? '–' : format_percent(share)}</td>
              <td class="n">{set.count}</td>
              <td class="n long">{largest(set)}</td>
              <td class="n">{first(N)}</td>
            </tr>
          );
        })}
      </tbody>
    </table>
  );
}

/* The interval in a few lines: what it is, and what to measure better. */
function Certainty(props: { of: Finished }) {
  const u = props.of.result.uncertainty;
  if (!u) return null;
  if (u.status !== 'given') return <p class="certainty">{why_none(u)}</p>;
  const between = [
    `ε max ${interval_text(u.strain.eps_max, 3)}`,
    `${t('numbers.v_shear')} ${interval_text(u.clusters.shear.volume_mm3, 0, ' mm³')}`,
    `${t('numbers.v_both')} ${interval_text(u.clusters.both.volume_mm3, 0, ' mm³')}`,
  ];
  const better = by_share(u).map(([key, share]) => `${key} ${format_percent(share)}`);
  return (
    <p class="certainty">
      {`${t('uncertain.report')}: ${between.join('; ')}. `}
      {better.length > 0 && `${t('uncertain.better')}: ${better.join(', ')}. `}
      {t('uncertain.model_form', { error: u.model_form_error.eps_max })}
    </p>
  );
}

function Report(props: { of: Finished; name: string; parameters: Parameters; version: string }) {
  const { of, name, parameters, version } = props;
  const { risk, model } = of.result;
  const caveats = [
    ...(of.warnings ?? []).map((w) => warning_text(w, of, name, parameters.inputs)),
    ...general_caveats(),
  ];
  return (
    <article class="report">
      <header>
        <h2>{`${t('report.title')} · ${name}`}</h2>
        <p>
          {[
            of.subject && t('result.subject', { subject: of.subject }),
            of.label,
            of.measured_at && t('result.measured', { time: format_time(of.measured_at) }),
          ]
            .filter(Boolean)
            .join(' · ')}
        </p>
      </header>
      <p class="verdict">
        <Shape of={risk.band} /> <strong>{t(`band.${risk.band}`)}</strong>
      </p>
      <div class="columns">
        <Inputs of={of} parameters={parameters} />
        <Strain of={of} />
      </div>
      <Clusters of={of} skin_mm={parameters.skin_thickness_mm} />
      <Certainty of={of} />
      <figure>
        <figcaption>{t('report.section')}</figcaption>
        <img src={section_path(of.id)} alt="" />
      </figure>
      <section class="limits">
        <h3>{t('report.caveats')}</h3>
        <ul>
          {caveats.map((text) => (
            <li key={text}>{text}</li>
          ))}
        </ul>
      </section>
      <footer>
        <p class="ids">
          {[
            version && t('report.program', { version }),
            `${t('report.model')} ${model.name} ${model.version}`,
            resolution_text(of),
            options_text(of),
            `${t('report.id')} ${of.id}`,
            `${t('report.created')} ${format_time(of.created_at)}`,
            t('report.printed', { time: format_time(new Date().toISOString()) }),
          ]
            .filter(Boolean)
            .join(' · ')}
        </p>
        <p class="signature">{t('report.signature')}</p>
      </footer>
    </article>
  );
}

export function Reports(props: { documents: Finished[]; parameters: Parameters }) {
  const names = column_names(props.documents);
  const [version, set_version] = useState('');
  useEffect(() => {
    get_version().then(
      (v) => set_version(v.version),
      () => undefined /* the report then names the model alone */,
    );
  }, []);
  return (
    <div class="reports">
      {props.documents.map((d, i) => (
        <Report
          key={d.id}
          of={d}
          name={names[i] ?? ''}
          parameters={props.parameters}
          version={version}
        />
      ))}
    </div>
  );
}
