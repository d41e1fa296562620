// SPDX-License-Identifier: GPL-3.0-or-later
//
// One assessment, or two beside each other.
import type { ComponentChildren } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import {
  access_key,
  type ApiError,
  document_path,
  field_path,
  get_parameters,
  report_path,
  section_path,
  type Parameters,
} from '../api.js';
import { use_emulator } from '../emulator.js';
import { fits_one_form, is_pair } from '../form/earlier.js';
import { Follower, has_ended, type Followed } from '../follow.js';
import { format_time, language, t } from '../i18n.js';
import { form_address } from '../router.js';
import { Reports } from '../report/report.js';
import type { Assessment } from '../types.js';
import { announce, column_names, Link } from '../ui.js';
import { Caveats } from './caveats.js';
import { Glance } from './glance.js';
import { History } from './history.js';
import { LoadCurve } from './load_curve.js';
import { Numbers } from './numbers.js';
import { Picture } from './picture.js';
import { finished, type Finished } from './quantities.js';
import { unusual_text } from './settings.js';
import { Strips } from './strip.js';
import { UncertaintyCard } from './uncertainty.js';
import { NoResult, Running } from './waiting.js';
import { WhatIfCard } from './what_if.js';

const nothing_yet: Followed = { document: null, progress: null, lost: false, error: null };

/* The state of every assessment, followed until it ends. */
function use_followed(ids: string[]): [Followed[], (index: number) => void] {
  const [states, set] = useState<Followed[]>(ids.map(() => nothing_yet));
  const followers = useRef<Follower[]>([]);
  useEffect(() => {
    set(ids.map(() => nothing_yet));
    followers.current = ids.map(
      (id, i) =>
        new Follower(id, (state) => set((now) => now.map((s, k) => (k === i ? state : s)))),
    );
    return () => followers.current.forEach((f) => f.stop());
  }, [ids.join()]);
  return [states, (index) => followers.current[index]?.refresh()];
}

function use_parameters(): Parameters | null {
  const [parameters, set] = useState<Parameters | null>(null);
  useEffect(() => {
    get_parameters().then(set, () => undefined /* names and limits are then left out */);
  }, [language()]);
  return parameters;
}

/* Says once, to a screen reader, how each side ended. */
function use_announcement(states: Followed[], names: string[]): void {
  const said = useRef(new Set<string>());
  useEffect(() => {
    states.forEach(({ document }, i) => {
      if (!document || !has_ended(document) || said.current.has(document.id)) return;
      said.current.add(document.id);
      const band = document.result?.risk?.band;
      const headline = band ? t(`band.${band}`) : t(`status.${document.status}`);
      announce(t('result.done', { side: names[i] ?? '', headline }));
    });
  }, [states]);
}

function error_text(e: ApiError): string {
  const key = e.status === 404 ? 'result.not_found' : access_key(e);
  return key ? t(key) : e.message;
}

function SideCard(props: {
  state: Followed;
  name: string;
  skin_mm: number;
  alone: boolean; /* it cannot be changed together with the other one */
  on_cancelled: () => void;
}) {
  const { state, name } = props;
  const { document, error, lost } = state;
  const done = document ? finished([document])[0] : undefined;
  const busy = !error && (!document || !has_ended(document));
  return (
    <section class={`card ${document?.side ?? ''}`} aria-label={name}>
      <header>
        <h2 tabIndex={-1}>{name}</h2>
        {document && <Meta of={document} />}
      </header>
      {lost && (
        <p class="lost" role="status">
          {t('result.lost')}
        </p>
      )}
      {error && (
        <p class="errors" role="alert">
          {error_text(error)}
        </p>
      )}
      {busy && <Running state={state} name={name} on_cancelled={props.on_cancelled} />}
      {document && has_ended(document) && !done && <NoResult of={document} />}
      {done && <Glance of={done} skin_mm={props.skin_mm} />}
      {props.alone && document && has_ended(document) && (
        <p class="again">
          <Again ids={[document.id]} of={name} />
        </p>
      )}
    </section>
  );
}

/* What stands behind the answer; an empty place keeps left and right in their columns. */
function FigureCard(props: { of: Assessment | null; name: string }) {
  const { of, name } = props;
  const done = of ? finished([of])[0] : undefined;
  if (!done) return <div />;
  const heading = t('result.pictures', { side: name });
  return (
    <section class={`card ${done.side ?? ''}`} aria-label={heading}>
      <h2>{heading}</h2>
      <div class="figures">
        <Picture of={done} side={name} />
        <LoadCurve of={done} side={name} />
      </div>
    </section>
  );
}

/* A card a side, left and right in their columns. */
function EachSide(props: {
  states: Followed[];
  of: (done: Finished, index: number) => ComponentChildren;
}) {
  return (
    <div class={`cards n${props.states.length}`}>
      {props.states.map(({ document }, i) => {
        const done = document ? finished([document])[0] : undefined;
        return <div key={document?.id ?? i}>{done && props.of(done, i)}</div>;
      })}
    </div>
  );
}

function Meta(props: { of: Assessment }) {
  const { of } = props;
  const parts = [
    of.subject ? t('result.subject', { subject: of.subject }) : '',
    of.label ?? '',
    of.measured_at ? t('result.measured', { time: format_time(of.measured_at) }) : '',
    ...unusual_text(of),
    of.finished_at
      ? t(of.status === 'succeeded' ? 'result.computed' : 'report.ended', {
          time: format_time(of.finished_at),
        })
      : '',
  ];
  return <p class="hint">{parts.filter(Boolean).join(' · ')}</p>;
}

function Files(props: { documents: Assessment[]; names: string[] }) {
  return (
    <details class="files">
      <summary>{t('result.more')}</summary>
      {props.documents.map((d, i) => (
        <p key={d.id}>
          <span>{`${props.names[i]}: `}</span>
          <a href={report_path(d.id)}>{t('result.file.report')}</a>
          <a href={field_path(d.id)} download>
            {t('result.file.field')}
          </a>
          <a href={section_path(d.id)} download>
            {t('result.file.section')}
          </a>
          <a href={document_path(d.id)}>{t('result.file.document')}</a>
        </p>
      ))}
    </details>
  );
}

/* To the form with these numbers; `of`: whose they are, where there are several such links. */
function Again(props: { ids: string[]; of?: string }) {
  return (
    <Link to={form_address(props.ids)} class="button">
      {t('result.again')}
      {props.of && <span class="visually-hidden">{` · ${props.of}`}</span>}
    </Link>
  );
}

function page_title(documents: Assessment[]): string {
  const [a, b] = documents;
  if (!a || !b) return t('result.title');
  return t(is_pair(documents) ? 'result.title.pair' : 'result.title.compare');
}

export function ResultPage(props: { ids: string[] }) {
  const { ids } = props;
  const [states, refresh] = use_followed(ids);
  const parameters = use_parameters();
  const documents = states.flatMap((s) => (s.document ? [s.document] : []));
  const complete = documents.length === ids.length;
  /* Until the documents are here nothing tells two cards apart but their place. */
  const numbered = (i: number): string => (ids.length > 1 ? ` ${i + 1}` : '');
  const names = complete
    ? column_names(documents)
    : ids.map((_, i) => t('result.title') + numbered(i));
  use_announcement(complete ? states : [], names);
  const emulator = use_emulator();
  const done = finished(documents);
  const together = fits_one_form(documents);
  const inputs = parameters?.inputs ?? [];
  return (
    <div class="result">
      <div class="title-row">
        <h1 tabIndex={-1}>{page_title(documents)}</h1>
        {documents.some(has_ended) && (
          <div class="actions">
            {together && <Again ids={documents.map((d) => d.id)} />}
            {done.length > 0 && (
              <>
                <button type="button" class="primary" onClick={() => window.print()}>
                  {t('result.print')}
                </button>
                <Files documents={done} names={column_names(done)} />
              </>
            )}
          </div>
        )}
      </div>
      <div class={`cards n${ids.length}`}>
        {states.map((state, i) => (
          <SideCard
            key={ids[i]}
            state={state}
            name={names[i] ?? ''}
            skin_mm={parameters?.skin_thickness_mm ?? 0}
            alone={complete && !together}
            on_cancelled={() => refresh(i)}
          />
        ))}
      </div>
      {done.length > 0 && <Caveats documents={done} inputs={inputs} />}
      {done.length > 0 && (
        <div class={`cards n${ids.length}`}>
          {states.map((state, i) => (
            <FigureCard key={ids[i]} of={state.document} name={names[i] ?? ''} />
          ))}
        </div>
      )}
      {done.some((d) => d.result.uncertainty) && (
        <EachSide
          states={states}
          of={(d, i) => <UncertaintyCard of={d} inputs={inputs} side={names[i] ?? ''} />}
        />
      )}
      {emulator && done.length > 0 && (
        <EachSide
          states={states}
          of={(d, i) => <WhatIfCard of={d} inputs={inputs} side={names[i] ?? ''} />}
        />
      )}
      <div class="lower">
        {done.length > 0 && <Numbers documents={done} inputs={inputs} />}
        <div>
          <Strips documents={done} />
          {complete && <History documents={documents} />}
        </div>
      </div>
      {parameters && <Reports documents={done} parameters={parameters} />}
    </div>
  );
}
