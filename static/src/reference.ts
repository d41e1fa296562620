// SPDX-License-Identifier: GPL-3.0-or-later
//
// The 26 sides of Table 2 as this program computed them (reference/table2.json, made by
// make-reference.mjs with `ischia cohort`). Results of another model or another version of it are
// never shown against them.
import results from 'table2:results';
import type { Assessment, Side } from './types.js';

export interface ReferenceSide {
  subject: string;
  side: Side;
  eps_max: number;
  eps_max_error: number;
  volume_shear_mm3: number;
  volume_both_mm3: number;
}

export interface ReferenceSet {
  model: { name: string; version: number };
  sides: ReferenceSide[];
}

/* The reference sides that these assessments may be held against; empty when there are none. */
export function comparable_sides(documents: Assessment[]): ReferenceSide[] {
  const set: ReferenceSet | null = results;
  if (!set) return [];
  const same = documents.every(
    (d) => d.result?.model.name === set.model.name && d.result.model.version === set.model.version,
  );
  return same ? set.sides : [];
}
