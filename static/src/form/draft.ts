// SPDX-License-Identifier: GPL-3.0-or-later
//
// What stood in the form at an address of the browser's history, so that "Back" finds it again. It
// is kept in memory alone, and gone with the page: measurements of people are left on no disk.
import { new_idempotency_key } from '../api.js';
import type { Assessment } from '../types.js';
import type { Entries, Person } from './model.js';

export interface Draft {
  person: Person;
  entries: Entries;
  earlier: Assessment[];
}

const drafts = new Map<string, Draft>();

const name_here = (): string | undefined => (history.state as { draft?: string } | null)?.draft;

export function draft_here(): Draft | undefined {
  const name = name_here();
  return name === undefined ? undefined : drafts.get(name);
}

/* As the draft of the address that the browser is at now. */
export function keep_draft(draft: Draft): void {
  const name = name_here() ?? new_idempotency_key();
  if (name_here() === undefined) history.replaceState({ draft: name }, '');
  drafts.set(name, draft);
}
