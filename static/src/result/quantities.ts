// SPDX-License-Identifier: GPL-3.0-or-later
//
// Every number of a result that is shown, once: where it is found, its unit, how it is written. The
// table of all numbers, the comparison and the report iterate these.
import { t, type Key, type Values } from '../i18n.js';
import type { Assessment, Result } from '../types.js';

export interface Quantity {
  key: Key;
  values?: (r: Result) => Values;
  unit: string;
  decimals: number;
  of: (r: Result) => number | null | undefined;
  absent?: Key; /* what null means; without it null is shown as a dash */
}

const shear_threshold = (r: Result): Values => ({ threshold: r.clusters.shear.threshold ?? '' });
const comp_threshold = (r: Result): Values => ({
  threshold: r.clusters.compression.threshold ?? '',
});

export const quantities: readonly Quantity[] = [
  { key: 'numbers.eps_max', unit: '', decimals: 3, of: (r) => r.strain.eps_max },
  { key: 'numbers.eps_error', unit: '', decimals: 3, of: (r) => r.numerics.eps_max_error },
  { key: 'numbers.eps_depth', unit: 'mm', decimals: 1, of: (r) => r.strain.eps_max_depth_mm },
  {
    key: 'numbers.E_shear',
    values: shear_threshold,
    unit: '',
    decimals: 3,
    of: (r) => r.strain.E_shear_max,
  },
  {
    key: 'numbers.E_comp',
    values: comp_threshold,
    unit: '',
    decimals: 3,
    of: (r) => r.strain.E_comp_max,
  },
  { key: 'numbers.v_shear', unit: 'mm³', decimals: 0, of: (r) => r.clusters.shear.volume_mm3 },
  { key: 'numbers.v_comp', unit: 'mm³', decimals: 0, of: (r) => r.clusters.compression.volume_mm3 },
  { key: 'numbers.v_both', unit: 'mm³', decimals: 0, of: (r) => r.clusters.both.volume_mm3 },
  {
    key: 'numbers.v_largest',
    unit: 'mm³',
    decimals: 0,
    of: (r) => r.clusters.both.largest?.volume_mm3,
  },
  { key: 'numbers.muscle', unit: 'mm³', decimals: 0, of: (r) => r.muscle_volume_mm3 },
  {
    key: 'numbers.f_shear',
    unit: 'N',
    decimals: 0,
    of: (r) => r.threshold_force_N.shear,
    absent: 'numbers.never',
  },
  {
    key: 'numbers.f_comp',
    unit: 'N',
    decimals: 0,
    of: (r) => r.threshold_force_N.compression,
    absent: 'numbers.never',
  },
  { key: 'numbers.travel', unit: 'mm', decimals: 1, of: (r) => r.seat.displacement_mm },
  { key: 'numbers.area', unit: 'mm²', decimals: 0, of: (r) => r.seat.contact_area_mm2 },
  { key: 'numbers.mean_pressure', unit: 'kPa', decimals: 1, of: (r) => r.seat.mean_pressure_kPa },
  { key: 'numbers.peak_pressure', unit: 'kPa', decimals: 1, of: (r) => r.seat.peak_pressure_kPa },
];

export const quantity_name = (q: Quantity, r: Result): string => t(q.key, q.values?.(r) ?? {});

export type Finished = Assessment & { result: Result };

export const finished = (documents: Assessment[]): Finished[] =>
  documents.filter((d): d is Finished => d.status === 'succeeded' && !!d.result);

/* Height of the bone's lowest point over the outer skin, unloaded. */
export const tip_height = (d: Assessment, default_skin_mm: number): number =>
  (d.skin?.thickness ?? default_skin_mm) + (d.parameters['eF'] ?? 0) + (d.parameters['eM'] ?? 0);

export function share_of_muscle(r: Result, volume_mm3: number): number | null {
  return r.muscle_volume_mm3 ? volume_mm3 / r.muscle_volume_mm3 : null;
}
