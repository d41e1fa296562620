// SPDX-License-Identifier: GPL-3.0-or-later
//
// The form: a person, two sides, one button.
import { useEffect, useRef, useState } from 'preact/hooks';
import {
  ApiError,
  get_assessment,
  get_parameters,
  new_idempotency_key,
  submit,
  type Parameters,
} from '../api.js';
import { t } from '../i18n.js';
import { navigate, result_address } from '../router.js';
import type { Side } from '../types.js';
import { announce } from '../ui.js';
import { field_id } from './field.js';
import {
  empty_side,
  faults,
  is_empty,
  server_faults,
  sides,
  subject_is_valid,
  submission,
  type Finding,
  type Person,
  type SideEntry,
} from './model.js';
import { PersonFields } from './person.js';
import type { SamplePerson } from './sample.js';
import { SideForm } from './side_form.js';

type Entries = Record<Side, SideEntry>;
type Refused = Record<Side, Map<string, Finding>>;

const no_refusals = (): Refused => ({ left: new Map(), right: new Map() });
const stiffness = ['muM', 'muF'];
const other: Record<Side, Side> = { left: 'right', right: 'left' };

interface Failure {
  text: string;
  fields: { side: Side; key: string; text: string }[];
}

function failure_of(e: unknown): Failure {
  if (!(e instanceof ApiError)) throw e;
  if (e.status === 0 || e.status >= 502) return { text: t('form.error.unreachable'), fields: [] };
  if (e.status === 429 || e.status === 503) return { text: t('form.error.busy'), fields: [] };
  return { text: t('form.error.server', { detail: e.message }), fields: [] };
}

function Errors(props: { failure: Failure }) {
  const box = useRef<HTMLDivElement>(null);
  const { text, fields } = props.failure;
  useEffect(() => box.current?.focus(), [props.failure]);
  return (
    <div class="errors" role="alert" tabIndex={-1} ref={box}>
      <p>{text}</p>
      {fields.length > 0 && (
        <ul>
          {fields.map((f) => (
            <li key={`${f.side}${f.key}`}>
              <a href={`#${field_id(f.side, f.key)}`} onClick={(e) => focus_field(e, f)}>
                {`${t(`side.${f.side}`)}, ${f.key}`}
              </a>
              {`: ${f.text}`}
            </li>
          ))}
        </ul>
      )}
    </div>
  );
}

function focus_field(e: Event, f: { side: Side; key: string }): void {
  e.preventDefault();
  document.getElementById(field_id(f.side, f.key))?.focus();
}

function use_parameters(): [Parameters | null, boolean, () => void] {
  const [parameters, set] = useState<Parameters | null>(null);
  const [failed, set_failed] = useState(false);
  const load = (): void => {
    set_failed(false);
    get_parameters().then(set, () => set_failed(true));
  };
  useEffect(load, []);
  return [parameters, failed, load];
}

/* The numbers of earlier assessments, to be changed and computed again. */
function use_earlier(ids: string[], fill: (entries: Partial<Entries>, subject: string) => void): void {
  useEffect(() => {
    if (ids.length === 0) return;
    void Promise.all(ids.map(get_assessment)).then(
      (documents) => {
        const entries: Partial<Entries> = {};
        documents.forEach((d, i) => {
          const text = Object.fromEntries(
            Object.entries(d.parameters).map(([key, value]) => [key, String(value)]),
          );
          entries[d.side ?? sides[i] ?? 'left'] = { ...empty_side(), text };
        });
        fill(entries, documents[0]?.subject ?? '');
      },
      () => undefined /* gone since: the form stays empty */,
    );
  }, [ids.join()]);
}

const submit_label = (filled: Side[]): string => {
  if (filled.length === 2) return t('form.submit.both');
  return filled[0] ? t(`form.submit.${filled[0]}`) : t('form.submit.none');
};

export function FormPage(props: { from: string[] }) {
  const [parameters, parameters_failed, reload] = use_parameters();
  const [person, set_person] = useState<Person>({ subject: '', measured_at: '', resolution: 'standard' });
  const [entries, set_entries] = useState<Entries>({ left: empty_side(), right: empty_side() });
  const [refused, set_refused] = useState<Refused>(no_refusals);
  const [failure, set_failure] = useState<Failure | null>(null);
  const [sending, set_sending] = useState(false);
  /* One key per side and content: a second click or a retry never makes a second assessment. */
  const keys = useRef(new Map<string, string>());

  use_earlier(props.from, (earlier, subject) => {
    set_entries((now) => ({ ...now, ...earlier }));
    set_person((now) => ({ ...now, subject }));
  });

  const filled = sides.filter((side) => !is_empty(entries[side]));

  const change_side = (side: Side, entry: SideEntry, key: string): void => {
    set_entries((now) => ({ ...now, [side]: entry }));
    set_refused((now) => {
      const left_over = new Map(now[side]);
      left_over.delete(key);
      if (key === 'R2') left_over.delete('R1');
      return { ...now, [side]: left_over };
    });
  };

  const copy_stiffness = (from: Side): void => {
    const to = other[from];
    const copied = Object.fromEntries(stiffness.map((key) => [key, entries[from].text[key] ?? '']));
    const entry = { ...entries[to], text: { ...entries[to].text, ...copied } };
    set_entries((now) => ({ ...now, [to]: entry }));
  };

  const clear = (): void => {
    set_entries({ left: empty_side(), right: empty_side() });
    set_person({ subject: '', measured_at: '', resolution: 'standard' });
    set_refused(no_refusals());
    set_failure(null);
  };

  const fill_sample = (sample: SamplePerson): void => {
    const entry = (side: Side): SideEntry => ({ ...empty_side(), text: { ...sample.sides[side] } });
    set_entries({ left: entry('left'), right: entry('right') });
    set_person((now) => ({ ...now, subject: sample.subject }));
    set_refused(no_refusals());
    set_failure(null);
    announce(t('form.sample.filled', { n: sample.subject.replace(/^\D*/, '') }));
  };

  const refuse = (found: Refused): void => {
    const fields = sides.flatMap((side) =>
      [...found[side]].map(([key, f]) => ({ side, key, text: f.text })),
    );
    set_refused(found);
    set_failure({ text: t('form.error.title'), fields });
  };

  const local_faults = (inputs: Parameters['inputs']): Refused | null => {
    const found = no_refusals();
    for (const side of filled) found[side] = faults(entries[side], inputs);
    return found.left.size + found.right.size > 0 ? found : null;
  };

  const send_side = async (side: Side, inputs: Parameters['inputs']): Promise<string> => {
    const body = submission(side, entries[side], person, inputs);
    const content = JSON.stringify(body);
    const key = keys.current.get(content) ?? new_idempotency_key();
    keys.current.set(content, key);
    try {
      return (await submit(body, key)).id;
    } catch (e) {
      if (e instanceof ApiError && e.problem.errors?.length) {
        refuse({ ...no_refusals(), [side]: server_faults(e.problem.errors) });
      } else set_failure(failure_of(e));
      throw e;
    }
  };

  const send = async (e: Event): Promise<void> => {
    e.preventDefault();
    if (!parameters || sending) return;
    set_failure(null);
    const found = local_faults(parameters.inputs);
    if (filled.length === 0) return set_failure({ text: t('form.error.empty'), fields: [] });
    if (found) return refuse(found);
    if (!subject_is_valid(person.subject)) {
      document.getElementById('subject')?.focus();
      return;
    }
    set_sending(true);
    try {
      const ids: string[] = [];
      for (const side of filled) ids.push(await send_side(side, parameters.inputs));
      keys.current.clear();
      navigate(result_address(ids));
    } catch (error) {
      if (!(error instanceof ApiError)) throw error;
    } finally {
      set_sending(false);
    }
  };

  if (!parameters) {
    return (
      <>
        <h1 tabIndex={-1}>{t('form.title')}</h1>
        {parameters_failed ? (
          <div class="errors" role="alert">
            <p>{t('form.loading.failed')}</p>
            <button type="button" onClick={reload}>
              {t('form.retry')}
            </button>
          </div>
        ) : (
          <p class="loading">{t('form.loading')}</p>
        )}
      </>
    );
  }

  return (
    <form class="assessment" onSubmit={(e) => void send(e)} noValidate>
      <h1 tabIndex={-1}>{t('form.title')}</h1>
      <PersonFields person={person} on_change={set_person} on_sample={fill_sample} />
      {failure && <Errors failure={failure} />}
      <div class="sides">
        {sides.map((side) => (
          <SideForm
            key={side}
            side={side}
            entry={entries[side]}
            parameters={parameters}
            refused={refused[side]}
            on_change={(entry, key) => change_side(side, entry, key)}
            on_copy={() => copy_stiffness(side)}
          />
        ))}
      </div>
      <div class="submit">
        <button type="submit" class="primary" aria-disabled={sending}>
          {sending ? t('form.submitting') : submit_label(filled)}
        </button>
        <button type="button" class="quiet" onClick={clear}>
          {t('form.clear')}
        </button>
        <span class="hint">{t('form.partial')}</span>
      </div>
    </form>
  );
}
