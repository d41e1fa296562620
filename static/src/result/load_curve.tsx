// SPDX-License-Identifier: GPL-3.0-or-later
//
// Strain in the muscle against the force on this side: two panels on one force axis, each with its
// threshold and the force at which the path first crosses it. The same numbers stand in a table.
import { format, format_fixed, t } from '../i18n.js';
import type { LoadPoint, Result } from '../types.js';
import { ticks } from './axis.js';
import { given, interval_of, type Interval } from './interval.js';
import type { Finished } from './quantities.js';

const width = 340;
const label_room = 84; /* for the longest words at a threshold */
/* For the number at the axis' end, and half of the one beside it. */
const tick_room = (F: number): number => 19 + 7 * format(F).length;
const plot = { left: 32, right: 8, height: 78, gap: 30, top: 18, foot: 34 };

interface Panel {
  name: string;
  class: string;
  of: (p: LoadPoint) => number;
  threshold: number;
  crossed: number | null;
  crossing: Interval | null; /* of the force, and of the strain at the measured force: */
  strain: Interval | null; /* between 5 and 95 % of the samples */
}

function panels(r: Result): Panel[] {
  const { shear, compression } = r.clusters;
  const u = given(r);
  return [
    {
      name: t('curve.shear'),
      class: 'shear',
      of: (p) => p.E_shear_max,
      threshold: shear.threshold ?? 0,
      crossed: r.threshold_force_N.shear,
      crossing: interval_of(u?.threshold_force_N.shear),
      strain: interval_of(u?.strain.E_shear_max),
    },
    {
      name: t('curve.compression'),
      class: 'compression',
      of: (p) => p.E_comp_max,
      threshold: compression.threshold ?? 0,
      crossed: r.threshold_force_N.compression,
      crossing: interval_of(u?.threshold_force_N.compression),
      strain: interval_of(u?.strain.E_comp_max),
    },
  ];
}

const panel_top = (i: number): number => plot.top + i * (plot.height + plot.gap);

/* Bars with ends: along the threshold for the force that crosses it, upright at the measured force
 * for the strain there. */
function Bars(props: {
  panel: Panel;
  x: (F: number) => number;
  y: (v: number) => number;
  F: number;
}) {
  const { panel, x, y, F } = props;
  const { crossing, strain } = panel;
  const [at, level] = [x(F) - 4, y(panel.threshold)];
  return (
    <g class="interval">
      {crossing && (
        <path
          d={
            `M${x(crossing.low)} ${level}H${x(crossing.high)}` +
            `M${x(crossing.low)} ${level - 4}v8M${x(crossing.high)} ${level - 4}v8`
          }
        />
      )}
      {strain && (
        <path
          d={
            `M${at} ${y(strain.low)}V${y(strain.high)}` +
            `M${at - 4} ${y(strain.low)}h8M${at - 4} ${y(strain.high)}h8`
          }
        />
      )}
    </g>
  );
}

function PanelPlot(props: {
  panel: Panel;
  points: LoadPoint[];
  index: number;
  x: (F: number) => number;
}) {
  const { panel, points, index, x } = props;
  const tops = [...points.map(panel.of), panel.strain?.high ?? 0];
  const max = Math.max(panel.threshold * 1.2, ...tops) * 1.05;
  const top = panel_top(index);
  const bottom = top + plot.height;
  const y = (v: number): number => bottom - (v / max) * plot.height;
  const line = points.map((p, i) => `${i ? 'L' : 'M'}${x(p.F_N)} ${y(panel.of(p))}`).join('');
  const y_threshold = y(panel.threshold);
  const ends_above = panel.of(points[points.length - 1] as LoadPoint) > panel.threshold;
  const end = width - plot.right;
  /* Under the line's end when it is above the threshold. A late crossing would go through the
   * words there; before it the space above the threshold is free. */
  const late = panel.crossed !== null && x(panel.crossed) > end - label_room;
  const y_label = y_threshold + (ends_above && !late ? 12 : -5);
  const latest = 0.8 * (points[points.length - 1]?.F_N ?? 0); /* a label after it would not fit */
  return (
    <g class={`panel ${panel.class}`}>
      <text class="name" x={plot.left} y={top - 6}>
        {panel.name}
      </text>
      {ticks(max, 3).map((v) => (
        <g key={v}>
          <path class="grid" d={`M${plot.left} ${y(v)}H${width - plot.right}`} />
          <text class="tick" x={plot.left - 5} y={y(v) + 4} text-anchor="end">
            {format(v)}
          </text>
        </g>
      ))}
      <path class="threshold" d={`M${plot.left} ${y_threshold}H${end}`} />
      <text
        class="threshold"
        x={late ? plot.left + 2 : end}
        y={y_label}
        text-anchor={late ? 'start' : 'end'}
      >
        {t('curve.threshold', { value: panel.threshold })}
      </text>
      <path class="line" d={line} />
      <Bars panel={panel} x={x} y={y} F={points[points.length - 1]?.F_N ?? 0} />
      {panel.crossed !== null && (
        <g class="crossed">
          <path d={`M${x(panel.crossed)} ${y_threshold}V${bottom}`} />
          <circle cx={x(panel.crossed)} cy={y_threshold} r="4" />
          <text
            x={x(panel.crossed) + (panel.crossed > latest ? -6 : 6)}
            y={bottom - 5}
            text-anchor={panel.crossed > latest ? 'end' : 'start'}
          >
            {t('curve.crossed', { force: format_fixed(panel.crossed, 0) })}
          </text>
        </g>
      )}
    </g>
  );
}

function Table(props: { points: LoadPoint[] }) {
  return (
    <details open>
      <summary>{t('curve.table')}</summary>
      <div class="scroll" tabIndex={0} role="group" aria-label={t('curve.table')}>
        <table class="numbers small">
          <thead>
            <tr>
              <th scope="col" rowSpan={2}>
                {t('curve.col.F')}
              </th>
              <th scope="col" rowSpan={2}>
                {t('curve.col.travel')}
              </th>
              <th scope="col">{t('report.engineering')}</th>
              <th scope="colgroup" colSpan={2}>
                {t('report.green_lagrange')}
              </th>
            </tr>
            <tr>
              <th scope="col">{t('curve.col.eps')}</th>
              <th scope="col">{t('curve.col.shear')}</th>
              <th scope="col">{t('curve.col.comp')}</th>
            </tr>
          </thead>
          <tbody>
            {props.points.map((p) => (
              <tr key={p.F_N}>
                <td>{format_fixed(p.F_N, 1)}</td>
                <td>{format_fixed(p.displacement_mm, 1)}</td>
                <td>{format_fixed(p.eps_max, 3)}</td>
                <td>{format_fixed(p.E_shear_max, 3)}</td>
                <td>{format_fixed(p.E_comp_max, 3)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </details>
  );
}

export function LoadCurve(props: { of: Finished; side: string }) {
  const { result, parameters } = props.of;
  const points = result.load_curve;
  if (points.length < 2) return null;
  const F = parameters['F'] ?? points[points.length - 1]?.F_N ?? 1;
  const x = (force: number): number => plot.left + (force / F) * (width - plot.left - plot.right);
  const bottom = panel_top(1) + plot.height;
  const height = bottom + plot.foot;
  return (
    <figure class="curve">
      <figcaption>{t('curve.title')}</figcaption>
      <svg
        viewBox={`0 0 ${width} ${height}`}
        role="img"
        aria-label={t('curve.alt', { side: props.side })}
      >
        {panels(result).map((panel, i) => (
          <PanelPlot key={panel.class} panel={panel} points={points} index={i} x={x} />
        ))}
        {ticks(F, 4)
          .filter((force) => x(F) - x(force) > tick_room(F))
          .map((force) => (
            <text key={force} class="tick" x={x(force)} y={bottom + 14} text-anchor="middle">
              {format(force)}
            </text>
          ))}
        <text class="tick end" x={x(F)} y={bottom + 14} text-anchor="end">
          {format(F)}
        </text>
        <text class="name" x={plot.left} y={bottom + 29}>
          {t('curve.force')}
        </text>
        <text class="name" x={width - plot.right} y={bottom + 29} text-anchor="end">
          {t('curve.measured', { F })}
        </text>
      </svg>
      <div>
        {given(result) && <p class="hint">{t('uncertain.bars')}</p>}
        <Table points={points} />
      </div>
    </figure>
  );
}
