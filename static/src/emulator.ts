// SPDX-License-Identifier: GPL-3.0-or-later
//
// Asking the emulator, where the daemon has one: at once, and again whenever the question changes.
import { useEffect, useState } from 'preact/hooks';
import { get_version } from './api.js';

/* True once the daemon has said that it gives estimates. */
export function use_emulator(): boolean {
  const [there, set] = useState(false);
  useEffect(() => {
    get_version().then(
      (v) => set(!!v.emulator),
      () => undefined /* then there are none */,
    );
  }, []);
  return there;
}

export interface Answer<T> {
  is: T | null; /* to the latest question or, while that is on its way, to the one before */
  stale: boolean; /* to the one before: not to be taken for an answer */
  failed: boolean; /* the latest question got none */
}

const no_answer = { is: null, stale: false, failed: false };

/* What is known of the latest question; a null one has no answer. A question that is overtaken is
 * given up. `wait_ms`: how long the question must stand before it is asked. */
export function use_answer<T>(
  question: string | null,
  ask: (signal: AbortSignal) => Promise<T>,
  wait_ms: number,
): Answer<T> {
  const [answer, set] = useState<{ to: string; is: T | null } | null>(null);
  useEffect(() => {
    if (question === null) {
      set(null);
      return undefined;
    }
    const gone = new AbortController();
    const timer = setTimeout(() => {
      ask(gone.signal).then(
        (is) => !gone.signal.aborted && set({ to: question, is }),
        () => !gone.signal.aborted && set({ to: question, is: null }),
      );
    }, wait_ms);
    return () => {
      clearTimeout(timer);
      gone.abort();
    };
  }, [question]);
  if (question === null || !answer) return no_answer;
  const { to, is } = answer;
  return { is, stale: to !== question && is !== null, failed: to === question && is === null };
}
