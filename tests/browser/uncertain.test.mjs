// SPDX-License-Identifier: GPL-3.0-or-later
// Estimates while typing, uncertain measurements, intervals of a result, and what if.
import assert from 'node:assert/strict';
import { after, afterEach, before, beforeEach, test } from 'node:test';
import {
  assert_accessible,
  assert_clean,
  cut_off,
  fill_side,
  on_paper,
  open_form,
  sample,
  stage,
} from './browser.mjs';

let s, page;
before(async () => {
  s = await stage();
  s.daemon.emulator = { rows: 3000, trial: false };
});
after(() => s.finish());
beforeEach(async () => {
  page = await s.page();
  await open_form(page, s.origin);
});
afterEach(async () => {
  assert_clean(page);
  await page.context().close();
});

const preview = (side) => page.locator(`fieldset.${side} .preview`).innerText({ timeout: 5000 });
const says = (side, words) =>
  page.waitForFunction(
    ([at, text]) => document.querySelector(`fieldset.${at} .preview`)?.innerText.includes(text),
    [side, words],
  );
const last_body = () => s.daemon.bodies[s.daemon.bodies.length - 1];

async function compute(subject, sides, sd) {
  await page.fill('#subject', subject);
  for (const side of sides) await fill_side(page, side);
  if (sd) await page.selectOption('#sd', sd);
  await page.click('button[type=submit]');
  await page.waitForURL('**/assessments/**');
  await page.waitForFunction(
    (n) => document.querySelectorAll('.glance').length === n,
    sides.length,
  );
}

test('an estimate appears with the seventh number, follows each change and is no result', async () => {
  assert.match(await preview('left'), /preview, not a solve/);
  assert.match(await preview('left'), /Seven numbers/);
  await fill_side(page, 'left', { ...sample.left, F: '200', muM: '5' });
  await says('left', '1.10');
  assert.match(await preview('left'), /1\.10\s\(1\.07 – 1\.13\)/);
  assert.match(await preview('right'), /Seven numbers/);
  await assert_accessible(page, 'the form with an estimate');
  await page.fill('#left-F', '300');
  await says('left', '1.25');
  await page.fill('#left-F', '');
  await says('left', 'Seven numbers');
  assert.equal(s.daemon.documents.size, 0, 'nothing was stored');
});

test('outside its training the emulator gives none, and says why', async () => {
  await fill_side(page, 'right', { ...sample.right, R2: '70' });
  await says('right', 'No estimate: R2 outside');
  assert.doesNotMatch(await preview('right'), /ε max/);
});

test('a slow answer never replaces a later one', async () => {
  await page.route('**/v1/estimates', async (route) => {
    const slow = JSON.parse(route.request().postData()).F === 200;
    if (slow) await new Promise((resolve) => setTimeout(resolve, 1500));
    await route.continue().catch(() => undefined);
  });
  await fill_side(page, 'left', { ...sample.left, F: '200', muM: '5' });
  await page.waitForTimeout(300);
  await page.fill('#left-F', '300');
  await says('left', '1.25');
  await page.waitForTimeout(1800);
  assert.match(await preview('left'), /1\.25/);
});

test('an estimate of other numbers than those on screen is marked, and none is kept', async () => {
  let release;
  const held = new Promise((resolve) => (release = resolve));
  await page.route('**/v1/estimates', async (route) => {
    const { F } = JSON.parse(route.request().postData());
    if (F === 300) await held;
    return F === 400 ? route.abort() : route.continue().catch(() => undefined);
  });
  const stale = page.locator('fieldset.left .preview [aria-busy=true]');
  await fill_side(page, 'left', { ...sample.left, F: '200', muM: '5' });
  await says('left', '1.10');
  assert.equal(await stale.count(), 0);
  await page.fill('#left-F', '300');
  await stale.waitFor();
  assert.match(await stale.innerText(), /1\.10/);
  assert.ok(Number(await stale.evaluate((e) => getComputedStyle(e).opacity)) < 1);
  release();
  await says('left', '1.25');
  assert.equal(await stale.count(), 0);
  await page.fill('#left-F', '400');
  await says('left', 'No estimate at the moment');
  assert.doesNotMatch(await preview('left'), /1\.25|Seven numbers/);
});

test('without an emulator the form has no preview', async () => {
  s.daemon.emulator = null;
  await page.reload();
  await page.waitForSelector('#left-R1');
  await fill_side(page, 'left');
  assert.equal(await page.locator('.preview').count(), 0);
  s.daemon.emulator = { rows: 3000, trial: false };
});

test('a trial emulator says so', async () => {
  s.daemon.emulator = { rows: 3000, trial: true };
  await fill_side(page, 'left');
  await says('left', 'do not rely on it');
  s.daemon.emulator = { rows: 3000, trial: false };
});

test('standard deviations are sent as they were chosen', async () => {
  await compute('P-1', ['left']);
  assert.equal(last_body().sd, undefined);
  await page.goto(s.origin);
  await compute('P-2', ['left'], 'typical');
  assert.equal(last_body().sd, 'typical');
  await page.goto(s.origin);
  await page.selectOption('#sd', 'own');
  assert.equal(await page.getAttribute('#sd-eF', 'placeholder'), '3');
  assert.match(await page.getAttribute('#sd-F', 'placeholder'), /10\s%/);
  await page.fill('#sd-R2', '4,5');
  await page.fill('#sd-F', '20');
  await assert_accessible(page, 'the form with standard deviations');
  await compute('P-3', ['left']);
  assert.deepEqual(last_body().sd, { R2: 4.5, F: 20 });
});

test('what is no standard deviation is not sent', async () => {
  const before_ = s.daemon.bodies.length;
  await fill_side(page, 'left');
  await page.selectOption('#sd', 'own');
  await page.fill('#sd-R2', '100000');
  assert.match(await page.locator('#sd-note').innerText(), /R2: Above 112 mm: not accepted/);
  await page.fill('#sd-R2', '-1');
  assert.equal(await page.getAttribute('#sd-R2', 'aria-invalid'), 'true');
  await page.click('button[type=submit]');
  assert.equal(await page.evaluate(() => document.activeElement.id), 'sd-R2');
  assert.equal(s.daemon.bodies.length, before_);
});

test('a result shows its interval, in numbers and as bars', async () => {
  await compute('P-4', ['left', 'right'], 'typical');
  const glance = await page.locator('.card.left .glance').innerText();
  assert.match(glance, /1\.144 to 1\.342 \(5 to 95 %\)/);
  const card = page.getByRole('region', { name: 'How certain this is · Left' });
  const text = await card.innerText();
  for (const part of [
    /shear 100\s%, compression 63\s%/,
    /not a probability of injury/,
    /0\.075 in ε max/,
    /2\.3\s% of the samples lie outside .*\(R2\)/,
    /2 of 4 full solves/,
    /not reached/,
  ])
    assert.match(text, part);
  assert.match(await card.locator('.warning').last().innerText(), /2 of 4 full solves/);
  assert.deepEqual(
    (await card.locator('.better strong').allInnerTexts()).map((t) => /(\d+)\s%/.exec(t)[1]),
    ['61', '22', '12'],
  );
  for (const where of ['.curve .interval path', '.strip .interval'])
    assert.ok((await page.locator(where).count()) >= 4, where);
  await assert_accessible(page, 'a result with intervals');
});

test('a phone shows an uncertain result without sideways scrolling', async () => {
  await compute('P-7', ['left'], 'typical');
  for (const width of [390, 320]) {
    await page.setViewportSize({ width, height: 844 });
    for (const tag of ['de', 'fr', 'en']) {
      await page.selectOption('.language select', tag);
      const content = await page.evaluate(() => document.documentElement.scrollWidth);
      assert.ok(content <= width, `${width} in ${tag}: ${content}`);
    }
  }
});

test('without an interval the page says why', async () => {
  await compute('outside-1', ['left'], 'typical');
  const text = await page.locator('.uncertain').innerText();
  assert.match(text, /No interval: too many samples lie outside .* \(R2\)/);
  assert.equal(await page.locator('.interval path').count(), 0);
  await open_form(page, s.origin);
  await compute('outside-itself-1', ['left'], 'typical');
  const itself = /No interval: what was measured lies outside .* \(R2\)/;
  assert.match(await page.locator('.uncertain').innerText(), itself);
  await page.locator('.report .certainty').waitFor({ state: 'attached' });
  assert.match((await on_paper(page)).text[0].replace(/\s+/g, ' '), itself);
});

test('the report holds the interval and still fits its page', async () => {
  for (const language of ['en', 'de', 'fr']) {
    await page.goto(`${s.origin}/?lang=${language}`);
    await compute('P-5', ['left', 'right'], 'typical');
    const paper = await on_paper(page);
    assert.equal(paper.pages, 2, language);
    assert.match(paper.text[0], /R2 61\s%,\s+muM 22\s%/);
    assert.deepEqual(await cut_off(page), [], language);
  }
});

test('what if: a force that keeps the muscle below, and curves of every input', async () => {
  await compute('P-6', ['left']);
  const box = page.locator('details.what-if');
  assert.equal(await box.locator('svg').count(), 0, 'asked only when opened');
  await box.locator('summary').first().click();
  await box.locator('svg').first().waitFor();
  assert.match(await box.innerText(), /shear 33\.0 N \(31\.0 to 35\.0\)/);
  assert.equal(await box.locator('svg').count(), 3);
  await assert_accessible(page, 'what if');
  await box.locator('select').selectOption('muM');
  await box.getByText('muM, kPa').first().waitFor();
  await box.getByText('In numbers').click();
  assert.ok((await box.locator('tbody tr').count()) >= 10);
});

test('what if: curves of another input than the chosen one are marked, and none is kept', async () => {
  await compute('P-7', ['left']);
  const box = page.locator('details.what-if');
  await box.locator('summary').first().click();
  await box.locator('svg').first().waitFor();
  let release;
  const held = new Promise((resolve) => (release = resolve));
  await page.route('**/what-if?parameter=eM', async (route) => {
    await held;
    return route.continue();
  });
  await page.route('**/what-if?parameter=eF', (route) => route.abort());
  await box.locator('select').selectOption('eM');
  await box.locator('[aria-busy=true]', { hasText: 'F, N' }).waitFor();
  release();
  await box.getByText('eM, mm').first().waitFor();
  assert.equal(await box.locator('[aria-busy=true]').count(), 0);
  await box.locator('select').selectOption('eF');
  await box.getByText('No estimate at the moment').waitFor();
  assert.equal(await box.locator('svg').count(), 0);
});
