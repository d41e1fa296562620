// SPDX-License-Identifier: GPL-3.0-or-later
//
// What the emulator says while somebody types: a preview, and it looks like one. The solve that the
// button starts takes its place.
import { estimate } from '../api.js';
import { use_answer } from '../emulator.js';
import { format_fixed, t, type Key } from '../i18n.js';
import type { Estimate, Estimated, ParameterInfo } from '../types.js';
import { whole_side, type SideEntry } from './model.js';

const WAIT_MS = 120;
const bar = { width: 200, height: 8 };

interface Row {
  key: Key;
  decimals: number;
  of: (e: Estimate) => Estimated | null | undefined;
}

const rows: readonly Row[] = [
  { key: 'form.preview.eps', decimals: 2, of: (e) => e.strain?.eps_max },
  { key: 'form.preview.shear', decimals: 0, of: (e) => e.clusters?.shear.volume_mm3 },
  { key: 'form.preview.both', decimals: 0, of: (e) => e.clusters?.both.volume_mm3 },
];

/* From zero to a little above the band; the mark is the value. */
function Bar(props: { of: Estimated }) {
  const { value, low, high } = props.of;
  const x = (v: number): number => 2 + ((bar.width - 4) * v) / (1.15 * high || 1);
  return (
    <svg class="bar" viewBox={`0 0 ${bar.width} ${bar.height}`} aria-hidden="true">
      <path class="line" d={`M2 4H${bar.width - 2}`} />
      <rect class="band" x={x(low)} y="1" width={Math.max(1, x(high) - x(low))} height="6" />
      <path class="mark" d={`M${x(value)} 0V8`} />
    </svg>
  );
}

function Rows(props: { of: Estimate }) {
  return (
    <dl>
      {rows.map(({ key, decimals, of }) => {
        const e = of(props.of);
        if (!e) return null;
        const text = (v: number): string => format_fixed(v, decimals);
        return (
          <div key={key}>
            <dt>{t(key)}</dt>
            <dd>
              <strong>{text(e.value)}</strong> {`(${text(e.low)} – ${text(e.high)})`}
            </dd>
            <Bar of={e} />
          </div>
        );
      })}
    </dl>
  );
}

/* The inputs that lie outside the emulator's training. */
const outside = (e: Estimate): string =>
  e.warnings
    .filter((w) => w.code === 'outside_training')
    .map((w) => w.pointer.slice(1))
    .join(', ');

export function Preview(props: { entry: SideEntry; inputs: ParameterInfo[]; side: string }) {
  const side = whole_side(props.entry, props.inputs);
  const question = side && JSON.stringify(side);
  const answer = use_answer(question, (signal) => estimate(side ?? {}, signal), WAIT_MS);
  const { is: e, stale, failed } = answer;
  return (
    <section class="preview" aria-label={`${t('form.preview.title')} · ${props.side}`}>
      <p class="title">{t('form.preview.title')}</p>
      {!question && <p class="hint">{t('form.preview.waiting')}</p>}
      {failed && <p>{t('form.preview.failed')}</p>}
      {e && (
        <div class={stale ? 'stale' : ''} aria-busy={stale}>
          {e.strain ? <Rows of={e} /> : <p>{t('form.preview.outside', { keys: outside(e) })}</p>}
        </div>
      )}
      {e?.emulator.trial && <p class="trial">{t('uncertain.trial')}</p>}
      {e && e.strain && <p class="hint">{t('form.preview.note')}</p>}
    </section>
  );
}
