#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/INTEGRATION.md: every block is run, every route is in it, and its tables are those of the
program."""
import json
import os
import re
import subprocess
import tempfile
import unittest

import hl7
import interop
from service import PROGRAM, Service

ISCHIA = os.environ.get('ISCHIA', 'ischia')


def read(*path):
    with open(os.path.join(interop.ROOT, *path), encoding='utf-8') as file:
        return file.read()


PAGE = read('docs/INTEGRATION.md')


def blocks(kind):
    fences = re.findall(r'^```(\w*)\n(.*?)^```$', PAGE, re.S | re.M)
    return [text for name, text in fences if name == kind]


class Integration(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.service = Service('--hl7-listen', '127.0.0.1:0')
        cls.service.until_ready()

    @classmethod
    def tearDownClass(cls):
        cls.service.stop()

    def test_every_block_runs(self):
        self.assertGreaterEqual(len(blocks('sh')), 7)
        script = 'set -euo pipefail\n' + '\n'.join(
            f'echo "== {n}"\n{block}' for n, block in enumerate(blocks('sh')))
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run(
                ['bash', '-c', script], cwd=folder, capture_output=True, text=True, timeout=120,
                env={**os.environ, 'ISCHIA': f'http://{self.service.address}',
                     'HL7': f'127.0.0.1:{hl7.port_of(self.service)}',
                     'PATH': os.path.dirname(ISCHIA) + ':' + os.environ['PATH']})
        self.assertEqual(done.returncode, 0, done.stdout[-2000:] + done.stderr)
        self.assertIn('MSA|AA|', done.stdout)
        message = next(block for block in blocks('') if block.startswith('MSH|'))
        self.assertIn(message.partition('\n')[2], done.stdout, 'is what `ischia hl7 message` prints')
        self.assertIn('\nfinal\n', done.stdout)
        self.assertIn('"indicator"', done.stdout)

    def test_every_route_is_in_it(self):
        listed = subprocess.run(
            [PROGRAM, '--print-routes'], capture_output=True, text=True, check=True).stdout
        run = '\n'.join(blocks('sh')).replace('\\$', '$')
        for method, path, contract in re.findall(r'^(\w+) (\S+) (\w+) ', listed, re.M):
            if contract not in ('fhir', 'cds'):
                continue
            shown = path.split('/{')[0]
            if path == '/fhir/async/{id}':  # its address is in $WHERE
                self.assertIn('$WHERE', run)
                continue
            self.assertTrue(f'$ISCHIA{shown}' in run, (method, path))
            if '{' in path:
                self.assertTrue(re.search(re.escape(shown) + r'/[$\w]', run), path)

    def test_the_table_of_numbers_is_that_of_the_program(self):
        concepts = self.service.get('/fhir/CodeSystem/measure').json()['concept']
        listed = interop.mapping()
        self.assertEqual([m['code'] for m in listed], [c['code'] for c in concepts])
        for row, concept in zip(listed, concepts):
            line = next(n for n in PAGE.splitlines() if n.startswith(f'| `{row["code"]}` '))
            meaning = line.split(' | ')[-1].removesuffix(' |')
            self.assertTrue(concept['definition'].startswith(
                f'{meaning} Unit: {row["unit"]}.'), (row, concept))
        inputs = {p['key']: p for p in self.service.get('/v1/parameters').json()['parameters']}
        self.assertEqual([m['code'] for m in listed if m['way'] == 'in'], list(inputs))
        for row in listed[:len(inputs)]:
            self.assertEqual(row['unit'], inputs[row['code']]['unit'])
        document = self.service.submit(F=300)
        interval = [row for row in listed if row['v1'].startswith('/result/uncertainty/')]
        self.assertEqual(len(interval), 2)  # those: uncertainty_test.py, these inputs are exact
        for row in listed[:-2]:
            place = document
            for key in row['v1'].strip('/').split('/'):
                self.assertIn(key, place)
                place = place[key]

    def test_each_unit_that_is_listed_is_taken_and_no_other(self):
        rows = re.findall(r'^\| `(mm|kPa|N)` \| (.*?) \|$', PAGE, re.M)
        self.assertEqual([r[0] for r in rows], ['mm', 'kPa', 'N'])
        key = {'mm': 'R1', 'kPa': 'muM', 'N': 'F'}
        for canonical, listed in rows:
            units = re.findall(r'`([^`]+)`', listed)
            body = interop.parameters()
            mine = next(p for p in body['parameter'] if p['name'] == key[canonical])
            mine['valueQuantity']['code'] = 'nonsense'
            told = interop.post(self.service, body).json()['issue'][0]['diagnostics']
            self.assertEqual(told.split('accepted ')[1].split(', '), units)

    def test_the_configuration_is_good(self):
        (text,) = blocks('ini')
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, 'ischiad.conf')
            with open(path, 'w', encoding='utf-8') as file:
                file.write(text)
            done = subprocess.run([PROGRAM, '--config', path, '--check-config'],
                                  capture_output=True, text=True)
            self.assertEqual((done.returncode, done.stderr), (0, ''))
        named = set(re.findall(r'`((?:hl7|webhook|push|outbound|cds)_\w+|public_url)`', PAGE))
        known = subprocess.run([PROGRAM, '--print-config'], capture_output=True, text=True,
                               check=True).stdout
        for name in named:
            self.assertTrue(f'\n{name} = ' in known, name)
        for name in re.findall(r'(?m)^((?:hl7|webhook|push|outbound|cds)_\w+|public_url) =', known):
            self.assertTrue(name in PAGE, name)

    def test_the_example_message_is_taken(self):
        message = next(b for b in blocks('') if b.startswith('MSH|'))
        with hl7.Mllp(hl7.port_of(self.service)) as link:
            self.assertEqual(link.ask(message), ('AA', '4711', []))

    def test_the_check_of_a_signature_holds(self):
        import base64
        import hashlib
        import hmac
        (text,) = blocks('python')
        scope = {}
        exec(text, scope)  # what the page tells receivers to use
        headers = {'webhook-id': 'msg_1', 'webhook-timestamp': '1'}
        mac = hmac.new(b'k', b'msg_1.1.{}', hashlib.sha256).digest()
        headers['webhook-signature'] = 'v1,' + base64.b64encode(mac).decode()
        self.assertTrue(scope['is_ours'](headers, b'{}', b'k'))
        self.assertFalse(scope['is_ours'](headers, b'{ }', b'k'))
        json.loads(blocks('json')[0].replace('…', ''))


if __name__ == '__main__':
    unittest.main()
