// SPDX-License-Identifier: GPL-3.0-or-later
//
// The /docs page: fills in what openapi.json says about each route, and sends requests from a form.
'use strict';

const example = {
  R1: 7.1, R2: 22.8, eM: 31, eF: 10, muM: 8, muF: 5, F: 258, side: 'left', subject: 'P-017',
};

function element(name, attributes, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

function describe(contract) {
  for (const row of document.querySelectorAll('#routes tr')) {
    const operation = contract.paths[row.dataset.path]?.[row.dataset.method.toLowerCase()];
    if (operation) row.querySelector('.summary').textContent = operation.summary;
  }
}

function field(label, control) {
  control.id = control.name;
  return element('p', {}, element('label', { for: control.id }, label), control);
}

async function send(form, output) {
  const method = form.method_and_path.value.split(' ')[0];
  const path = form.path.value;
  const headers = {};
  if (form.token.value) headers.Authorization = `Bearer ${form.token.value}`;
  if (form.prefer.value) headers.Prefer = form.prefer.value;
  const has_body = method === 'POST' && form.body.value.trim() !== '';
  if (has_body) headers['Content-Type'] = 'application/json';
  output.textContent = '…';
  try {
    const response = await fetch(path, { method, headers, body: has_body ? form.body.value : undefined });
    const lines = [`${response.status} ${response.statusText}`];
    for (const [name, value] of response.headers) lines.push(`${name}: ${value}`);
    output.textContent = `${lines.join('\n')}\n\n${await response.text()}`;
  } catch (fault) {
    output.textContent = String(fault);
  }
}

function build_form(contract) {
  const choice = element('select', { name: 'method_and_path' });
  for (const [path, item] of Object.entries(contract.paths))
    for (const method of Object.keys(item))
      if (['get', 'post', 'delete'].includes(method) && !path.endsWith('/events'))
        choice.append(element('option', {}, `${method.toUpperCase()} ${path}`));
  const path = element('input', { name: 'path', size: '60' });
  const body = element('textarea', { name: 'body', rows: '12', cols: '60', spellcheck: 'false' });
  const form = element('form', {},
    field('Route', choice), field('Address', path),
    field('Token (only where the service asks for one)',
      element('input', { name: 'token', type: 'password', autocomplete: 'off' })),
    field('Prefer', element('input', { name: 'prefer', placeholder: 'wait=30' })),
    field('Body', body), element('p', {}, element('button', { type: 'submit' }, 'Send')));
  const fill = () => {
    path.value = choice.value.split(' ')[1];
    body.value = choice.value === 'POST /v1/assessments' ? JSON.stringify(example, null, 2) : '';
  };
  choice.addEventListener('change', fill);
  fill();
  return form;
}

async function start() {
  const contract = await (await fetch('/openapi.json')).json();
  describe(contract);
  const section = document.getElementById('try');
  const output = element('pre', { 'aria-live': 'polite', tabindex: '0' });
  const form = build_form(contract);
  form.addEventListener('submit', (event) => {
    event.preventDefault();
    send(form, output);
  });
  section.append(form, output);
  section.hidden = false;
}

start();
