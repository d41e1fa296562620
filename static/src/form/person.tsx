// SPDX-License-Identifier: GPL-3.0-or-later
//
// Who was measured and when, under a pseudonym; and a sample person to try the form with.
import { useState } from 'preact/hooks';
import { t } from '../i18n.js';
import { Shape } from '../ui.js';
import { subject_is_valid, type Person } from './model.js';
import { sample_persons, type SamplePerson } from './sample.js';

function Sample(props: { on_sample: (sample: SamplePerson) => void }) {
  const [chosen, choose] = useState(0);
  const fill = (): void => {
    const sample = sample_persons[chosen];
    if (sample) props.on_sample(sample);
  };
  if (sample_persons.length === 0) return null;
  return (
    <div class="sample">
      <label for="sample">{t('form.sample')}</label>
      <select id="sample" value={chosen} onChange={(e) => choose(Number(e.currentTarget.value))}>
        {sample_persons.map((p, i) => (
          <option key={p.subject} value={i}>
            {t('form.sample.option', { n: p.number })}
          </option>
        ))}
      </select>
      <button type="button" onClick={fill}>
        {t('form.sample.fill')}
      </button>
    </div>
  );
}

function date_of(input: HTMLInputElement): Pick<Person, 'measured_at' | 'broken_date'> {
  return { measured_at: input.value, broken_date: input.validity.badInput };
}

export function PersonFields(props: {
  person: Person;
  on_change: (person: Person) => void;
  on_sample: (sample: SamplePerson) => void;
}) {
  const { person, on_change } = props;
  const bad_subject = !subject_is_valid(person.subject);
  return (
    <fieldset class="person">
      <legend class="visually-hidden">{t('form.person')}</legend>
      <div class="item">
        <label for="subject">{t('form.subject')}</label>
        <input
          id="subject"
          name="subject"
          type="text"
          maxLength={64}
          autoComplete="off"
          spellcheck={false}
          value={person.subject}
          aria-invalid={bad_subject}
          aria-describedby="subject-note"
          onInput={(e) => on_change({ ...person, subject: e.currentTarget.value.trim() })}
        />
        <span id="subject-note" class={bad_subject ? 'reading fault' : 'hint'}>
          {bad_subject && <Shape of="none" />}
          {t(bad_subject ? 'form.subject.fault' : 'form.subject.hint')}
        </span>
      </div>
      <div class="item">
        <label for="measured_at">{t('form.measured_at')}</label>
        <input
          id="measured_at"
          name="measured_at"
          type="date"
          value={person.measured_at}
          aria-invalid={person.broken_date}
          aria-describedby="measured_at-note"
          onInput={(e) => on_change({ ...person, ...date_of(e.currentTarget) })}
          onBlur={(e) => on_change({ ...person, ...date_of(e.currentTarget) })}
        />
        <span id="measured_at-note" class="reading fault">
          {person.broken_date && (
            <>
              <Shape of="none" />
              {t('form.measured_at.fault')}
            </>
          )}
        </span>
      </div>
      <Sample on_sample={props.on_sample} />
    </fieldset>
  );
}
