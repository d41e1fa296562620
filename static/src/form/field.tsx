// SPDX-License-Identifier: GPL-3.0-or-later
//
// One measured number: label, input, unit, accepted range, help, what was understood, what is wrong.
import type { ComponentChildren } from 'preact';
import { useState } from 'preact/hooks';
import { format, t } from '../i18n.js';
import { Shape } from '../ui.js';
import type { ParameterInfo, Side } from '../types.js';
import { in_words, lang_of, type Finding } from './model.js';

export interface FieldProps {
  side: Side;
  info: ParameterInfo;
  text: string;
  value: number | null;
  finding: Finding | null;
  label?: string;
  echo?: string;
  more_help?: string;
  toggle?: ComponentChildren;
  action?: ComponentChildren;
  on_text: (text: string) => void;
  on_typing: (typing: boolean) => void;
}

export const field_id = (side: Side, key: string): string => `${side}-${key}`;

export function Symbol_(props: { of: string }) {
  const symbols: Record<string, [string, string]> = {
    R1: ['R', '1'],
    R2: ['R', '2'],
    eM: ['e', 'M'],
    eF: ['e', 'F'],
    muM: ['μ', 'M'],
    muF: ['μ', 'F'],
  };
  const [letter, index] = symbols[props.of] ?? [props.of, ''];
  return (
    <span class="symbol">
      {letter}
      {index && <sub>{index}</sub>}
    </span>
  );
}

function Help(props: { info: ParameterInfo; more: string; id: string; side: Side }) {
  const [open, set_open] = useState(false);
  const name = props.info.name;
  return (
    <span class="help" onKeyDown={(e) => e.key === 'Escape' && set_open(false)}>
      <button
        type="button"
        class="help-button"
        aria-expanded={open}
        aria-controls={props.id}
        aria-label={t('form.help', { name, side: t(`side.${props.side}`) })}
        onClick={() => set_open(!open)}
        onBlur={() => set_open(false)}
      >
        ?
      </button>
      <span id={props.id} class="help-text" hidden={!open}>
        {`${props.info.description} ${props.more}`.trim()}
      </span>
    </span>
  );
}

/* The line under the input: a fault, a warning, or what was understood. */
function Reading(props: FieldProps & { id: string }) {
  const { finding, info, value } = props;
  if (finding) {
    return (
      <span id={props.id} class={`reading ${finding.severity}`}>
        <Shape of={finding.severity === 'fault' ? 'none' : 'shear'} />
        <span class="visually-hidden">
          {`${t(finding.severity === 'fault' ? 'fault.word' : 'warning.word')}: `}
        </span>
        <span lang={lang_of(finding.says)}>{in_words(finding.says)}</span>
        {props.action}
      </span>
    );
  }
  const echo =
    props.echo ?? (value === null ? '' : t('form.echo', { value: format(value), unit: info.unit }));
  return (
    <span id={props.id} class="reading echo">
      {echo}
    </span>
  );
}

export function Field(props: FieldProps) {
  const { side, info, finding } = props;
  const id = field_id(side, info.key);
  const { accepted, studied, unit } = info;
  return (
    <div class="field">
      <label for={id}>
        <Symbol_ of={info.key} /> {props.label ?? info.name}
      </label>
      <Help info={info} more={props.more_help ?? ''} id={`${id}-help`} side={side} />
      <span class="entry">
        <input
          id={id}
          name={id}
          type="text"
          inputMode="decimal"
          autoComplete="off"
          spellcheck={false}
          value={props.text}
          aria-invalid={finding?.severity === 'fault'}
          aria-describedby={`${id}-reading ${id}-range`}
          onInput={(e) => props.on_text(e.currentTarget.value)}
          onFocus={() => props.on_typing(true)}
          onBlur={() => props.on_typing(false)}
        />
        <span class="unit">{unit}</span>
      </span>
      <span class="notes">
        <span id={`${id}-range`} class="range">
          {t('form.accepted', { min: accepted.min, max: accepted.max, unit })}
          <span class="studied">
            {` · ${t('form.studied', { min: studied.min, max: studied.max })}`}
          </span>
        </span>
        {props.toggle}
        <Reading {...props} id={`${id}-reading`} />
      </span>
    </div>
  );
}
