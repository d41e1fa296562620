// SPDX-License-Identifier: GPL-3.0-or-later
//
// Small parts that every page uses.
import type { ComponentChildren } from 'preact';
import { t } from './i18n.js';
import { navigate } from './router.js';
import type { Assessment, Band, Side, Status } from './types.js';

/* A link inside the page: no reload on a plain click, an ordinary link otherwise. */
export function Link(props: {
  to: string;
  class?: string;
  current?: boolean;
  children: ComponentChildren;
}) {
  const follow = (e: MouseEvent): void => {
    if (e.button !== 0 || e.metaKey || e.ctrlKey || e.shiftKey || e.altKey) return;
    e.preventDefault();
    navigate(props.to);
  };
  return (
    <a
      href={props.to}
      class={props.class}
      onClick={follow}
      aria-current={props.current ? 'page' : undefined}
    >
      {props.children}
    </a>
  );
}

/* Shape and word always stand together: colour only repeats what they say. */
const shapes: Record<Band | 'none' | 'progress', string> = {
  below: 'M12 3a9 9 0 1 1 0 18a9 9 0 1 1 0-18zm0 2.6a6.4 6.4 0 1 0 0 12.8a6.4 6.4 0 1 0 0-12.8z',
  shear: 'M12 2.5L22.5 21H1.5z',
  compression: 'M3.5 3.5h17v17h-17z',
  both: 'M8 2h8l6 6v8l-6 6H8l-6-6V8z',
  none: 'M4 5.8L5.8 4L12 10.2L18.2 4L20 5.8L13.8 12L20 18.2L18.2 20L12 13.8L5.8 20L4 18.2L10.2 12z',
  progress: 'M6 2h12v4l-4.5 6L18 18v4H6v-4l4.5-6L6 6z',
};

export function Shape(props: { of: keyof typeof shapes; class?: string }) {
  return (
    <svg class={`shape ${props.class ?? ''}`} viewBox="0 0 24 24" aria-hidden="true">
      <path d={shapes[props.of]} fill-rule="evenodd" />
    </svg>
  );
}

const unfinished: Record<Exclude<Status, 'succeeded'>, 'none' | 'progress'> = {
  queued: 'progress',
  running: 'progress',
  failed: 'none',
  cancelled: 'none',
};

/* How an assessment ended, or where it stands: shape, then words. */
export function Outcome(props: { of: Assessment; class?: string }) {
  const { status, result } = props.of;
  const band = status === 'succeeded' ? result?.risk.band : undefined;
  const shape = band ?? (status === 'succeeded' ? 'below' : unfinished[status]);
  return (
    <span class={`outcome ${band ?? status} ${props.class ?? ''}`}>
      <Shape of={shape} />
      <span>{band ? t(`band.${band}`) : t(`status.${status}`)}</span>
    </span>
  );
}

export const side_name = (side: Side | null | undefined): string =>
  t(side ? `side.${side}` : 'side.none');

export const side_letter = (side: Side | null | undefined): string =>
  t(side ? `side.${side}.short` : 'side.none.short');

/* What tells the columns of a pair apart: the side when the sides differ, else letters. */
export function column_names(documents: Assessment[]): string[] {
  const [a, b] = documents;
  if (a && b && a.side === b.side) {
    return documents.map((d, i) => `${'AB'[i]} · ${side_name(d.side)}`);
  }
  return documents.map((d) => side_name(d.side));
}

export function column_letters(documents: Assessment[]): string[] {
  const [a, b] = documents;
  if (a && b && a.side === b.side) return ['A', 'B'];
  return documents.map((d) => side_letter(d.side));
}

/* Tells a screen reader, and nobody else, what changed. */
export function announce(text: string): void {
  const region = document.getElementById('announcer');
  if (region) region.textContent = text;
}

/* Hands a file to the reader's browser, as if a download link had been followed. */
export function save_file(blob: Blob, name: string): void {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
