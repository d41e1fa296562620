// SPDX-License-Identifier: GPL-3.0-or-later
//
// The one place that talks to the daemon. Every address is a path: nothing but the daemon that
// served the page is ever asked.
import { language, type Key } from './i18n.js';
import type { Assessment, Estimate, ParameterInfo, Problem, WhatIf } from './types.js';

/* What went wrong with a request: the daemon's own problem document, or status 0 when it could
 * not be reached at all. */
export class ApiError extends Error {
  readonly status: number;
  readonly problem: Problem;

  constructor(status: number, problem: Problem) {
    super(problem.detail ?? problem.title ?? `HTTP ${status}`);
    this.status = status;
    this.problem = problem;
  }
}

const no_access: Partial<Record<number, Key>> = {
  401: 'app.sign_in',
  403: 'app.no_access',
};

/* For those who are not let in: the daemon's own words are for programs, and speak of tokens. */
export const access_key = (e: ApiError): Key | undefined => no_access[e.status];

async function problem_of(response: Response): Promise<Problem> {
  try {
    return (await response.json()) as Problem;
  } catch {
    return { status: response.status, title: response.statusText };
  }
}

async function ask(path: string, accept: string, init: RequestInit = {}): Promise<Response> {
  let response: Response;
  try {
    const headers = {
      Accept: accept,
      'Accept-Language': language() /* of a refusal, which is shown as it is */,
      ...(init.headers as Record<string, string>),
    };
    response = await fetch(path, { ...init, headers });
  } catch {
    throw new ApiError(0, {});
  }
  if (!response.ok) throw new ApiError(response.status, await problem_of(response));
  return response;
}

async function request<T>(path: string, init?: RequestInit): Promise<T> {
  return (await (await ask(path, 'application/json', init)).json()) as T;
}

const assessment_path = (id: string): string => `/v1/assessments/${encodeURIComponent(id)}`;

export const events_path = (id: string): string => `${assessment_path(id)}/events`;
export const field_path = (id: string): string => `${assessment_path(id)}/field.vtu`;
export const section_path = (id: string): string =>
  `${assessment_path(id)}/section.svg?lang=${language()}`;
export const report_path = (id: string): string =>
  `${assessment_path(id)}/report?lang=${language()}`;
export const document_path = assessment_path;

/* A number of the skin or of the model, which the form leaves at its default. */
export interface ModelOption {
  group: 'skin' | 'model';
  key: string;
  default: number;
}

interface ParametersDocument {
  parameters: ParameterInfo[];
  options?: ModelOption[];
  resolutions?: { name: string }[];
}

export interface Parameters {
  inputs: ParameterInfo[];
  skin_thickness_mm: number; /* the default one */
  resolutions: string[];
  options: ModelOption[];
}

export async function get_parameters(): Promise<Parameters> {
  const document = await request<ParametersDocument>('/v1/parameters');
  const skin = document.options?.find((o) => o.group === 'skin' && o.key === 'thickness');
  return {
    inputs: document.parameters,
    skin_thickness_mm: skin?.default ?? 0,
    resolutions: document.resolutions?.map((r) => r.name) ?? [],
    options: document.options ?? [],
  };
}

/* The program that answers; emulator: null when it gives no estimates. */
export interface Version {
  version: string;
  emulator?: { rows: number; trial: boolean } | null;
}

export const get_version = (): Promise<Version> => request('/version');

/* 128 random bits; crypto.randomUUID() does not exist on plain http, which clinics do use. */
export function new_idempotency_key(): string {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return Array.from(bytes, (b) => b.toString(16).padStart(2, '0')).join('');
}

export interface Submission {
  [key: string]: number | string | Record<string, number>;
}

const json_post = (body: unknown, signal: AbortSignal): RequestInit => ({
  method: 'POST',
  headers: { 'Content-Type': 'application/json' },
  body: JSON.stringify(body),
  signal,
});

/* By the emulator, at once; nothing is stored. */
export const estimate = (
  parameters: Record<string, number>,
  signal: AbortSignal,
): Promise<Estimate> => request('/v1/estimates', json_post(parameters, signal));

/* The same along the range of one input. body: parameters, with the options of an assessment. */
export const what_if = (body: unknown, input: string, signal: AbortSignal): Promise<WhatIf> =>
  request(`/v1/estimates/what-if?parameter=${encodeURIComponent(input)}`, json_post(body, signal));

export function submit(body: Submission, idempotency_key: string): Promise<Assessment> {
  return request('/v1/assessments', {
    method: 'POST',
    headers: { 'Content-Type': 'application/json', 'Idempotency-Key': idempotency_key },
    body: JSON.stringify(body),
  });
}

export const get_assessment = (id: string): Promise<Assessment> => request(assessment_path(id));

export function cancel(id: string): Promise<unknown> {
  return request(`${assessment_path(id)}/cancel`, { method: 'POST' });
}

export interface Page {
  items: Assessment[];
  next_cursor: string | null;
}

/* The daemon's largest. */
const csv_page_size = 500;

export interface Filter {
  subject?: string;
  side?: string;
  status?: string;
  cursor?: string;
  limit?: number;
}

function list_path(filter: Filter): string {
  const query = new URLSearchParams();
  for (const [key, value] of Object.entries(filter)) if (value) query.set(key, String(value));
  return `/v1/assessments?${query}`;
}

export async function list(filter: Filter): Promise<Page> {
  const page = await request<{ items: Assessment[]; next_cursor?: string | null }>(
    list_path(filter),
  );
  return { items: page.items, next_cursor: page.next_cursor ?? null };
}

/* The same list, all of it, as a table for a spreadsheet: page by page, its header once. */
export async function list_as_csv(filter: Filter): Promise<Blob> {
  const pages: string[] = [];
  let cursor = '';
  do {
    const response = await ask(list_path({ ...filter, cursor, limit: csv_page_size }), 'text/csv');
    const text = await response.text();
    pages.push(cursor ? text.slice(text.indexOf('\n') + 1) : text);
    cursor = response.headers.get('X-Next-Cursor') ?? '';
  } while (cursor);
  return new Blob(pages, { type: 'text/csv;charset=utf-8' });
}
