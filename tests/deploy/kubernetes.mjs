// SPDX-License-Identifier: GPL-3.0-or-later
//
// The manifests of deploy/kubernetes against the schemas of Kubernetes, strictly: a key that no
// schema asks for is a fault. Then what they promise: probes, a budget, a queue to scale by,
// nobody root, nothing writable but the state; and that names agree with each other and with the
// program's options and metrics.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { parse, parseAllDocuments } from 'yaml';

const folder = fileURLToPath(new URL('../../deploy/kubernetes/', import.meta.url));
const ischiad = process.env.ISCHIAD;

const documents = readdirSync(folder)
  .filter((name) => name.endsWith('.yaml'))
  .flatMap((name) =>
    parseAllDocuments(readFileSync(join(folder, name), 'utf8'), { strict: true, merge: false }).map(
      (document) => {
        assert.deepEqual(document.errors, [], name);
        return { name, object: document.toJS() };
      },
    ),
  );
const one = (kind) => {
  const found = documents.filter(
    ({ name, object }) => name === 'ischia.yaml' && object.kind === kind,
  );
  assert.equal(found.length, 1, `one ${kind}`);
  return found[0].object;
};

/* The schemas allow keys that they do not know. A validator looks at each key that it does know,
 * whether it is there or not: one that is there and was not looked at is a slip. */
function watched(object, path, unseen) {
  if (object === null || typeof object !== 'object') return object;
  const copy = Array.isArray(object) ? [] : {};
  for (const [key, value] of Object.entries(object)) {
    copy[key] = watched(value, `${path}/${key}`, unseen);
    if (!Array.isArray(object)) unseen.add(`${path}/${key}`);
  }
  return new Proxy(copy, {
    get(target, key) {
      unseen.delete(`${path}/${String(key)}`);
      return target[key];
    },
  });
}

async function faults(object) {
  const group = object.apiVersion;
  const module = await import(`kubernetes-models/${group}/${object.kind}`);
  const schema = module[object.kind].prototype;
  const unseen = new Set();
  const copy = watched(object, '', unseen);
  const found = [];
  try {
    schema.validate.call(copy);
  } catch (error) {
    found.push(String(error.message));
  }
  return [...found, ...[...unseen].map((path) => `no schema has ${path}`)];
}

for (const { name, object } of documents)
  test(`${name}: ${object.kind} fits its schema`, async () => {
    assert.deepEqual(await faults(object), []);
  });

test('slips are found', async () => {
  const slips = [
    (pod) => (pod.containers[0].readinesProbe = {}),
    (pod) => (pod.containers[0].ports[0].containerPort = 'eighty'),
    (pod) => (pod.containers[0].securityContext.readOnlyRootFileSystem = true),
    (pod) => delete pod.containers[0].name,
    (pod) => (pod.volumes[0].emptydir = {}),
  ];
  for (const slip of slips) {
    const object = structuredClone(one('Deployment'));
    slip(object.spec.template.spec);
    assert.notDeepEqual(await faults(object), [], slip);
  }
});

test('nobody is root and nothing is writable but the state', () => {
  const pod = one('Deployment').spec.template.spec;
  assert.equal(pod.securityContext.runAsNonRoot, true);
  assert.equal(pod.securityContext.seccompProfile.type, 'RuntimeDefault');
  assert.equal(pod.automountServiceAccountToken, false);
  for (const { securityContext, volumeMounts, resources } of pod.containers) {
    assert.equal(securityContext.readOnlyRootFilesystem, true);
    assert.equal(securityContext.allowPrivilegeEscalation, false);
    assert.deepEqual(securityContext.capabilities, { drop: ['ALL'] });
    assert.deepEqual(volumeMounts.map((v) => v.mountPath), ['/var/lib/ischia']);
    assert.ok(resources.limits.memory && resources.requests.cpu);
  }
  const file = readFileSync(join(folder, '../container/Containerfile'), 'utf8');
  const user = /^USER (\d+):(\d+)$/m.exec(file);
  assert.deepEqual(
    [pod.securityContext.runAsUser, pod.securityContext.runAsGroup].map(String),
    user.slice(1),
  );
});

test('probes ask what the program answers, and a stop waits for the drain', () => {
  const { spec } = one('Deployment').spec.template;
  const [container] = spec.containers;
  const routes = execFileSync(ischiad, ['--print-routes'], { encoding: 'utf8' });
  for (const probe of ['startupProbe', 'livenessProbe', 'readinessProbe']) {
    const { path, port, httpHeaders } = container[probe].httpGet;
    assert.match(routes, new RegExp(`^GET ${path} open$`, 'm'));
    assert.ok(container.ports.some((p) => p.name === port));
    assert.deepEqual(httpHeaders, [{ name: 'Host', value: 'localhost' }]);
  }
  assert.equal(container.readinessProbe.httpGet.path, '/readyz');
  const drain = Number(one('ConfigMap').data.ISCHIA_DRAIN_TIMEOUT);
  assert.ok(spec.terminationGracePeriodSeconds > drain);
});

test('every setting is an option of the program, and a good one', () => {
  const { data } = one('ConfigMap');
  const { env } = one('Deployment').spec.template.spec.containers[0];
  const printed = execFileSync(ischiad, ['--print-config'], {
    encoding: 'utf8',
    env: { PATH: process.env.PATH, ...data },
  });
  for (const name of [...Object.keys(data), ...env.map((e) => e.name)]) {
    const option = name.replace(/^ISCHIA_/, '').toLowerCase();
    assert.match(printed, new RegExp(`^${option} = ${data[name] ?? ''}`, 'm'), name);
  }
});

test('a budget, and a queue to scale by', () => {
  const labels = one('Deployment').spec.template.metadata.labels;
  for (const kind of ['PodDisruptionBudget', 'NetworkPolicy', 'Service', 'Deployment']) {
    const { spec } = one(kind);
    const selector = spec.selector?.matchLabels ?? spec.podSelector?.matchLabels ?? spec.selector;
    assert.deepEqual(selector, labels, kind);
  }
  const scaler = one('HorizontalPodAutoscaler').spec;
  assert.equal(scaler.scaleTargetRef.name, one('Deployment').metadata.name);
  assert.ok(scaler.minReplicas > one('PodDisruptionBudget').spec.minAvailable);
  const [{ external }] = scaler.metrics;
  const adapter = documents.find(({ name }) => name === 'prometheus-adapter.yaml').object;
  const rules = parse(adapter.data['config.yaml']).externalRules;
  assert.deepEqual(rules.map((r) => r.name.as), [external.metric.name]);
  assert.ok(rules[0].metricsQuery.includes('max(ischia_queue_depth{'));
});
