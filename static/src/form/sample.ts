// SPDX-License-Identifier: GPL-3.0-or-later
//
// The 13 persons of Table 2, from examples/table2.csv, to try the form with.
import csv from 'table2:inputs';
import type { Side } from '../types.js';

export interface SamplePerson {
  subject: string; /* as sent: table2-1 */
  number: string; /* as in the table: 1 */
  sides: Partial<Record<Side, Record<string, string>>>;
}

/* A column may carry its unit: R1_mm is R1. */
const key_of = (column: string): string => column.trim().split('_')[0] ?? '';

function rows(text: string): Record<string, string>[] {
  const [header, ...lines] = text.split(/\r?\n/).filter((l) => l.trim() && !l.startsWith('#'));
  const names = header?.split(',') ?? [];
  return lines.map((line) => {
    const cells = line.split(',');
    return Object.fromEntries(names.map((name, i) => [key_of(name), (cells[i] ?? '').trim()]));
  });
}

function read(text: string): SamplePerson[] {
  const persons = new Map<string, SamplePerson>();
  for (const { subject = '', side, ...numbers } of rows(text)) {
    if (side !== 'left' && side !== 'right') continue;
    const person = persons.get(subject) ?? {
      subject,
      number: subject.replace(/^.*-/, ''),
      sides: {},
    };
    person.sides[side] = numbers;
    persons.set(subject, person);
  }
  return [...persons.values()];
}

export const sample_persons: SamplePerson[] = read(csv);
