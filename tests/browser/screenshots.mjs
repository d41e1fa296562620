// SPDX-License-Identifier: GPL-3.0-or-later
//
// Takes the pictures of docs/screenshots from a running daemon:
//   node screenshots.mjs ORIGIN [FOLDER] [RESOLUTION]
import { mkdir } from 'node:fs/promises';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { launch, open_form, watched_page } from './browser.mjs';

const [origin, folder, resolution = 'standard'] = process.argv.slice(2);
const out = folder ?? fileURLToPath(new URL('../../docs/screenshots', import.meta.url));
const sizes = { '1366x768': [1366, 768], '1920x1080': [1920, 1080], phone: [390, 844] };
const solve_ms = 900_000;

async function shoot(page, name, size, options = {}) {
  await page.screenshot({ path: join(out, `${name}-${size}.png`), ...options });
}

/* Until every picture of the page is there. */
const drawn = (page) =>
  page.waitForFunction(() =>
    [...document.images].every((image) => image.complete && image.naturalWidth > 0),
  );

/* An earlier visit of the same person, so that there is a history. */
async function earlier_visit() {
  const sides = {
    left: { R1: 7.1, R2: 22.8, eM: 33, eF: 11, muM: 8, muF: 5, F: 245 },
    right: { R1: 6.9, R2: 19.7, eM: 30, eF: 11, muM: 8, muF: 5, F: 205 },
  };
  for (const [side, numbers] of Object.entries(sides)) {
    const answer = await fetch(`${origin}/v1/assessments`, {
      method: 'POST',
      headers: { 'Content-Type': 'application/json', Prefer: 'wait=60' },
      body: JSON.stringify({ ...numbers, side, subject: 'table2-1', measured_at: '2026-05-04' }),
    });
    if (answer.status !== 201) throw new Error(`${answer.status} ${await answer.text()}`);
  }
}

/* A sample person computed once: the address of the result. */
async function compute(browser) {
  const page = await watched_page(browser, origin);
  await open_form(page, origin);
  await page.getByRole('button', { name: 'Fill in' }).click();
  await page.selectOption('.submit select', resolution);
  await page.click('button[type=submit]');
  await page.waitForURL('**/assessments/**');
  await page.waitForFunction(() => document.querySelectorAll('.glance').length === 2, null, {
    timeout: solve_ms,
  });
  const address = page.url();
  await drawn(page);
  await page.pdf({ path: join(out, 'report.pdf'), preferCSSPageSize: true });
  const id = new URL(address).pathname.split('/')[2];
  await page.goto(`${origin}/v1/assessments/${id}/report`, { waitUntil: 'networkidle' });
  await page.pdf({ path: join(out, 'report-daemon.pdf'), preferCSSPageSize: true });
  await page.context().close();
  return address;
}

async function all_of(page, size, result) {
  await open_form(page, origin);
  await page.getByRole('button', { name: 'Fill in' }).click();
  await shoot(page, 'form', size);
  await page.fill('#left-R1', '71');
  await page.fill('#right-eF', '1,234.5');
  await page.fill('#right-muM', '12,5');
  await page.click('button[type=submit]');
  await shoot(page, 'form-faults', size);
  await page.goto(result);
  await page.locator('.glance').first().waitFor();
  await page.waitForLoadState('networkidle');
  await drawn(page);
  await shoot(page, 'result-whole', size, { fullPage: true });
  await page.getByRole('button', { name: '3-D' }).first().click();
  await page.locator('.view3d .loading').waitFor({ state: 'detached' });
  await page.locator('.view3d').scrollIntoViewIfNeeded();
  await shoot(page, 'view3d', size);
  await page.goto(`${origin}/assessments`);
  await page.locator('table.list').waitFor();
  await shoot(page, 'list', size);
}

await mkdir(out, { recursive: true });
const browser = await launch({ webgl: true });
if (!process.env.RESULT) await earlier_visit();
const result = process.env.RESULT ?? (await compute(browser));
for (const [size, [width, height]] of Object.entries(sizes)) {
  const page = await watched_page(browser, origin, { viewport: { width, height } });
  await all_of(page, size, result);
  await page.context().close();
}
await browser.close();
console.log(result);
