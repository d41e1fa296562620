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

/* The answer to the latest question; null while there is none, and after a refusal. A question that
 * is overtaken is given up. `wait_ms`: how long the question must stand before it is asked. */
export function use_answer<T>(
  question: string | null,
  ask: (signal: AbortSignal) => Promise<T>,
  wait_ms: number,
): T | null {
  const [answer, set] = useState<{ to: string; is: T } | null>(null);
  useEffect(() => {
    if (question === null) return undefined;
    const gone = new AbortController();
    const timer = setTimeout(() => {
      ask(gone.signal).then(
        (is) => !gone.signal.aborted && set({ to: question, is }),
        () => !gone.signal.aborted && set(null),
      );
    }, wait_ms);
    return () => {
      clearTimeout(timer);
      gone.abort();
    };
  }, [question]);
  return question === null ? null : (answer?.is ?? null);
}
