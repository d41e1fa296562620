// SPDX-License-Identifier: GPL-3.0-or-later
// What is shipped: its size, what it may ask for, how soon it can be used, and the parts that can
// be tried without a browser.
import assert from 'node:assert/strict';
import { readdir, readFile } from 'node:fs/promises';
import { createRequire } from 'node:module';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';
import { assert_clean, assert_usable_within, dist, stage } from './browser.mjs';
import { parameters } from './stand_in.mjs';

let s;
before(async () => {
  s = await stage();
});
after(() => s.finish());

const source = fileURLToPath(new URL('../../static', import.meta.url));
const esbuild = createRequire(join(source, 'package.json'))('esbuild');

test('the first page is at most 100 KB compressed, all it fetches counted', async () => {
  const page = await s.page();
  const fetched = new Map();
  page.on('response', async (r) => fetched.set(r.url(), gzipSync(await r.body()).length));
  await page.goto(`${s.origin}/`, { waitUntil: 'networkidle' });
  const total = [...fetched.values()].reduce((a, b) => a + b, 0);
  assert.ok(fetched.size >= 4, [...fetched.keys()].join());
  assert.ok(total <= 100 * 1024, `${total} bytes`);
  assert_clean(page);
  await page.context().close();
});

test('the form can be used within 200 ms of its arrival', async () => {
  const page = await s.page();
  await page.goto(`${s.origin}/`); /* once, so that the browser itself is warm */
  await assert_usable_within(page, 200, 'responseStart');
  await page.context().close();
});

test('no inline script, no inline style, no address of anybody else', async () => {
  const html = await readFile(join(dist, 'index.html'), 'utf8');
  assert.doesNotMatch(html, /<script(?![^>]*\ssrc=)|<style|\sstyle=|\son\w+=|javascript:/i);
  for (const name of ['index.html', 'assets/app.css', 'assets/app.js']) {
    const text = await readFile(join(dist, name), 'utf8');
    const addresses = (text.match(/https?:\/\/[^"'`\s)]+/g) ?? []).filter(
      (a) => !a.startsWith('http://www.w3.org/'),
    );
    assert.deepEqual(addresses, [], name);
  }
});

test('the licences of what is bundled are shipped', async () => {
  const text = await readFile(join(dist, 'assets/licences.txt'), 'utf8');
  for (const name of ['preact', '@kitware/vtk.js', 'gl-matrix'])
    assert.ok(text.includes(`${name} `), name);
});

async function load(file) {
  const { outputFiles } = await esbuild.build({
    entryPoints: [join(source, file)],
    bundle: true,
    write: false,
    format: 'esm',
    logLevel: 'silent',
  });
  return import(
    `data:text/javascript;base64,${Buffer.from(outputFiles[0].contents).toString('base64')}`
  );
}

test('numbers as people type them', async () => {
  const { parse_number, difference } = await load('src/number.ts');
  const good = {
    7.1: 7.1,
    '7,1': 7.1,
    ' 7 ': 7,
    '.5': 0.5,
    '5,': 5,
    '+3': 3,
    '-2,5': -2.5,
    '\u22122': -2,
    '\u00a08\u202f': 8,
    '007': 7,
  };
  for (const [text, value] of Object.entries(good))
    assert.deepEqual(parse_number(text), { kind: 'number', value }, text);
  for (const text of ['1,234.5', '1.234,5', '1,2,3', '1.2.3', '..1'])
    assert.equal(parse_number(text).kind, 'ambiguous', text);
  for (const text of ['x', '7 mm', '1e3', '0x10', '1 234', '--1', '.', ',', '∞', 'NaN', '٣'])
    assert.equal(parse_number(text).kind, 'not_a_number', text);
  for (const text of ['', '  ', '\u00a0']) assert.equal(parse_number(text).kind, 'empty');
  assert.equal(difference(41.2, 10.1), 31.1);
});

const languages = (await readdir(join(source, '../words')))
  .filter((f) => f.endsWith('.json'))
  .map((f) => f.slice(0, -5));
const words = Object.fromEntries(
  await Promise.all(
    languages.map(async (tag) => [
      tag,
      JSON.parse(await readFile(join(source, '../words', `${tag}.json`), 'utf8')),
    ]),
  ),
);

test('the page has the words of every language, and none of the daemon’s', async () => {
  assert.deepEqual(languages.toSorted(), ['de', 'en', 'fr']);
  const bundle = await readFile(join(dist, 'assets/app.js'), 'utf8');
  for (const tag of languages) {
    const all = Object.entries(words[tag]);
    const of_the_page = all.filter(([key]) => !key.startsWith('daemon.')).map(([, text]) => text);
    for (const [key, text] of all) {
      if (/["'`\\\u007f-\uffff]/.test(text) || text.length < 20) continue; /* written otherwise */
      const wanted = of_the_page.some((t) => t.includes(text));
      assert.equal(bundle.includes(text), wanted, `${tag} ${key}`);
    }
  }
});

test('the page without JavaScript is there in every language, with no word left open', async () => {
  for (const tag of languages) {
    const html = await readFile(
      join(dist, tag === 'en' ? 'index.html' : `index.${tag}.html`),
      'utf8',
    );
    assert.ok(html.includes(`<html lang="${tag}">`), tag);
    assert.ok(html.includes(`action="/v1/assessments?lang=${tag}"`), tag);
    assert.doesNotMatch(html, /[{}]{2}|\{\w+\}/);
    const { accepted } = parameters.parameters.find(({ key }) => key === 'muM');
    const low = String(accepted.min).replace('.', words[tag]['number.decimal']);
    assert.ok(html.includes(`${low} `), `${tag}: ${low}`);
    assert.ok(html.includes(words[tag]['daemon.param.muM.name']), tag);
    for (const other of languages) assert.ok(html.includes(`href="?lang=${other}"`), other);
  }
});

/* Words between tags, or in an attribute that is read out, belong into words/. */
test('no text for people stands in the components', async () => {
  const folder = join(source, 'src');
  const files = (await readdir(folder, { recursive: true })).filter((f) => f.endsWith('.tsx'));
  assert.ok(files.length > 12);
  for (const file of files) {
    const code = (await readFile(join(folder, file), 'utf8')).replace(/\/\*[^]*?\*\//g, '');
    const found = [
      ...code.matchAll(/^ *([A-Z][a-z]+ [a-z][^={}();<>]*)$/gm),
      ...code.matchAll(/<[a-z]\w*[^<>]*>\s*([A-Za-z][a-z]{2,}[^<>{}=]*)</g),
      ...code.matchAll(/(?:aria-label|title|alt|placeholder)="([^"]+)"/g),
    ].map((m) => m[1]);
    assert.deepEqual(found, [], file);
  }
});

test('axis ticks are round and cover the axis', async () => {
  const { ticks } = await load('src/result/axis.ts');
  assert.deepEqual(ticks(2.1, 3), [0, 1, 2]);
  assert.deepEqual(ticks(0.5, 3), [0, 0.2, 0.4]);
  assert.deepEqual(ticks(258, 4), [0, 100, 200]);
  assert.deepEqual(ticks(0, 3), [0]);
});

test('the surface of two bricks, and its mirror images', async () => {
  const { boundary_faces, place, cells, quarters } = await load('src/view3d/surface.ts');
  /* Bricks 0 and 1 share the face x = 1. */
  const corners = Int32Array.from([0, 1, 4, 3, 6, 7, 10, 9, 1, 2, 5, 4, 7, 8, 11, 10]);
  const field = { element_count: 2, corners };
  assert.equal(boundary_faces(field, () => true).count, 10);
  const one = boundary_faces(field, (e) => e === 1);
  assert.equal(one.count, 6);
  const motion = {
    at: (n, axis) => [n % 3, Math.floor(n / 3) % 2, Math.floor(n / 6)][axis],
    tip: 0,
  };
  const points = place(one, motion, 1, quarters);
  const polys = cells(one, quarters);
  assert.equal(points.length, 4 * 6 * 4 * 3);
  /* Every face of every image looks outwards: the signed volume is that of four unit bricks. */
  let volume = 0;
  const at = (i) => points.subarray(3 * i, 3 * i + 3);
  for (let k = 0; k < polys.length; k += 5) {
    assert.equal(polys[k], 4);
    const [a, b, c, d] = [1, 2, 3, 4].map((i) => at(polys[k + i]));
    for (const [p, q, r] of [
      [a, b, c],
      [a, c, d],
    ])
      volume +=
        (p[0] * (q[1] * r[2] - q[2] * r[1]) +
          p[1] * (q[2] * r[0] - q[0] * r[2]) +
          p[2] * (q[0] * r[1] - q[1] * r[0])) /
        6;
  }
  assert.ok(Math.abs(volume - 4) < 1e-6, String(volume));
});
