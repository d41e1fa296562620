// SPDX-License-Identifier: GPL-3.0-or-later
//
// The state of the form and what can be done with it.
import { useEffect, useRef, useState } from 'preact/hooks';
import { ApiError, get_assessment, new_idempotency_key, submit, type Parameters } from '../api.js';
import { t } from '../i18n.js';
import { navigate, result_address } from '../router.js';
import type { Assessment, ParameterInfo, Side } from '../types.js';
import { announce } from '../ui.js';
import { sd_id } from './deviations.js';
import { entries_of, fits_one_form, person_of } from './earlier.js';
import {
  empty_side,
  sd_is_good,
  faults,
  is_empty,
  nobody,
  server_faults,
  sides,
  subject_is_valid,
  submission,
  type Entries,
  type Finding,
  type Person,
  type SideEntry,
} from './model.js';
import type { SamplePerson } from './sample.js';

type Refused = Record<Side, Map<string, Finding>>;

export interface Failure {
  text: string;
  fields: { side: Side; key: string; text: string }[];
}

const nothing = (): Entries => ({ left: empty_side(), right: empty_side() });
const no_refusals = (): Refused => ({ left: new Map(), right: new Map() });
const other: Record<Side, Side> = { left: 'right', right: 'left' };
const stiffness = ['muM', 'muF'];

function failure_of(e: ApiError): Failure {
  const busy = e.status === 429 || e.status === 503;
  if (busy) return { text: t('form.error.busy'), fields: [] };
  if (e.status === 0 || e.status >= 502) return { text: t('form.error.unreachable'), fields: [] };
  return { text: t('form.error.server', { detail: e.message }), fields: [] };
}

function failure_of_fields(refused: Refused): Failure {
  const fields = sides.flatMap((side) =>
    [...refused[side]].map(([key, f]) => ({ side, key, text: f.text })),
  );
  return { text: t('form.error.title'), fields };
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
  const [earlier, set_earlier] = useState<Assessment[]>([]);
  const [person, set_person] = useState<Person>(nobody);
  const [entries, set_entries] = useState<Entries>(nothing);
  const [refused, set_refused] = useState<Refused>(no_refusals);
  const [failure, set_failure] = useState<Failure | null>(null);
  const [sending, set_sending] = useState(false);
  const send_side = use_sender();
  const filled = sides.filter((side) => !is_empty(entries[side]));

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

  useEffect(() => {
    if (from.length === 0) return;
    Promise.all(from.map(get_assessment)).then(
      start_from,
      () => undefined /* erased since: the form stays empty */,
    );
  }, [from.join()]);

  const change_side = (side: Side, entry: SideEntry, key: string): void => {
    set_entries((now) => ({ ...now, [side]: entry }));
    set_refused((now) => {
      const rest = new Map(now[side]);
      rest.delete(key);
      if (key === 'R2') rest.delete('R1'); /* swapped together */
      return { ...now, [side]: rest };
    });
  };

  const copy_stiffness = (side: Side): void => {
    const from = entries[side].text;
    const filled_in = stiffness.filter((key) => from[key]?.trim());
    const copied = Object.fromEntries(filled_in.map((key) => [key, from[key] ?? '']));
    const to = other[side];
    set_entries((now) => ({ ...now, [to]: { ...now[to], text: { ...now[to].text, ...copied } } }));
  };

  const fill_sample = (sample: SamplePerson): void => {
    const entry = (side: Side): SideEntry => ({ ...empty_side(), text: { ...sample.sides[side] } });
    restart({ left: entry('left'), right: entry('right') }, { ...person, subject: sample.subject });
    announce(t('form.sample.filled', { n: sample.number }));
  };

  const refuse = (found: Refused): void => {
    set_refused(found);
    set_failure(failure_of_fields(found));
  };

  /* True when nothing is wrong that can be seen from here. */
  const check = (inputs: ParameterInfo[]): boolean => {
    const bad_sd =
      person.sd === 'own' && inputs.find(({ key }) => !sd_is_good(person.sd_text[key] ?? ''))?.key;
    const found = no_refusals();
    for (const side of filled) found[side] = faults(entries[side], inputs);
    if (filled.length === 0) set_failure({ text: t('form.error.empty'), fields: [] });
    else if (found.left.size + found.right.size > 0) refuse(found);
    else if (!subject_is_valid(person.subject)) document.getElementById('subject')?.focus();
    else if (person.broken_date) document.getElementById('measured_at')?.focus();
    else if (bad_sd) document.getElementById(sd_id(bad_sd))?.focus();
    else return true;
    return false;
  };

  const explain = (e: unknown, side: Side): void => {
    if (!(e instanceof ApiError)) throw e;
    const { errors } = e.problem;
    if (errors?.length) refuse({ ...no_refusals(), [side]: server_faults(errors) });
    else set_failure(failure_of(e));
  };

  const send_all = async (inputs: ParameterInfo[]): Promise<string[] | null> => {
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
    if (!check(parameters.inputs)) return;
    set_sending(true);
    const ids = await send_all(parameters.inputs).finally(() => set_sending(false));
    if (ids) navigate(result_address(ids));
  };

  return {
    earlier,
    person,
    entries,
    refused,
    failure,
    sending,
    filled,
    set_person,
    change_side,
    copy_stiffness,
    fill_sample,
    send,
    clear: (): void => restart(nothing(), nobody),
  };
}
