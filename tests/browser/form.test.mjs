// SPDX-License-Identifier: GPL-3.0-or-later
// The form: what it accepts, what it refuses and how it says so, its drawing, without a mouse,
// without JavaScript.
import assert from 'node:assert/strict';
import { after, afterEach, before, beforeEach, test } from 'node:test';
import {
  assert_accessible,
  assert_clean,
  fill_side,
  moving,
  open_form,
  reading,
  sample,
  stage,
  submit_and_wait,
} from './browser.mjs';
import { parameters } from './stand_in.mjs';

let s, page;
before(async () => {
  s = await stage();
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

const text_of = async (side, key) => (await reading(page, side, key).innerText()).trim();
const leave = () => page.locator('h1').click();

test('label, unit, range and help of every field come from the daemon', async () => {
  for (const { key, name, unit, description, accepted, studied } of parameters.parameters) {
    const field = page.locator(`.field:has(#left-${key})`);
    const label = (await field.locator(`label[for=left-${key}]`).innerText()).replace(/\s+/g, '');
    assert.ok(label.endsWith(name.replace(/\s+/g, '')), label);
    assert.equal(await field.locator('.unit').innerText(), unit);
    assert.ok((await page.locator(`#left-${key}-help`).textContent()).startsWith(description));
    const range = await page.locator(`#left-${key}-range`).innerText();
    assert.ok(range.includes(`${accepted.min} to ${accepted.max} ${unit}`), range);
    assert.ok(range.includes(`studied ${studied.min} to ${studied.max}`), range);
  }
  await assert_accessible(page, 'the empty form');
});

test('decimal comma and decimal point mean the same, and the value is echoed', async () => {
  await page.fill('#left-R1', '7,1');
  assert.equal(await text_of('left', 'R1'), '= 7.1 mm');
  await page.fill('#left-R1', '7.1');
  assert.equal(await text_of('left', 'R1'), '= 7.1 mm');
});

test('two decimal marks are refused as typed', async () => {
  for (const text of ['1,234.5', '1.234,5', '1,234,5']) {
    await page.fill('#left-R2', text);
    assert.match(await text_of('left', 'R2'), /More than one decimal mark/);
    assert.equal(await page.getAttribute('#left-R2', 'aria-invalid'), 'true');
  }
});

test('what is no number, too small or too large is refused beside its field', async () => {
  const cases = [
    ['eM', '3x', /Not a number/],
    ['eM', '61', /Above 60 mm/],
    ['eM', '4', /Below 5 mm/],
    ['eM', '-20', /Below 5 mm/],
    ['muM', '0,4', /Below 0.5 kPa/],
    ['F', '601', /Above 600 N/],
  ];
  for (const [key, text, expected] of cases) {
    await page.fill(`#right-${key}`, text);
    await leave();
    assert.match(await text_of('right', key), expected, `${key} ${text}`);
  }
});

test('a number that is still being typed is not called too small', async () => {
  await page.focus('#left-eM');
  await page.keyboard.type('3');
  assert.equal(await page.getAttribute('#left-eM', 'aria-invalid'), 'false');
  await page.keyboard.type('1');
  assert.equal(await text_of('left', 'eM'), '= 31 mm');
});

test('outside the studied range is a note, not a fault', async () => {
  await page.fill('#left-muM', '12');
  await leave();
  assert.match(await text_of('left', 'muM'), /Outside the studied range/);
  await assert_accessible(page, 'the form with a warning');
  assert.equal(await page.getAttribute('#left-muM', 'aria-invalid'), 'false');
});

test('swapped radii are noticed and swapped back with one click', async () => {
  await fill_side(page, 'left', { ...sample.left, R1: '14', R2: '9' });
  await leave();
  assert.match(await text_of('left', 'R2'), /Smaller than R1/);
  await page.click('text=Swap R1 and R2');
  assert.equal(await page.evaluate(() => document.activeElement.id), 'left-R2');
  assert.equal(await page.inputValue('#left-R1'), '9');
  assert.equal(await page.inputValue('#left-R2'), '14');
  assert.equal(await text_of('left', 'R2').then((t) => /Smaller/.test(t)), false);
});

test('stiffness is copied to the other side, and what is empty erases nothing', async () => {
  const copy = (side) => page.locator(`fieldset.${side} .beside > .quiet`);
  await fill_side(page, 'left', { muM: '7', muF: '' });
  await fill_side(page, 'right', { muM: '3', muF: '4' });
  await copy('left').click();
  assert.equal(await page.inputValue('#right-muM'), '7');
  assert.equal(await page.inputValue('#right-muF'), '4');
  await page.click('text=Clear');
  await fill_side(page, 'right');
  await copy('left').click();
  assert.equal(await page.inputValue('#right-muM'), '8');
  await page.selectOption('.language select', 'fr');
  assert.match(await copy('left').innerText(), /vers l’autre côté/);
});

test('total thickness gives eM, and says how', async () => {
  await fill_side(page, 'left');
  await page.getByLabel(/total thickness of muscle and fat instead of eM, Left/).check();
  await page.fill('#left-eM', '41,2');
  assert.equal(await text_of('left', 'eM'), 'eM = 41,2 − 10 = 31.2 mm');
  await assert_accessible(page, 'the form with a total thickness');
  await page.fill('#left-eM', '80');
  assert.match(await text_of('left', 'eM'), /Above 60 mm/);
  await page.fill('#left-eM', '41.2');
  await submit_and_wait(page, 1);
  const [document] = [...s.daemon.documents.values()].slice(-1);
  assert.equal(document.parameters.eM, 31.2);
});

test('sending faults lists them all, links to the fields and sends nothing', async () => {
  const before_count = s.daemon.documents.size;
  await fill_side(page, 'left', { ...sample.left, R1: '1,234.5', eM: '80', F: '' });
  await page.fill('#subject', 'P-1');
  await page.click('button[type=submit]');
  const box = page.locator('.errors');
  assert.equal(await box.locator('li').count(), 3);
  assert.ok(await box.evaluate((e) => e === document.activeElement));
  await assert_accessible(page, 'the form with faults');
  await box.getByRole('link', { name: 'Left, F' }).click();
  assert.equal(await page.evaluate(() => document.activeElement.id), 'left-F');
  assert.equal(s.daemon.documents.size, before_count);
});

test('the list of faults shrinks with each correction, and goes with the last', async () => {
  await fill_side(page, 'left', { ...sample.left, R1: '', eM: '80', muM: '', muF: '' });
  await fill_side(page, 'right');
  await page.click('button[type=submit]');
  const left = () => page.locator('.errors li a').allInnerTexts();
  assert.deepEqual(await left(), ['Left, R1', 'Left, eM', 'Left, muM', 'Left, muF']);
  await page.fill('#left-R1', '7.1');
  assert.deepEqual(await left(), ['Left, eM', 'Left, muM', 'Left, muF']);
  assert.equal(await page.evaluate(() => document.activeElement.id), 'left-R1');
  await page.locator('fieldset.right .beside > .quiet').click();
  assert.deepEqual(await left(), ['Left, eM']);
  assert.equal(await page.getAttribute('#left-muM', 'aria-invalid'), 'false');
  await page.fill('#left-eM', '31');
  assert.equal(await page.locator('.errors').count(), 0);
  await page.click('text=Clear');
  await page.click('button[type=submit]');
  assert.equal(await page.locator('.errors').count(), 1);
  await page.fill('#right-F', '200');
  assert.equal(await page.locator('.errors').count(), 0);
});

test('a fault goes when another number takes it away', async () => {
  await fill_side(page, 'left', { ...sample.left, R1: '14', R2: '9' });
  await page.click('button[type=submit]');
  assert.equal(await page.locator('.errors li').count(), 1);
  await page.fill('#left-R1', '8');
  assert.equal(await page.locator('.errors').count(), 0);
  assert.equal(await page.getAttribute('#left-R2', 'aria-invalid'), 'false');
});

test('faults are told in the language that the page changes to', async () => {
  await fill_side(page, 'left', { ...sample.left, R1: '99', F: '' });
  await page.click('button[type=submit]');
  await page.selectOption('.language select', 'fr');
  const box = await page.locator('.errors').innerText();
  assert.match(box, /À corriger\s?:/);
  assert.match(box, /Gauche, R1\s?: .*15 mm/);
  assert.doesNotMatch(box, /Above|missing|correct:/);
  assert.doesNotMatch(await text_of('left', 'R1'), /Above/);
  assert.doesNotMatch(await text_of('left', 'F'), /missing/);
});

test('what the server refuses of neither side leads to its own field', async () => {
  await fill_side(page, 'right');
  await page.fill('#subject', 'odd-subject');
  await page.click('button[type=submit]');
  await page.locator('.errors').getByRole('link', { name: 'Subject code' }).click();
  assert.equal(await page.evaluate(() => document.activeElement.id), 'subject');
  await page.fill('#subject', 'odd-sd');
  assert.equal(await page.locator('.errors').count(), 0);
  await page.selectOption('#sd', 'own');
  await page.fill('#sd-eM', '2');
  await page.click('button[type=submit]');
  const link = page.locator('.errors').getByRole('link', { name: 'Uncertainty, eM' });
  await link.waitFor();
  assert.equal(await page.getAttribute('#sd-eM', 'aria-invalid'), 'true');
  assert.match(await page.locator('#sd-note').innerText(), /eM: .*refused by the server/);
  assert.equal(await page.getAttribute('#right-eM', 'aria-invalid'), 'false');
  await assert_accessible(page, 'the form with a refused standard deviation');
  await link.click();
  assert.equal(await page.evaluate(() => document.activeElement.id), 'sd-eM');
  await page.fill('#sd-eM', '3');
  assert.equal(await page.locator('.errors').count(), 0);
  assert.equal(await page.getAttribute('#sd-eM', 'aria-invalid'), 'false');
});

test('an empty form is not sent', async () => {
  await page.click('button[type=submit]');
  assert.match(await page.locator('.errors').innerText(), /at least one side/);
});

test('a name is no subject code', async () => {
  await page.fill('#subject', 'Jane Doe');
  assert.match(await page.locator('#subject-note').innerText(), /Only letters, digits/);
  await fill_side(page, 'left');
  await page.click('button[type=submit]');
  assert.equal(await page.evaluate(() => document.activeElement.id), 'subject');
});

test('a date that is not whole is not sent as no date', async () => {
  await fill_side(page, 'left');
  await page.locator('#measured_at').pressSequentially('12');
  await page.locator('h1').click();
  assert.match(await page.locator('#measured_at-note').innerText(), /Not a whole date/);
  await assert_accessible(page, 'the form with half a date');
  const before_count = s.daemon.documents.size;
  await page.click('button[type=submit]');
  assert.equal(await page.evaluate(() => document.activeElement.id), 'measured_at');
  assert.equal(s.daemon.documents.size, before_count);
  await page.fill('#measured_at', '2026-03-01');
  assert.equal(await page.locator('#measured_at-note').innerText(), '');
});

test('the muscle left over by a total thickness is judged too', async () => {
  await fill_side(page, 'left');
  await page.getByLabel(/total thickness of muscle and fat instead of eM, Left/).check();
  await page.fill('#left-eM', '12');
  await leave();
  assert.match(await text_of('left', 'eM'), /Below 5 mm/); /* 12 - 10 */
  await page.fill('#left-eF', '');
  assert.match(await text_of('left', 'eM'), /needs the fat thickness eF/);
  await page.click('button[type=submit]');
  assert.match(await page.locator('.errors').innerText(), /Left, eM: missing/);
});

test('what only the server refuses is shown beside the field', async () => {
  await page.fill('#subject', 'odd-1');
  await fill_side(page, 'left');
  await page.click('button[type=submit]');
  await page.locator('.errors').waitFor();
  assert.match(await text_of('left', 'muM'), /refused by the server alone/);
  await page.fill('#left-muM', '7');
  assert.equal(await text_of('left', 'muM'), '= 7 kPa');
});

test('a service that is shutting down is not called a full queue', async () => {
  await fill_side(page, 'left');
  const stopping = { status: 503, json: { detail: 'The service is shutting down.' } };
  await page.route('**/v1/assessments', (route) => route.fulfill(stopping));
  await page.click('button[type=submit]');
  assert.match(await page.locator('.errors').innerText(), /does not answer. Nothing is lost/);
});

test('a full queue loses nothing', async () => {
  await page.fill('#subject', 'busy-1');
  await fill_side(page, 'left');
  await page.click('button[type=submit]');
  assert.match(await page.locator('.errors').innerText(), /queue is full/);
  assert.equal(await page.inputValue('#left-R1'), '7.1');
});

test('who is not let in is told so in words of people, and loses nothing', async () => {
  const cases = { 'unknown-1': /not signed in.*Nothing .* lost/, 'forbidden-1': /access.*Nothing/ };
  await fill_side(page, 'left');
  for (const [subject, expected] of Object.entries(cases)) {
    await page.fill('#subject', subject);
    await page.click('button[type=submit]');
    await page.locator('.errors', { hasText: expected }).waitFor();
    assert.doesNotMatch(await page.locator('.errors').innerText(), /token/i);
    assert.equal(await page.inputValue('#left-R1'), '7.1');
  }
  const refuse = (route) => route.fulfill({ status: 401, json: { detail: 'Send a token' } });
  await page.route('**/v1/assessments?*', refuse);
  await page.route('**/v1/assessments/*', refuse);
  for (const address of ['/assessments', '/assessments/0192f0c1']) {
    await page.goto(`${s.origin}${address}`);
    await page.locator('.errors', { hasText: 'You are not signed in' }).waitFor();
  }
});

test('sending again what was sent makes no second assessment', async () => {
  let dropped = false;
  await page.route('**/v1/assessments', async (route) => {
    const response = await route.fetch();
    if (dropped) return route.fulfill({ response });
    dropped = true;
    return route.abort();
  });
  const before_count = s.daemon.documents.size;
  await fill_side(page, 'left');
  await page.click('button[type=submit]');
  await page.locator('.errors').waitFor();
  assert.match(await page.locator('.errors').innerText(), /does not answer/);
  await submit_and_wait(page, 1);
  assert.equal(s.daemon.documents.size, before_count + 1);
});

test('a sample person fills both sides with one click', async () => {
  await page.getByRole('button', { name: 'Fill in' }).click();
  for (const side of ['left', 'right'])
    for (const [key, text] of Object.entries(sample[side]))
      assert.equal(
        Number(await page.inputValue(`#${side}-${key}`)),
        Number(text),
        `${side} ${key}`,
      );
  assert.equal(await page.inputValue('#subject'), 'table2-1');
  assert.equal(await page.locator('#sample option').count(), 13);
  await assert_accessible(page, 'the filled form');
});

test('the drawing is to scale and shows a slip of the decimal mark', async () => {
  const layer = async (name) =>
    Number(await page.locator(`.side.left .tissue.${name}`).getAttribute('height'));
  assert.equal(await page.locator('.side.left .drawing .tissue').count(), 0);
  await fill_side(page, 'left');
  const [fat, muscle] = [await layer('fat'), await layer('muscle')];
  assert.ok(
    Math.abs(muscle / fat - (31 + 7.1) / 10) < 1e-6,
  ); /* muscle up to the top of the tissue */
  const ring = () => page.locator('.side.left .bone').nth(1).getAttribute('d');
  const before_slip = await ring();
  await page.fill('#left-R2', '228');
  assert.notEqual(await ring(), before_slip);
  await page.fill('#left-eF', '100');
  assert.ok((await layer('fat')) > 3 * fat);
});

test('the drawing names bone, muscle, fat, skin and seat, with their sizes', async () => {
  await fill_side(page, 'left');
  const texts = await page.locator('.side.left .drawing text').allTextContents();
  for (const part of ['bone', 'muscle', 'fat', 'skin 1', 'seat', 'eM 31', 'eF 10'])
    assert.ok(texts.includes(part), part);
  assert.ok(
    texts.some((text) => text.endsWith('R1 7.1')) && texts.some((t) => t.endsWith('R2 22.8')),
  );
  for (const name of ['bone', 'tissue.muscle', 'tissue.fat', 'tissue.skin', 'seat'])
    assert.ok(await page.locator(`.side.left .drawing .${name}`).first().isVisible(), name);
  const said = await page.locator('.side.left .drawing figcaption').textContent();
  assert.match(said, /Bone radii R1 7\.1 mm and R2 22\.8 mm, muscle 31 mm, fat 10 mm/);
});

test('every field has a name, a description and a help text', async () => {
  const field = page.getByRole('textbox', { name: 'R1 Stand-in R1' }).first();
  assert.equal(await field.getAttribute('aria-describedby'), 'left-R1-reading left-R1-range');
  const help = page.getByRole('button', { name: 'About Stand-in R1, Left' });
  await help.click();
  assert.equal(await help.getAttribute('aria-expanded'), 'true');
  assert.ok(await page.locator('#left-R1-help').isVisible());
  await assert_accessible(page, 'the form with help open');
  await page.keyboard.press('Escape');
  assert.ok(await page.locator('#left-R1-help').isHidden());
});

test('Tab goes through the left side, then the right, then the button', async () => {
  await page.focus('#subject');
  const visited = [];
  for (let i = 0; i < 60; i++) {
    await page.keyboard.press('Tab');
    const id = await page.evaluate(() => document.activeElement.id || document.activeElement.type);
    if (/^(left|right)-\w+$/.test(id)) visited.push(id);
    if (id === 'submit') break;
  }
  const keys = parameters.parameters.map((p) => p.key);
  assert.deepEqual(
    visited,
    ['left', 'right'].flatMap((side) => keys.map((key) => `${side}-${key}`)),
  );
});

test('a screen reader hears the form in order, each control by its name', async () => {
  await page.fill('#left-R1', '99');
  await leave();
  const order = [
    'heading "New assessment"',
    'textbox "Subject code"',
    'combobox "Sample person"',
    'group "Left"',
    'button "About Stand-in R1, Left"',
    'textbox "R1 Stand-in R1"',
    'Error: Above 15 mm: not accepted',
    'checkbox "Enter the total thickness of muscle and fat instead of eM, Left"',
    'textbox "F Stand-in F"',
    'group "Right"',
    'textbox "R1 Stand-in R1"',
    'button "Compute the left side"',
    'combobox "Resolution"',
  ];
  const heard = await page.locator('main').ariaSnapshot();
  let at = 0;
  for (const part of order) {
    const next = heard.indexOf(part, at);
    assert.ok(next >= at, `${part} after ${heard.slice(0, at).slice(-80)}\n${heard}`);
    at = next + part.length;
  }
});

test('nothing moves on the form for those who asked for stillness', async () => {
  await page.emulateMedia({ reducedMotion: 'reduce' });
  assert.deepEqual(await moving(page), []);
});

test('a keyboard is enough to compute', async () => {
  await page.focus('#left-R1');
  for (const text of Object.values(sample.left)) {
    await page.keyboard.type(text);
    const id = await page.evaluate(() => document.activeElement.id);
    const next = id === 'left-F' ? 'Enter' : 'Tab';
    await page.keyboard.press(next);
    while (
      next === 'Tab' &&
      !(await page.evaluate(() => /^left-\w+$/.test(document.activeElement.id)))
    )
      await page.keyboard.press('Tab');
  }
  await page.waitForURL('**/assessments/**');
  await page.locator('.glance').waitFor();
});

test('French and German: words, decimal comma, names for screen readers', async () => {
  await page.selectOption('.language select', 'fr');
  assert.equal(await page.getAttribute('html', 'lang'), 'fr');
  assert.equal(await page.locator('h1').innerText(), 'Nouvelle évaluation');
  await page.fill('#left-R1', '7.1');
  assert.equal(await text_of('left', 'R1'), '= 7,1 mm');
  await assert_accessible(page, 'the French form');
  await page.selectOption('.language select', 'de');
  assert.equal(await page.locator('h1').innerText(), 'Neue Auswertung');
  await page.reload();
  assert.equal(await page.locator('h1').innerText(), 'Neue Auswertung');
});

test('the form waits for the limits and offers to try again', async () => {
  await page.route('**/v1/parameters', (route) => route.abort());
  await page.reload();
  await page.getByRole('button', { name: 'Try again' }).waitFor();
  await assert_accessible(page, 'the form without limits');
  await page.unroute('**/v1/parameters');
  await page.click('text=Try again');
  await page.locator('fieldset.side').first().waitFor();
});

test('an earlier assessment can be changed and computed again', async () => {
  await fill_side(page, 'right');
  await page.fill('#subject', 'again-1');
  await submit_and_wait(page, 1);
  await page.click('text=Change and compute again');
  await page.waitForFunction(() => document.querySelector('#right-R1')?.value === '6.9');
  assert.equal(await page.inputValue('#subject'), 'again-1');
  assert.equal(await page.inputValue('#left-R1'), '');
});

/* Opens the form as "Change and compute again" does, with assessments that never were computed. */
async function again(...bodies) {
  const ids = bodies.map(([side, body]) => {
    const numbers = Object.entries(sample[side]).map(([key, text]) => [key, Number(text)]);
    return s.daemon.add({ ...Object.fromEntries(numbers), side, ...body }).id;
  });
  await page.goto(`${s.origin}/?from=${ids.join(',')}`);
  const [[side]] = bodies;
  await page.waitForFunction((at) => document.querySelector(`#${at}-R1`)?.value, side);
}

test('an earlier assessment that cannot be read is waited for, and an erased one is said', async () => {
  const numbers = Object.entries(sample.left).map(([key, text]) => [key, Number(text)]);
  const { id } = s.daemon.add({ ...Object.fromEntries(numbers), side: 'left' });
  await page.route('**/v1/assessments/*', (route) => route.abort());
  await page.goto(`${s.origin}/?from=${id}`);
  await page.locator('.errors', { hasText: 'earlier assessment cannot be read' }).waitFor();
  assert.equal(await page.locator('#left-R1').count(), 0);
  await page.unroute('**/v1/assessments/*');
  await page.getByRole('button', { name: 'Try again' }).click();
  await page.locator('#left-R1').waitFor();
  assert.equal(await page.inputValue('#left-R1'), '7.1');

  await page.goto(`${s.origin}/?from=gone`);
  await page.locator('.errors', { hasText: 'There is no such assessment.' }).waitFor();
  await fill_side(page, 'left');
  assert.equal(await page.locator('.errors').count(), 0);
});

test('what belongs to an earlier assessment comes with its numbers', async () => {
  const body = { subject: 'again-2', resolution: 'fine', measured_at: '2026-01-10T09:30:00Z' };
  await again(
    ['left', { ...body, sd: { R1: 0.5, R2: 0, F: 20 } }],
    ['right', { ...body, sd: { R1: 0.5, R2: 0, F: 20 } }],
  );
  assert.equal(await page.inputValue('#right-R1'), '6.9');
  assert.equal(await page.inputValue('#measured_at'), '2026-01-10');
  assert.equal(await page.inputValue('#sd'), 'own');
  assert.equal(await page.inputValue('#sd-R1'), '0.5');
  assert.equal(await page.inputValue('#sd-R2'), '');
  assert.equal(await page.locator('.left-behind').count(), 0);
  await submit_and_wait(page, 2);
  const [sent] = s.daemon.bodies.slice(-1);
  assert.equal(sent.resolution, 'fine');
  assert.deepEqual(sent.sd, { R1: 0.5, F: 20 });
});

test('what the form has no place for is said not to be taken over', async () => {
  await again(['left', { skin: { mu: 50 }, label: 'before the cushion' }]);
  const said = () => page.locator('.left-behind').innerText();
  assert.match(await said(), /Not taken over from the earlier assessment: its skin .*, its label/);
  await assert_accessible(page, 'the form with an earlier assessment');
  await page.click('text=Clear');
  assert.equal(await page.locator('.left-behind').count(), 0);
  assert.equal(await page.locator('#announcer').innerText(), 'The form is empty.');
});

test('two assessments that are no pair never stand in one form', async () => {
  for (const second of ['left', 'right']) {
    await again(['left', { subject: 'again-A' }], [second, { subject: 'again-B', R1: 8 }]);
    assert.equal(await page.inputValue('#subject'), 'again-A');
    assert.equal(await page.inputValue('#left-R1'), '7.1');
    assert.equal(await page.inputValue('#right-R1'), '');
  }
});

test('Back finds the form as it was left, and a new one is empty', async () => {
  const is = async (subject, R1) => {
    await page.waitForFunction((text) => document.querySelector('#left-R1')?.value === text, R1);
    assert.equal(await page.inputValue('#subject'), subject);
  };
  await fill_side(page, 'left');
  await page.fill('#subject', 'back-1');
  await page.click('text=Past assessments');
  await page.locator('h1', { hasText: 'Past assessments' }).waitFor();
  await page.goBack();
  await is('back-1', '7.1');
  await submit_and_wait(page, 1);
  await page.click('text=Change and compute again');
  await is('back-1', '7.1');
  await page.fill('#left-R1', '8');
  await page.click('text=Past assessments');
  await page.locator('h1', { hasText: 'Past assessments' }).waitFor();
  await page.goBack();
  await is('back-1', '8');
  await page.goBack();
  await page.goBack();
  await is('back-1', '7.1');
  await page.click('text=Past assessments');
  await page.click('text=New assessment');
  await is('', '');
});
