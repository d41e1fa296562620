// SPDX-License-Identifier: GPL-3.0-or-later
// The page against ischiad itself, which solves: ISCHIAD and ISCHIA name the two programs. The
// solves are coarse ones, but for the one that is cancelled, so that the file takes seconds; what is
// shown must be what was computed.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { after, afterEach, before, beforeEach, test } from 'node:test';
import {
  assert_accessible,
  assert_clean,
  launch,
  open_form,
  sample,
  watched_page,
} from './browser.mjs';
import { Daemon } from './daemon.mjs';

const { ISCHIAD, ISCHIA } = process.env;
const solve_ms = 240_000;

let daemon, origin, browser, page;
before(async () => {
  daemon = new Daemon(ISCHIAD, ISCHIA);
  origin = await daemon.start();
  browser = await launch({ webgl: true });
});
after(async () => {
  await browser.close();
  await daemon.finish();
});
beforeEach(async () => {
  page = await watched_page(browser, origin);
});
afterEach(async () => {
  assert_clean(page);
  await page.context().close();
});

const document_of = (id) =>
  page.evaluate(async (path) => (await fetch(path)).json(), `/v1/assessments/${id}`);

/* Sends a person of Table 2 and resolves to the ids of the two sides. The daemon answers at once
 * what it has solved before: `force` makes the numbers new. */
async function submit_sample(force, resolution = 'coarse') {
  await open_form(page, origin);
  await page.getByRole('button', { name: 'Fill in' }).click();
  if (force) for (const side of ['left', 'right']) await page.fill(`#${side}-F`, force);
  await page.selectOption('.submit select', resolution);
  await page.click('button[type=submit]');
  await page.waitForURL('**/assessments/**');
  const url = new URL(page.url());
  return [url.pathname.split('/')[2], url.searchParams.get('with')];
}

const all_ended = (n) =>
  page.waitForFunction((k) => document.querySelectorAll('.glance').length === k, n, {
    timeout: solve_ms,
  });

test('both sides of a person of Table 2: what is shown is what was computed', async () => {
  const ids = await submit_sample();
  await all_ended(2);
  for (const [i, side] of ['Left', 'Right'].entries()) {
    const { result, parameters } = await document_of(ids[i]);
    const text = await page.getByRole('region', { name: side, exact: true }).innerText();
    const expected = [
      `${result.strain.eps_max.toFixed(3)} ± ${result.numerics.eps_max_error.toFixed(3)}`,
      `from ${result.threshold_force_N.shear.toFixed(0)} N`,
      `of the ${parameters.F} N measured`,
    ];
    for (const part of expected) assert.ok(text.includes(part), `${side}: ${part} in ${text}`);
    const volume = Math.round(result.clusters.shear.volume_mm3).toString();
    assert.ok(text.replace(/\s/g, '').includes(`${volume}mm³`), `${side}: ${volume}`);
  }
  await assert_accessible(page, 'a true result');

  const input = JSON.stringify(
    Object.fromEntries(Object.entries(sample.left).map(([key, text]) => [key, Number(text)])),
  );
  const output = execFileSync(ISCHIA, ['solve', '-', '--resolution', 'coarse'], {
    input,
    encoding: 'utf8',
    stdio: ['pipe', 'pipe', 'ignore'],
  });
  const shown = (await document_of(ids[0])).result;
  assert.deepEqual(shown.strain, JSON.parse(output).strain);
});

test('the 3-D view and the section draw the field of the daemon', async () => {
  await submit_sample();
  await all_ended(2);
  const picture = page.locator('.picture img').first();
  await picture.evaluate((image) => image.decode());
  assert.ok((await picture.evaluate((image) => image.naturalWidth)) > 100);
  await page.getByRole('button', { name: '3-D' }).first().click();
  await page.locator('.view3d .loading').waitFor({ state: 'detached' });
  await page.locator('.view3d canvas').waitFor();
  await assert_accessible(page, 'the 3-D view of a true field');
});

test('cancel stops a solve', async () => {
  const ids = await submit_sample('201,5', 'fine'); /* long enough to be caught */
  const card = (name) => page.getByRole('region', { name, exact: true });
  for (const side of ['Left', 'Right']) {
    await card(side).getByRole('button', { name: 'Cancel' }).click();
    await card(side).locator('.no-result').waitFor();
  }
  await all_ended(2);
  for (const id of ids) assert.equal((await document_of(id)).status, 'cancelled');
  assert.match(await page.locator('.no-result').first().innerText(), /Cancelled/);
});

test('the daemon is killed in the middle of a solve, comes back, and the page recovers', async () => {
  const ids = await submit_sample('202,5');
  await page.locator('.running').first().waitFor();
  await daemon.end('SIGKILL');
  await page.locator('.lost').first().waitFor();
  await daemon.start();
  await all_ended(2);
  assert.equal(await page.locator('.lost').count(), 0);
  for (const id of ids) assert.equal((await document_of(id)).status, 'succeeded');
});

test('without JavaScript: a plain submit is answered with the report', async () => {
  const plain = await watched_page(browser, origin, { javaScriptEnabled: false });
  await plain.goto(`${origin}/`);
  const limits = await (await fetch(`${origin}/v1/parameters`)).json();
  for (const { key, unit, accepted } of limits.parameters) {
    const range = `${accepted.min} to ${accepted.max} ${unit}`;
    assert.equal(await plain.locator(`#${key}-range`).innerText(), range);
  }
  for (const [key, text] of Object.entries(sample.left)) await plain.fill(`#${key}`, text);
  await plain.fill('#subject', 'plain-1');
  await plain.click('button[type=submit]');
  await plain.waitForURL(/\/v1\/assessments\/[^/]+\/report$/);
  assert.match(await plain.locator('body').innerText(), /plain-1/);
  const id = plain.url().split('/')[5];
  await fetch(`${origin}/v1/assessments/${id}/cancel`, { method: 'POST' });
  assert_clean(plain);
  await plain.context().close();
});

test('the list finds what was computed', async () => {
  await page.goto(`${origin}/assessments?subject=table2-1&status=succeeded`);
  await page.locator('table.list').waitFor();
  assert.ok((await page.locator('table.list tbody tr').count()) >= 2);
  assert.match(await page.locator('table.list').innerText(), /thresholds crossed/);
  await page.goto(`${origin}/assessments?subject=nobody`);
  await page.getByText('No assessment matches.').waitFor();
});
