// SPDX-License-Identifier: GPL-3.0-or-later
//
// The form: a person, two sides, one button.
import { useEffect, useRef, useState } from 'preact/hooks';
import { get_parameters, type Parameters } from '../api.js';
import { use_emulator } from '../emulator.js';
import { language, t, t_or, type Key } from '../i18n.js';
import type { Assessment, Side } from '../types.js';
import { Shape } from '../ui.js';
import { Deviations, DeviationFields } from './deviations.js';
import { left_behind } from './earlier.js';
import { in_words, lang_of, sides } from './model.js';
import { PersonFields } from './person.js';
import { id_of, listed, name_of, type Refusal, type Refused } from './refusal.js';
import { Resolution } from './resolution.js';
import { SideForm } from './side_form.js';
import { use_form, type Failure } from './use_form.js';

function focus_field(e: Event, id: string): void {
  e.preventDefault();
  document.getElementById(id)?.focus();
}

function Refusals(props: { of: Refusal[] }) {
  return (
    <ul>
      {props.of.map((refusal) => {
        const { group, key, finding } = refusal;
        const [id, name] = [id_of(refusal), name_of(refusal)];
        return (
          <li key={group + key}>
            {id && (
              <a href={`#${id}`} onClick={(e) => focus_field(e, id)}>
                {name}
              </a>
            )}
            {id ? ': ' : `${name}: `}
            <span lang={lang_of(finding.says)}>{in_words(finding.says)}</span>
          </li>
        );
      })}
    </ul>
  );
}

/* Takes the focus when it appears, and when the form was sent again; not while it is corrected. */
function Errors(props: { failure: Failure; refused: Refused }) {
  const box = useRef<HTMLDivElement>(null);
  const { key, values } = props.failure;
  const refusals = listed(props.refused);
  useEffect(() => box.current?.focus(), [props.failure]);
  return (
    <div class="errors" role="alert" tabIndex={-1} ref={box}>
      <p>{t(key, values)}</p>
      {refusals.length > 0 && <Refusals of={refusals} />}
    </div>
  );
}

function use_parameters(): [Parameters | null, boolean, () => void] {
  const [parameters, set] = useState<Parameters | null>(null);
  const [failed, set_failed] = useState(false);
  const load = (): void => {
    set_failed(false);
    get_parameters().then(set, () => set_failed(true));
  };
  useEffect(load, [language()]); /* names and helps are the daemon's, in the reader's language */
  return [parameters, failed, load];
}

function Loading(props: { failed: Key | null; again: () => void }) {
  return (
    <>
      <h1 tabIndex={-1}>{t('form.title')}</h1>
      {props.failed ? (
        <div class="errors" role="alert">
          <p>{t(props.failed)}</p>
          <button type="button" onClick={props.again}>
            {t('form.retry')}
          </button>
        </div>
      ) : (
        <p class="loading">{t('form.loading')}</p>
      )}
    </>
  );
}

/* What the earlier assessment had and this form has no place for. */
function LeftBehind(props: { earlier: Assessment[]; parameters: Parameters }) {
  const names = left_behind(props.earlier, props.parameters.options);
  if (names.length === 0) return null;
  const list = names.map((name) => t_or(`form.earlier.${name}`, name)).join(', ');
  return (
    <p class="left-behind">
      <span class="reading warning">
        <Shape of="shear" />
        <span>{t('form.earlier', { list })}</span>
      </span>
    </p>
  );
}

function submit_label(filled: Side[]): string {
  if (filled.length === 2) return t('form.submit.both');
  return filled[0] ? t(`form.submit.${filled[0]}`) : t('form.submit.none');
}

export function FormPage(props: { from: string[] }) {
  const [parameters, failed, again] = use_parameters();
  const form = use_form(parameters, props.from);
  const previews = use_emulator();
  /* An empty form would take what is typed, and lose it when the earlier numbers come. */
  if (!parameters || form.loading) {
    const unread = form.unread ? 'form.earlier.failed' : null;
    const try_again = (): void => {
      again();
      form.load_earlier();
    };
    return <Loading failed={failed ? 'form.loading.failed' : unread} again={try_again} />;
  }
  const { person, entries, failure, sending } = form;
  const send = (e: Event): void => {
    e.preventDefault();
    void form.send();
  };
  return (
    <form class="assessment" onSubmit={send} noValidate>
      <h1 tabIndex={-1}>{t('form.title')}</h1>
      <PersonFields person={person} on_change={form.change_person} on_sample={form.fill_sample} />
      <LeftBehind earlier={form.earlier} parameters={parameters} />
      {failure && <Errors failure={failure} refused={form.refused} />}
      <div class="sides">
        {sides.map((side) => (
          <SideForm
            key={side}
            side={side}
            entry={entries[side]}
            parameters={parameters}
            refused={form.refused[side]}
            on_change={(entry) => form.change_side(side, entry)}
            on_copy={() => form.copy_stiffness(side)}
            preview={previews}
          />
        ))}
      </div>
      <DeviationFields
        person={person}
        inputs={parameters.inputs}
        refused={form.refused.sd}
        on_change={form.change_person}
      />
      <div class="submit">
        <button type="submit" class="primary" aria-disabled={sending}>
          {sending ? t('form.submitting') : submit_label(form.filled)}
        </button>
        <button type="button" class="quiet" onClick={form.clear}>
          {t('form.clear')}
        </button>
        <span class="hint">{t('form.partial')}</span>
        <Resolution
          names={parameters.resolutions}
          value={person.resolution}
          change={(resolution) => form.change_person({ ...person, resolution })}
        />
        <Deviations person={person} on_change={form.change_person} />
      </div>
    </form>
  );
}
