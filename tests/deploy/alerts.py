#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Alert rules and dashboard against a live /metrics: every query names what the service measures,
with labels that it has; and everything that it measures is looked at."""
import json
import os
import re
import shutil
import subprocess
import sys
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, '../api'))
from service import PATIENCE_S, Service  # noqa: E402

DEPLOY = os.path.join(HERE, '../../deploy')
RULES = os.path.join(DEPLOY, 'prometheus/ischia-alerts.yml')
DASHBOARD = os.path.join(DEPLOY, 'grafana/ischia.json')
# Prometheus adds these itself; the dashboard's variables stand for values of labels.
OWN_METRICS, OWN_LABELS = {'up'}, {'instance', 'job'}
WORDS = {'by', 'without', 'on', 'ignoring', 'group_left', 'group_right', 'and', 'or', 'unless', 'bool',
         'offset'}
OPERATORS = {'sum', 'max', 'min', 'avg', 'count', 'topk', 'rate', 'increase', 'histogram_quantile'}


def read_rules():
    """{alert: expression}. The file keeps each on a line of its own, so that this needs no YAML."""
    with open(RULES, encoding='utf-8') as file:
        text = file.read()
    found = re.findall(r'^ +- alert: (\w+)\n +expr: (.+)$', text, re.M)
    assert len(found) == text.count('alert:') == text.count('expr:') > 0, 'an expression is hidden'
    return dict(found)


def read_dashboard():
    with open(DASHBOARD, encoding='utf-8') as file:
        dashboard = json.load(file)
    queries = {}
    for panel in dashboard['panels']:
        for target in panel.get('targets', []):
            queries[f'{panel["title"]} {target["refId"]}'] = target['expr']
    for variable in dashboard['templating']['list']:
        if variable['type'] == 'query':
            name = re.fullmatch(r'label_values\((\w+), (\w+)\)', variable['query'])
            queries['variable ' + variable['name']] = name[1]
    return queries


def parse(expression):
    """[(metric, {label: (operator, value)})] and the labels of by(...) of a PromQL expression."""
    grouped = {label.strip() for inside in re.findall(r'\b(?:by|without|on)\s*\(([^)]*)\)', expression)
               for label in inside.split(',')}
    text = re.sub(r'\b(?:by|without|on)\s*\([^)]*\)', ' ', expression)
    selectors, plain = [], re.sub(r'\[[^\]]*\]', '', text)
    pattern = r'(?<![\w.])([a-zA-Z_:][\w:]*)\s*(\{[^}]*\})?(?=\s*(\()?)'
    for name, braces, call in re.findall(pattern, plain):
        if call and not braces:
            assert name in OPERATORS, f'{name} is no function of the list'
        elif name not in WORDS:
            matchers = re.findall(r'(\w+)\s*(=~|!~|!=|=)\s*"([^"]*)"', braces)
            selectors.append((name, {label: (sign, value) for label, sign, value in matchers}))
    return selectors, grouped


def samples(text):
    """{sample name: [{label: value}]} of the exposition format."""
    found = {}
    for line in text.splitlines():
        if line and not line.startswith('#'):
            name, braces = re.match(r'(\w+)(\{.*\})?', line).groups()
            found.setdefault(name, []).append(dict(re.findall(r'(\w+)="([^"]*)"', braces or '')))
    return found


class Queries(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        with Service() as service:
            service.until_ready()
            service.submit(F=100.5)
            service.get('/')
            cls.text = service.get('/metrics').body.decode()
        cls.samples = samples(cls.text)
        cls.queries = {**read_rules(), **read_dashboard()}

    def check(self, where, expression):
        selectors, grouped = parse(expression)
        self.assertTrue(selectors, where)
        for name, matchers in selectors:
            if name in OWN_METRICS:
                continue
            self.assertTrue(name in self.samples, f'{where}: nothing measures {name}')
            has = self.samples[name]
            for label, (sign, value) in matchers.items():
                if label in OWN_LABELS:
                    continue
                self.assertTrue(label in has[0], f'{where}: {name} has no label {label}')
                if sign == '=' and label != 'code':  # codes appear when they are answered
                    self.assertIn(value, [one[label] for one in has], f'{where}: {label}')
            for label in grouped - OWN_LABELS:
                self.assertTrue(label in has[0], f'{where}: {name} has no label {label}')

    def test_every_query_names_what_the_service_measures(self):
        for where, expression in self.queries.items():
            with self.subTest(where):
                self.check(where, expression)

    def test_wrong_queries_are_found(self):
        for wrong in ('ischia_queue_dept > 1', 'rate(ischia_solve_seconds[5m])',
                      'ischia_solve_seconds_count{outcome="won"}', 'sum by (rout) (ischia_workers)',
                      'ischia_workers{outcome="failed"}', '5 > 3'):
            with self.assertRaises(AssertionError, msg=wrong):
                self.check('wrong', wrong)

    def test_all_that_is_measured_is_looked_at(self):
        used = {name for text in self.queries.values() for name, _ in parse(text)[0]}
        for name in re.findall(r'^# TYPE (\w+) ', self.text, re.M):
            family = {name, name + '_bucket', name + '_count', name + '_sum'}
            self.assertTrue(family & used, f'no alert and no panel shows {name}')

    def test_every_alert_says_what_to_do(self):
        with open(RULES, encoding='utf-8') as file:
            text = file.read()
        count = len(read_rules())
        for key in (' summary: ".+"', ' action: ".+"', r' labels: \{severity: (?:page|ticket)\}'):
            self.assertEqual(len(re.findall(key, text)), count, key)


class Promtool(unittest.TestCase):
    @unittest.skipUnless(shutil.which('promtool'), 'promtool is not installed (package prometheus)')
    def test_prometheus_reads_the_rules_and_each_is_silent_and_fires(self):
        folder = os.path.dirname(RULES)
        for words in (['check', 'rules', RULES],
                      ['check', 'config', '--syntax-only', os.path.join(folder, 'scrape.yml')],
                      ['test', 'rules', os.path.join(folder, 'ischia-alerts.test.yml')]):
            done = subprocess.run(['promtool', *words], capture_output=True, text=True,
                                  cwd=folder, timeout=PATIENCE_S)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            self.assertNotIn('FAILED', done.stdout)
        with open(os.path.join(folder, 'ischia-alerts.test.yml'), encoding='utf-8') as file:
            tried = file.read()
        for alert in read_rules():
            self.assertIn(f'alertname="{alert}"', tried, 'no test sees it fire')


if __name__ == '__main__':
    unittest.main()
