// SPDX-License-Identifier: GPL-3.0-or-later
// The 3-D view: loaded on demand, under the page's policy, by keyboard, and what is shown instead
// where there is no WebGL.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { after, before, test } from 'node:test';
import {
  assert_accessible,
  assert_clean,
  fill_side,
  launch,
  open_form,
  stage,
  submit_and_wait,
  watched_page,
} from './browser.mjs';

let s;
before(async () => {
  s = await stage({ webgl: true });
});
after(() => s.finish());

async function result_page(page, origin = s.origin) {
  await open_form(page, origin);
  await fill_side(page, 'left');
  await submit_and_wait(page, 1);
}

/* How many distinct colours a PNG of the view has, told by the browser itself. */
const colours_of = (page, png) =>
  page.evaluate(async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    const image = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
    const canvas = new OffscreenCanvas(image.width, image.height);
    const context = canvas.getContext('2d');
    context.drawImage(image, 0, 0);
    const { data } = context.getImageData(0, 0, image.width, image.height);
    const seen = new Set();
    for (let i = 0; i < data.length; i += 4)
      seen.add((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]);
    return seen.size;
  }, png.toString('base64'));

test('the bundle is fetched only when the view is opened, and the view draws', async () => {
  const page = await s.page();
  s.daemon.requests.length = 0;
  await result_page(page);
  assert.ok(!s.daemon.requests.includes('GET /assets/view3d.js'));
  assert.ok(!s.daemon.requests.some((r) => r.endsWith('field.vtu')));
  await page.getByRole('button', { name: '3-D' }).click();
  await page.locator('.view3d canvas').waitFor();
  await page.locator('.view3d .loading').waitFor({ state: 'detached' });
  assert.ok(s.daemon.requests.includes('GET /assets/view3d.js'));
  const picture = () => page.locator('.view3d .canvas').screenshot();
  const coloured = await picture();
  assert.ok((await colours_of(page, coloured)) > 40, 'the view is blank');
  await assert_accessible(page, 'the 3-D view');

  const changed = async (act) => {
    const before_act = await picture();
    await act();
    await page.waitForTimeout(150);
    assert.ok(!before_act.equals(await picture()), act.toString());
  };
  await changed(() => page.getByLabel('Cut open').uncheck());
  await changed(() => page.getByLabel('Cut open').check());
  const show = page.getByLabel('Show', { exact: true });
  await changed(() => show.selectOption('shear'));
  await changed(() => show.selectOption('compression'));
  await changed(() => show.selectOption('both'));
  await changed(() => show.selectOption(''));
  await changed(() => page.getByLabel('Seat').uncheck());
  await changed(() => page.getByLabel('Bone').uncheck());
  await changed(() => page.selectOption('.view3d select', 'E_comp'));
  await page.locator('.view3d .canvas').focus();
  await changed(() => page.keyboard.press('ArrowLeft'));
  await changed(() => page.keyboard.press('+'));
  await changed(() => page.getByRole('button', { name: 'Reset view' }).click());
  assert_clean(page);
  await page.context().close();
});

test('a criterion that no muscle is over is said to have no bodies', async () => {
  const page = await s.page();
  await open_form(page, s.origin);
  await page.fill('#subject', 'shear-3d');
  await fill_side(page, 'left');
  await submit_and_wait(page, 1);
  await page.getByRole('button', { name: '3-D' }).click();
  await page.locator('.view3d .loading').waitFor({ state: 'detached' });
  const show = page.getByLabel('Show', { exact: true });
  await show.selectOption('shear');
  assert.equal(await page.getByText('No muscle is over it.').count(), 0);
  await show.selectOption('both');
  await page.getByText('No muscle is over it.').waitFor();
  await assert_accessible(page, 'the 3-D view without bodies');
  assert_clean(page);
  await page.context().close();
});

test('the load slider walks the computed load path from nothing to full', async () => {
  const page = await s.page();
  await result_page(page);
  await page.getByRole('button', { name: '3-D' }).click();
  await page.locator('.view3d .loading').waitFor({ state: 'detached' });
  const slider = page.getByRole('slider', { name: 'Load' });
  const output = page.locator('.view3d output');
  assert.match(await output.innerText(), /^258 N · travel 30\.0 mm/);
  assert.equal(await page.locator('.view3d .load .hint').count(), 0);
  await slider.focus();
  await page.keyboard.press('Home');
  assert.match(await output.innerText(), /^0 N · travel 0\.0 mm/);
  assert.match(
    await page.locator('.view3d .load .hint').innerText(),
    /scaled to the computed seat travel/,
  );
  await assert_accessible(page, 'the 3-D view, unloaded');
  assert_clean(page);
  await page.context().close();
});

test('the picture can be saved', async () => {
  const page = await s.page();
  await result_page(page);
  await page.getByRole('button', { name: '3-D' }).click();
  await page.locator('.view3d .loading').waitFor({ state: 'detached' });
  const [download] = await Promise.all([
    page.waitForEvent('download'),
    page.getByRole('button', { name: 'Save picture' }).click(),
  ]);
  const png = await readFile(await download.path());
  assert.ok((await colours_of(page, png)) > 40, 'the saved picture is blank');
  assert_clean(page);
  await page.context().close();
});

test('a field that cannot be read is said, and the section is shown', async () => {
  const page = await s.page();
  await page.route('**/field.vtu', (route) => route.fulfill({ body: '<VTKFile/>' }));
  await result_page(page);
  await page.getByRole('button', { name: '3-D' }).click();
  await page.getByText('The 3-D view could not be shown: not a VTU file').waitFor();
  assert.ok(await page.locator('.picture img').isVisible());
  assert_clean(page);
  await page.context().close();
});

test('without WebGL the section takes its place', async () => {
  const browser = await launch();
  const page = await watched_page(browser, s.origin);
  await result_page(page);
  await page.getByRole('button', { name: '3-D' }).click();
  await page.getByText('cannot draw 3-D (no WebGL)').waitFor();
  assert.ok(await page.locator('.picture img').isVisible());
  assert.ok(
    !(await page.evaluate(() =>
      performance.getEntriesByType('resource').some((e) => e.name.includes('view3d')),
    )),
  );
  await assert_accessible(page, 'the result without WebGL');
  assert_clean(page);
  await browser.close();
});
