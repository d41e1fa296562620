// SPDX-License-Identifier: GPL-3.0-or-later
//
// Past assessments: filtered, newest first, two of them selectable for comparison. The filter
// stands in the address, so a list can be kept as a bookmark.
import { useEffect, useState } from 'preact/hooks';
import { access_key, ApiError, list, list_as_csv, type Filter, type Page } from '../api.js';
import { format, format_fixed, format_time, t } from '../i18n.js';
import { list_address, navigate, result_address } from '../router.js';
import type { Assessment } from '../types.js';
import { Link, Outcome, save_file, side_name } from '../ui.js';

const page_size = 50;
const inputs = ['R1', 'R2', 'eM', 'eF', 'muM', 'muF', 'F'];
const statuses = ['queued', 'running', 'succeeded', 'failed', 'cancelled'] as const;

function filter_of(query: URLSearchParams): Filter {
  const value = (key: string): string => query.get(key) ?? '';
  return { subject: value('subject'), side: value('side'), status: value('status') };
}

function fault_text(e: unknown): string {
  if (!(e instanceof ApiError)) throw e;
  const key = e.status === 0 ? 'form.error.unreachable' : access_key(e);
  return key ? t(key) : t('list.error', { detail: e.message });
}

type UsedPage = [Page | null, string | null, (e: unknown) => void];

function use_page(query: URLSearchParams): UsedPage {
  const [page, set_page] = useState<Page | null>(null);
  const [fault, set_fault] = useState<string | null>(null);
  useEffect(() => {
    let overtaken = false;
    set_page(null);
    set_fault(null);
    list({ ...filter_of(query), cursor: query.get('cursor') ?? '', limit: page_size }).then(
      (answer) => !overtaken && set_page(answer),
      (e: unknown) => !overtaken && set_fault(fault_text(e)),
    );
    return () => {
      overtaken = true;
    };
  }, [
    query,
  ]); /* a new one with every move, also to the same address: then the list is read again */
  return [page, fault, (e) => set_fault(fault_text(e))];
}

function address(query: URLSearchParams): string {
  const kept = [...query].filter(([, value]) => value !== '');
  return kept.length ? `${list_address}?${new URLSearchParams(kept)}` : list_address;
}

/* One choice of a select; `chosen` is what the address says. */
function Choice(props: { value: string; chosen: string | null; children: string }) {
  return (
    <option value={props.value} selected={props.value === (props.chosen ?? '')}>
      {props.children}
    </option>
  );
}

function FilterForm(props: { query: URLSearchParams }) {
  const { query } = props;
  const [side, status] = [query.get('side'), query.get('status')];
  const apply = (e: SubmitEvent): void => {
    e.preventDefault();
    const entries = [...new FormData(e.currentTarget as HTMLFormElement)];
    navigate(address(new URLSearchParams(entries.map(([k, v]) => [k, String(v).trim()]))));
  };
  return (
    <form class="filter" onSubmit={apply} key={query.toString()} aria-label={t('list.filter')}>
      <div class="item">
        <label for="f-subject">{t('list.subject')}</label>
        <input
          id="f-subject"
          name="subject"
          type="text"
          autoComplete="off"
          defaultValue={query.get('subject') ?? ''}
        />
      </div>
      <div class="item">
        <label for="f-side">{t('list.side')}</label>
        <select id="f-side" name="side">
          <Choice value="" chosen={side}>
            {t('list.any')}
          </Choice>
          <Choice value="left" chosen={side}>
            {t('side.left')}
          </Choice>
          <Choice value="right" chosen={side}>
            {t('side.right')}
          </Choice>
        </select>
      </div>
      <div class="item">
        <label for="f-status">{t('list.status')}</label>
        <select id="f-status" name="status">
          <Choice value="" chosen={status}>
            {t('list.any')}
          </Choice>
          {statuses.map((s) => (
            <Choice key={s} value={s} chosen={status}>
              {t(`status.${s}`)}
            </Choice>
          ))}
        </select>
      </div>
      <button type="submit">{t('list.apply')}</button>
    </form>
  );
}

function Row(props: { of: Assessment; selected: boolean; full: boolean; on_select: () => void }) {
  const { of, selected, full } = props;
  const time = format_time(of.measured_at ?? of.created_at);
  const name = t('list.select', { subject: of.subject ?? of.id, side: side_name(of.side), time });
  const result = of.status === 'succeeded' ? of.result : null;
  return (
    <tr class={selected ? 'ours' : ''}>
      <td class="text">
        <input
          type="checkbox"
          checked={selected}
          disabled={full && !selected}
          aria-label={name}
          onChange={props.on_select}
        />
      </td>
      <th scope="row" class="text">
        <Link to={result_address([of.id])}>{time}</Link>
      </th>
      <td class="text">{of.subject ?? '–'}</td>
      <td class="text">{side_name(of.side)}</td>
      <td class="text">
        <Outcome of={of} />
      </td>
      <td>{result ? format_fixed(result.strain.eps_max, 3) : '–'}</td>
      <td>{result ? format_fixed(result.clusters.both.volume_mm3, 0) : '–'}</td>
      <td class="text inputs">
        {inputs.map((key) => `${key} ${format(of.parameters[key] ?? NaN)}`).join(', ')}
      </td>
    </tr>
  );
}

function Rows(props: { items: Assessment[]; selected: string[]; on_select: (id: string) => void }) {
  const { items, selected } = props;
  return (
    <div class="scroll" tabIndex={0} role="group" aria-label={t('list.title')}>
      <table class="numbers list">
        <thead>
          <tr>
            <th scope="col" class="text">
              {t('list.col.select')}
            </th>
            <th scope="col" class="text">
              {t('list.col.time')}
            </th>
            <th scope="col" class="text">
              {t('list.col.subject')}
            </th>
            <th scope="col" class="text">
              {t('list.col.side')}
            </th>
            <th scope="col" class="text">
              {t('list.col.outcome')}
            </th>
            <th scope="col">{t('list.col.eps')}</th>
            <th scope="col">{t('list.col.both')}</th>
            <th scope="col" class="text">
              {t('list.col.inputs')}
            </th>
          </tr>
        </thead>
        <tbody>
          {items.map((d) => (
            <Row
              key={d.id}
              of={d}
              selected={selected.includes(d.id)}
              full={selected.length === 2}
              on_select={() => props.on_select(d.id)}
            />
          ))}
        </tbody>
      </table>
    </div>
  );
}

function Pager(props: { query: URLSearchParams; page: Page }) {
  const { query, page } = props;
  const older = new URLSearchParams(query);
  older.set('cursor', page.next_cursor ?? '');
  const newest = new URLSearchParams(query);
  newest.delete('cursor');
  return (
    <p class="pager">
      {query.get('cursor') && <Link to={address(newest)}>{t('list.newest')}</Link>}
      {page.next_cursor && <Link to={address(older)}>{t('list.older')}</Link>}
    </p>
  );
}

export function ListPage(props: { query: URLSearchParams }) {
  const [page, fault, fail] = use_page(props.query);
  const [selected, set_selected] = useState<string[]>([]);
  useEffect(() => set_selected([]), [props.query.toString()]); /* rows that are not shown */
  const toggle = (id: string): void =>
    set_selected((now) =>
      now.includes(id) ? now.filter((s) => s !== id) : [...now, id].slice(0, 2),
    );
  const save_csv = (): void => {
    list_as_csv(filter_of(props.query)).then((blob) => save_file(blob, 'assessments.csv'), fail);
  };
  const compare = (): void => {
    if (selected.length === 2) navigate(result_address(selected));
  };
  return (
    <div class="past">
      <h1 tabIndex={-1}>{t('list.title')}</h1>
      <div class="list-bar">
        <FilterForm query={props.query} />
        <button type="button" onClick={save_csv}>
          {t('list.csv')}
        </button>
        <div class="compare">
          <button
            type="button"
            class="primary"
            aria-disabled={selected.length !== 2}
            onClick={compare}
          >
            {t('list.compare')}
          </button>
          <span class="hint">{selected.length === 2 ? '' : t('list.compare.hint')}</span>
        </div>
      </div>
      {fault && (
        <p class="errors" role="alert">
          {fault}
        </p>
      )}
      {!page && !fault && <p class="loading">{t('list.loading')}</p>}
      {page?.items.length === 0 && <p class="hint">{t('list.empty')}</p>}
      {page && page.items.length > 0 && (
        <Rows items={page.items} selected={selected} on_select={toggle} />
      )}
      {page && <Pager query={props.query} page={page} />}
    </div>
  );
}
