// SPDX-License-Identifier: GPL-3.0-or-later
// The page against ischiad itself, which solves: ISCHIAD and ISCHIA name the two programs. The first
// person is solved as the form is set; the other solves are coarse ones, but for those that are
// interrupted, so that the file takes seconds. What is shown must be what was computed.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFile } from 'node:fs/promises';
import { after, afterEach, before, beforeEach, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import {
  assert_accessible,
  assert_clean,
  assert_usable_within,
  cut_off,
  launch,
  on_paper,
  open_form,
  sample,
  watched_page,
} from './browser.mjs';
import { Daemon } from './daemon.mjs';

const { ISCHIAD, ISCHIA } = process.env;
const solve_ms = 240_000;
const reference_file = fileURLToPath(
  new URL('../../static/reference/table2.json', import.meta.url),
);

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
  if (resolution) await page.selectOption('.submit select', resolution);
  await page.click('button[type=submit]');
  await page.waitForURL('**/assessments/**');
  const url = new URL(page.url());
  return [url.pathname.split('/')[2], url.searchParams.get('with')];
}

const numbers_of = (side) =>
  Object.fromEntries(Object.entries(side).map(([key, text]) => [key, Number(text)]));

const all_ended = (n) =>
  page.waitForFunction((k) => document.querySelectorAll('.glance').length === k, n, {
    timeout: solve_ms,
  });

test('the first page: what crosses the wire, and how soon it can be used', async () => {
  const wire = await page.context().newCDPSession(page);
  await wire.send('Network.enable');
  const sizes = [];
  wire.on('Network.loadingFinished', (e) => sizes.push(e.encodedDataLength));
  const answer = await page.goto(`${origin}/`, { waitUntil: 'networkidle' });
  assert.doesNotMatch(answer.headers()['content-security-policy'], /unsafe/);
  assert.ok(sizes.length >= 4, `${sizes}`);
  const total = sizes.reduce((a, b) => a + b, 0);
  assert.ok(total <= 100 * 1024, `${total} bytes`);
  await assert_usable_within(page, 200, 'requestStart');
});

test('both sides of a person of Table 2: what is shown is what was computed', async () => {
  const ids = await submit_sample(null, null);
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
  const output = execFileSync(ISCHIA, ['solve', '-'], {
    input,
    encoding: 'utf8',
    stdio: ['pipe', 'pipe', 'ignore'],
  });
  const shown = (await document_of(ids[0])).result;
  assert.deepEqual(shown.strain, JSON.parse(output).strain);

  /* The strip plot holds it against the reference sides, which this program must still compute. */
  const strips = page.getByRole('region', { name: 'Against 26 sides of Table 2' });
  assert.equal(await strips.locator('svg.strip').count(), 3);
  assert.equal(await strips.locator('svg.strip').first().locator('.reference').count(), 26);
  assert.equal(await strips.locator('svg.strip').first().locator('.ours').count(), 2);
  const reference = JSON.parse(await readFile(reference_file, 'utf8'));
  assert.deepEqual(reference.model, shown.model);
  const ours = reference.sides.find((s) => s.subject === 'table2-1' && s.side === 'left');
  assert.ok(
    Math.abs(ours.eps_max - shown.strain.eps_max) <= ours.eps_max_error,
    'static/reference/table2.json is out of date: node static/make-reference.mjs ISCHIA',
  );
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
  const ids = await submit_sample('202,5', 'standard'); /* a coarse one may be over too soon */
  await page.locator('.running').first().waitFor();
  await daemon.end('SIGKILL');
  await page.locator('.lost').first().waitFor();
  await daemon.start();
  await all_ended(2);
  assert.equal(await page.locator('.lost').count(), 0);
  for (const id of ids) assert.equal((await document_of(id)).status, 'succeeded');
});

const plain_page = () => watched_page(browser, origin, { javaScriptEnabled: false });

test('without JavaScript: limits, a comma, a fault beside its field, then the report', async () => {
  const plain = await plain_page();
  await plain.goto(`${origin}/`);
  const limits = await (await fetch(`${origin}/v1/parameters`)).json();
  for (const { key, name, unit, accepted } of limits.parameters) {
    const range = `${accepted.min} to ${accepted.max} ${unit}`;
    assert.equal(await plain.locator(`#${key}-range`).innerText(), range);
    assert.ok((await plain.locator(`label[for=${key}]`).innerText()).includes(name), name);
  }
  for (const [key, text] of Object.entries(sample.left)) await plain.fill(`#${key}`, text);
  await plain.fill('#R1', '7,1');
  await plain.fill('#R2', '1,234.5');
  await plain.fill('#subject', 'plain-1');
  await plain.click('button[type=submit]');
  assert.match(await plain.locator('#R2-fault').innerText(), /"1,234.5" with more than one/);
  assert.equal(await plain.inputValue('#R1'), '7,1');
  await plain.fill('#R2', '22,8');
  await plain.click('button[type=submit]');
  await plain.waitForURL(/\/v1\/assessments\/[^/]+\/report\?lang=en$/);
  const id = plain.url().split('/')[5];
  const { parameters, subject } = await (await fetch(`${origin}/v1/assessments/${id}`)).json();
  assert.deepEqual([parameters.R1, parameters.R2, subject], [7.1, 22.8, 'plain-1']);
  const wait = plain.getByRole('button', { name: 'Wait for the result' });
  if (await wait.count())
    await wait.click({ timeout: solve_ms }); /* the same numbers may have been solved before */
  await plain
    .getByText('Muscle strain crosses both damage thresholds.')
    .waitFor({ timeout: solve_ms });
  assert.match(await plain.locator('body').innerText(), /Subject plain-1/);
  assert_clean(plain);
  await plain.context().close();
});

test('without JavaScript: waiting, cancelled, and what is read aloud of both', async () => {
  const slow = { ...numbers_of(sample.left), F: 257.5, resolution: 'fine' };
  const answer = await fetch(`${origin}/v1/assessments`, {
    method: 'POST',
    headers: { 'Content-Type': 'application/json' },
    body: JSON.stringify(slow),
  });
  const { id } = await answer.json();
  await page.goto(`${origin}/v1/assessments/${id}/report`);
  await page.getByText(/Being solved|Waiting for a solver/).waitFor();
  await assert_accessible(page, 'a report that waits');
  await page.getByRole('button', { name: 'Cancel' }).click();
  await page.getByText('There is no result.').waitFor();
  await assert_accessible(page, 'the report of a cancelled assessment');
});

test('without JavaScript the address of a result leads to its report', async () => {
  const answer = await fetch(`${origin}/v1/assessments`, {
    method: 'POST',
    headers: { 'Content-Type': 'application/json' },
    body: JSON.stringify({ ...numbers_of(sample.left), resolution: 'coarse' }),
  });
  const { id } = await answer.json();
  const plain = await watched_page(browser, origin, { javaScriptEnabled: false, locale: 'de' });
  await plain.goto(`${origin}/assessments/${id}`);
  await plain.getByRole('link', { name: 'Bericht' }).click();
  await plain.waitForURL(`**/v1/assessments/${id}/report?lang=de`);
  assert.match(await plain.locator('body').innerText(), new RegExp(id));
  assert_clean(plain);
  await plain.context().close();
});

test('the report of the daemon is one A4 page and has all that a report must', async () => {
  await submit_sample();
  await all_ended(2);
  const id = new URL(page.url()).pathname.split('/')[2];
  const { result, created_at } = await document_of(id);
  await page.goto(`${origin}/v1/assessments/${id}/report`);
  await page.locator('figure img').evaluate((image) => image.decode());
  await assert_accessible(page, 'the report of the daemon');
  assert.deepEqual(await cut_off(page), []);
  const { pages, is_a4, text } = await on_paper(page);
  assert.deepEqual([pages, is_a4], [1, true]);
  for (const part of [
    /left side/,
    /Smaller bone radius\s+R1\s+7\.1\s+mm/,
    /engineering/,
    /Green–Lagrange/,
    new RegExp(`${result.strain.eps_max.toFixed(3)} ± ${result.numerics.eps_max_error.toFixed(3)}`),
    new RegExp(`Both at once\\s+${Math.round(result.clusters.both.volume_mm3)}`),
    /10 mm/ /* scale bar */,
    /0\.00\s+0\.25[^]*2\.00/ /* colour bar */,
    /animals/,
    /not a medical device/,
    /Ischia \d+\.\d+\.\d+ · model macron2020-local \d+/,
    new RegExp(id),
    new RegExp(created_at.replaceAll('.', '\\.')),
    /Name, date, signature/,
  ])
    assert.match(text[0], part);

  /* Everything outside the studied range: seven warnings more, and still one page. */
  const odd = { R1: 10, R2: 70, eM: 41, eF: 36, muM: 9, muF: 9, F: 100, resolution: 'coarse' };
  const answer = await fetch(`${origin}/v1/assessments`, {
    method: 'POST',
    headers: { 'Content-Type': 'application/json', Prefer: 'wait=60' },
    body: JSON.stringify({ ...odd, subject: 'x'.repeat(64), label: 'y'.repeat(200) }),
  });
  const long = await answer.json();
  assert.equal(long.status, 'succeeded');
  await page.goto(`${origin}/v1/assessments/${long.id}/report`);
  assert.equal(await page.locator('li.warning').count(), 7);
  assert.deepEqual(await cut_off(page), []);
  const paper = await on_paper(page);
  assert.equal(paper.pages, 1);
  assert.match(paper.text[0], /Name, date, signature/);
});

const words = Object.fromEntries(
  await Promise.all(
    ['en', 'fr', 'de'].map(async (tag) => [
      tag,
      JSON.parse(await readFile(new URL(`../../words/${tag}.json`, import.meta.url), 'utf8')),
    ]),
  ),
);

/* Texts of a page that are English in a language that has other words for them. */
const english_in = (text, tag) =>
  Object.keys(words.en).filter(
    (key) =>
      words.en[key] !== words[tag][key] &&
      words.en[key].length > 8 &&
      !words.en[key].includes('{') &&
      text.split('\n').some((line) => line.trim() === words.en[key]),
  );

for (const [tag, locale] of [
  ['fr', 'fr-CA'],
  ['de', 'de-CH'],
]) {
  test(`without JavaScript in ${tag}: the form, a fault, waiting, the report`, async () => {
    const plain = await watched_page(browser, origin, { javaScriptEnabled: false, locale });
    const word = (key) => words[tag][key];
    await plain.goto(`${origin}/`);
    assert.equal(await plain.locator('html').getAttribute('lang'), tag);
    for (const { key, accepted, unit } of (await (await fetch(`${origin}/v1/parameters`)).json())
      .parameters) {
      const range = word('form.accepted')
        .replace('{min}', String(accepted.min).replace('.', ','))
        .replace('{max}', accepted.max)
        .replace('{unit}', unit);
      assert.equal(await plain.locator(`#${key}-range`).innerText(), range);
      const label = await plain.locator(`label[for=${key}]`).innerText();
      assert.ok(label.includes(word(`daemon.param.${key}.name`)), label);
    }
    assert.deepEqual(english_in(await plain.locator('body').innerText(), tag), []);
    for (const [key, text] of Object.entries(sample.left)) await plain.fill(`#${key}`, text);
    await plain.fill('#muM', '99,5');
    await plain.click('button[type=submit]');
    assert.equal(await plain.locator('html').getAttribute('lang'), tag);
    const fault = await plain.locator('#muM-fault').innerText();
    assert.match(fault, tag === 'fr' ? /99,5 kPa.*0,5 à 30 kPa/ : /99,5 kPa.*0,5 bis 30 kPa/);
    await plain.fill('#muM', '8,0');
    await plain.fill('#subject', `plain-${tag}`);
    await plain.click('button[type=submit]');
    await plain.waitForURL(/\/report\?lang=..$/);
    const wait = plain.getByRole('button', { name: word('daemon.report.wait') });
    if (await wait.count()) await wait.click({ timeout: solve_ms });
    await plain.getByText(word('daemon.risk.both')).waitFor({ timeout: solve_ms });
    assert.equal(await plain.locator('html').getAttribute('lang'), tag);
    assert.deepEqual(english_in(await plain.locator('body').innerText(), tag), []);
    await plain.getByRole('link', { name: 'English' }).click();
    assert.equal(await plain.locator('html').getAttribute('lang'), 'en');
    assert_clean(plain);
    await plain.context().close();
  });

  test(`the report and the picture of the daemon in ${tag}: one page, accessible`, async () => {
    await submit_sample();
    await all_ended(2);
    const id = new URL(page.url()).pathname.split('/')[2];
    const { result } = await document_of(id);
    await page.goto(`${origin}/v1/assessments/${id}/report?lang=${tag}`);
    await page.locator('figure img').evaluate((image) => image.decode());
    assert.equal(await page.locator('html').getAttribute('lang'), tag);
    await assert_accessible(page, `the report in ${tag}`);
    assert.deepEqual(await cut_off(page), []);
    const { pages, is_a4, text } = await on_paper(page);
    assert.deepEqual([pages, is_a4], [1, true]);
    const comma = (number) => number.toFixed(3).replace('.', ',');
    for (const part of [
      words[tag]['report.title'],
      `${comma(result.strain.eps_max)} ± ${comma(result.numerics.eps_max_error)}`,
      words[tag]['daemon.section.heading'],
      words[tag]['daemon.section.y0'],
      words[tag]['drawing.seat'],
      words[tag]['report.signature'],
    ])
      assert.ok(text[0].includes(part), part);
    assert.match(text[0], /0,00\s+0,25[^]*2,00/); /* colour bar */
    assert.deepEqual(english_in(text[0].replace(/ {2,}/g, '\n'), tag), []);
    assert.doesNotMatch(text[0].replace(/^.*(Ischia|T\d\d:).*$/gm, ''), /\d\.\d/);
    /* Everything outside the studied range: seven warnings more, and still one page. */
    const odd = { R1: 10, R2: 70, eM: 41, eF: 36, muM: 9, muF: 9, F: 100, resolution: 'coarse' };
    const answer = await fetch(`${origin}/v1/assessments`, {
      method: 'POST',
      headers: { 'Content-Type': 'application/json', Prefer: 'wait=60' },
      body: JSON.stringify({ ...odd, subject: 'x'.repeat(64), label: 'y'.repeat(200) }),
    });
    const { id: long } = await answer.json();
    await page.goto(`${origin}/v1/assessments/${long}/report?lang=${tag}`);
    await page.locator('li.warning').first().waitFor({ timeout: solve_ms });
    assert.equal(await page.locator('li.warning').count(), 7);
    assert.deepEqual(await cut_off(page), []);
    assert.equal((await on_paper(page)).pages, 1);
  });

  test(`the page in ${tag} shows names, refusals and pictures in that language`, async () => {
    const own = await watched_page(browser, origin, { locale });
    await own.goto(`${origin}/`);
    await own.locator('fieldset.side').first().waitFor();
    assert.equal(await own.locator('html').getAttribute('lang'), tag);
    await own.getByText(words[tag]['daemon.param.R1.name']).first().waitFor();
    /* The names follow the language that is chosen. */
    await own.selectOption('.language select', 'en');
    await own.getByText(words.en['daemon.param.R1.name']).first().waitFor();
    await own.selectOption('.language select', tag);
    await own.getByText(words[tag]['daemon.param.R1.name']).first().waitFor();
    const refusal = await own.evaluate(
      async (language) =>
        (await fetch('/v1/assessments/none', { headers: { 'Accept-Language': language } })).json(),
      tag,
    );
    assert.equal(refusal.detail, words[tag]['daemon.refusal.no_assessment']);
    assert_clean(own);
    await own.context().close();
  });
}

test('the other pages of the daemon are accessible too', async () => {
  for (const path of ['/form', '/form?lang=fr', '/form?lang=de', '/docs']) {
    await page.goto(`${origin}${path}`, { waitUntil: 'networkidle' });
    await assert_accessible(page, path);
  }
  await page.goto(`${origin}/form`);
  for (const [key, text] of Object.entries(sample.left)) await page.fill(`#${key}`, text);
  await page.fill('#muM', '99');
  await page.click('button[type=submit]');
  const fault = page.getByRole('textbox', { name: /Muscle stiffness/ });
  assert.equal(await fault.getAttribute('aria-invalid'), 'true');
  const described = await fault.getAttribute('aria-describedby');
  assert.match(await page.locator(`#${described}`).innerText(), /accepted 0\.5 to 30 kPa/);
  await assert_accessible(page, 'the plain form with a fault');
});

test('the list finds what was computed', async () => {
  await page.goto(`${origin}/assessments?subject=table2-1&status=succeeded`);
  await page.locator('table.list').waitFor();
  assert.ok((await page.locator('table.list tbody tr').count()) >= 2);
  assert.match(await page.locator('table.list').innerText(), /thresholds crossed/);
  await page.goto(`${origin}/assessments?subject=nobody`);
  await page.getByText('No assessment matches.').waitFor();
});
