// SPDX-License-Identifier: GPL-3.0-or-later
//
// Round tick positions for a linear axis that starts at zero.

const steps = [1, 2, 2.5, 5, 10];

export function ticks(max: number, wanted: number): number[] {
  if (!(max > 0)) return [0];
  const raw = max / wanted;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = (steps.find((s) => s * power >= raw) ?? 10) * power;
  const count = Math.floor(max / step + 1e-9);
  return Array.from({ length: count + 1 }, (_, i) => Number((i * step).toPrecision(12)));
}
