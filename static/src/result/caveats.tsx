// SPDX-License-Identifier: GPL-3.0-or-later
//
// What a result does not say. Always in sight, never folded away.
import { t } from '../i18n.js';
import type { Assessment, FieldError, ParameterInfo } from '../types.js';
import { column_names, Shape } from '../ui.js';

/* Warnings of the daemon in the reader's language; one this page does not know is shown as sent. */
export function warning_text(
  w: FieldError,
  d: Assessment,
  name: string,
  inputs: ParameterInfo[],
): string {
  const key = w.pointer.replace(/^\//, '');
  const info = inputs.find((i) => i.key === key);
  const value = d.parameters[key];
  if (w.code !== 'outside_study_range' || !info || value === undefined) return w.detail;
  const { min, max } = info.studied;
  return t('caveat.studied', { side: name, key, value, unit: info.unit, min, max });
}

export function general_caveats(): string[] {
  return [t('caveat.animal'), t('caveat.high'), t('caveat.measures'), t('caveat.device')];
}

export function Caveats(props: { documents: Assessment[]; inputs: ParameterInfo[] }) {
  const names = column_names(props.documents);
  const warnings = props.documents.flatMap((d, i) =>
    (d.warnings ?? []).map((w) => warning_text(w, d, names[i] ?? '', props.inputs)),
  );
  return (
    <section class="caveats" aria-labelledby="caveats">
      <h2 id="caveats">{t('caveat.title')}</h2>
      <ul>
        {warnings.map((text) => (
          <li key={text} class="warning">
            <Shape of="shear" />
            {text}
          </li>
        ))}
        {general_caveats().map((text) => (
          <li key={text}>{text}</li>
        ))}
      </ul>
    </section>
  );
}
