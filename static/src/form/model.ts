// SPDX-License-Identifier: GPL-3.0-or-later
//
// What the form knows, apart from how it looks: the texts as typed, what they mean, what is wrong
// with them, and the documents to send. Limits come from the daemon, never from here.
import { t, type Key, type Values } from '../i18n.js';
import { difference, parse_number, type Parsed } from '../number.js';
import type { Submission } from '../api.js';
import type { ParameterInfo, Side } from '../types.js';

export interface SideEntry {
  text: Record<string, string>;
  total: string;
  by_total: boolean; /* eM is total - eF */
}

export interface Person {
  subject: string;
  measured_at: string;
  broken_date: boolean; /* begun and not finished: the browser then gives no value at all */
  resolution: string;
  sd: 'none' | 'typical' | 'own';
  sd_text: Record<string, string>; /* of "own", by input */
}

export type Entries = Record<Side, SideEntry>;

export const nobody: Person = {
  subject: '',
  measured_at: '',
  broken_date: false,
  resolution: 'standard',
  sd: 'none',
  sd_text: {},
};

/* Words of this page, in whatever language it is in when they are shown; or the daemon's own. */
export type Said = { key: Key; values?: Values } | { text: string; lang: string };

export const in_words = (said: Said): string =>
  'key' in said ? t(said.key, said.values) : said.text;

/* The language of the daemon's own words; those of the page need no mark. */
export const lang_of = (said: Said): string | undefined => ('key' in said ? undefined : said.lang);

export interface Finding {
  severity: 'fault' | 'warning';
  code: string;
  says: Said;
}

const fault = (code: string, key: Key, values: Values = {}): Finding => ({
  severity: 'fault',
  code,
  says: { key, values },
});

export const sides: readonly Side[] = ['left', 'right'];

export const empty_side = (): SideEntry => ({ text: {}, total: '', by_total: false });

export const is_empty = (entry: SideEntry): boolean =>
  Object.values(entry.text).every((text) => text.trim() === '') && entry.total.trim() === '';

/* What was typed for a key, as a number; eM may come from the total thickness. */
export function parsed(entry: SideEntry, key: string): Parsed {
  if (key !== 'eM' || !entry.by_total) return parse_number(entry.text[key] ?? '');
  const total = parse_number(entry.total);
  const fat = parse_number(entry.text['eF'] ?? '');
  if (total.kind !== 'number') return total;
  if (fat.kind !== 'number') return { kind: 'empty' };
  return { kind: 'number', value: difference(total.value, fat.value) };
}

export function value_of(entry: SideEntry, key: string): number | null {
  const p = parsed(entry, key);
  return p.kind === 'number' ? p.value : null;
}

function range_finding(value: number, info: ParameterInfo, typing: boolean): Finding | null {
  const { accepted, studied, unit } = info;
  if (value < accepted.min) {
    /* 1 may be on its way to 10: say so only when the field is left. */
    if (typing && value >= 0) return null;
    return fault('low', 'fault.low', { min: accepted.min, unit });
  }
  if (value > accepted.max) {
    return fault('high', 'fault.high', { max: accepted.max, unit });
  }
  if (value < studied.min || value > studied.max) {
    return { severity: 'warning', code: 'studied', says: { key: 'fault.studied' } };
  }
  return null;
}

/* The fault or the warning of one field, or null. `typing`: the cursor is still in it. */
export function finding(entry: SideEntry, info: ParameterInfo, typing: boolean): Finding | null {
  const p = parsed(entry, info.key);
  if (p.kind === 'empty') return null;
  if (p.kind === 'ambiguous') {
    return fault('ambiguous', 'fault.ambiguous');
  }
  if (p.kind === 'not_a_number') {
    return fault('not_a_number', 'fault.not_a_number');
  }
  const range = range_finding(p.value, info, typing);
  if (range?.severity === 'fault') return range;
  const R1 = value_of(entry, 'R1');
  if (info.key === 'R2' && !typing && R1 !== null && p.value < R1) {
    return fault('inconsistent', 'fault.R2_small');
  }
  return range;
}

/* All faults of a side that is to be sent, missing numbers included, by key. */
export function faults(entry: SideEntry, inputs: ParameterInfo[]): Map<string, Finding> {
  const found = new Map<string, Finding>();
  for (const info of inputs) {
    const f = finding(entry, info, false);
    if (f?.severity === 'fault') found.set(info.key, f);
    else if (parsed(entry, info.key).kind === 'empty') {
      found.set(info.key, fault('missing', 'fault.missing'));
    }
  }
  return found;
}

export const subject_is_valid = (subject: string): boolean =>
  subject === '' || /^[A-Za-z0-9._-]{1,64}$/.test(subject);

/* What is wrong with a standard deviation; nothing with '': the input is known exactly. */
export function sd_fault(text: string, info: ParameterInfo): Finding | null {
  const p = parse_number(text);
  if (p.kind === 'empty') return null;
  if (p.kind !== 'number' || p.value < 0) return fault('not_a_number', 'form.sd.fault');
  const max = info.sd?.max ?? Infinity;
  return p.value > max ? fault('high', 'fault.high', { max, unit: info.unit }) : null;
}

function own_sd(person: Person): Record<string, number> {
  const given = Object.entries(person.sd_text).flatMap(([key, text]) => {
    const p = parse_number(text);
    return p.kind === 'number' ? [[key, p.value] as const] : [];
  });
  return Object.fromEntries(given);
}

/* All seven numbers, when each can be used as it stands; else null. */
export function whole_side(
  entry: SideEntry,
  inputs: ParameterInfo[],
): Record<string, number> | null {
  if (faults(entry, inputs).size > 0) return null;
  return Object.fromEntries(inputs.map(({ key }) => [key, value_of(entry, key) as number]));
}

export function submission(
  side: Side,
  entry: SideEntry,
  person: Person,
  inputs: ParameterInfo[],
): Submission {
  const body: Submission = { side };
  for (const { key } of inputs) body[key] = value_of(entry, key) as number;
  if (person.subject !== '') body['subject'] = person.subject;
  if (person.measured_at !== '') body['measured_at'] = person.measured_at;
  if (person.resolution !== 'standard') body['resolution'] = person.resolution;
  if (person.sd === 'typical') body['sd'] = 'typical';
  if (person.sd === 'own') body['sd'] = own_sd(person);
  return body;
}
