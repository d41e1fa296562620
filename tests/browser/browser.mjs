// SPDX-License-Identifier: GPL-3.0-or-later
//
// What every browser test needs: Debian's Chromium, pages that are watched, axe-core.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { mkdtemp, readFile, rm } from 'node:fs/promises';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { chromium } from 'playwright-core';
import { StandIn } from './stand_in.mjs';

export const dist = fileURLToPath(new URL('../../static/dist', import.meta.url));
const axe_source = readFileSync(
  createRequire(import.meta.url).resolve('axe-core/axe.min.js'),
  'utf8',
);

const flags = [
  '--headless',
  '--no-sandbox',
  '--disable-quic',
  '--no-first-run',
  '--disable-background-networking',
  '--disable-component-update',
  '--disable-sync',
  '--disable-default-apps',
  '--no-default-browser-check',
];
/* WebGL drawn in software, for the 3-D view; or none at all, as on many a workstation. */
const with_webgl = [
  '--use-angle=swiftshader',
  '--enable-unsafe-swiftshader',
  '--ignore-gpu-blocklist',
];
const without_webgl = ['--disable-gpu', '--disable-3d-apis'];

export function launch({ webgl = false } = {}) {
  return chromium.launch({
    executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
    args: [...flags, ...(webgl ? with_webgl : without_webgl)],
  });
}

/* A page whose every request, error and CSP violation is recorded. */
export async function watched_page(browser, origin, options = {}) {
  const context = await browser.newContext({
    viewport: { width: 1366, height: 768 },
    locale: 'en-GB',
    timezoneId: 'UTC',
    ...options,
  });
  const page = await context.newPage();
  const seen = { foreign: [], errors: [], violations: [] };
  page.on('request', (r) => {
    const url = r.url();
    if (!url.startsWith(origin) && !url.startsWith('blob:') && !url.startsWith('data:'))
      seen.foreign.push(url);
  });
  page.on('pageerror', (e) => seen.errors.push(e.message));
  page.on('console', (m) => {
    if (/content security policy/i.test(m.text())) seen.violations.push(m.text());
  });
  page.seen = seen;
  return page;
}

/* Nothing left the origin, nothing was thrown, the policy was never broken. */
export function assert_clean(page) {
  assert.deepEqual(page.seen, { foreign: [], errors: [], violations: [] });
}

/* The form can be used within so many ms of an instant of the page's own visit (requestStart,
 * responseStart): in one of as many visits as a machine needs that does other things too. */
export async function assert_usable_within(page, most_ms, from) {
  const times = [];
  while (times.length < 40 && !(Math.min(...times) < most_ms)) {
    await page.reload();
    await page.locator('fieldset.side').first().waitFor();
    times.push(
      await page.evaluate((start) => {
        const [visit] = performance.getEntriesByType('navigation');
        const [limits] = performance.getEntriesByName(`${location.origin}/v1/parameters`);
        return limits.responseEnd - visit[start];
      }, from),
    );
  }
  assert.ok(Math.min(...times) < most_ms, `${times.map(Math.round)} ms`);
}

/* No WCAG 2.2 AA violation, nor of axe's best practices, on the page as it stands. */
export async function assert_accessible(page, what) {
  await page.evaluate(axe_source);
  const { violations, passes } = await page.evaluate(() =>
    window.axe.run(document, {
      runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa', 'best-practice'],
    }),
  );
  const found = violations.map(
    (v) => `${v.id}: ${v.nodes.map((n) => n.html.slice(0, 160)).join(' | ')}`,
  );
  assert.deepEqual(found, [], what);
  assert.ok(passes.length > 10, `${what}: axe looked at too little`);
}

/* What a page looks like on paper: the number of pages, their size in points, the text of each. */
export async function on_paper(page) {
  const folder = await mkdtemp(join(tmpdir(), 'ischia-print-'));
  try {
    const path = join(folder, 'page.pdf');
    await page.pdf({ path, preferCSSPageSize: true });
    const info = execFileSync('pdfinfo', [path], { encoding: 'utf8' });
    const [, width, height] = /Page size:\s+([\d.]+) x ([\d.]+)/.exec(info);
    const text = execFileSync('pdftotext', ['-layout', path, '-'], { encoding: 'utf8' });
    return {
      pages: Number(/Pages:\s+(\d+)/.exec(info)[1]),
      is_a4: Math.abs(width - 595.3) < 1 && Math.abs(height - 841.9) < 1,
      text: text.split('\f'),
      bytes: (await readFile(path)).length,
    };
  } finally {
    await rm(folder, { recursive: true });
  }
}

/* What sticks out of a report where paper cuts it off; empty when all of it is printed. */
export async function cut_off(page) {
  const paper = { width: 688, height: 1010 }; /* A4 less its margins, in CSS pixels */
  const before = page.viewportSize();
  await page.setViewportSize(paper);
  await page.emulateMedia({ media: 'print' });
  const found = await page.evaluate(() =>
    [...document.querySelectorAll('.report')].flatMap((report) => {
      const edge = report.getBoundingClientRect();
      return [...report.querySelectorAll('td, th, p, li, h1, h2, h3, img, caption')]
        .filter((e) => {
          const box = e.getBoundingClientRect();
          return box.right > edge.right + 1 || box.bottom > edge.bottom + 1;
        })
        .map((e) => e.textContent || e.tagName);
    }),
  );
  await page.emulateMedia({ media: null });
  await page.setViewportSize(before);
  return found;
}

/* A stand-in daemon and a browser for one test file; `finish` ends both. */
export async function stage(options) {
  const daemon = new StandIn(dist);
  const origin = await daemon.start();
  const browser = await launch(options);
  return {
    daemon,
    origin,
    browser,
    page: (page_options) => watched_page(browser, origin, page_options),
    finish: async () => {
      await browser.close();
      await daemon.finish();
    },
  };
}

export const sample = {
  left: { R1: '7.1', R2: '22.8', eM: '31', eF: '10', muM: '8', muF: '5', F: '258' },
  right: { R1: '6.9', R2: '19.7', eM: '28', eF: '10', muM: '8', muF: '5', F: '196' },
};

export async function open_form(page, origin) {
  await page.goto(`${origin}/`);
  await page.locator('fieldset.side').first().waitFor();
}

export async function fill_side(page, side, values = sample[side]) {
  for (const [key, text] of Object.entries(values)) await page.fill(`#${side}-${key}`, text);
}

/* Sends the form and waits until every side of the result page has ended. */
export async function submit_and_wait(page, sides = 2) {
  await page.click('button[type=submit]');
  await page.waitForURL('**/assessments/**');
  await page.waitForFunction((n) => document.querySelectorAll('.glance').length === n, sides);
}

/* What is animated or takes time to change, as seen by the browser. */
export const moving = (page) =>
  page.evaluate(() =>
    [...document.querySelectorAll('*')]
      .filter((e) => {
        const style = getComputedStyle(e);
        const slow = style.transitionDuration.split(',').some((d) => parseFloat(d) > 0);
        return slow || style.animationName !== 'none' || e.getAnimations().length > 0;
      })
      .map((e) => e.outerHTML.slice(0, 80)),
  );

/* Where Tab goes from an element on: the accessible names, as the browser computes them. */
export async function tab_order(page, selector, steps) {
  await page.locator(selector).focus();
  const names = [];
  for (let i = 0; i < steps; i++) {
    await page.keyboard.press('Tab');
    const focused = page.locator('*:focus');
    const [line] = (await focused.ariaSnapshot()).split('\n');
    names.push(line.replace(/^- /, ''));
  }
  return names;
}

export const reading = (page, side, key) => page.locator(`#${side}-${key}-reading`);
