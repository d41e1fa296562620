// SPDX-License-Identifier: GPL-3.0-or-later
//
// Computes the 26 sides of Table 2 with `ischia cohort` and writes what the strip plot needs to
// reference/table2.json:  node make-reference.mjs ISCHIA [OUT]
// Run it when the solver's numbers or the model's version change; a side that does not converge is
// left out.
import { execFileSync } from 'node:child_process';
import { mkdir, mkdtemp, readFile, rm, writeFile } from 'node:fs/promises';
import { availableParallelism, tmpdir } from 'node:os';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const here = dirname(fileURLToPath(import.meta.url));
const input = join(here, '../examples/table2.csv');
const [ischia, out = join(here, 'reference/table2.json')] = process.argv.slice(2);
const digits = 6; /* a plot needs no more, and another compiler then writes the same file */
/* What the cohort is computed with, as nothing else is said: the defaults of GET /v1/parameters. */
const computed_with = {
  resolution: 'standard',
  options: {
    skin: { mu: 67, thickness: 1 },
    model: { L_over_h: 2, bulk_ratio: 2000, friction: 0.4, R2_surface: 0, embed_over_R1: 1 },
  },
};
const columns = ['eps_max', 'eps_max_error', 'volume_shear_mm3', 'volume_both_mm3'];

function rows_of(csv) {
  const [header, ...lines] = csv.trim().split(/\r?\n/);
  const names = header.split(',');
  return lines.map((line) => {
    const cells = line.split(',');
    return Object.fromEntries(names.map((name, i) => [name, cells[i]]));
  });
}

async function cohort() {
  const folder = await mkdtemp(join(tmpdir(), 'ischia-reference-'));
  try {
    const csv = join(folder, 'cohort.csv');
    execFileSync(ischia, ['cohort', input, '-j', String(availableParallelism()), '-o', csv], {
      stdio: ['ignore', 'inherit', 'inherit'],
    });
    return rows_of(await readFile(csv, 'utf8'));
  } finally {
    await rm(folder, { recursive: true });
  }
}

if (!ischia) {
  console.error('usage: node make-reference.mjs ISCHIA [OUT]');
  process.exit(2);
}
const [, name, version] = /^model (\S+) (\d+)$/m.exec(
  execFileSync(ischia, ['version'], { encoding: 'utf8' }),
);
const model = { name, version: Number(version) };
const rows = await cohort();
const converged = rows.filter((row) => row.status === 'succeeded');
const sides = converged.map((row) => ({
  subject: row.subject,
  side: row.side,
  ...Object.fromEntries(columns.map((name) => [name, Number(Number(row[name]).toPrecision(digits))])),
}));
await mkdir(dirname(out), { recursive: true });
await writeFile(out, `${JSON.stringify({ model, ...computed_with, sides }, null, 2)}\n`);
console.log(`${out}: ${sides.length} of ${rows.length} sides`);
