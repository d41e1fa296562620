// SPDX-License-Identifier: GPL-3.0-or-later
//
// Bundles the clinic page into dist/: index.html, assets/app.js, assets/app.css and, as a file of
// its own that is fetched only when somebody opens the 3-D view, assets/view3d.js. The names carry
// no hash: the daemon serves them with an ETag, so a browser asks once and keeps what it has.
import { build } from 'esbuild';
import { cp, mkdir, readFile, rm, stat, writeFile } from 'node:fs/promises';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';

const here = dirname(fileURLToPath(import.meta.url));
const dist = join(here, 'dist');
const first_page_limit = 100 * 1024;

const exists = (path) => stat(path).then(() => true, () => false);

/* `table2:inputs` is examples/table2.csv as text; `table2:results` is what `make-reference.mjs`
 * made of it with `ischia cohort`, or null while nobody has run it: then no strip plot is shown. */
const table2 = {
  name: 'table2',
  setup(bundle) {
    const files = {
      'table2:inputs': { path: join(here, '../examples/table2.csv'), loader: 'text', absent: '' },
      'table2:results': { path: join(here, 'reference/table2.json'), loader: 'json', absent: 'null' },
    };
    bundle.onResolve({ filter: /^table2:/ }, (a) => ({ path: a.path, namespace: 'table2' }));
    bundle.onLoad({ filter: /.*/, namespace: 'table2' }, async (a) => {
      const { path, loader, absent } = files[a.path];
      return { contents: (await exists(path)) ? await readFile(path, 'utf8') : absent, loader };
    });
  },
};

const common = {
  bundle: true,
  minify: true,
  format: 'esm',
  target: ['es2022', 'chrome109', 'firefox115', 'safari16.4'],
  jsx: 'automatic',
  jsxImportSource: 'preact',
  legalComments: 'linked',
  logLevel: 'warning',
  plugins: [table2],
};

async function first_page_bytes() {
  const files = ['index.html', 'assets/app.js', 'assets/app.css', 'assets/icon.svg'];
  const sizes = await Promise.all(
    files.map(async (f) => gzipSync(await readFile(join(dist, f)), { level: 9 }).length));
  return sizes.reduce((a, b) => a + b, 0);
}

await rm(dist, { recursive: true, force: true });
await mkdir(join(dist, 'assets'), { recursive: true });
await build({ ...common, entryPoints: [join(here, 'src/main.tsx')], outfile: join(dist, 'assets/app.js'),
  external: ['/assets/*'] });
await build({ ...common, entryPoints: [join(here, 'src/style/app.css')], outfile: join(dist, 'assets/app.css') });
await build({ ...common, entryPoints: [join(here, 'src/view3d/scene.ts')], outfile: join(dist, 'assets/view3d.js') });
await cp(join(here, 'public/icon.svg'), join(dist, 'assets/icon.svg'));
await writeFile(join(dist, 'index.html'), await readFile(join(here, 'index.html')));

const bytes = await first_page_bytes();
console.log(`first page: ${(bytes / 1024).toFixed(1)} KB compressed (limit ${first_page_limit / 1024})`);
if (bytes > first_page_limit) {
  console.error('The first page is too large: move what it does not need at once out of src/main.tsx.');
  process.exit(1);
}
