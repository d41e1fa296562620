// SPDX-License-Identifier: GPL-3.0-or-later
//
// Words and numbers in the reader's language. Every string stands in words/, one file a language,
// which the page shares with the daemon: keys that begin with "daemon." are not bundled here. The
// type of the English one makes the compiler find a missing string in the others.
import de from '../../words/de.json';
import en from '../../words/en.json';
import fr from '../../words/fr.json';

export type Key = Exclude<keyof typeof en, `daemon.${string}`>;
export type Strings = Record<keyof typeof en, string>;

const languages = { en, de, fr } satisfies Record<string, Strings>;
export type Language = keyof typeof languages;
export const language_names = Object.fromEntries(
  Object.entries(languages).map(([code, words]) => [code, words['language.name']]),
) as Record<Language, string>;

const storage_key = 'ischia.language';
const is_language = (text: string | null | undefined): text is Language =>
  typeof text === 'string' && Object.hasOwn(languages, text);

/* What the address asks for, as the links of the page without JavaScript do. */
const asked = (): string | null => new URLSearchParams(window.location.search).get('lang');

function stored(): string | null {
  try {
    return localStorage.getItem(storage_key);
  } catch {
    return null; /* storage switched off: the browser's language is used */
  }
}

function initial(): Language {
  const wanted = [asked(), stored(), ...navigator.languages.map((l) => l.slice(0, 2))];
  return wanted.find(is_language) ?? 'en';
}

let current: Language = initial();

/* The reader's own way of writing dates and numbers where the browser knows one: en-GB for en. */
const locale = (): string => navigator.languages.find((l) => l.startsWith(current)) ?? current;

export const language = (): Language => current;

export function set_language(next: Language): void {
  current = next;
  document.documentElement.lang = next;
  const address = new URL(window.location.href);
  address.searchParams.delete('lang'); /* what is chosen now holds, also after a reload */
  if (asked() !== null) history.replaceState(history.state, '', address);
  try {
    localStorage.setItem(storage_key, next);
  } catch {
    /* storage switched off: the choice holds until the page is left */
  }
}

export type Values = Record<string, string | number>;

export function t(key: Key, values: Values = {}): string {
  return languages[current][key].replace(/\{(\w+)\}/g, (whole, name: string) => {
    const value = values[name];
    if (value === undefined) return whole;
    return typeof value === 'number' ? format(value) : value;
  });
}

/* A string that may not exist, such as the name of a parameter this page has never heard of. */
export function t_or(key: string, otherwise: string): string {
  return (languages[current] as Record<string, string>)[key] ?? otherwise;
}

/* Up to `digits` significant digits, without a thousands separator that could be misread: a group
 * is set apart with a narrow space. */
export function format(value: number, digits = 6): string {
  return new Intl.NumberFormat(locale(), { maximumSignificantDigits: digits })
    .formatToParts(value)
    .map((part) => (part.type === 'group' ? '\u202f' : part.value))
    .join('');
}

export function format_fixed(value: number, decimals: number): string {
  return new Intl.NumberFormat(locale(), {
    minimumFractionDigits: decimals,
    maximumFractionDigits: decimals,
  })
    .formatToParts(value)
    .map((part) => (part.type === 'group' ? '\u202f' : part.value))
    .join('');
}

export const format_percent = (fraction: number): string =>
  `${format_fixed(fraction * 100, Math.abs(fraction) < 0.1 ? 1 : 0)}\u202f%`;

export function format_signed(value: number, decimals: number): string {
  const text = format_fixed(Math.abs(value), decimals);
  if (Number(Math.abs(value).toFixed(decimals)) === 0) return text;
  return `${value < 0 ? '\u2212' : '+'}${text}`;
}

export function format_time(iso: string): string {
  if (/^\d{4}-\d{2}-\d{2}$/.test(iso)) {
    return new Date(`${iso}T00:00:00Z`).toLocaleDateString(locale(), {
      dateStyle: 'medium',
      timeZone: 'UTC',
    });
  }
  return new Date(iso).toLocaleString(locale(), { dateStyle: 'medium', timeStyle: 'short' });
}
