// SPDX-License-Identifier: GPL-3.0-or-later
//
// One side of the body: its seven numbers and the drawing of what they mean.
import { useState } from 'preact/hooks';
import { t } from '../i18n.js';
import type { Parameters } from '../api.js';
import type { ParameterInfo, Side } from '../types.js';
import { Drawing } from './drawing.js';
import { Field, field_id } from './field.js';
import { Preview } from './preview.js';
import { finding, value_of, type Finding, type SideEntry } from './model.js';

export interface SideFormProps {
  side: Side;
  entry: SideEntry;
  parameters: Parameters;
  refused: Map<string, Finding>; /* shown until the field is changed */
  on_change: (entry: SideEntry) => void;
  on_copy: () => void;
  preview: boolean; /* there is an emulator to ask */
}

function swapped(entry: SideEntry): SideEntry {
  const { R1 = '', R2 = '' } = entry.text;
  return { ...entry, text: { ...entry.text, R1: R2, R2: R1 } };
}

function total_echo(entry: SideEntry): string {
  const [fat, muscle] = [value_of(entry, 'eF'), value_of(entry, 'eM')];
  if (entry.total.trim() !== '' && fat === null) return t('form.total.needs_eF');
  if (fat === null || muscle === null) return '';
  return t('form.total.echo', { total: entry.total.trim(), eF: fat, eM: muscle });
}

export function SideForm(props: SideFormProps) {
  const { side, entry, parameters, refused } = props;
  const [typing, set_typing] = useState<string | null>(null);
  const name = t(`side.${side}`);

  const set_text = (key: string, text: string): void => {
    if (key === 'eM' && entry.by_total) props.on_change({ ...entry, total: text });
    else props.on_change({ ...entry, text: { ...entry.text, [key]: text } });
  };

  const total_toggle = (
    <label class="total">
      <input
        type="checkbox"
        checked={entry.by_total}
        aria-label={t('form.total.label', { side: name })}
        onChange={(e) => props.on_change({ ...entry, by_total: e.currentTarget.checked })}
      />
      {t('form.total')}
    </label>
  );

  /* The button goes with the fault: who stood on it goes on in its field. */
  const swap = (): void => {
    props.on_change(swapped(entry));
    document.getElementById(field_id(side, 'R2'))?.focus();
  };
  const swap_button = (
    <button type="button" class="inline" onClick={swap}>
      {t('fault.swap')}
    </button>
  );

  const field = (info: ParameterInfo) => {
    const { key } = info;
    const found = refused.get(key) ?? finding(entry, info, typing === key);
    const by_total = key === 'eM' && entry.by_total;
    return (
      <Field
        key={key}
        side={side}
        info={info}
        text={by_total ? entry.total : (entry.text[key] ?? '')}
        value={value_of(entry, key)}
        finding={found}
        {...(by_total ? { label: t('form.total.name'), echo: total_echo(entry) } : {})}
        {...(key === 'eM' ? { more_help: t('form.total.help'), toggle: total_toggle } : {})}
        action={found?.code === 'inconsistent' ? swap_button : undefined}
        on_text={(text) => set_text(key, text)}
        on_typing={(on) => set_typing(on ? key : null)}
      />
    );
  };

  const drawn = Object.fromEntries(
    ['R1', 'R2', 'eM', 'eF'].flatMap((key) => {
      const value = value_of(entry, key);
      return value === null ? [] : [[key, value]];
    }),
  );

  return (
    <fieldset class={`side ${side}`}>
      <legend>{name}</legend>
      <div class="fields">{parameters.inputs.map(field)}</div>
      <div class="beside">
        <Drawing geometry={drawn} skin={parameters.skin_thickness_mm} side={name} />
        <button type="button" class="quiet" onClick={props.on_copy}>
          {t('form.copy')}
        </button>
        {props.preview && <Preview entry={entry} inputs={parameters.inputs} side={name} />}
      </div>
    </fieldset>
  );
}
