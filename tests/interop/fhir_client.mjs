// SPDX-License-Identifier: GPL-3.0-or-later
//
// Usage: node fhir_client.mjs BASE < Parameters.json
// fhir-kit-client asks for everything that a record system would; what it was told is the output.
import { readFileSync } from 'node:fs';
import fhirKit from 'fhir-kit-client';

const Client = fhirKit.default ?? fhirKit;
const client = new Client({ baseUrl: process.argv[2] });
const input = JSON.parse(readFileSync(0, 'utf8'));
const told = {};
const refused = (promise) => promise.then(
  () => ({ status: 'none' }),
  (error) => ({ status: error.response?.status, outcome: error.response?.data?.resourceType }));

told.metadata = await client.capabilityStatement();
told.assessed = await client.operation({ name: 'assess', method: 'POST', input });
const risk = told.assessed.entry.find((e) => e.resource.resourceType === 'RiskAssessment').resource;
told.read = await client.read({ resourceType: 'RiskAssessment', id: risk.id });
told.basis = await Promise.all(risk.basis.map((b) => client.resolve({ reference: b.reference })));
told.performer = await client.resolve({ reference: risk.performer.reference });
told.report = await client.read({ resourceType: 'DiagnosticReport', id: risk.id });
told.definition = await client.read({ resourceType: 'OperationDefinition', id: 'assess' });
told.search = await client.search({
  resourceType: 'RiskAssessment',
  searchParams: { subject: risk.subject.reference, status: 'final', _count: 1 },
});
told.next = await client.nextPage({ bundle: told.search });
told.posted = await client.search({
  resourceType: 'RiskAssessment',
  searchParams: { subject: risk.subject.reference },
  options: { postSearch: true },
});
told.missing = await refused(client.read({ resourceType: 'RiskAssessment', id: 'nobody' }));
told.bad = await refused(client.operation({
  name: 'assess', method: 'POST', input: { resourceType: 'Parameters', parameter: [] },
}));
console.log(JSON.stringify(told));
