// SPDX-License-Identifier: GPL-3.0-or-later
// The page where JavaScript is off, or never arrives.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { readFile } from 'node:fs/promises';
import { assert_accessible, sample, stage } from './browser.mjs';
import { parameters } from './stand_in.mjs';

let s;
before(async () => {
  s = await stage();
});
after(() => s.finish());

test('the plain form repeats the limits that the daemon serves', async () => {
  const page = await s.page({ javaScriptEnabled: false });
  await page.goto(`${s.origin}/`);
  for (const { key, unit, accepted } of parameters.parameters) {
    assert.equal(
      await page.locator(`#${key}-range`).innerText(),
      `${accepted.min} to ${accepted.max} ${unit}`,
    );
  }
  await page.context().close();
});

test('a plain submit is answered with the report of the new assessment', async () => {
  const page = await s.page({ javaScriptEnabled: false });
  await page.goto(`${s.origin}/`);
  assert.ok(await page.locator('.plain-form').isVisible());
  for (const [key, text] of Object.entries(sample.left)) await page.fill(`#${key}`, text);
  await page.selectOption('#side', 'right');
  await page.fill('#subject', 'P-017');
  await page.click('button[type=submit]');
  await page.waitForURL(/\/v1\/assessments\/[^/]+\/report$/);
  const [document] = [...s.daemon.documents.values()].slice(-1);
  assert.equal(document.side, 'right');
  assert.equal(document.subject, 'P-017');
  assert.equal(document.parameters.F, 258);
  await page.context().close();
});

for (const tag of ['en', 'de', 'fr'])
  test(`without the script a result and the list say what there is, in ${tag}`, async () => {
    const text = await readFile(new URL(`../../words/${tag}.json`, import.meta.url), 'utf8');
    const words = JSON.parse(text);
    const page = await s.page({ javaScriptEnabled: false, locale: tag });
    await page.goto(`${s.origin}/assessments/0192f0c1?with=0192f0c2`);
    assert.equal(await page.locator('h1').innerText(), words['result.title']);
    assert.ok(await page.getByText(words['plain.result']).isVisible());
    await page.getByRole('link', { name: words['result.file.report'] }).click();
    await page.waitForURL(`**/v1/assessments/0192f0c1/report?lang=${tag}`);

    await page.goto(`${s.origin}/assessments?subject=P-017`);
    assert.equal(await page.locator('h1').innerText(), words['list.title']);
    assert.ok(await page.getByText(words['plain.list']).isVisible());
    await page.getByRole('link', { name: words['plain.list.data'] }).click();
    await page.waitForURL('**/v1/assessments');
    await page.context().close();
  });

test('when the script does not arrive the plain form appears, and is accessible', async () => {
  const page = await s.page();
  await page.route('**/assets/app.js', (route) => route.abort());
  await page.goto(`${s.origin}/`);
  await page.locator('.plain-form').waitFor({ state: 'visible', timeout: 8000 });
  await assert_accessible(page, 'the plain form');
  await page.context().close();
});
