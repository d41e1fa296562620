// SPDX-License-Identifier: GPL-3.0-or-later
//
// The colour scale of the 3-D view: cool below the threshold, a visible step at it, warm above.
import type { ColourStop } from './contract.js';

export function colour_stops(threshold: number, max: number): ColourStop[] {
  const step = threshold * 1e-3;
  return [
    { value: 0, rgb: [0.93, 0.95, 0.97] },
    { value: threshold * 0.5, rgb: [0.62, 0.76, 0.87] },
    { value: threshold - step, rgb: [0.2, 0.45, 0.66] },
    { value: threshold + step, rgb: [0.98, 0.76, 0.36] },
    { value: (threshold + max) / 2, rgb: [0.85, 0.37, 0.15] },
    { value: max, rgb: [0.5, 0.06, 0.1] },
  ];
}

export function css_colour(stop: ColourStop): string {
  return `rgb(${stop.rgb.map((c) => Math.round(c * 255)).join(',')})`;
}
