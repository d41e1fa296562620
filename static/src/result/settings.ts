// SPDX-License-Identifier: GPL-3.0-or-later
//
// How a result was computed, in words: without it a coarse one, or one with another skin, reads like
// any other.
import { t, t_or } from '../i18n.js';
import { unusual_options } from '../reference.js';
import type { Assessment } from '../types.js';

/* The resolution. */
export function resolution_text({ resolution }: Assessment): string {
  if (!resolution) return '';
  return `${t('form.resolution')}: ${t_or(`form.resolution.${resolution}`, resolution)}`;
}

/* The options that are not the default; empty when all are. */
export function options_text(d: Assessment): string {
  const list = unusual_options(d).join(', ');
  return list && t('result.options', { list });
}

/* What is not as usual, for a line under a heading or a row. */
export const unusual_text = (d: Assessment): string[] =>
  [d.resolution === 'standard' ? '' : resolution_text(d), options_text(d)].filter(Boolean);
