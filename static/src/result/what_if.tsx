// SPDX-License-Identifier: GPL-3.0-or-later
//
// What the result would be were one of its numbers another: which force keeps the muscle below each
// threshold, which is what a cushion aims at. By the emulator, at once.
import { useState } from 'preact/hooks';
import { what_if } from '../api.js';
import { use_answer } from '../emulator.js';
import { format, format_fixed, t, type Key } from '../i18n.js';
import type { Estimated, ParameterInfo, WhatIf, WhatIfPoint } from '../types.js';
import { ticks } from './axis.js';
import type { Finished } from './quantities.js';

const width = 340;
const plot = { left: 42, right: 10, top: 18, height: 92, foot: 32 };

interface Curve {
  key: Key;
  decimals: number;
  zero: boolean; /* the line at zero means something */
  of: (p: WhatIfPoint) => Estimated | null | undefined;
}

const curves: readonly Curve[] = [
  { key: 'what_if.eps', decimals: 3, zero: false, of: (p) => p.strain?.eps_max },
  { key: 'what_if.shear', decimals: 3, zero: true, of: (p) => p.margin.shear },
  { key: 'what_if.compression', decimals: 3, zero: true, of: (p) => p.margin.compression },
];

type Known = [at: number, e: Estimated][];

const known = (points: WhatIfPoint[], curve: Curve): Known =>
  points.flatMap((p) => {
    const e = curve.of(p);
    return e ? [[p.at, e] as [number, Estimated]] : [];
  });

const line = (points: [number, number][]): string =>
  points.map(([x, y], i) => `${i ? 'L' : 'M'}${x.toFixed(1)} ${y.toFixed(1)}`).join('');

/* Round values between two ends of any sign. */
function marks(from: number, to: number): number[] {
  const step = ticks(to - from, 3)[1] ?? to - from;
  const first = Math.ceil(from / step);
  const count = Math.floor(to / step + 1e-9) - first + 1;
  return Array.from({ length: Math.max(0, count) }, (_, i) =>
    Number(((first + i) * step).toPrecision(12)),
  );
}

function Plot(props: { data: Known; curve: Curve; input: string; unit: string; measured: number }) {
  const { data, curve, measured } = props;
  const all = data.flatMap(([, e]) => [e.low, e.high]);
  const low = Math.min(...all, ...(curve.zero ? [0] : []));
  const high = Math.max(...all, ...(curve.zero ? [0] : []));
  const space = 0.06 * (high - low || 1);
  const [from, to] = [low - space, high + space];
  const [first, last] = [data[0]?.[0] ?? 0, data[data.length - 1]?.[0] ?? 1];
  const x = (v: number): number =>
    plot.left + ((v - first) / (last - first)) * (width - plot.left - plot.right);
  const bottom = plot.top + plot.height;
  const y = (v: number): number => bottom - ((v - from) / (to - from)) * plot.height;
  const name = t(curve.key);
  const band = [
    ...data.map(([at, e]): [number, number] => [x(at), y(e.high)]),
    ...[...data].reverse().map(([at, e]): [number, number] => [x(at), y(e.low)]),
  ];
  const inside = measured >= first && measured <= last;
  return (
    <svg
      viewBox={`0 0 ${width} ${bottom + plot.foot}`}
      role="img"
      aria-label={t('what_if.alt', { quantity: name, input: props.input })}
    >
      <text class="name" x={plot.left} y={plot.top - 6}>
        {name}
      </text>
      {marks(from, to).map((v) => (
        <g key={v}>
          <path class="grid" d={`M${plot.left} ${y(v)}H${width - plot.right}`} />
          <text class="tick" x={plot.left - 5} y={y(v) + 4} text-anchor="end">
            {format(v)}
          </text>
        </g>
      ))}
      {curve.zero && <path class="threshold" d={`M${plot.left} ${y(0)}H${width - plot.right}`} />}
      <path class="band" d={`${line(band)}Z`} />
      <path class="line" d={line(data.map(([at, e]) => [x(at), y(e.value)]))} />
      {inside && <path class="measured" d={`M${x(measured)} ${plot.top}V${bottom}`} />}
      {marks(first, last).map((v) => (
        <text key={v} class="tick" x={x(v)} y={bottom + 14} text-anchor="middle">
          {format(v)}
        </text>
      ))}
      <text class="name" x={plot.left} y={bottom + 28}>
        {`${props.input}, ${props.unit}`}
      </text>
    </svg>
  );
}

function Table(props: { of: WhatIf }) {
  const { points, parameter, unit } = props.of;
  const every = Math.max(1, Math.round((points.length - 1) / 10));
  const cell = (e: Estimated | null | undefined, decimals: number): string =>
    e
      ? `${format_fixed(e.value, decimals)} (${format_fixed(e.low, decimals)} – ${format_fixed(e.high, decimals)})`
      : '–';
  return (
    <details>
      <summary>{t('what_if.table')}</summary>
      <div class="scroll" tabIndex={0} role="group" aria-label={t('what_if.table')}>
        <table class="numbers small">
          <thead>
            <tr>
              <th scope="col">{`${parameter}, ${unit}`}</th>
              {curves.map((c) => (
                <th scope="col" key={c.key}>
                  {t(c.key)}
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {points
              .filter((_, i) => i % every === 0)
              .map((p) => (
                <tr key={p.at}>
                  <td>{format(p.at, 4)}</td>
                  {curves.map((c) => (
                    <td key={c.key}>{cell(c.of(p), c.decimals)}</td>
                  ))}
                </tr>
              ))}
          </tbody>
        </table>
      </div>
    </details>
  );
}

const force = (e: Estimated | null): string =>
  e
    ? t('what_if.force', {
        value: format_fixed(e.value, 1),
        low: format_fixed(e.low, 1),
        high: format_fixed(e.high, 1),
      })
    : '–';

function Curves(props: { of: WhatIf; measured: number }) {
  const { of, measured } = props;
  const { target_force_N: target } = of;
  if (of.points.length < 2) return <p>{t('what_if.none')}</p>;
  return (
    <>
      {target && (
        <p>
          {t('what_if.target', {
            shear: force(target.shear),
            compression: force(target.compression),
          })}
        </p>
      )}
      <div class="plots">
        {curves.map((curve) => {
          const data = known(of.points, curve);
          if (data.length < 2) return null;
          return (
            <Plot
              key={curve.key}
              data={data}
              curve={curve}
              input={of.parameter}
              unit={of.unit}
              measured={measured}
            />
          );
        })}
      </div>
      <p class="hint">{t('what_if.note')}</p>
      <Table of={of} />
    </>
  );
}

/* The case as it was asked for: an emulator of other options has no answer to it. */
function question_of(d: Finished): Record<string, unknown> {
  const { skin, model } = d as Finished & { model?: unknown };
  return { ...d.parameters, ...(skin ? { skin } : {}), ...(model ? { model } : {}) };
}

function Panel(props: { of: Finished; inputs: ParameterInfo[]; side: string }) {
  const [input, choose] = useState('F');
  const body = question_of(props.of);
  const question = input + JSON.stringify(body);
  const { is, stale, failed } = use_answer(question, (signal) => what_if(body, input, signal), 0);
  const id = `what-if-${props.of.id}`;
  return (
    <>
      <p>
        <label for={id}>{t('what_if.input')}</label>{' '}
        <select id={id} value={input} onChange={(e) => choose(e.currentTarget.value)}>
          {props.inputs.map((i) => (
            <option key={i.key} value={i.key}>
              {`${i.key} · ${i.name}`}
            </option>
          ))}
        </select>
      </p>
      {failed && <p>{t('form.preview.failed')}</p>}
      {is && (
        <div class={stale ? 'stale' : ''} aria-busy={stale}>
          <Curves of={is} measured={props.of.parameters[is.parameter] ?? NaN} />
        </div>
      )}
    </>
  );
}

export function WhatIfCard(props: { of: Finished; inputs: ParameterInfo[]; side: string }) {
  const [open, set_open] = useState(false);
  return (
    <details
      class={`card what-if ${props.of.side ?? ''}`}
      onToggle={(e) => set_open(e.currentTarget.open)}
    >
      <summary>
        <h2>{t('what_if.title', { side: props.side })}</h2>
      </summary>
      {open && <Panel {...props} />}
    </details>
  );
}
