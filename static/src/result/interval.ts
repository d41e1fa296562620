// SPDX-License-Identifier: GPL-3.0-or-later
//
// The ends of an interval: what nine samples in ten lie between.
import { format_fixed, t } from '../i18n.js';
import type { Quantiles, Result, Uncertainty } from '../types.js';

export interface Interval {
  low: number;
  high: number;
}

/* The uncertainty of a result that has an interval; else null. */
export const given = (r: Result): Uncertainty | null =>
  r.uncertainty?.status === 'given' ? r.uncertainty : null;

/* Null when an end is not known. */
export function interval_of(quantiles: Quantiles | undefined): Interval | null {
  const [low, high] = [quantiles?.[0], quantiles?.[4]];
  return typeof low === 'number' && typeof high === 'number' ? { low, high } : null;
}

export function interval_text(
  quantiles: Quantiles | undefined,
  decimals: number,
  unit = '',
): string {
  const [low, high] = [quantiles?.[0], quantiles?.[4]];
  const text = (v: number): string => format_fixed(v, decimals) + unit;
  if (typeof low !== 'number') return '';
  if (typeof high !== 'number') return t('uncertain.from', { low: text(low) });
  return t('uncertain.interval', { low: format_fixed(low, decimals), high: text(high) });
}
