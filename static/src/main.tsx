// SPDX-License-Identifier: GPL-3.0-or-later
//
// The page: header, the part that the address names, footer.
import { render } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import { FormPage } from './form/form_page.js';
import { language, language_names, set_language, t, type Key, type Language } from './i18n.js';
import { ListPage } from './list/list_page.js';
import { ResultPage } from './result/result_page.js';
import { form_address, list_address, on_navigation, route_of, type Route } from './router.js';
import { Link } from './ui.js';

const titles: Record<Route['page'], Key> = {
  form: 'form.title',
  list: 'list.title',
  result: 'result.title',
};

function Content(props: { route: Route }) {
  const { route } = props;
  if (route.page === 'list') return <ListPage query={route.query} />;
  if (route.page === 'result') return <ResultPage key={route.ids.join()} ids={route.ids} />;
  return <FormPage key={route.from.join()} from={route.from} />;
}

function Header(props: { route: Route; on_language: (l: Language) => void }) {
  const { page } = props.route;
  return (
    <header class="top">
      <a class="skip" href="#content">
        {t('app.skip')}
      </a>
      <p class="brand">
        <strong>{t('app.title')}</strong>
        <span>{t('app.tagline')}</span>
      </p>
      <nav aria-label={t('nav.main')}>
        <Link to={form_address()} current={page === 'form'}>
          {t('nav.new')}
        </Link>
        <Link to={list_address} current={page === 'list'}>
          {t('nav.past')}
        </Link>
      </nav>
      <label class="language">
        <span class="visually-hidden">{t('app.language')}</span>
        <select
          value={language()}
          onChange={(e) => props.on_language(e.currentTarget.value as Language)}
        >
          {Object.entries(language_names).map(([code, name]) => (
            <option key={code} value={code} lang={code}>
              {name}
            </option>
          ))}
        </select>
      </label>
    </header>
  );
}

/* After a move to another address the reader starts at its heading, as after a page load. */
function use_route(): Route {
  const [route, set] = useState<Route>(() => route_of(window.location));
  const moved = useRef(false);
  useEffect(
    () =>
      on_navigation(() => {
        moved.current = true;
        set(route_of(window.location));
      }),
    [],
  );
  useEffect(() => {
    if (!moved.current) return;
    window.scrollTo(0, 0);
    document.querySelector<HTMLElement>('main h1')?.focus();
  }, [route]);
  return route;
}

function App() {
  const route = use_route();
  const [, set_shown_language] = useState<Language>(language());
  const change_language = (next: Language): void => {
    set_language(next);
    set_shown_language(next);
  };
  document.title = `${t(titles[route.page])} · ${t('app.title')}`;
  return (
    <>
      <Header route={route} on_language={change_language} />
      <main id="content" tabIndex={-1}>
        <Content route={route} />
      </main>
      <footer class="bottom">
        <strong>{t('app.not_device')}</strong>
        <a href="/version">{t('app.versions')}</a>
        <a href="/docs">{t('app.api_docs')}</a>
      </footer>
    </>
  );
}

const root = document.getElementById('app');
if (root) {
  document.documentElement.lang = language();
  root.replaceChildren();
  render(<App />, root);
}
