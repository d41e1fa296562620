// SPDX-License-Identifier: GPL-3.0-or-later
//
// A stand-in for the daemon, for tests only: it speaks the HTTP contract from fixtures, so that the
// suite can bring about at will what a real solve does rarely (a failure, a full queue, a loss of
// connection in the middle). Its numbers are invented and never leave the tests; the same suite
// runs against the real daemon wherever the outcome does not have to be arranged.
//
// The subject says what happens: `slow...` takes 20 s, `fail...` does not converge, `busy...` finds
// the queue full, `odd...` is refused by the server alone, `below...`, `shear...`, `compression...`
// give those bands; anything else crosses both thresholds after half a second.
import { createServer } from 'node:http';
import { readFile } from 'node:fs/promises';
import { extname, join, normalize } from 'node:path';
import { section_svg, field_vtu } from './fixtures.mjs';

export const csp =
  "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; " +
  "connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'";

/* The files of the clinic page, by address. */
const pages = [
  [/^\/$/, 'index'],
  [/^\/assessments\/?$/, 'list'],
  [/^\/assessments\//, 'result'],
];

/* Names and descriptions are not the daemon's, so that what the page takes from it can be told. */
const parameter = (key, unit, description, accepted, studied, sd) => ({
  key,
  name: `Stand-in ${key}`,
  aliases: [],
  unit,
  description,
  accepted: { min: accepted[0], max: accepted[1] },
  studied: { min: studied[0], max: studied[1] },
  sd: { max: accepted[1] - accepted[0], typical: { absolute: sd[0], relative: sd[1] } },
});

export const parameters = {
  model: { name: 'macron2020-local', version: 1 },
  parameters: [
    parameter(
      'R1',
      'mm',
      'Smaller radius of curvature of the ischium.',
      [3, 15],
      [4.8, 9],
      [0.84, 0],
    ),
    parameter(
      'R2',
      'mm',
      'Radius of curvature in the orthogonal plane.',
      [8, 120],
      [15, 63.3],
      [10.6, 0],
    ),
    parameter('eM', 'mm', 'Thickness of the muscle, unloaded.', [5, 60], [19, 39], [2, 0]),
    parameter('eF', 'mm', 'Thickness of the fat, unloaded.', [3, 60], [9, 35], [3, 0]),
    parameter('muM', 'kPa', 'Shear modulus of the muscle.', [0.5, 30], [1, 8], [0, 0.2]),
    parameter('muF', 'kPa', 'Shear modulus of the fat.', [0.5, 30], [2.75, 8], [0, 0.2]),
    parameter('F', 'N', 'Vertical force on this side.', [1, 600], [192, 429], [0, 0.1]),
  ],
  options: [
    {
      group: 'skin',
      key: 'mu',
      pointer: '/skin/mu',
      unit: 'kPa',
      accepted: { min: 5, max: 1000 },
      default: 67,
    },
    {
      group: 'skin',
      key: 'thickness',
      pointer: '/skin/thickness',
      unit: 'mm',
      accepted: { min: 0.5, max: 3 },
      default: 1,
    },
  ],
  resolutions: [
    { name: 'standard', default: true },
    { name: 'fine', default: false },
  ],
};

/* The names as the daemon has them in each language: what the page shows can be told from them. */
const parameters_in = (tag) =>
  ['fr', 'de'].includes(tag)
    ? {
        ...parameters,
        parameters: parameters.parameters.map((p) => ({ ...p, name: `${p.name} ${tag}` })),
      }
    : parameters;

const default_model = {
  name: 'default',
  L_over_h: 2,
  bulk_ratio: 2000,
  friction: 0.4,
  R2_surface: 0,
  embed_over_R1: 1,
};

const cluster_set = (threshold, volume, F, tip) => ({
  ...(threshold ? { threshold } : {}),
  volume_mm3: volume,
  count: volume > 0 ? 1 : 0,
  largest:
    volume > 0
      ? {
          volume_mm3: volume,
          eps_max: 1.1,
          E_shear_max: 1.9,
          E_comp_max: 0.47,
          centroid_mm: [0, 0, tip - 6.4],
        }
      : null,
});

const volumes = {
  below: [0, 0, 0],
  shear: [2310, 0, 0],
  compression: [0, 410, 0],
  both: [14400, 8100, 7900],
};

/* A smooth made-up path whose strains end above the thresholds that the band says are crossed. */
function load_curve(F, top_shear, top_comp) {
  return Array.from({ length: 13 }, (_, i) => {
    const s = i / 12;
    const grown = Math.sqrt(s);
    return {
      F_N: F * s,
      displacement_mm: 30 * grown,
      eps_max: 1.2 * grown,
      E_shear_max: top_shear * grown,
      E_comp_max: top_comp * grown,
    };
  });
}

const around = (value, part) =>
  [-1.6, -0.7, 0, 0.7, 1.6].map((z) => Number((value * (1 + z * part)).toPrecision(8)));

/* As the daemon gives it; a subject `outside...` has no interval, that of `outside-itself...` was not
 * even sampled. */
function uncertainty_of(document, result) {
  const keys = parameters.parameters.map(({ key }) => key);
  const all = (value) => Object.fromEntries(keys.map((key) => [key, value]));
  const given = !document.subject?.startsWith('outside');
  const sampled = !document.subject?.startsWith('outside-itself');
  const five = (value, part) => (given ? around(value, part) : Array(5).fill(null));
  const total = { ...all(0), R2: 0.61, muM: 0.22, F: 0.12, R1: 0.04 };
  return {
    status: given ? 'given' : 'outside_training',
    typical: document.sd === 'typical',
    sd: document.sd === 'typical' ? all(1) : { ...all(0), ...document.sd },
    trial: false,
    samples: sampled ? 2048 : 0,
    inside: given ? 2000 : sampled ? 900 : 0,
    outside: { ...all(0), R2: given ? 0.023 : sampled ? 0.56 : 1 },
    quantiles: [0.05, 0.25, 0.5, 0.75, 0.95],
    strain: {
      eps_max: five(result.strain.eps_max, 0.05),
      E_shear_max: five(result.strain.E_shear_max, 0.05),
      E_comp_max: five(result.strain.E_comp_max, 0.005),
    },
    clusters: {
      shear: { volume_mm3: five(result.clusters.shear.volume_mm3, 0.1) },
      compression: { volume_mm3: five(result.clusters.compression.volume_mm3, 0.1) },
      both: { volume_mm3: five(result.clusters.both.volume_mm3, 0.1) },
    },
    threshold_force_N: {
      shear: five(33, 0.1),
      compression: given ? [30, 35, 40, null, null] : Array(5).fill(null),
    },
    share_crossing: given
      ? { shear: 1, compression: 0.63, both: 0.63 }
      : { shear: null, compression: null, both: null },
    sensitivity: { first_order: total, total: given ? total : all(null) },
    emulator_sd: given ? 0.008 : null,
    model_form_error: { eps_max: 0.075 },
    checks: given
      ? [1.2, 1.25, null, 1.3].map((eps_max) => ({
          parameters: document.parameters,
          eps_max,
          estimate: 1.25,
          low: 1.21,
          high: 1.31,
        }))
      : [],
  };
}

const band = (value, half) => ({ value, low: value - half, high: value + half });

/* An emulator made up of one line; R2 above 63 is outside what it knows. */
function groups_at(p) {
  const eps = 0.9 + 0.0015 * p.F - 0.02 * p.muM;
  return {
    strain: {
      eps_max: band(eps, 0.03),
      E_shear_max: band(1.5 * eps, 0.05),
      E_comp_max: band(0.46, 0.01),
    },
    clusters: {
      shear: { volume_mm3: band(60 * p.F, 300) },
      compression: { volume_mm3: band(30 * p.F, 200) },
      both: { volume_mm3: band(28 * p.F, 200) },
    },
    seat: { displacement_mm: band(30, 1) },
    threshold_force_N: { shear: band(33, 2), compression: band(40, 3) },
  };
}
const none = { strain: null, clusters: null, seat: null, threshold_force_N: null };
const knows = (p) => p.R2 <= 63;
const outside_training = { code: 'outside_training', pointer: '/R2', detail: 'R2 is outside' };

function estimate_of(p, emulator) {
  return {
    kind: 'estimate',
    parameters: p,
    ...(knows(p) ? groups_at(p) : none),
    emulator,
    warnings: knows(p) ? [] : [outside_training],
  };
}

function what_if_of(body, key, emulator) {
  const { unit, studied } = parameters.parameters.find((p) => p.key === key);
  const at = (i) => studied.min + ((studied.max - studied.min) * i) / 40;
  const points = Array.from({ length: 41 }, (_, i) => ({ ...body, [key]: at(i) })).filter(knows);
  return {
    kind: 'what_if',
    parameters: body,
    parameter: key,
    unit,
    points: points.map((p) => {
      const groups = groups_at(p);
      const { E_shear_max: e, E_comp_max: c } = groups.strain;
      const margin = {
        shear: band(0.75 - e.value, 0.05),
        compression: band(0.45 - c.value, 0.01),
      };
      return { at: p[key], ...groups, margin };
    }),
    target_force_N: knows(body) ? groups_at(body).threshold_force_N : null,
    emulator,
    warnings: [],
  };
}

function result_of(document) {
  const { F, eM, eF } = document.parameters;
  const band =
    ['below', 'shear', 'compression'].find((b) => document.subject?.startsWith(b)) ?? 'both';
  const [v_shear, v_comp, v_both] = volumes[band];
  const top_shear = v_shear > 0 ? 2.1 : 0.6;
  const top_comp = v_comp > 0 ? 0.48 : 0.4;
  const crossed = (top, threshold) => (top > threshold ? F * (threshold / top) ** 2 : null);
  const tip = 1 + eF + eM;
  return {
    strain: {
      eps_max: document.side === 'left' ? 1.243 : 1.287,
      eps_max_depth_mm: 8.2,
      E_shear_max: top_shear,
      E_comp_max: top_comp,
    },
    clusters: {
      shear: cluster_set(0.75, v_shear, F, tip),
      compression: cluster_set(0.45, v_comp, F, tip),
      both: cluster_set(null, v_both, F, tip),
    },
    muscle_volume_mm3: 148200,
    seat: {
      displacement_mm: 30,
      contact_area_mm2: 4400,
      mean_pressure_kPa: (1000 * F) / 4400,
      peak_pressure_kPa: 142.3,
    },
    load_curve: load_curve(F, top_shear, top_comp),
    threshold_force_N: { shear: crossed(top_shear, 0.75), compression: crossed(top_comp, 0.45) },
    risk: { band, headline: band, reasons: [], caveats: [] },
    numerics: {
      converged: true,
      reason: 'converged',
      elements: 1536,
      dof: 5200,
      load_steps: 12,
      newton_iterations: 61,
      force_residual: 3.1e-10,
      energy_residual: 1.2e-3,
      eps_max_error: 0.011,
      wall_s: 0.91,
      cpu_s: 0.88,
    },
    model: { name: 'macron2020-local', version: 1 },
  };
}

function faults_of(body) {
  const errors = [];
  for (const { key, unit, accepted } of parameters.parameters) {
    const value = body[key];
    if (typeof value !== 'number')
      errors.push({ pointer: `/${key}`, code: 'missing', detail: `${key} is missing` });
    else if (value < accepted.min || value > accepted.max) {
      errors.push({
        pointer: `/${key}`,
        code: 'out_of_range',
        detail: `${key} is ${value} ${unit}; accepted ${accepted.min} to ${accepted.max} ${unit}`,
      });
    }
  }
  if (body.subject?.startsWith('odd')) {
    errors.push({
      pointer: { 'odd-sd': '/sd/eM', 'odd-subject': '/subject' }[body.subject] ?? '/muM',
      code: 'out_of_range',
      detail: 'muM is refused by the server alone',
    });
  }
  return errors;
}

const warnings_of = (p) =>
  parameters.parameters
    .filter(({ key, studied }) => p[key] < studied.min || p[key] > studied.max)
    .map(({ key }) => ({
      pointer: `/${key}`,
      code: 'outside_study_range',
      detail: `${key} is outside the studied range`,
    }));

async function text_of(request) {
  let text = '';
  for await (const chunk of request) text += chunk;
  return text;
}
const body_of = async (request) => JSON.parse(await text_of(request));

const ended = (document) => !['queued', 'running'].includes(document.status);

export class StandIn {
  constructor(dist) {
    this.dist = dist;
    this.documents = new Map();
    this.by_key = new Map();
    this.streams = new Set();
    this.requests = [];
    this.next = 1;
    this.emulator = null; /* what it makes estimates with, when a test gives it one */
    this.bodies = []; /* of what was asked to be computed */
    this.timer = setInterval(() => this.advance(), 60);
  }

  /* Resolves to the address it serves; `port` 0 takes a free one. */
  async start(port = 0) {
    this.server = createServer((request, response) => {
      this.route(request, response).catch((e) => {
        response.writeHead(500);
        response.end(String(e));
      });
    });
    await new Promise((resolve) => this.server.listen(port, '127.0.0.1', resolve));
    this.port = this.server.address().port;
    return `http://127.0.0.1:${this.port}`;
  }

  /* Drops every connection, as a daemon that dies does; what was accepted is kept. */
  async stop() {
    for (const stream of this.streams) stream.response.destroy();
    this.streams.clear();
    this.server.closeAllConnections();
    await new Promise((resolve) => this.server.close(resolve));
  }

  async finish() {
    clearInterval(this.timer);
    if (this.server.listening) await this.stop();
  }

  advance() {
    for (const document of this.documents.values()) {
      if (ended(document) || !this.server?.listening) continue;
      const seconds = document.subject?.startsWith('slow') ? 20 : 0.5;
      document.status = 'running';
      document.progress = Math.min(1, document.progress + 0.06 / seconds);
      if (document.progress >= 1) this.end(document);
      this.tell(document);
    }
  }

  end(document) {
    document.finished_at = new Date().toISOString();
    if (document.subject?.startsWith('fail')) {
      document.status = 'failed';
      document.problem = {
        title: 'The solve did not converge',
        status: 500,
        detail:
          'The load step became smaller than its floor; the last converged force is 143.2 N of 258 N.',
      };
    } else {
      document.status = 'succeeded';
      document.result = result_of(document);
      if (document.sd) document.result.uncertainty = uncertainty_of(document, document.result);
    }
  }

  tell(document) {
    for (const { id, response } of this.streams) {
      if (id !== document.id) continue;
      const event = {
        fraction: document.progress,
        load_step: Math.ceil(document.progress * 12),
        newton_iteration: 3,
        message: 'loading',
      };
      response.write(`id: ${this.next++}\nevent: progress\ndata: ${JSON.stringify(event)}\n\n`);
      if (ended(document)) {
        response.write(`event: done\ndata: {"status":"${document.status}"}\n\n`);
        response.end();
      }
    }
  }

  async route(request, response) {
    const url = new URL(request.url, 'http://x');
    this.requests.push(`${request.method} ${url.pathname}`);
    response.setHeader('Content-Security-Policy', csp);
    response.setHeader('X-Content-Type-Options', 'nosniff');
    const [, id, part] = /^\/v1\/assessments\/([^/]+)(?:\/(.+))?$/.exec(url.pathname) ?? [];
    const tag = url.searchParams.get('lang') ?? request.headers['accept-language']?.slice(0, 2);
    if (url.pathname === '/v1/parameters') return this.json(response, 200, parameters_in(tag));
    if (url.pathname === '/version')
      return this.json(response, 200, {
        program: 'stand-in',
        version: '0.0.0',
        emulator: this.emulator,
      });
    if (url.pathname === '/v1/estimates')
      return this.json(response, 200, estimate_of(await body_of(request), this.emulator));
    if (url.pathname === '/v1/estimates/what-if') {
      const key = url.searchParams.get('parameter');
      return this.json(response, 200, what_if_of(await body_of(request), key, this.emulator));
    }
    if (url.pathname.startsWith('/assessments/') && url.searchParams.has('plain')) {
      const report = `/v1${url.pathname}/report?lang=${tag}`;
      return response.writeHead(303, { Location: report }).end();
    }
    if (url.pathname === '/v1/assessments' && request.method === 'POST')
      return this.create(request, response);
    if (url.pathname === '/v1/assessments') return this.list(url, request, response);
    if (id) return this.one(id, part, response);
    return this.file(url.pathname, tag, response);
  }

  json(response, status, body, headers = {}) {
    const type = status >= 400 ? 'application/problem+json' : 'application/json';
    response.writeHead(status, { 'Content-Type': type, ...headers });
    response.end(JSON.stringify(body));
  }

  async create(request, response) {
    const text = await text_of(request);
    const plain = request.headers['content-type'].startsWith('application/x-www-form-urlencoded');
    const body = plain
      ? Object.fromEntries(
          [...new URLSearchParams(text)].map(([k, v]) => [k, /^[\d.]+$/.test(v) ? Number(v) : v]),
        )
      : JSON.parse(text);
    this.bodies.push(body);
    const refused = { 'unknown-1': 401, 'forbidden-1': 403 }[body.subject];
    if (refused) {
      const detail = 'Send a token: `Authorization: Bearer TOKEN`.';
      return this.json(response, refused, { title: 'No access', status: refused, detail });
    }
    if (body.subject?.startsWith('busy')) {
      return this.json(response, 429, { title: 'Queue full', status: 429 }, { 'Retry-After': '1' });
    }
    const errors = faults_of(body);
    if (errors.length)
      return this.json(response, 422, {
        title: 'Not accepted',
        status: 422,
        detail: errors[0].detail,
        errors,
      });
    const key = request.headers['idempotency-key'];
    const document = this.by_key.get(key) ?? this.add(body);
    if (key) this.by_key.set(key, document);
    if (plain) {
      response.writeHead(303, { Location: `/v1/assessments/${document.id}/report` });
      return response.end();
    }
    return this.json(response, 202, document, { Location: `/v1/assessments/${document.id}` });
  }

  add(body, created_at = new Date().toISOString()) {
    const number = String(this.documents.size + 1).padStart(12, '0');
    const document = {
      id: `0192f0c1-0000-7000-8000-${number}`,
      status: 'queued',
      created_at,
      started_at: null,
      finished_at: null,
      subject: body.subject || null,
      side: body.side ?? null,
      label: body.label ?? null,
      measured_at: body.measured_at || null,
      resolution: body.resolution ?? 'standard',
      skin: { mu: 67, thickness: 1, ...body.skin },
      sd: body.sd || null,
      skin: { mu: 67, thickness: 1, ...body.skin },
      resolution: body.resolution ?? 'standard',
      model: { ...default_model, ...body.model },
      parameters: Object.fromEntries(parameters.parameters.map(({ key }) => [key, body[key]])),
      progress: 0,
      result: null,
      problem: null,
      warnings: warnings_of(body),
    };
    this.documents.set(document.id, document);
    return document;
  }

  list(url, request, response) {
    const wanted = (d) =>
      ['subject', 'side', 'status'].every(
        (k) => !url.searchParams.get(k) || d[k] === url.searchParams.get(k),
      );
    const all = [...this.documents.values()].reverse().filter(wanted);
    const start = Number(url.searchParams.get('cursor') ?? 0);
    const limit = Number(url.searchParams.get('limit') ?? 50);
    const items = all.slice(start, start + limit);
    const next = start + limit < all.length ? String(start + limit) : null;
    if (request.headers.accept.includes('text/csv')) {
      response.writeHead(200, {
        'Content-Type': 'text/csv; charset=utf-8; header=present',
        ...(next ? { 'X-Next-Cursor': next } : {}),
      });
      return response.end(
        ['id,subject', ...items.map((d) => `${d.id},${d.subject}`), ''].join('\n'),
      );
    }
    this.json(response, 200, { items, next_cursor: next });
  }

  one(id, part, response) {
    const document = this.documents.get(id);
    if (!document)
      return this.json(response, 404, {
        title: 'Not found',
        status: 404,
        detail: 'No such assessment',
      });
    const parts = {
      cancel: () => {
        document.status = 'cancelled';
        document.finished_at = new Date().toISOString();
        this.tell(document);
        this.json(response, 202, document);
      },
      events: () => this.stream(id, response),
      'section.svg': () => {
        response.setHeader('Content-Type', 'image/svg+xml');
        response.end(section_svg(document.parameters));
      },
      'field.vtu': () => {
        response.setHeader('Content-Type', 'model/vtu+xml');
        response.end(field_vtu(document.parameters));
      },
      report: () => {
        response.setHeader('Content-Type', 'text/html; charset=utf-8');
        response.end(`<!doctype html><title>Report</title><h1>Report ${id}</h1>`);
      },
    };
    return part ? parts[part]() : this.json(response, 200, document);
  }

  stream(id, response) {
    response.writeHead(200, { 'Content-Type': 'text/event-stream' });
    response.write('retry: 500\n\n');
    const stream = { id, response };
    this.streams.add(stream);
    response.on('close', () => this.streams.delete(stream));
    const document = this.documents.get(id);
    if (ended(document)) this.tell(document); /* between the page's look and its listening */
  }

  async file(path, tag, response) {
    const types = {
      '.html': 'text/html; charset=utf-8',
      '.js': 'text/javascript',
      '.css': 'text/css',
      '.svg': 'image/svg+xml',
      '.txt': 'text/plain',
    };
    const page = pages.find(([pattern]) => pattern.test(path))?.[1];
    const of_page = ['fr', 'de'].includes(tag) ? `${page}.${tag}.html` : `${page}.html`;
    const name = page ? of_page : normalize(path).replace(/^(\.\.)+/, '');
    try {
      const bytes = await readFile(join(this.dist, name));
      response.writeHead(200, {
        'Content-Type': types[extname(name)] ?? 'application/octet-stream',
      });
      response.end(bytes);
    } catch {
      this.json(response, 404, { title: 'Not found', status: 404 });
    }
  }
}
