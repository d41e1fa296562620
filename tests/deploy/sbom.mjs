// SPDX-License-Identifier: GPL-3.0-or-later
// Holds a list of parts against CycloneDX's own strict schema. Usage: node sbom.mjs FILE.json
import { readFileSync } from 'node:fs';
import { Spec, Validation } from '@cyclonedx/cyclonedx-library';

const validator = new Validation.JsonStrictValidator(Spec.Version.v1dot5);
const text = readFileSync(process.argv[2], 'utf8');
const fault = await validator.validate(text);
if (fault !== null) {
  console.log(JSON.stringify(fault, null, 1));
  process.exit(1);
}
/* A validator that could not read its schema would be content with anything. */
const broken = { ...JSON.parse(text), bomFormat: 'Other' };
if ((await validator.validate(JSON.stringify(broken))) === null) process.exit(2);
console.log('fits CycloneDX 1.5');
