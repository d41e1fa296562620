#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""openapi.json against the program, both ways: the routes, the limits, the kinds of problems, and
every answer of a tour of the service against its schema (contract.mjs, with ajv)."""
import filecmp
import json
import os
import shutil
import subprocess
import tempfile
import unittest
import urllib.parse

from emulator_file import write_emulator
from service import HERE, JSON, PATIENCE_S, PROGRAM, SIDE, Service, eventually, side

METHODS = ('get', 'post', 'put', 'patch', 'delete')
FORM = {'Content-Type': 'application/x-www-form-urlencoded'}


def install_validators():
    """npm ci, unless what the lock file names is there already."""
    lock, done = (
        os.path.join(HERE, name) for name in ('package-lock.json', 'node_modules/.ischia-lock')
    )
    if os.path.exists(done) and filecmp.cmp(lock, done, shallow=False):
        return
    subprocess.run(
        ['npm', 'ci', '--ignore-scripts', '--no-audit', '--no-fund', '--loglevel=error'],
        cwd=HERE,
        check=True,
        timeout=PATIENCE_S,
    )
    shutil.copyfile(lock, done)


class Contract(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        install_validators()
        cls.folder = tempfile.TemporaryDirectory()
        emulator = os.path.join(cls.folder.name, 'emulator.txt')
        write_emulator(emulator)
        cls.service = Service('--emulator', emulator)
        cls.service.until_ready()
        cls.contract = cls.service.get('/openapi.json').json()

    @classmethod
    def tearDownClass(cls):
        cls.service.stop()
        cls.folder.cleanup()

    def operations(self):
        for path, item in self.contract['paths'].items():
            for method in METHODS:
                if method in item:
                    yield method, path, item[method]

    def test_the_routes_are_those_of_the_program(self):
        listed = subprocess.run(
            [PROGRAM, '--print-routes'], capture_output=True, text=True, check=True
        )
        program = {}
        for line in listed.stdout.splitlines():
            method, path, *rest = line.split()
            if rest[0] not in ('page', 'fhir', 'cds'):
                program[(method.lower(), path)] = rest[0]
        contract = {
            (method, path): operation.get('x-scope', 'open')
            for method, path, operation in self.operations()
        }
        self.assertEqual(contract, program)

    def test_the_limits_are_those_of_the_tables(self):
        schemas = self.contract['components']['schemas']
        served = self.service.get('/v1/parameters').json()
        for parameter in served['parameters']:
            for schema in (schemas['Request'], schemas['Assessment']['properties']['parameters']):
                for key in [parameter['key']] + (
                    parameter['aliases'] if schema is schemas['Request'] else []
                ):
                    limits = schema['properties'][key]
                    self.assertEqual(
                        (limits['minimum'], limits['maximum']),
                        (parameter['accepted']['min'], parameter['accepted']['max']),
                        key,
                    )
        request = schemas['Request']['properties']
        for option in served['options']:
            group = request[option['group']]
            group = group['oneOf'][1] if 'oneOf' in group else group
            limits = group['properties'][option['key']]
            self.assertEqual(
                (limits['minimum'], limits['maximum'], limits['default']),
                (option['accepted']['min'], option['accepted']['max'], option['default']),
            )
        self.assertEqual(request['resolution']['enum'], [r['name'] for r in served['resolutions']])
        presets = [preset['name'] for preset in served['presets']]
        self.assertEqual(request['model']['oneOf'][0]['enum'], presets)
        for parameter in self.contract['paths']['/v1/studies']['post']['parameters']:
            if parameter.get('name') == 'model':
                self.assertEqual(parameter['schema']['enum'], presets)

    def test_the_query_parameters_are_taken_and_no_others(self):
        for method, path, operation in self.operations():
            if method != 'get' or '{' in path:
                continue
            names = [p['name'] for p in operation.get('parameters', []) if p.get('in') == 'query']
            for name in names:
                self.assertLess(self.service.get(f'{path}?{name}=').status, 500)
            answer = self.service.get(f'{path}?nothing=1')
            self.assertEqual(answer.status, 400, path)

    def tour(self):
        """Asks for everything in all ways; yields what contract.mjs checks."""
        asked = []

        def ask(method, path, template, body=None, headers=None):
            answer = self.service.ask(method, path, body, headers)
            asked.append(
                {
                    'method': method.lower(),
                    'path': template,
                    'status': answer.status,
                    'type': answer.type,
                    'headers': sorted(h.lower() for h in answer.headers),
                    'body': answer.body.decode(),
                }
            )
            return answer

        many = '/v1/assessments'
        made = ask(
            'POST',
            many,
            many,
            side(F=400.5, subject='T-1', side='left', R2=80),
            {'Prefer': 'wait=60'},
        )
        ask('POST', many, many, side(F=401.5))
        ask('POST', many, many, side(muM=99))
        ask('POST', many, many, b'{', JSON)
        ask('POST', many, many, b'x', {'Content-Type': 'text/plain'})
        ask('POST', many, many, b' ' * 70000, JSON)
        ask('POST', many, many, urllib.parse.urlencode({**SIDE, 'F': 402.5}).encode(), FORM)
        failed = ask('POST', many, many, side(F=598, eM=22), {'Prefer': 'wait=60'})
        hanging = ask('POST', many, many, side(F=599, eM=22))
        for query in ('', '?limit=1', '?status=failed', '?limit=0'):
            ask('GET', many + query, many)
        ask('GET', many, many, headers={'Accept': 'text/csv'})
        ask('GET', many, many, headers={'Accept': 'image/png'})
        ask('GET', many, many, headers={'Host': 'evil.example'})
        one = many + '/{id}'
        self.service.until(hanging.json()['id'], 'running')
        for document in (made.json(), failed.json(), hanging.json()):
            path = document['links']['self']
            for suffix in ('', '/report', '/section.svg', '/field.vtu'):
                answer = ask('GET', path + suffix, one + suffix)
                if 'ETag' in answer.headers:
                    ask(
                        'GET',
                        path + suffix,
                        one + suffix,
                        headers={'If-None-Match': answer.headers['ETag']},
                    )
        ask('GET', failed.json()['links']['self'] + '/events', one + '/events')
        ask('DELETE', hanging.json()['links']['self'], one)
        ask('POST', hanging.json()['links']['self'] + '/cancel', one + '/cancel')
        ask('POST', made.json()['links']['self'] + '/cancel', one + '/cancel')
        ask('DELETE', made.json()['links']['self'], one)
        for suffix, method in (
            ('', 'GET'),
            ('', 'DELETE'),
            ('/cancel', 'POST'),
            ('/events', 'GET'),
            ('/report', 'GET'),
            ('/field.vtu', 'GET'),
            ('/section.svg', 'GET'),
        ):
            ask(method, made.json()['links']['self'] + suffix, one + suffix)
        for path in (
            '/v1/parameters',
            '/v1/changes',
            '/openapi.json',
            '/healthz',
            '/readyz',
            '/metrics',
            '/version',
        ):
            ask('GET', path, path)
            ask('PUT', path, path)
            ask('GET', path, path, headers={'Accept': 'image/png'})
        ask('GET', '/v1/changes?since=x', '/v1/changes')
        self.tour_of_studies(ask)
        self.tour_of_estimates(ask)
        return asked

    def tour_of_estimates(self, ask):
        one, inside = '/v1/estimates', side(R2=40)
        for body in (inside, side(R1=4), side(model='as-published'), side(muM=99)):
            ask('POST', one, one, body)
        for body, headers in ((b'{', JSON), (b'x', {'Content-Type': 'text/plain'})):
            ask('POST', one, one, body, headers)
        ask('GET', one, one)
        ask('POST', one, one, json.dumps(inside).encode(), {**JSON, 'Accept': 'image/png'})
        sweep = one + '/what-if'
        for query in ('', '?parameter=R2&points=5', '?parameter=x', '?points=1', '?other=1'):
            ask('POST', sweep + query, sweep, inside)
        for body in (side(R1=4), side(muM=99)):
            ask('POST', sweep, sweep, body)
        ask('GET', sweep, sweep)

    def tour_of_studies(self, ask):
        many, csv_type = '/v1/studies', {'Content-Type': 'text/csv'}
        one = many + '/{id}'
        header = ','.join(SIDE)
        cohort = f'{header}\n7,22,31,10,8,5,403.5\n7,22,31,10,8,5,598.5\n7,5,31,10,8,5,200\n'
        design = {
            'name': 'tour',
            'design': {'kind': 'full'},
            'factors': [{'key': 'F', 'levels': [599.1, 599.2]}],
            'case': side(F=None),
        }
        made = ask('POST', many, many, cohort.encode(), csv_type).json()['links']['self']
        for body, headers in ((b'{', JSON), (b'{}', JSON), (b'x', csv_type), (b'x', {})):
            ask('POST', many, many, body, headers)
        too_large = {'Content-Length': str(1024 * 1024 + 1), 'Expect': '100-continue'}
        ask('POST', many, many, b' ' * 10, {**JSON, **too_large})
        eventually(lambda: self.service.get(made).json()['status'] == 'finished', made)
        tag = ask('GET', made, one).headers['ETag']
        ask('GET', made, one, headers={'If-None-Match': tag})
        for query in ('', '?limit=1', '?limit=0'):
            ask('GET', many + query, many)
        hanging = ask('POST', many, many, design).json()['links']['self']
        for path in (made, hanging):
            for accept in ('application/json', 'text/csv', 'image/png'):
                ask('GET', path + '/results', one + '/results', headers={'Accept': accept})
        eventually(lambda: self.service.get(hanging).json()['points']['running'], hanging)
        ask('DELETE', hanging, one)
        ask('POST', hanging + '/cancel', one + '/cancel')
        ask('POST', made + '/cancel', one + '/cancel')
        ask('DELETE', made, one)
        for suffix, method in (('', 'GET'), ('', 'DELETE'), ('/cancel', 'POST'), ('/results', 'GET')):
            ask(method, made + suffix, one + suffix)

    def test_every_answer_fits_the_contract(self):
        asked = self.tour()
        toured = {(a['method'], a['path']) for a in asked}
        self.assertEqual({(m, p) for m, p, _ in self.operations()} - toured, set())
        with tempfile.TemporaryDirectory() as folder:
            files = [os.path.join(folder, name) for name in ('openapi.json', 'asked.json')]
            for name, content in zip(files, (self.contract, asked)):
                with open(name, 'w', encoding='utf-8') as file:
                    json.dump(content, file)
            checked = subprocess.run(
                ['node', os.path.join(HERE, 'contract.mjs'), *files],
                capture_output=True,
                text=True,
                timeout=PATIENCE_S,
            )
        self.assertEqual(checked.returncode, 0, checked.stdout + checked.stderr)
        self.assertIn(f'{len(asked)} answers fit', checked.stdout)

    def test_every_kind_of_problem_is_explained(self):
        page = self.service.get('/docs').body.decode()
        for status, path, method in ((404, '/nothing', 'GET'), (405, '/healthz', 'POST')):
            problem = self.service.ask(method, path).json()
            self.assertEqual(problem['status'], status)
            self.assertIn(f'id="{problem["type"].split("#")[1]}"', page)


if __name__ == '__main__':
    unittest.main()
