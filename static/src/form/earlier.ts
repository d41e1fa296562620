// SPDX-License-Identifier: GPL-3.0-or-later
//
// Earlier assessments as the start of a new one: which of them fit into one form, what the form
// takes over from them, and what it has no place for.
import type { ModelOption } from '../api.js';
import type { Assessment } from '../types.js';
import { empty_side, nobody, sides, type Entries, type Person } from './model.js';

/* The two sides of one person. */
export function is_pair(documents: Assessment[]): boolean {
  const [a, b] = documents;
  if (!a?.side || !b?.side) return false;
  return a.side !== b.side && (a.subject ?? null) === (b.subject ?? null);
}

/* What a form holds once, for both of its sides. */
const shared = (d: Assessment): string =>
  JSON.stringify([d.resolution ?? 'standard', d.sd ?? null, d.measured_at ?? null]);

/* A form is of one person, each side once. */
export function fits_one_form(documents: Assessment[]): boolean {
  const [a, b] = documents;
  if (!a || !b) return documents.length === 1;
  return is_pair(documents) && shared(a) === shared(b);
}

const as_texts = (numbers: [string, number][]): Record<string, string> =>
  Object.fromEntries(numbers.map(([key, value]) => [key, String(value)]));

/* The numbers as texts to be changed; a side nobody named takes a free one. */
export function entries_of(documents: Assessment[]): Entries {
  const entries: Entries = { left: empty_side(), right: empty_side() };
  documents.forEach((d, i) => {
    entries[d.side ?? sides[i] ?? 'left'].text = as_texts(Object.entries(d.parameters));
  });
  return entries;
}

/* Of standard deviations; one of 0 is left empty, which means the same. */
function deviations_of({ sd }: Assessment): Pick<Person, 'sd' | 'sd_text'> {
  if (!sd) return { sd: 'none', sd_text: {} };
  if (sd === 'typical') return { sd, sd_text: {} };
  return { sd: 'own', sd_text: as_texts(Object.entries(sd).filter(([, value]) => value > 0)) };
}

export function person_of(of: Assessment): Person {
  return {
    ...nobody,
    ...deviations_of(of),
    subject: of.subject ?? '',
    measured_at: of.measured_at?.slice(0, 'YYYY-MM-DD'.length) ?? '',
    resolution: of.resolution ?? nobody.resolution,
  };
}

/* The groups of options, and the label, that a form cannot hold and that were not the default. */
export function left_behind(documents: Assessment[], options: ModelOption[]): string[] {
  const differs = ({ group, key, default: usual }: ModelOption): boolean =>
    documents.some((d) => {
      const value = d[group]?.[key];
      return value !== undefined && value !== usual;
    });
  const groups = options.filter(differs).map(({ group }) => group);
  const labels = documents.some((d) => d.label) ? ['label'] : [];
  return [...new Set([...groups, ...labels])];
}
