// SPDX-License-Identifier: GPL-3.0-or-later
//
// Usage: node contract.mjs OPENAPI.json ASKED.json
// Checks that the document is valid OpenAPI 3.1 and that each answer in ASKED has a status, a media
// type, the headers and a body that the document allows for its route.
import { readFile } from 'node:fs/promises';
import { Validator } from '@seriousme/openapi-schema-validator';
import Ajv2020 from 'ajv/dist/2020.js';
import addFormats from 'ajv-formats';

const [contract, asked] = await Promise.all(
  process.argv.slice(2, 4).map(async (name) => JSON.parse(await readFile(name, 'utf8'))));
const faults = [];

const verdict = await new Validator().validate(structuredClone(contract));
if (!verdict.valid) faults.push(`openapi.json is not valid: ${JSON.stringify(verdict.errors, null, 1)}`);
if (verdict.valid && contract.openapi !== '3.1.0') faults.push('openapi.json is not of version 3.1.0');

const ajv = new Ajv2020({ strict: false, allErrors: true });
addFormats(ajv);
ajv.addSchema({ $id: 'contract', ...contract });

const pointer = (...parts) =>
  parts.map((p) => `/${String(p).replace(/~/g, '~0').replace(/\//g, '~1')}`).join('');

function resolve(object, where) {
  if (!object?.$ref) return [object, where];
  const path = object.$ref.slice(2).split('/');
  return [path.reduce((o, key) => o[key], contract), path];
}

function check(a) {
  const operation = contract.paths[a.path]?.[a.method];
  const known = operation?.responses ?? { default: Object.values(contract.paths[a.path])
    .find((o) => o.responses).responses.default };
  const key = known[a.status] ? a.status : a.status >= 400 ? 'default' : null;
  if (key === null || !known[key]) return `status ${a.status} is not in the contract`;
  if (key === 'default' && a.status !== 405) return `status ${a.status} is only covered by "default"`;
  const start = operation ? ['paths', a.path, a.method, 'responses', key] : null;
  const [response, where] = resolve(known[key], start ?? []);
  for (const name of Object.keys(response.headers ?? {}))
    if (name !== 'Link' && !a.headers.includes(name.toLowerCase())) return `no header ${name}`;
  if (!response.content) return a.body === '' ? null : 'a body where there should be none';
  const media = response.content[a.type];
  if (!media) return `media type ${a.type} is not in the contract`;
  if (!a.type.endsWith('json')) return a.body === '' ? 'an empty body' : null;
  const path = where.length ? where : ['paths', a.path,
    Object.keys(contract.paths[a.path]).find((m) => contract.paths[a.path][m].responses),
    'responses', 'default'];
  const validate = ajv.getSchema(`contract#${pointer(...path, 'content', a.type, 'schema')
    .replace(/[{}]/g, encodeURIComponent)}`);
  if (!validate) return `no schema at ${path.join(' ')}`;
  return validate(JSON.parse(a.body)) ? null : ajv.errorsText(validate.errors);
}

for (const a of asked) {
  const fault = check(a);
  if (fault) faults.push(`${a.method} ${a.path} ${a.status} ${a.type}: ${fault}\n  ${a.body.slice(0, 300)}`);
}
if (faults.length) {
  console.error(faults.join('\n'));
  process.exit(1);
}
console.log(`openapi.json is valid; ${asked.length} answers fit`);
