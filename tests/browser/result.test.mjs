// SPDX-License-Identifier: GPL-3.0-or-later
// The result page: progress, outcome, recovery, cancel, comparison, history, lists, paper.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { after, afterEach, before, beforeEach, test } from 'node:test';
import {
  assert_accessible,
  assert_clean,
  cut_off,
  fill_side,
  moving,
  on_paper,
  open_form,
  stage,
  submit_and_wait,
  tab_order,
} from './browser.mjs';

let s, page;
before(async () => {
  s = await stage();
});
after(() => s.finish());
beforeEach(async () => {
  page = await s.page();
});
afterEach(async () => {
  assert_clean(page);
  await page.context().close();
});

async function compute(subject, sides = ['left', 'right'], options = {}) {
  await open_form(page, s.origin);
  await page.fill('#subject', subject);
  if (options.measured_at) await page.fill('#measured_at', options.measured_at);
  for (const side of sides) await fill_side(page, side, options[side]);
  await page.click('button[type=submit]');
  await page.waitForURL('**/assessments/**');
}

/* A side for assessments that were never entered in the form. */
const numbers = { R1: 7.1, R2: 22.8, eM: 31, eF: 10, muM: 8, muF: 5, F: 258 };

const all_ended = (n) =>
  page.waitForFunction((k) => document.querySelectorAll('.glance').length === k, n);

test('both sides: outcome in words, volumes, forces, error, caveats in sight', async () => {
  await compute('P-1');
  await all_ended(2);
  const card = page.getByRole('region', { name: 'Left', exact: true });
  const text = await card.innerText();
  for (const part of [
    /Both thresholds crossed/,
    /14\s400\smm³, 9\.7\s%/,
    /1\.243 ± 0\.011/,
    /from 33 N, 13\s% of the 258 N/,
    /centred 6\.4 mm below/,
  ])
    assert.match(text, part);
  for (const caveat of [
    'animal experiments',
    'reads higher',
    'Never compare',
    'Not a medical device',
  ])
    assert.ok(await page.locator('.caveats', { hasText: caveat }).isVisible(), caveat);
  assert.match(await page.locator('#announcer').innerText(), /Both thresholds crossed/);
  await assert_accessible(page, 'the result of both sides');
});

test('every band says what it means, by shape and word', async () => {
  const words = {
    below: 'Below both thresholds',
    shear: 'Shear threshold crossed',
    compression: 'Compression threshold crossed',
  };
  const drawn = new Set();
  for (const [band, expected] of Object.entries(words)) {
    await compute(`${band}-1`, ['left']);
    await all_ended(1);
    assert.equal(await page.locator('.verdict').first().innerText(), expected);
    drawn.add(await page.locator('.glance .shape path').first().getAttribute('d'));
    await assert_accessible(page, `the result ${band}`);
  }
  assert.equal(drawn.size, 3);
  assert.match(await page.locator('.glance').innerText(), /not reached up to the 258 N/);
});

test('progress is followed, and cancel stops it', async () => {
  await compute('slow-1', ['left']);
  const bar = page.getByRole('progressbar');
  await bar.waitFor();
  await page.waitForFunction(() => document.querySelector('progress')?.value > 0);
  /* The words follow the bar with the next event. */
  await page.locator('.running', { hasText: /load step \d+, iteration 3/ }).waitFor();
  await assert_accessible(page, 'a running assessment');
  await page.getByRole('button', { name: 'Cancel' }).focus();
  await page.keyboard.press('Enter');
  await page.locator('.no-result').waitFor();
  assert.equal(await page.evaluate(() => document.activeElement.innerText), 'Left');
  assert.match(await page.locator('.no-result').innerText(), /Cancelled/);
  assert.match(await page.locator('.card header').innerText(), /ended/);
  assert.doesNotMatch(await page.locator('.card header').innerText(), /computed/);
  await assert_accessible(page, 'a cancelled assessment');
});

test('who may not cancel is told so, and the computation goes on', async () => {
  const refusal = { status: 403, json: { detail: "This needs a token with the scope 'assess'." } };
  await page.route('**/cancel', (route) => route.fulfill(refusal));
  await compute('slow-2', ['left']);
  await page.getByRole('button', { name: 'Cancel' }).click();
  await page.locator('.running .errors', { hasText: 'access does not allow this' }).waitFor();
  assert.equal(await page.getByRole('progressbar').count(), 1);
});

test('a failed solve shows the reason and no number', async () => {
  await compute('fail-1', ['left']);
  await all_ended(1);
  const text = await page.locator('.card').innerText();
  assert.match(text, /No result/);
  assert.match(text, /last converged force is 143\.2 N/);
  assert.equal(await page.locator('.curve, .caveats, .report').count(), 0);
  await assert_accessible(page, 'a failed assessment');
  assert.equal(await page.getByRole('button', { name: 'Print report' }).count(), 0);
  await page.click('text=Change and compute again');
  await page.waitForFunction(() => document.querySelector('#left-R1')?.value === '7.1');
});

test('a load path that ended is told in the language of the page', async () => {
  const ends = {
    diverged_step: /up to 143 N of the 258 N, not beyond/,
    diverged_checks: /whole force was reached, but what was computed failed its checks/,
  };
  await compute('fail-2', ['left']);
  await all_ended(1);
  const [document] = [...s.daemon.documents.values()].slice(-1);
  for (const [reason, expected] of Object.entries(ends)) {
    Object.assign(document.problem, { reason, last_converged_fraction: 143.2 / 258 });
    await page.reload();
    await page.locator('.no-result').waitFor();
    assert.match(await page.locator('.no-result').innerText(), expected);
  }
  await page.selectOption('.language select', 'de');
  assert.match(await page.locator('.no-result').innerText(), /Die ganze Kraft wurde erreicht/);
  await assert_accessible(page, 'a failed assessment in German');
});

test('the daemon restarts in the middle of a solve and the page recovers', async () => {
  await compute('slow-2', ['left']);
  await page.waitForFunction(() => document.querySelector('progress')?.value > 0);
  await s.daemon.stop();
  await page.locator('.lost').waitFor();
  await assert_accessible(page, 'a page that lost its server');
  await page.waitForTimeout(1200);
  await s.daemon.start(s.daemon.port);
  for (const d of s.daemon.documents.values()) if (d.subject === 'slow-2') d.subject = 'P-slow-2';
  await all_ended(1);
  assert.equal(await page.locator('.lost').count(), 0);
  assert.match(await page.locator('.glance').innerText(), /Both thresholds crossed/);
});

test('an unknown assessment is said to be unknown', async () => {
  await page.goto(`${s.origin}/assessments/0192f0c1-0000-7000-8000-ffffffffffff`);
  await page.getByText('There is no such assessment.').waitFor();
  await assert_accessible(page, 'an unknown assessment');
});

test('outside the studied range is said with the result', async () => {
  await compute('P-2', ['left'], {
    left: { R1: '7.1', R2: '22.8', eM: '31', eF: '10', muM: '12', muF: '5', F: '258' },
  });
  await all_ended(1);
  assert.match(
    await page.locator('.caveats').innerText(),
    /Left: muM = 12 kPa is outside the range studied in the paper \(1 to 8\)/,
  );
});

test('numbers stand in tables beside the charts', async () => {
  await compute('P-3');
  await all_ended(2);
  const row = page.getByRole('row', { name: /peak pressure on the skin/ });
  assert.match(await row.innerText(), /142\.3\skPa\s+142\.3\skPa\s+0\.0/);
  const force = page.getByRole('row', { name: /Stand-in F/ }).first();
  assert.match(await force.innerText(), /258\sN\s+196\sN\s+−62/);
  assert.equal(await page.locator('.curve').first().locator('tbody tr').count(), 13);
  await assert_accessible(page, 'the result with its tables open');
});

test('no words of the load curve lie on others, nor on a crossing', async () => {
  await compute('P-late', ['left']);
  await all_ended(1);
  const [document] = [...s.daemon.documents.values()].slice(-1);
  for (const part of [0.3, 0.74, 0.8, 0.97]) {
    const F = part < 0.5 ? 162.25 : 162; /* 150 would be under it */
    const scale = F / document.parameters.F;
    document.parameters.F = F;
    for (const point of document.result.load_curve) point.F_N *= scale;
    document.result.threshold_force_N = { shear: part * F, compression: part * F };
    for (const tag of ['fr', 'de', 'en']) {
      await page.goto(`${s.origin}/assessments/${document.id}?lang=${tag}`);
      await all_ended(1);
      const on_others = await page
        .locator('.curve svg')
        .first()
        .evaluate((svg) => {
          const boxes = [...svg.querySelectorAll('text, .crossed path')].map((e) => ({
            box: e.getBoundingClientRect(),
            says: e.textContent || 'crossing',
          }));
          const meet = (a, b) =>
            a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
          return boxes.flatMap((a, i) =>
            boxes
              .slice(i + 1)
              .flatMap((b) => (meet(a.box, b.box) ? [`${a.says} / ${b.says}`] : [])),
          );
        });
      assert.deepEqual(on_others, [], `${tag}, crossing at ${part}`);
    }
  }
});

test('history of the same subject, and the list, its filter and its comparison', async () => {
  await compute('P-4', ['left'], { measured_at: '2026-01-10' });
  await all_ended(1);
  await compute('P-4', ['left'], { measured_at: '2026-03-10' });
  await all_ended(1);
  await page.locator('svg.history').waitFor();
  assert.equal(await page.locator('section:has(#history) tbody tr').count(), 2);
  await assert_accessible(page, 'the result with a history');
  /* One that was measured long ago and entered last. */
  s.daemon.add({ ...numbers, side: 'left', subject: 'P-4', measured_at: '2025-11-10' });
  await page.reload();
  await page.locator('svg.history').waitFor();
  const times = await page.locator('section:has(#history) tbody th').allInnerTexts();
  assert.deepEqual(
    times.map((text) => text.replace(' (this one)', '')),
    ['10 Mar 2026', '10 Jan 2026', '10 Nov 2025'],
  );

  await page.click('text=Past assessments');
  await page.locator('table.list').waitFor();
  assert.ok((await page.locator('table.list tbody tr').count()) > 2);
  await page.fill('#f-subject', 'P-4');
  await page.click('text=Show');
  await page.waitForURL('**/assessments?subject=P-4');
  await page.waitForFunction(() => document.querySelectorAll('table.list tbody tr').length === 3);
  await assert_accessible(page, 'the filtered list');
  for (const i of [1, 2]) await page.locator('table.list input').nth(i).check();
  await page.click('text=Compare the two selected');
  await all_ended(2);
  assert.equal(await page.locator('h1').innerText(), 'Comparison');
  assert.deepEqual(await page.locator('.card h2').allInnerTexts(), [
    'A · Left',
    'B · Left',
    'A · Left: tissue and load curve',
    'B · Left: tissue and load curve',
  ]);
  assert.ok(await page.locator('h1').evaluate((e) => e === document.activeElement));
  await assert_accessible(page, 'a comparison');
});

test('two that are no pair are changed one by one', async () => {
  const ids = [];
  for (const [subject, side] of [
    ['A-1', 'left'],
    ['B-1', 'left'],
    ['B-2', 'right'],
  ]) {
    await compute(subject, [side]);
    await all_ended(1);
    ids.push([...s.daemon.documents.keys()].slice(-1)[0]);
  }
  for (const other of [ids[1], ids[2]]) {
    await page.goto(`${s.origin}/assessments/${ids[0]}?with=${other}`);
    await all_ended(2);
    const links = page.getByRole('link', { name: 'Change and compute again' });
    assert.deepEqual(await links.evaluateAll((all) => all.map((a) => new URL(a.href).search)), [
      `?from=${ids[0]}`,
      `?from=${other}`,
    ]);
    await assert_accessible(page, 'a comparison of two persons');
  }
  await page.getByRole('link', { name: 'compute again · Right' }).click();
  await page.waitForFunction(() => document.querySelector('#right-R1')?.value === '6.9');
  assert.equal(await page.inputValue('#subject'), 'B-2');
});

test('the list pages through what is older', async () => {
  add_many(55, { subject: 'cancelled-many' });
  await page.goto(`${s.origin}/assessments?subject=cancelled-many`);
  await page.getByRole('link', { name: 'Older' }).click();
  await page.waitForFunction(() => document.querySelectorAll('table.list tbody tr').length === 5);
  await page.getByRole('link', { name: 'Newest' }).click();
  await page.waitForFunction(() => document.querySelectorAll('table.list tbody tr').length === 50);
  await page.fill('#f-subject', 'nobody');
  await page.click('text=Show');
  await page.getByText('No assessment matches.').waitFor();
  await assert_accessible(page, 'the empty list');
});

test('the report prints on one A4 page a side and says what it must', async () => {
  await compute('P-5');
  await all_ended(2);
  await page.locator('.report .ids', { hasText: 'Ischia' }).nth(1).waitFor({ state: 'attached' });
  const { pages, is_a4, text, bytes } = await on_paper(page);
  assert.deepEqual([pages, is_a4], [2, true]);
  for (const part of [
    /Tissue strain report · Left/,
    /Subject P-5/,
    /Both thresholds crossed/,
    /22\.8\s+mm/,
    /ε max\s+engineering\s+1\.243 ± 0\.011/,
    /E shear\s+Green–Lagrange/,
    /14\s400\s+9\.7\s%\s+1\s+14\s400 mm³, 6\.4 mm\s+33 N/,
    /animal experiments/,
    /Not a medical device/,
    /Ischia 0\.0\.0/,
    /macron2020-local 1/,
    /0192f0c1-/,
    /signature/,
  ])
    assert.match(text[0], part);
  assert.doesNotMatch(text.join(), /Change and compute again/);
  assert.ok(bytes > 5000);
  const address = page.url();
  for (const d of [...s.daemon.documents.values()].slice(-2)) {
    d.subject = 'x'.repeat(64);
    d.label = 'y'.repeat(200);
  }
  await page.goto(address);
  await all_ended(2);
  for (const language of ['en', 'fr', 'de']) {
    await page.selectOption('.language select', language);
    assert.deepEqual(await cut_off(page), [], language);
    assert.equal((await on_paper(page)).pages, 2, language);
  }
});

test('a body beside the bone lies above its lowest point, in every language', async () => {
  const above = {
    en: /2\.7 mm above the bone’s lowest point/,
    fr: /2,7 mm au-dessus du point le plus bas de l’os/,
    de: /2,7 mm über dem tiefsten Punkt des Knochens/,
  };
  const shear = { en: /E shear/, fr: /E cis\./, de: /E Scher/ };
  await compute('P-above', ['left']);
  await all_ended(1);
  const [document] = [...s.daemon.documents.values()].slice(-1);
  for (const set of Object.values(document.result.clusters)) set.largest.centroid_mm[2] = 44.7;
  await page.reload();
  await all_ended(1);
  for (const tag of ['de', 'fr', 'en']) {
    await page.selectOption('.language select', tag);
    await page.locator('.glance', { hasText: above[tag] }).waitFor();
    const { pages, text } = await on_paper(page);
    assert.equal(pages, 1);
    /* Words of one cell, beside those of the others: the cell is wrapped. */
    const table = await page.locator('.report td.long').allTextContents();
    assert.match(table[0], above[tag]);
    assert.deepEqual(await cut_off(page), []);
    assert.match(text[0], shear[tag]);
    assert.doesNotMatch(text[0], /[-−]2[.,]7/);
    if (tag !== 'en') assert.doesNotMatch(text[0], /E (shear|comp\s)/);
  }
});

test('a result of another mesh, skin or model says so, and is neither ranked nor joined', async () => {
  const otherwise = [
    { resolution: 'fine' },
    { skin: { mu: 67, thickness: 2.5 } },
    { model: { name: 'as-published', bulk_ratio: 100 } },
  ];
  const said = [/Resolution: Fine/, /skin\.thickness 2\.5\smm/, /model\.bulk_ratio 100/];
  for (const [i, change] of otherwise.entries()) {
    await compute(`P-other-${i}`, ['left'], { measured_at: '2026-01-10' });
    await all_ended(1);
    await compute(`P-other-${i}`, ['left'], { measured_at: '2026-03-10' });
    await all_ended(1);
    assert.equal(await page.locator('.strip .ours').count(), 3);
    await page.locator('svg.history .mark').nth(1).waitFor();
    assert.match((await on_paper(page)).text[0], /Resolution: Standard · Assessment/);
    const [document] = [...s.daemon.documents.values()].slice(-1);
    Object.assign(document, change);
    await page.reload();
    await all_ended(1);
    const heading = page.locator('.card > header .hint').first();
    assert.match(await heading.innerText(), said[i]);
    assert.equal(await page.locator('svg.strip').count(), 0);
    assert.match(await page.locator('.no-rank').innerText(), /macron2020-local 1, standard/);
    await page.getByText('Not in the chart, computed otherwise: 1.').waitFor();
    assert.equal(await page.locator('svg.history .mark').count(), 0);
    assert.match(await page.locator('tr.ours .otherwise').innerText(), said[i]);
    await page.locator('.report .ids', { hasText: 'Ischia' }).waitFor({ state: 'attached' });
    const paper = await on_paper(page);
    assert.match(paper.text[0].replace(/\s+/g, ' '), said[i]);
    assert.equal(paper.pages, 1);
    await assert_accessible(page, `a result with ${Object.keys(change)[0]} of its own`);
  }
});

/* Assessments that ended without being computed, straight into the daemon. */
function add_many(n, body) {
  const numbers = { R1: 7, R2: 20, eM: 30, eF: 10, muM: 8, muF: 5, F: 200 };
  for (let i = 0; i < n; i++)
    s.daemon.add({ side: 'left', ...numbers, ...body }).status = 'cancelled';
}

test('the list can be saved for a spreadsheet, however long it is', async () => {
  add_many(1100, { subject: 'csv-many' });
  await page.goto(`${s.origin}/assessments?subject=csv-many`);
  await page.locator('table.list').waitFor();
  const [download] = await Promise.all([page.waitForEvent('download'), page.click('text=As CSV')]);
  const [header, ...rows] = (await readFile(await download.path(), 'utf8')).trim().split('\n');
  assert.equal(header, 'id,subject');
  assert.equal(rows.length, 1100);
  assert.equal(new Set(rows).size, 1100);
  assert.ok(rows.every((row) => row.endsWith(',csv-many')));
});

test('the filter of a list stays in sight, and what it hides is not selected', async () => {
  add_many(2, { subject: 'filtered', side: 'right' });
  add_many(1, { subject: 'filtered' });
  await page.goto(`${s.origin}/assessments?subject=filtered`);
  for (const box of (await page.locator('table.list input').all()).slice(0, 2)) await box.check();
  await page.selectOption('#f-side', 'right');
  await page.selectOption('#f-status', 'cancelled');
  await page.click('text=Show');
  await page.waitForFunction(() => document.querySelectorAll('table.list tbody tr').length === 2);
  assert.equal(await page.inputValue('#f-side'), 'right');
  assert.equal(await page.inputValue('#f-status'), 'cancelled');
  assert.equal(await page.locator('table.list input:checked').count(), 0);
  const compare = page.getByRole('button', { name: 'Compare the two selected' });
  assert.equal(await compare.getAttribute('aria-disabled'), 'true');
  await page.goBack();
  await page.waitForFunction(() => document.querySelectorAll('table.list tbody tr').length === 3);
  assert.equal(await page.inputValue('#f-side'), '');
});

test('nothing moves for those who asked for stillness', async () => {
  await page.emulateMedia({ reducedMotion: 'reduce' });
  await compute('P-6');
  await page.locator('.running').first().waitFor();
  assert.deepEqual(await moving(page), []);
  await all_ended(2);
  assert.deepEqual(await moving(page), []);
  await page.goto(`${s.origin}/assessments`);
  await page.locator('table.list').waitFor();
  assert.deepEqual(await moving(page), []);
});

test('Tab goes through a result from top to bottom', async () => {
  await compute('P-8', ['left']);
  await all_ended(1);
  const names = await tab_order(page, '.language select', 7);
  const expected = [
    /link "Change and compute again"/,
    /button "Print report"/,
    /Files/,
    /button "Section" \[pressed\]/,
    /button "3-D"/,
    /Load curve in numbers/ /* to open and close the table */,
    /group "Load curve in numbers"/ /* to scroll it */,
  ];
  expected.forEach((pattern, i) => assert.match(names[i], pattern));
});

test('Tab goes through the list: filter, actions, rows', async () => {
  await compute('P-9', ['left']);
  await all_ended(1);
  await page.goto(`${s.origin}/assessments?subject=P-9`);
  await page.locator('table.list').waitFor();
  const names = await tab_order(page, '#f-subject', 8);
  const expected = [
    /combobox "Side"/,
    /combobox "Status"/,
    /button "Show"/,
    /button "As CSV"/,
    /button "Compare the two selected"/,
    /group "Past assessments"/,
    /checkbox "Select P-9, Left, .* for comparison"/,
    /link "\d/,
  ];
  expected.forEach((pattern, i) => assert.match(names[i], pattern));
});

test('a screen reader hears the answer, then its limits, then the pictures', async () => {
  await compute('P-10');
  await all_ended(2);
  const heard = await page.locator('main').ariaSnapshot();
  const order = [
    'heading "Left and right" [level=1]',
    'region "Left"',
    'heading "Left" [level=2]',
    'Both thresholds crossed',
    'term: Shear over 0.75',
    'region "Right"',
    'region "What this does not say"',
    'animal experiments',
    'region "Left: tissue and load curve"',
    'img "Section of the loaded tissue, Left',
    'img "Load curve, Left',
    'columnheader "Green–Lagrange"',
    'region "Right: tissue and load curve"',
    'region "All numbers"',
  ];
  let at = 0;
  for (const part of order) {
    const next = heard.indexOf(part, at);
    assert.ok(next >= at, `${part} is not where it should be:\n${heard}`);
    at = next + part.length;
  }
});

test('Show reads the list again, also under the same filter', async () => {
  await page.route('**/v1/assessments?*', (route) => route.abort());
  await page.goto(`${s.origin}/assessments`);
  await page.locator('.errors', { hasText: 'does not answer' }).waitFor();
  await page.unroute('**/v1/assessments?*');
  await page.click('text=Show');
  await page.locator('table.list').waitFor();
  assert.equal(await page.locator('.errors').count(), 0);
});

/* In a theme of high contrast the page's own colours are not there to be seen on. */
test('drawings take the colours that the reader has set', async () => {
  await compute('P-8', ['left'], { measured_at: '2026-01-10' });
  await all_ended(1);
  await page.emulateMedia({ forcedColors: 'active', colorScheme: 'dark' });
  const ink = await page.evaluate(() => getComputedStyle(document.body).color);
  for (const words of ['.curve .name', '.curve .tick', '.curve text.threshold', '.strip .tick'])
    assert.equal(
      await page
        .locator(words)
        .first()
        .evaluate((e) => getComputedStyle(e).fill),
      ink,
      words,
    );
  const pressed = page.locator('.switch button');
  const grounds = await pressed.evaluateAll((all) =>
    all.map((e) => getComputedStyle(e).backgroundColor),
  );
  assert.notEqual(grounds[0], grounds[1]);
});

test('codes and labels of one long word stay on the page', async () => {
  const long = { subject: 'x'.repeat(64), label: 'Wumpus'.repeat(33) };
  const ids = ['left', 'right'].map((side) => s.daemon.add({ ...numbers, side, ...long }).id);
  for (const width of [1366, 320]) {
    await page.setViewportSize({ width, height: 800 });
    await page.goto(`${s.origin}/assessments/${ids[0]}?with=${ids[1]}`);
    await all_ended(2);
    await page.locator('#history').waitFor();
    const out = await page.evaluate(() =>
      [...document.querySelectorAll('.card header *, #history')]
        .filter((e) => {
          const text = document.createRange();
          text.selectNodeContents(e);
          return (
            text.getBoundingClientRect().right > e.closest('section').getBoundingClientRect().right
          );
        })
        .map((e) => e.textContent),
    );
    assert.deepEqual(out, [], `${width}`);
  }
});

test('the smallest phone shows the longest name of the form whole', async () => {
  await page.setViewportSize({ width: 320, height: 640 });
  await open_form(page, s.origin);
  const wide = 'Muskelsteifigkeit';
  const covered = await page.evaluate((word) => {
    const label = document.querySelector('label[for=left-muM]');
    label.lastChild.textContent = word;
    const text = document.createRange();
    text.selectNodeContents(label.lastChild);
    const help = label.parentElement.querySelector('.help').getBoundingClientRect();
    return text.getBoundingClientRect().right > help.left;
  }, wide);
  assert.equal(covered, false);
});

test('a phone shows everything without sideways scrolling', async () => {
  await page.setViewportSize({ width: 390, height: 844 });
  await compute('P-7');
  await all_ended(2);
  for (const address of [page.url(), `${s.origin}/`, `${s.origin}/assessments`]) {
    await page.goto(address);
    await page.locator('h1').waitFor();
    for (const tag of ['de', 'fr', 'en']) {
      await page.selectOption('.language select', tag);
      const [content, view] = await page.evaluate(() => [
        document.documentElement.scrollWidth,
        window.innerWidth,
      ]);
      assert.ok(content <= view, `${address} in ${tag}: ${content} > ${view}`);
    }
    await assert_accessible(page, `${address} on a phone`);
  }
});
