// SPDX-License-Identifier: GPL-3.0-or-later
//
// The 26 sides of Table 2 as this program computed them (reference/table2.json, made by
// make-reference.mjs with `ischia cohort`). Results of another model, another version of it, another
// resolution or other options are never shown against them.
import results from 'table2:results';
import { format } from './i18n.js';
import type { Assessment, Side } from './types.js';

export interface ReferenceSide {
  subject: string;
  side: Side;
  eps_max: number;
  eps_max_error: number;
  volume_shear_mm3: number;
  volume_both_mm3: number;
}

type OptionGroup = 'skin' | 'model';

export interface ReferenceSet {
  model: { name: string; version: number };
  resolution: string;
  options: Record<OptionGroup, Record<string, number>>; /* the defaults of the daemon */
  sides: ReferenceSide[];
}

const set: ReferenceSet | null = results;
const units: Record<string, string> = { 'skin.mu': 'kPa', 'skin.thickness': 'mm' };

/* "skin.thickness 2 mm": every option that has another value than the default. */
export function unusual_options(d: Assessment): string[] {
  return (['skin', 'model'] as const).flatMap((group) =>
    Object.entries(d[group] ?? {}).flatMap(([key, value]) => {
      const name = `${group}.${key}`;
      if (typeof value !== 'number' || value === set?.options[group][key]) return [];
      return `${name} ${format(value)}${units[name] ? `\u00a0${units[name]}` : ''}`;
    }),
  );
}

/* Whether two results may stand in one row: the same mesh, skin and model. */
export function computed_alike(a: Assessment, b: Assessment): boolean {
  const all = (d: Assessment): string =>
    JSON.stringify([d.result?.model, d.resolution, unusual_options(d)]);
  return all(a) === all(b);
}

const model_name = ({ name, version }: ReferenceSet['model']): string => `${name} ${version}`;
export const reference_model = set && model_name(set.model);

/* The reference sides that these assessments may be held against; empty when there are none. */
export function comparable_sides(documents: Assessment[]): ReferenceSide[] {
  if (!set) return [];
  const same = documents.every(
    (d) =>
      d.result &&
      model_name(d.result.model) === reference_model &&
      (d.resolution ?? set.resolution) === set.resolution &&
      unusual_options(d).length === 0,
  );
  return same ? set.sides : [];
}
