// SPDX-License-Identifier: GPL-3.0-or-later
//
// Follows one assessment until it ends. The event stream gives the progress; the document is the
// truth. When the stream breaks — the daemon restarts, the network drops — the document is asked
// for again, ever more patiently, until somebody answers; then the stream is opened anew.
import { ApiError, events_path, get_assessment } from './api.js';
import type { Assessment, ProgressEvent } from './types.js';

export interface Followed {
  document: Assessment | null;
  progress: ProgressEvent | null;
  lost: boolean; /* the daemon does not answer at the moment; being tried again */
  error: ApiError | null; /* it answered, and there is no such document for us */
}

const first_retry_ms = 500;
const last_retry_ms = 5000;

export const has_ended = (document: Assessment): boolean =>
  document.status !== 'queued' && document.status !== 'running';

/* Refused for good: asking again cannot help. 5xx, 429 and no answer may pass. */
const is_final = (e: ApiError): boolean => e.status >= 400 && e.status < 500 && e.status !== 429;

export class Follower {
  private readonly id: string;
  private readonly tell: (state: Followed) => void;
  private state: Followed = { document: null, progress: null, lost: false, error: null };
  private stream: EventSource | null = null;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private retry_ms = first_retry_ms;
  private stopped = false;

  constructor(id: string, tell: (state: Followed) => void) {
    this.id = id;
    this.tell = tell;
    void this.load();
  }

  stop(): void {
    this.stopped = true;
    this.stream?.close();
    clearTimeout(this.timer);
  }

  /* Ask now: after a cancel, for instance. */
  refresh(): void {
    clearTimeout(this.timer);
    void this.load();
  }

  private update(change: Partial<Followed>): void {
    if (this.stopped) return;
    this.state = { ...this.state, ...change };
    this.tell(this.state);
  }

  private async load(): Promise<void> {
    try {
      const document = await get_assessment(this.id);
      this.retry_ms = first_retry_ms;
      this.update({ document, lost: false, error: null });
      if (has_ended(document)) this.close_stream();
      else this.open_stream();
    } catch (e) {
      if (!(e instanceof ApiError)) throw e;
      if (is_final(e)) this.update({ error: e, lost: false });
      else this.retry();
    }
  }

  private retry(): void {
    if (this.stopped) return;
    this.close_stream();
    this.update({ lost: true });
    clearTimeout(this.timer);
    this.timer = setTimeout(() => void this.load(), this.retry_ms);
    this.retry_ms = Math.min(this.retry_ms * 2, last_retry_ms);
  }

  private close_stream(): void {
    this.stream?.close();
    this.stream = null;
  }

  private open_stream(): void {
    if (this.stopped || this.stream) return;
    const stream = new EventSource(events_path(this.id));
    stream.addEventListener('progress', (e) => {
      this.update({ progress: JSON.parse((e as MessageEvent<string>).data) as ProgressEvent });
    });
    stream.addEventListener('done', () => {
      this.close_stream();
      void this.load();
    });
    stream.addEventListener('error', () => this.retry());
    this.stream = stream;
  }
}
