// SPDX-License-Identifier: GPL-3.0-or-later
//
// Bundles the clinic page into dist/: index.html, list.html, result.html and their like in other languages, assets/app.js, assets/app.css and, as a file of
// its own that is fetched only when somebody opens the 3-D view, assets/view3d.js. The names carry
// no hash: the daemon serves them with an ETag, so a browser asks once and keeps what it has.
import { build } from 'esbuild';
import { cp, mkdir, readdir, readFile, rm, stat, writeFile } from 'node:fs/promises';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';

const here = dirname(fileURLToPath(import.meta.url));
const dist = join(here, 'dist');
const first_page_limit = 100 * 1024;

const exists = (path) =>
  stat(path).then(
    () => true,
    () => false,
  );

/* `table2:inputs` is examples/table2.csv as text; `table2:results` is what `make-reference.mjs`
 * made of it with `ischia cohort`, or null while nobody has run it: then no strip plot is shown. */
const table2 = {
  name: 'table2',
  setup(bundle) {
    const files = {
      'table2:inputs': { path: join(here, '../examples/table2.csv'), loader: 'text', absent: '' },
      'table2:results': {
        path: join(here, 'reference/table2.json'),
        loader: 'json',
        absent: 'null',
      },
    };
    bundle.onResolve({ filter: /^table2:/ }, (a) => ({ path: a.path, namespace: 'table2' }));
    bundle.onLoad({ filter: /.*/, namespace: 'table2' }, async (a) => {
      const { path, loader, absent } = files[a.path];
      return { contents: (await exists(path)) ? await readFile(path, 'utf8') : absent, loader };
    });
  },
};

/* The words that the page has a use for, of words/LANGUAGE.json. */
const page_words = (text) =>
  Object.fromEntries(
    Object.entries(JSON.parse(text)).filter(([key]) => !key.startsWith('daemon.')),
  );

const words = {
  name: 'words',
  setup(bundle) {
    bundle.onLoad({ filter: /[/\\]words[/\\]\w+\.json$/ }, async (a) => ({
      contents: JSON.stringify(page_words(await readFile(a.path, 'utf8'))),
      loader: 'json',
    }));
  },
};

const common = {
  bundle: true,
  minify: true,
  format: 'esm',
  target: ['es2022', 'chrome109', 'firefox115', 'safari16.4'],
  jsx: 'automatic',
  jsxImportSource: 'preact',
  legalComments: 'none' /* licences.txt has them whole */,
  metafile: true,
  logLevel: 'warning',
  plugins: [table2, words],
};

async function first_page_bytes() {
  const files = ['index.html', 'assets/app.js', 'assets/app.css', 'assets/icon.svg'];
  const sizes = await Promise.all(
    files.map(async (f) => gzipSync(await readFile(join(dist, f)), { level: 9 }).length),
  );
  return sizes.reduce((a, b) => a + b, 0);
}

/* The licence texts of the packages that ended up in a bundle: their terms ask for that. */
async function write_licences(metafiles) {
  const inputs = metafiles.flatMap((m) => Object.keys(m.inputs));
  const names = new Set(
    inputs.flatMap((path) => /node_modules\/((?:@[^/]+\/)?[^/]+)/.exec(path)?.[1] ?? []),
  );
  const texts = [];
  for (const name of [...names].sort()) {
    const folder = join(here, 'node_modules', name);
    const { version, license } = JSON.parse(await readFile(join(folder, 'package.json'), 'utf8'));
    const file = (await readdir(folder)).find((f) => /^licen[cs]e/i.test(f));
    const text = file ? await readFile(join(folder, file), 'utf8') : `Licence: ${license}\n`;
    texts.push(`${name} ${version} (${license})\n\n${text.trim()}\n`);
  }
  await writeFile(join(dist, 'assets/licences.txt'), texts.join(`\n${'-'.repeat(78)}\n\n`));
}

const bundle = async (entry, out) =>
  (await build({ ...common, entryPoints: [join(here, entry)], outfile: join(dist, out) })).metafile;

const html = (text) =>
  text.replace(/[&<>"]/g, (c) => ({ '&': '&amp;', '<': '&lt;', '>': '&gt;', '"': '&quot;' })[c]);

/* A template in one language: {{key}}, or {{key|name=value|…}} for a string that names values;
 * `parts` are put in as they are. */
function in_language(template, words, parts) {
  return template.replace(/\{\{([^{}]+)\}\}/g, (_, inside) => {
    const [key, ...given] = inside.split('|');
    if (key in parts) return parts[key];
    const values = Object.fromEntries(given.map((g) => g.split('=')));
    if (words[key] === undefined) throw new Error(`no word ${key}`);
    const mark = words['number.decimal'];
    return html(words[key].replace(/\{(\w+)\}/g, (__, name) => values[name].replace('.', mark)));
  });
}

/* To the same address in each language. */
function language_links(tag, all) {
  const link = ([code, of]) =>
    `<a href="?lang=${code}" lang="${code}" hreflang="${code}"` +
    `${code === tag ? ' aria-current="true"' : ''}>${html(of['language.name'])}</a>`;
  return Object.entries(all).map(link).join(' ');
}

async function all_words() {
  const files = (await readdir(join(here, '../words'))).filter((f) => f.endsWith('.json'));
  const all = {};
  for (const file of ['en.json', ...files.filter((f) => f !== 'en.json').sort()])
    all[file.slice(0, -5)] = JSON.parse(await readFile(join(here, '../words', file), 'utf8'));
  return all;
}

/* list.html is English, list.fr.html French: the daemon sends the one that the reader wants. They
 * differ in what stands there without the script, and a page is called as its heading. */
async function write_pages() {
  const shell = await readFile(join(here, 'index.html'), 'utf8');
  const all = await all_words();
  for (const name of ['index', 'list', 'result']) {
    const inside = await readFile(join(here, 'plain', `${name}.html`), 'utf8');
    for (const [tag, words] of Object.entries(all)) {
      const main = in_language(inside, words, { language: tag });
      const title = /<h1>(.*)<\/h1>/.exec(main)[1];
      const parts = { language: tag, languages: language_links(tag, all), main, title };
      const file = tag === 'en' ? `${name}.html` : `${name}.${tag}.html`;
      await writeFile(join(dist, file), in_language(shell, words, parts));
    }
  }
}

await rm(dist, { recursive: true, force: true });
await mkdir(join(dist, 'assets'), { recursive: true });
await write_licences([
  await bundle('src/main.tsx', 'assets/app.js'),
  await bundle('src/style/app.css', 'assets/app.css'),
  await bundle('src/view3d/scene.ts', 'assets/view3d.js'),
]);
await cp(join(here, 'public/icon.svg'), join(dist, 'assets/icon.svg'));
await write_pages();

const bytes = await first_page_bytes();
console.log(
  `first page: ${(bytes / 1024).toFixed(1)} KB compressed (limit ${first_page_limit / 1024})`,
);
if (bytes > first_page_limit) {
  console.error(
    'The first page is too large: move what it does not need at once out of src/main.tsx.',
  );
  process.exit(1);
}
