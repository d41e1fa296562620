#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""deploy/sbom.py on the built programs: it fits CycloneDX, and nothing that runs is left out."""
import json
import os
import re
import subprocess
import sys
import tempfile
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.join(HERE, '../..')
PROGRAMS = [os.environ['ISCHIAD'], os.environ['ISCHIA']]
PATIENCE_S = 600


def write():
    done = subprocess.run([sys.executable, os.path.join(ROOT, 'deploy/sbom.py'), *PROGRAMS],
                          capture_output=True, text=True, timeout=PATIENCE_S, check=True)
    return done.stdout


class Parts(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.text = write()
        cls.bom = json.loads(cls.text)
        cls.parts = {part['bom-ref']: part for part in cls.bom['components']}
        cls.needed = {part['name'] for part in cls.bom['components'] if part['scope'] == 'required'}

    def test_it_fits_the_schema_of_cyclonedx(self):
        with tempfile.NamedTemporaryFile('w', suffix='.json', encoding='utf-8') as file:
            file.write(self.text)
            file.flush()
            done = subprocess.run(['node', os.path.join(HERE, 'sbom.mjs'), file.name], cwd=HERE,
                                  capture_output=True, text=True, timeout=PATIENCE_S)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_every_part_has_version_and_licence(self):
        self.assertEqual(len(self.parts), len(self.bom['components']), 'references are unique')
        for part in self.bom['components']:
            self.assertTrue(part['version'], part['name'])
            licence = part['licenses'][0]
            text = licence.get('expression') or licence['license'].get('id', '') or \
                licence['license']['name']
            self.assertTrue(text, part['name'])
            if part['scope'] == 'required' and 'npm/' in part['bom-ref']:
                self.assertEqual(part['hashes'][0]['alg'], 'SHA-512', part['name'])
                self.assertNotIn('not declared', text)

    def test_every_library_that_is_loaded_is_in_it(self):
        for word in ('libsqlite3-0', 'libpq5', 'libmicrohttpd12', 'libgnutls30', 'libcholmod3',
                     'libsodium23', 'libc6', 'libcjson1', 'libseccomp2'):
            self.assertIn(word, self.needed)
        self.assertTrue(any(name.startswith('libopenblas') for name in self.needed))
        for program in PROGRAMS:
            ref = 'program:' + os.path.basename(program)
            row = next(row for row in self.bom['dependencies'] if row['ref'] == ref)
            self.assertFalse(set(row['dependsOn']) - set(self.parts))
            text = subprocess.run(['ldd', program], capture_output=True, text=True).stdout
            self.assertGreater(len(row['dependsOn']), 8, text)

    def test_everything_in_the_page_is_in_it(self):
        with open(os.path.join(ROOT, 'static/dist/assets/licences.txt'), encoding='utf-8') as file:
            bundled = re.findall(r'^(\S+) (\S+) \(([^)]+)\)$', file.read(), re.M)
        self.assertGreater(len(bundled), 5)
        for name, version, licence in bundled:
            found = [p for p in self.bom['components']
                     if (p['name'], p['version'], p['scope']) == (name, version, 'required')]
            self.assertEqual(len(found), 1, name)
            self.assertEqual(found[0]['licenses'], [{'license': {'id': licence}}], name)

    def test_the_same_programs_give_the_same_bytes(self):
        self.assertEqual(write(), self.text)


if __name__ == '__main__':
    unittest.main()
