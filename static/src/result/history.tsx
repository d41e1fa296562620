// SPDX-License-Identifier: GPL-3.0-or-later
//
// Other assessments of the same subject, over time: a small chart and the same in a table.
import { useEffect, useState } from 'preact/hooks';
import { list } from '../api.js';
import { has_ended } from '../follow.js';
import { format, format_fixed, format_time, t } from '../i18n.js';
import { computed_alike } from '../reference.js';
import { result_address } from '../router.js';
import type { Assessment, Side } from '../types.js';
import { Link, Outcome, side_letter, side_name } from '../ui.js';
import { axis_of } from './axis.js';
import { finished, type Finished } from './quantities.js';
import { unusual_text } from './settings.js';

const size = { width: 460, height: 120, left: 36, right: 20, top: 12, foot: 22 };
const inset = 22;
const day_ms = 24 * 3600 * 1000; /* two sides of one visit make no history */
const time_of = (d: Assessment): string => d.measured_at ?? d.created_at;

/* As measured: an old visit may have been entered late. */
const newest_first = (items: Assessment[]): Assessment[] =>
  [...items].sort((a, b) => Date.parse(time_of(b)) - Date.parse(time_of(a)));

/* Read again whenever one more of the assessments shown has ended. */
function use_history(subject: string | null, ended: number): Assessment[] | null {
  const [items, set] = useState<Assessment[] | null>(null);
  useEffect(() => {
    if (!subject) return set(null);
    let wanted = true;
    list({ subject, limit: 100 }).then(
      (page) => wanted && set(newest_first(page.items)),
      () => wanted && set([]) /* the history is an extra: the result stands without it */,
    );
    return () => {
      wanted = false;
    };
  }, [subject, ended]);
  return items;
}

/* Left and right of one visit stand beside each other, so that neither hides the other. */
const aside = (d: Finished): number => (d.side === 'left' ? -7 : d.side === 'right' ? 7 : 0);

function Mark(props: { x: number; y: number; of: Finished; current: boolean }) {
  const { x, y, of, current } = props;
  const right = of.side === 'right';
  const shape = right
    ? `M${x - 5} ${y - 5}h10v10h-10z`
    : `M${x - 5} ${y}a5 5 0 1 0 10 0a5 5 0 1 0 -10 0z`;
  return (
    <g class={`mark ${of.side ?? ''} ${current ? 'current' : ''}`}>
      <path d={shape} />
      <text x={x + (right ? 8 : -8)} y={y + 4} text-anchor={right ? 'start' : 'end'}>
        {side_letter(of.side)}
      </text>
    </g>
  );
}

function Chart(props: { items: Finished[]; current: string[] }) {
  const { items, current } = props;
  const times = items.map((d) => Date.parse(time_of(d)));
  const [first, last] = [Math.min(...times), Math.max(...times)];
  if (items.length < 2 || last - first < day_ms) return null;
  const { from, to, marks } = axis_of(
    items.map((d) => d.result.strain.eps_max),
    3,
  );
  const bottom = size.height - size.foot;
  const room = size.width - size.left - size.right - 2 * inset;
  const x = (time: number): number => size.left + inset + ((time - first) / (last - first)) * room;
  const y = (v: number): number => bottom - ((v - from) / (to - from)) * (bottom - size.top);
  const points = items.map((of) => ({
    of,
    x: x(Date.parse(time_of(of))) + aside(of),
    y: y(of.result.strain.eps_max),
  }));
  const line_of = (side: Side): string =>
    points
      .filter((p) => p.of.side === side)
      .sort((a, b) => a.x - b.x)
      .map((p, i) => `${i ? 'L' : 'M'}${p.x} ${p.y}`)
      .join('');
  return (
    <svg
      class="history"
      viewBox={`0 0 ${size.width} ${size.height}`}
      role="img"
      aria-label={t('history.alt')}
    >
      {marks.map((v) => (
        <g key={v}>
          <path class="grid" d={`M${size.left} ${y(v)}H${size.width - size.right}`} />
          <text class="tick" x={size.left - 5} y={y(v) + 4} text-anchor="end">
            {format(v)}
          </text>
        </g>
      ))}
      <path class="line left" d={line_of('left')} />
      <path class="line right" d={line_of('right')} />
      {points.map((p) => (
        <Mark key={p.of.id} {...p} current={current.includes(p.of.id)} />
      ))}
      <text class="tick" x={size.left} y={size.height - 4}>
        {format_time(new Date(first).toISOString().slice(0, 10))}
      </text>
      <text class="tick" x={size.width - size.right} y={size.height - 4} text-anchor="end">
        {format_time(new Date(last).toISOString().slice(0, 10))}
      </text>
    </svg>
  );
}

function Row(props: { of: Assessment; current: boolean }) {
  const { of, current } = props;
  return (
    <tr class={current ? 'ours' : ''}>
      <th scope="row">
        {current ? (
          `${format_time(time_of(of))} (${t('history.this')})`
        ) : (
          <Link to={result_address([of.id])}>{format_time(time_of(of))}</Link>
        )}
      </th>
      <td class="text">
        {side_name(of.side)}
        {unusual_text(of).map((text) => (
          <span key={text} class="hint otherwise">
            {text}
          </span>
        ))}
      </td>
      <td class="text">
        <Outcome of={of} />
      </td>
      <td>{of.result?.strain ? format_fixed(of.result.strain.eps_max, 3) : '–'}</td>
    </tr>
  );
}

export function History(props: { documents: Assessment[] }) {
  const [first, second] = props.documents;
  const subject =
    first?.subject && (!second || second.subject === first.subject) ? first.subject : null;
  const items = use_history(subject, props.documents.filter(has_ended).length);
  if (!subject || !items) return null;
  const current = props.documents.map((d) => d.id);
  const others = items.filter((d) => !current.includes(d.id));
  const ended = finished(items);
  const [shown] = finished(props.documents);
  const drawn = ended.filter((d) => !shown || computed_alike(d, shown));
  return (
    <section class="panel-box" aria-labelledby="history">
      <h2 id="history">{t('history.title', { subject })}</h2>
      {others.length === 0 ? (
        <p class="hint">{t('history.none')}</p>
      ) : (
        <div class="beside-chart">
          <div>
            <Chart items={drawn} current={current} />
            {drawn.length < ended.length && (
              <p class="hint">{t('history.other', { n: ended.length - drawn.length })}</p>
            )}
          </div>
          <div class="scroll" tabIndex={0} role="group" aria-labelledby="history">
            <table class="numbers small">
              <thead>
                <tr>
                  <th scope="col">{t('history.when')}</th>
                  <th scope="col" class="text">
                    {t('list.side')}
                  </th>
                  <th scope="col" class="text">
                    {t('list.col.outcome')}
                  </th>
                  <th scope="col">{t('list.col.eps')}</th>
                </tr>
              </thead>
              <tbody>
                {items.map((d) => (
                  <Row key={d.id} of={d} current={current.includes(d.id)} />
                ))}
              </tbody>
            </table>
          </div>
        </div>
      )}
    </section>
  );
}
