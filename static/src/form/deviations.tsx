// SPDX-License-Identifier: GPL-3.0-or-later
//
// How far the measurements may be off: not considered, what is typical, or a standard deviation for
// each. It holds for both sides: they were measured by the same hands.
import { format, t } from '../i18n.js';
import type { ParameterInfo } from '../types.js';
import { Shape } from '../ui.js';
import { Symbol_ } from './field.js';
import { in_words, lang_of, sd_fault, type Finding, type Person } from './model.js';

export const sd_id = (key: string): string => `sd-${key}`;

const choices = ['none', 'typical', 'own'] as const;

export function Deviations(props: { person: Person; on_change: (person: Person) => void }) {
  const { person, on_change } = props;
  const choose = (name: string): void =>
    on_change({ ...person, sd: choices.find((c) => c === name) ?? 'none' });
  return (
    <label>
      {t('form.sd')}
      <select id="sd" value={person.sd} onChange={(e) => choose(e.currentTarget.value)}>
        {choices.map((name) => (
          <option key={name} value={name}>
            {t(`form.sd.${name}`)}
          </option>
        ))}
      </select>
    </label>
  );
}

/* "2" for 2 mm, "20 %" for a part of what was measured. */
function typical(info: ParameterInfo): string {
  const { absolute = 0, relative = 0 } = info.sd?.typical ?? {};
  return relative > 0 ? `${format(100 * relative)}\u202f%` : format(absolute);
}

/* The first that is wrong, by its name; else what to type. */
function Note(props: { found: Map<string, Finding> }) {
  const [first] = props.found;
  if (!first) {
    return (
      <span id="sd-note" class="hint">
        {t('form.sd.hint')}
      </span>
    );
  }
  const [key, { says }] = first;
  return (
    <span id="sd-note" class="reading fault">
      <Shape of="none" />
      <span lang={lang_of(says)}>{`${key}: ${in_words(says)}`}</span>
    </span>
  );
}

export function DeviationFields(props: {
  person: Person;
  inputs: ParameterInfo[];
  refused: Map<string, Finding>; /* shown until the field is changed */
  on_change: (person: Person) => void;
}) {
  const { person, inputs, refused, on_change } = props;
  if (person.sd !== 'own') return null;
  const set = (key: string, text: string): void =>
    on_change({ ...person, sd_text: { ...person.sd_text, [key]: text } });
  const found = new Map(
    inputs.flatMap((info): [string, Finding][] => {
      const f = refused.get(info.key) ?? sd_fault(person.sd_text[info.key] ?? '', info);
      return f ? [[info.key, f]] : [];
    }),
  );
  return (
    <fieldset class="deviations">
      <legend>{t('form.sd.title')}</legend>
      {inputs.map((info) => {
        const { key, unit } = info;
        const text = person.sd_text[key] ?? '';
        return (
          <label key={key}>
            <Symbol_ of={key} />
            <input
              id={sd_id(key)}
              name={sd_id(key)}
              type="text"
              inputMode="decimal"
              autoComplete="off"
              placeholder={typical(info)}
              value={text}
              aria-invalid={found.has(key)}
              aria-describedby="sd-note"
              onInput={(e) => set(key, e.currentTarget.value)}
            />
            <span class="unit">{unit}</span>
          </label>
        );
      })}
      <Note found={found} />
    </fieldset>
  );
}
