// SPDX-License-Identifier: GPL-3.0-or-later
//
// What was refused when the form was sent, by this page or by the daemon: which field each refusal
// belongs to, what it is called, and which of them still stand after a change.
import { language, t, t_or } from '../i18n.js';
import type { Parsed } from '../number.js';
import type { FieldError, ParameterInfo, Side } from '../types.js';
import { sd_id } from './deviations.js';
import { field_id } from './field.js';
import {
  faults,
  is_empty,
  parsed,
  sides,
  type Finding,
  type Person,
  type SideEntry,
} from './model.js';

/* A field is of one side, a standard deviation, or of the person that both sides belong to. */
export type Group = Side | 'sd' | 'person';
export type Refused = Record<Group, Map<string, Finding>>;

export interface Refusal {
  group: Group;
  key: string;
  finding: Finding;
}

export const no_refusals = (): Refused => ({
  left: new Map(),
  right: new Map(),
  sd: new Map(),
  person: new Map(),
});

const groups: readonly Group[] = ['person', ...sides, 'sd'];

export const listed = (refused: Refused): Refusal[] =>
  groups.flatMap((group) => [...refused[group]].map(([key, finding]) => ({ group, key, finding })));

const person_fields = ['subject', 'measured_at', 'sd'];

/* The id of the field; null when the form has none of that name. */
export function id_of({ group, key }: Refusal): string | null {
  if (group === 'person') return person_fields.includes(key) ? key : null;
  return group === 'sd' ? sd_id(key) : field_id(group, key);
}

export function name_of({ group, key }: Refusal): string {
  if (group === 'person') return t_or(`form.${key}`, key);
  return `${t(group === 'sd' ? 'form.sd' : `side.${group}`)}, ${key}`;
}

/* "/sd/eM" is the standard deviation of eM, "/eM" is of the side, all else of the person. */
function place_of(pointer: string, side: Side, inputs: ParameterInfo[]): [Group, string] {
  const path = pointer.split('/').slice(1);
  const key = path[path.length - 1] ?? '';
  const is_input = inputs.some((info) => info.key === key);
  if (is_input && path.length === 1) return [side, key];
  return is_input && path[0] === 'sd' ? ['sd', key] : ['person', path.join('.')];
}

/* The daemon's own findings on a side. */
export function refused_by_daemon(
  errors: FieldError[],
  side: Side,
  inputs: ParameterInfo[],
): Refused {
  const refused = no_refusals();
  for (const { pointer, code, detail } of errors) {
    const [group, key] = place_of(pointer, side, inputs);
    const says = { text: detail, lang: language() };
    refused[group].set(key, { severity: 'fault', code, says });
  }
  return refused;
}

const same = (a: Parsed, b: Parsed): boolean =>
  a.kind === b.kind && (a.kind !== 'number' || b.kind !== 'number' || a.value === b.value);

/* Of the refusals of a side those that its change leaves: of numbers that did not change and, where
 * this page made them, that are still wrong beside those that did. */
export function left_of_side(
  refused: Map<string, Finding>,
  before: SideEntry,
  after: SideEntry,
  inputs: ParameterInfo[],
): Map<string, Finding> {
  if (is_empty(after)) return new Map();
  const wrong = faults(after, inputs);
  const left = [...refused].flatMap(([key, f]): [string, Finding][] => {
    if (!same(parsed(before, key), parsed(after, key))) return [];
    const now = 'text' in f.says ? f : wrong.get(key);
    return now ? [[key, now]] : [];
  });
  return new Map(left);
}

const without = (refused: Map<string, Finding>, changed: (key: string) => boolean) =>
  new Map([...refused].filter(([key]) => !changed(key)));

/* The same of what a person's change leaves. */
export function left_of_person(refused: Refused, before: Person, after: Person): Refused {
  return {
    ...refused,
    sd: without(
      refused.sd,
      (key) => after.sd !== 'own' || before.sd_text[key] !== after.sd_text[key],
    ),
    person: without(
      refused.person,
      (key) => before[key as keyof Person] !== after[key as keyof Person],
    ),
  };
}
