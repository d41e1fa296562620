// SPDX-License-Identifier: GPL-3.0-or-later
//
// Linear axes with round tick positions.

const steps = [1, 2, 2.5, 5, 10];

export function ticks(max: number, wanted: number): number[] {
  if (!(max > 0)) return [0];
  const raw = max / wanted;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = (steps.find((s) => s * power >= raw) ?? 10) * power;
  const count = Math.floor(max / step + 1e-9);
  return Array.from({ length: count + 1 }, (_, i) => Number((i * step).toPrecision(12)));
}

export interface Axis {
  from: number;
  to: number;
  marks: number[];
}

/* From zero, unless all values are far from it: then what differs among them would be a blot. */
export function axis_of(values: number[], wanted: number): Axis {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const margin = 0.04 * (high - low || high);
  const to = high + margin || 1;
  const from = low > 0.4 * high ? low - margin : 0;
  return { from, to, marks: ticks(to, (wanted * to) / (to - from)).filter((v) => v >= from) };
}
