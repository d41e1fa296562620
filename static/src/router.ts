// SPDX-License-Identifier: GPL-3.0-or-later
//
// The addresses of this page, read from the location and written back to it.

export type Route =
  | { page: 'form'; from: string[] }
  | { page: 'list'; query: URLSearchParams }
  | { page: 'result'; ids: string[] };

export const form_address = (from: string[] = []): string =>
  from.length ? `/?from=${from.map(encodeURIComponent).join(',')}` : '/';
export const list_address = '/assessments';

/* One assessment, or two beside each other: left and right, or any two to compare. */
export function result_address(ids: string[]): string {
  const [first, second] = ids.map(encodeURIComponent);
  return second ? `/assessments/${first}?with=${second}` : `/assessments/${first}`;
}

export function route_of(location: { pathname: string; search: string }): Route {
  const query = new URLSearchParams(location.search);
  const result = /^\/assessments\/([^/]+)\/?$/.exec(location.pathname);
  if (result?.[1]) {
    const other = query.get('with');
    return { page: 'result', ids: [decodeURIComponent(result[1]), ...(other ? [other] : [])] };
  }
  if (/^\/assessments\/?$/.test(location.pathname)) return { page: 'list', query };
  return { page: 'form', from: query.get('from')?.split(',').filter(Boolean) ?? [] };
}

type Listener = () => void;
const listeners = new Set<Listener>();

export function on_navigation(listener: Listener): () => void {
  listeners.add(listener);
  window.addEventListener('popstate', listener);
  return () => {
    listeners.delete(listener);
    window.removeEventListener('popstate', listener);
  };
}

export function navigate(address: string): void {
  history.pushState(null, '', address);
  for (const listener of listeners) listener();
}
