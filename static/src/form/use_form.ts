// SPDX-License-Identifier: GPL-3.0-or-later
//
// The state of the form and what can be done with it.
import { useEffect, useLayoutEffect, useRef, useState } from 'preact/hooks';
import {
  access_key,
  ApiError,
  get_assessment,
  new_idempotency_key,
  submit,
  type Parameters,
} from '../api.js';
import { t, type Key, type Values } from '../i18n.js';
import { navigate, result_address } from '../router.js';
import type { Assessment, Side } from '../types.js';
import { announce } from '../ui.js';
import { sd_id } from './deviations.js';
import { draft_here, keep_draft } from './draft.js';
import { entries_of, fits_one_form, person_of } from './earlier.js';
import {
  empty_side,
  faults,
  is_empty,
  nobody,
  sd_fault,
  sides,
  subject_is_valid,
  submission,
  type Entries,
  type Person,
  type SideEntry,
} from './model.js';
import {
  left_of_person,
  left_of_side,
  listed,
  no_refusals,
  refused_by_daemon,
  type Refused,
} from './refusal.js';
import type { SamplePerson } from './sample.js';

/* Why the form was not sent, or not taken. `until`: what takes it away. */
export interface Failure {
  key: Key;
  values?: Values;
  until: 'corrected' | 'filled' | 'sent';
}

const nothing = (): Entries => ({ left: empty_side(), right: empty_side() });
const other: Record<Side, Side> = { left: 'right', right: 'left' };
const stiffness = ['muM', 'muF'];

function failure_of(e: ApiError): Failure {
  const until = 'sent';
  if (e.status === 429) return { key: 'form.error.busy', until };
  if (e.status === 0 || e.status >= 502) return { key: 'form.error.unreachable', until };
  const access = access_key(e);
  if (access) return { key: access, until };
  return { key: 'form.error.server', values: { detail: e.message }, until };
}

/* Sends sides one after the other; the same content always under the same key, so that neither a
 * second click nor a retry makes a second assessment. */
function use_sender(): (body: ReturnType<typeof submission>) => Promise<string> {
  const keys = useRef(new Map<string, string>());
  return async (body) => {
    const content = JSON.stringify(body);
    const key = keys.current.get(content) ?? new_idempotency_key();
    keys.current.set(content, key);
    return (await submit(body, key)).id;
  };
}

export function use_form(parameters: Parameters | null, from: string[]) {
  const [draft] = useState(draft_here);
  const [loading, set_loading] = useState(!draft && from.length > 0);
  const [unread, set_unread] = useState(false);
  const [earlier, set_earlier] = useState<Assessment[]>(draft?.earlier ?? []);
  const [person, set_person] = useState<Person>(draft?.person ?? nobody);
  const [entries, set_entries] = useState<Entries>(draft?.entries ?? nothing);
  const [refused, set_refused] = useState<Refused>(no_refusals);
  const [failure, set_failure] = useState<Failure | null>(null);
  const [sending, set_sending] = useState(false);
  const send_side = use_sender();
  const inputs = parameters?.inputs ?? [];
  const filled = sides.filter((side) => !is_empty(entries[side]));
  const is_over = {
    corrected: listed(refused).length === 0,
    filled: filled.length > 0,
    sent: false,
  };

  const restart = (next: Entries, next_person: Person, next_earlier: Assessment[] = []): void => {
    set_entries(next);
    set_person(next_person);
    set_earlier(next_earlier);
    set_refused(no_refusals());
    set_failure(null);
  };

  /* Of two that do not fit into one form the first. */
  const start_from = (documents: Assessment[]): void => {
    const used = fits_one_form(documents) ? documents : documents.slice(0, 1);
    if (used[0]) restart(entries_of(used), person_of(used[0]), used);
  };

  const load_earlier = (): void => {
    if (!loading) return;
    set_unread(false);
    Promise.all(from.map(get_assessment)).then(
      (documents) => {
        start_from(documents);
        set_loading(false);
      },
      (e: unknown) => {
        if (!(e instanceof ApiError)) throw e;
        if (e.status !== 404) return set_unread(true);
        set_failure({ key: 'result.not_found', until: 'filled' }); /* erased since */
        set_loading(false);
      },
    );
  };
  useEffect(load_earlier, [from.join()]);

  /* After every change, and when the same form stands at another address. */
  useLayoutEffect(() => {
    if (!loading) keep_draft({ person, entries, earlier });
  });

  const change_side = (side: Side, entry: SideEntry): void => {
    const before = entries[side];
    set_entries((now) => ({ ...now, [side]: entry }));
    set_refused((now) => ({ ...now, [side]: left_of_side(now[side], before, entry, inputs) }));
  };

  const change_person = (next: Person): void => {
    set_person(next);
    set_refused((now) => left_of_person(now, person, next));
  };

  const copy_stiffness = (side: Side): void => {
    const from = entries[side].text;
    const filled_in = stiffness.filter((key) => from[key]?.trim());
    const copied = Object.fromEntries(filled_in.map((key) => [key, from[key] ?? '']));
    const to = other[side];
    change_side(to, { ...entries[to], text: { ...entries[to].text, ...copied } });
  };

  const fill_sample = (sample: SamplePerson): void => {
    const entry = (side: Side): SideEntry => ({ ...empty_side(), text: { ...sample.sides[side] } });
    restart({ left: entry('left'), right: entry('right') }, { ...person, subject: sample.subject });
    announce(t('form.sample.filled', { n: sample.number }));
  };

  const refuse = (found: Refused): void => {
    set_refused(found);
    set_failure({ key: 'form.error.title', until: 'corrected' });
  };

  /* True when nothing is wrong that can be seen from here. */
  const check = (): boolean => {
    const bad_sd =
      person.sd === 'own' &&
      inputs.find((info) => sd_fault(person.sd_text[info.key] ?? '', info))?.key;
    const found = no_refusals();
    for (const side of filled) found[side] = faults(entries[side], inputs);
    if (filled.length === 0) set_failure({ key: 'form.error.empty', until: 'filled' });
    else if (listed(found).length > 0) refuse(found);
    else if (!subject_is_valid(person.subject)) document.getElementById('subject')?.focus();
    else if (person.broken_date) document.getElementById('measured_at')?.focus();
    else if (bad_sd) document.getElementById(sd_id(bad_sd))?.focus();
    else return true;
    return false;
  };

  const explain = (e: unknown, side: Side): void => {
    if (!(e instanceof ApiError)) throw e;
    const { errors } = e.problem;
    if (errors?.length) refuse(refused_by_daemon(errors, side, inputs));
    else set_failure(failure_of(e));
  };

  const send_all = async (): Promise<string[] | null> => {
    const ids: string[] = [];
    for (const side of filled) {
      try {
        ids.push(await send_side(submission(side, entries[side], person, inputs)));
      } catch (e) {
        explain(e, side);
        return null;
      }
    }
    return ids;
  };

  const send = async (): Promise<void> => {
    if (!parameters || sending) return;
    set_failure(null);
    set_refused(no_refusals());
    if (!check()) return;
    set_sending(true);
    const ids = await send_all().finally(() => set_sending(false));
    if (ids) navigate(result_address(ids));
  };

  const clear = (): void => {
    restart(nothing(), nobody);
    announce(t('form.cleared'));
  };

  return {
    loading,
    unread /* what the form is to start from */,
    load_earlier,
    earlier,
    person,
    entries,
    refused,
    failure: failure && !is_over[failure.until] ? failure : null,
    sending,
    filled,
    change_person,
    change_side,
    copy_stiffness,
    fill_sample,
    send,
    clear,
  };
}
