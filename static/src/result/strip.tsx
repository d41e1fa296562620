// SPDX-License-Identifier: GPL-3.0-or-later
//
// These sides among the 26 of Table 2: a strip a quantity, every reference side a ring, ours a
// labelled pointer; the same in numbers beside it.
import { format, format_fixed, t, type Key } from '../i18n.js';
import { comparable_sides, reference_model, type ReferenceSide } from '../reference.js';
import type { Quantiles, Result } from '../types.js';
import { column_letters, column_names, side_letter } from '../ui.js';
import { axis_of } from './axis.js';
import { given, interval_of, type Interval } from './interval.js';
import type { Finished } from './quantities.js';

interface Metric {
  key: Key;
  decimals: number;
  of_reference: (s: ReferenceSide) => number;
  of_result: (r: Result) => number;
  between: (r: Result) => Quantiles | undefined;
}

const metrics: readonly Metric[] = [
  {
    key: 'strip.eps',
    decimals: 2,
    of_reference: (s) => s.eps_max,
    of_result: (r) => r.strain.eps_max,
    between: (r) => given(r)?.strain.eps_max,
  },
  {
    key: 'strip.v_shear',
    decimals: 0,
    of_reference: (s) => s.volume_shear_mm3,
    of_result: (r) => r.clusters.shear.volume_mm3,
    between: (r) => given(r)?.clusters.shear.volume_mm3,
  },
  {
    key: 'strip.v_both',
    decimals: 0,
    of_reference: (s) => s.volume_both_mm3,
    of_result: (r) => r.clusters.both.volume_mm3,
    between: (r) => given(r)?.clusters.both.volume_mm3,
  },
];

const width = 460;
const margin = 14;
const line_y = 40;

function Strip(props: {
  metric: Metric;
  reference: number[];
  ours: number[];
  bars: (Interval | null)[];
  letters: string[];
}) {
  const { metric, reference, ours, bars, letters } = props;
  const ends = bars.flatMap((b) => (b ? [b.low, b.high] : []));
  const { from, to, marks } = axis_of([...reference, ...ours, ...ends], 5);
  const x = (v: number): number => margin + ((v - from) / (to - from)) * (width - 2 * margin);
  const highest = ours.indexOf(
    Math.max(...ours),
  ); /* its letter goes to the right, so that two close
                                                      marks do not write over each other */
  const label = t('strip.alt', { metric: t(metric.key), n: reference.length });
  return (
    <svg class="strip" viewBox={`0 0 ${width} 72`} role="img" aria-label={label}>
      <path class="axis" d={`M${margin} ${line_y}H${width - margin}`} />
      {marks.map((v) => (
        <g key={v}>
          <path class="axis" d={`M${x(v)} ${line_y + 8}v4`} />
          <text class="tick" x={x(v)} y={line_y + 24} text-anchor="middle">
            {format(v)}
          </text>
        </g>
      ))}
      {reference.map((v, i) => (
        <circle key={i} class="reference" cx={x(v)} cy={line_y} r="4.5" />
      ))}
      {ours.map((v, i) => (
        <g key={i} class={`ours n${i}`}>
          <Bar of={bars[i] ?? null} index={i} x={x} />
          <path d={`M${x(v)} ${line_y - 6}l-6 -10h12z`} />
          <text
            x={x(v)}
            y={line_y - 20}
            text-anchor={i === highest ? 'start' : 'end'}
            dx={i === highest ? 1 : -1}
          >
            {letters[i]}
          </text>
        </g>
      ))}
    </svg>
  );
}

/* Between 5 and 95 % of the samples of uncertain measurements. */
function Bar(props: { of: Interval | null; index: number; x: (v: number) => number }) {
  if (!props.of) return null;
  const [a, b] = [props.x(props.of.low), props.x(props.of.high)];
  const y =
    line_y + (props.index ? 4 : -4); /* two sides beside each other, not one over the other */
  return <path class="interval" d={`M${a} ${y}H${b}M${a} ${y - 3}v6M${b} ${y - 3}v6`} />;
}

const median = (sorted: number[]): number => {
  const half = sorted.length / 2;
  const [a = 0, b = 0] = [sorted[Math.ceil(half) - 1], sorted[Math.floor(half)]];
  return (a + b) / 2;
};

const between = (bar: Interval | null, number: (v: number) => string): string =>
  bar ? ` (${number(bar.low)} – ${number(bar.high)})` : '';

function Row(props: { metric: Metric; sides: ReferenceSide[]; documents: Finished[] }) {
  const { metric, sides, documents } = props;
  const reference = sides.map(metric.of_reference);
  const sorted = [...reference].sort((a, b) => a - b);
  const ours = documents.map((d) => metric.of_result(d.result));
  const bars = documents.map((d) => interval_of(metric.between(d.result)));
  const number = (v: number): string => format_fixed(v, metric.decimals);
  const names = column_names(documents);
  return (
    <div class="strip-row">
      <h3>{t(metric.key)}</h3>
      <Strip
        metric={metric}
        reference={reference}
        ours={ours}
        bars={bars}
        letters={column_letters(documents)}
      />
      <table class="numbers small">
        <thead>
          <tr>
            <th scope="col">{t('list.side')}</th>
            <th scope="col">{t(metric.key)}</th>
            <th scope="col">{t('strip.rank')}</th>
          </tr>
        </thead>
        <tbody>
          {ours.map((v, i) => (
            <tr key={i} class="ours">
              <th scope="row">{names[i]}</th>
              <td>{number(v) + between(bars[i] ?? null, number)}</td>
              <td>
                {t('strip.rank.of', {
                  below: reference.filter((r) => r < v).length,
                  n: sides.length,
                })}
              </td>
            </tr>
          ))}
          <tr>
            <th scope="row">{`${t('strip.low')} · ${t('strip.median')} · ${t('strip.high')}`}</th>
            <td colSpan={2}>
              {[sorted[0] ?? 0, median(sorted), sorted[sorted.length - 1] ?? 0]
                .map(number)
                .join(' · ')}
            </td>
          </tr>
        </tbody>
      </table>
    </div>
  );
}

function All(props: { sides: ReferenceSide[] }) {
  return (
    <details>
      <summary>{t('strip.all')}</summary>
      <table class="numbers small">
        <thead>
          <tr>
            <th scope="col">{t('strip.side')}</th>
            {metrics.map((m) => (
              <th scope="col" key={m.key}>
                {t(m.key)}
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {props.sides.map((s) => (
            <tr key={s.subject + s.side}>
              <th scope="row">{`${s.subject} ${side_letter(s.side)}`}</th>
              {metrics.map((m) => (
                <td key={m.key}>{format_fixed(m.of_reference(s), m.decimals)}</td>
              ))}
            </tr>
          ))}
        </tbody>
      </table>
    </details>
  );
}

export function Strips(props: { documents: Finished[] }) {
  const sides = comparable_sides(props.documents);
  if (!reference_model || props.documents.length === 0) return null;
  if (sides.length === 0)
    return <p class="panel-box hint no-rank">{t('strip.none', { model: reference_model })}</p>;
  return (
    <section class="panel-box strips" aria-labelledby="strips">
      <h2 id="strips">{t('strip.title', { n: sides.length })}</h2>
      <p class="hint">
        {t('strip.note')}
        {props.documents.some((d) => given(d.result)) && ` ${t('uncertain.bars')}`}
      </p>
      {metrics.map((metric) => (
        <Row key={metric.key} metric={metric} sides={sides} documents={props.documents} />
      ))}
      <All sides={sides} />
    </section>
  );
}
