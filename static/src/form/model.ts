// SPDX-License-Identifier: GPL-3.0-or-later
//
// What the form knows, apart from how it looks: the texts as typed, what they mean, what is wrong
// with them, and the documents to send. Limits come from the daemon, never from here.
import { t } from '../i18n.js';
import { difference, parse_number, type Parsed } from '../number.js';
import type { Submission } from '../api.js';
import type { FieldError, ParameterInfo, Side } from '../types.js';

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

export interface Finding {
  severity: 'fault' | 'warning';
  text: string;
  code: string;
}

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
    return { severity: 'fault', code: 'low', text: t('fault.low', { min: accepted.min, unit }) };
  }
  if (value > accepted.max) {
    return { severity: 'fault', code: 'high', text: t('fault.high', { max: accepted.max, unit }) };
  }
  if (value < studied.min || value > studied.max) {
    return { severity: 'warning', code: 'studied', text: t('fault.studied') };
  }
  return null;
}

/* The fault or the warning of one field, or null. `typing`: the cursor is still in it. */
export function finding(entry: SideEntry, info: ParameterInfo, typing: boolean): Finding | null {
  const p = parsed(entry, info.key);
  if (p.kind === 'empty') return null;
  if (p.kind === 'ambiguous') {
    return { severity: 'fault', code: 'ambiguous', text: t('fault.ambiguous') };
  }
  if (p.kind === 'not_a_number') {
    return { severity: 'fault', code: 'not_a_number', text: t('fault.not_a_number') };
  }
  const range = range_finding(p.value, info, typing);
  if (range?.severity === 'fault') return range;
  const R1 = value_of(entry, 'R1');
  if (info.key === 'R2' && !typing && R1 !== null && p.value < R1) {
    return { severity: 'fault', code: 'inconsistent', text: t('fault.R2_small') };
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
      found.set(info.key, { severity: 'fault', code: 'missing', text: t('fault.missing') });
    }
  }
  return found;
}

/* The daemon's own findings, by key; what belongs to no field is kept under ''. */
export function server_faults(errors: FieldError[]): Map<string, Finding> {
  return new Map(
    errors.map((e) => [
      e.pointer.replace(/^\//, ''),
      { severity: 'fault', code: e.code, text: e.detail } as Finding,
    ]),
  );
}

export const subject_is_valid = (subject: string): boolean =>
  subject === '' || /^[A-Za-z0-9._-]{1,64}$/.test(subject);

/* What was typed that is no standard deviation; '' is one: the input is known exactly. */
export function sd_is_good(text: string): boolean {
  const p = parse_number(text);
  return p.kind === 'empty' || (p.kind === 'number' && p.value >= 0);
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
