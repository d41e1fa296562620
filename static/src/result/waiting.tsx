// SPDX-License-Identifier: GPL-3.0-or-later
//
// A side that has no result, yet or ever: where it stands, why it ended.
import { useLayoutEffect, useRef, useState } from 'preact/hooks';
import { access_key, ApiError, cancel } from '../api.js';
import { format, t, type Key } from '../i18n.js';
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
  const button = useRef<HTMLButtonElement>(null);
  /* The button goes with the computation: who stands on it goes on at the heading of its card. */
  useLayoutEffect(
    () => () => {
      const gone = button.current;
      if (gone?.matches(':focus')) gone.closest('section')?.querySelector('h2')?.focus();
    },
    [],
  );
  const [refused, set_refused] = useState<Key | null>(null);
  if (!document) return <p class="loading">{t('result.loading')}</p>;
  const fraction = state.progress?.fraction ?? document.progress;
  /* When the daemon cannot be reached, or it is over already, the follower says so. */
  const stop = (): void => {
    set_refused(null);
    cancel(document.id)
      .catch((e: unknown) => set_refused((e instanceof ApiError && access_key(e)) || null))
      .then(props.on_cancelled);
  };
  return (
    <div class="running">
      <p>{progress_text(state)}</p>
      <progress max={1} value={fraction} aria-label={t('result.progress', { side: name })} />
      <button type="button" ref={button} onClick={stop}>
        {t('result.cancel')}
      </button>
      {refused && (
        <p class="errors" role="alert">
          {t(refused)}
        </p>
      )}
    </div>
  );
}

/* Why a load path ended, in the reader's language; '' for other reasons, which the daemon words. */
function end_of_path(of: Assessment): string {
  const { reason, last_converged_fraction: fraction } = of.problem ?? {};
  const F = of.parameters['F'];
  if (reason === 'diverged_checks') return t('result.failed.checks');
  if (!reason || fraction === undefined || F === undefined) return '';
  return t('result.failed.path', { at: format(fraction * F, 3), F });
}

export function NoResult(props: { of: Assessment }) {
  const { status, problem } = props.of;
  const cancelled = status === 'cancelled';
  const reason = end_of_path(props.of);
  return (
    <div class="glance no-result">
      <p class="verdict">
        <Shape of="none" />
        <strong>{t(cancelled ? 'result.cancelled' : 'result.failed')}</strong>
      </p>
      <p>{t(cancelled ? 'result.cancelled.text' : 'result.failed.text')}</p>
      {!cancelled && reason && (
        <p>
          <strong>{reason}</strong>
        </p>
      )}
      {!cancelled && problem && (
        <p class="hint" lang="en">
          {[problem.title, problem.detail].filter(Boolean).join(': ')}
        </p>
      )}
    </div>
  );
}
