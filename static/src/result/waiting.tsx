// SPDX-License-Identifier: GPL-3.0-or-later
//
// A side that has no result, yet or ever: where it stands, why it ended.
import { cancel } from '../api.js';
import { t } from '../i18n.js';
import type { Followed } from '../follow.js';
import type { Assessment } from '../types.js';
import { Shape } from '../ui.js';

function progress_text(state: Followed): string {
  const { document, progress } = state;
  if (document?.status === 'queued' && !progress) return t('result.queued');
  const { load_step, newton_iteration } = progress ?? {};
  if (load_step === undefined || newton_iteration === undefined) return t('result.running');
  const step = t('result.step', { step: load_step, iteration: newton_iteration });
  return `${t('result.running')}: ${step}`;
}

export function Running(props: { state: Followed; name: string; on_cancelled: () => void }) {
  const { state, name } = props;
  const { document } = state;
  if (!document) return <p class="loading">{t('result.loading')}</p>;
  const fraction = state.progress?.fraction ?? document.progress;
  /* When the daemon cannot be reached the follower already says so. */
  const stop = (): void => void cancel(document.id).then(props.on_cancelled, props.on_cancelled);
  return (
    <div class="running">
      <p>{progress_text(state)}</p>
      <progress max={1} value={fraction} aria-label={t('result.progress', { side: name })} />
      <button type="button" onClick={stop}>
        {t('result.cancel')}
      </button>
    </div>
  );
}

export function NoResult(props: { of: Assessment }) {
  const { status, problem } = props.of;
  const cancelled = status === 'cancelled';
  return (
    <div class="glance no-result">
      <p class="verdict">
        <Shape of="none" />
        <strong>{t(cancelled ? 'result.cancelled' : 'result.failed')}</strong>
      </p>
      <p>{t(cancelled ? 'result.cancelled.text' : 'result.failed.text')}</p>
      {!cancelled && problem?.title && (
        <p>
          <strong>{problem.title}</strong>
        </p>
      )}
      {!cancelled && problem?.detail && <p>{problem.detail}</p>}
    </div>
  );
}
