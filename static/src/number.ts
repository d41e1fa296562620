// SPDX-License-Identifier: GPL-3.0-or-later
//
// Numbers as people type them. A decimal comma and a decimal point both mean the decimal mark; a
// text with more than one mark (1,234.5) could be read in two ways and is refused, never guessed.

export type Parsed =
  | { kind: 'empty' }
  | { kind: 'number'; value: number }
  | { kind: 'ambiguous' }
  | { kind: 'not_a_number' };

export function parse_number(text: string): Parsed {
  const trimmed = text
    .replace(/^[\s\u00a0\u202f]+|[\s\u00a0\u202f]+$/g, '')
    .replace(/^\u2212/, '-');
  if (trimmed === '') return { kind: 'empty' };
  if (!/^[+-]?[\d.,]*\d[\d.,]*$/.test(trimmed)) return { kind: 'not_a_number' };
  if ((trimmed.match(/[.,]/g) ?? []).length > 1) return { kind: 'ambiguous' };
  return { kind: 'number', value: Number(trimmed.replace(',', '.')) };
}

/* a - b without the digits that binary fractions add: 41.2 - 10.1 is 31.1. */
export function difference(a: number, b: number): number {
  return Number((a - b).toPrecision(12));
}
