#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/API.md: each of its curl lines is run, in order, and each route has one. The manual page and
the sample configuration are those of the program."""
import os
import re
import shutil
import subprocess
import tempfile
import unittest

from emulator_file import write_emulator
from service import HERE, PATIENCE_S, PROGRAM, PROXY, Service, side

ROOT = os.path.join(HERE, '../..')


def read(*path):
    with open(os.path.join(ROOT, *path), encoding='utf-8') as file:
        return file.read()


def curl_lines():
    blocks = re.findall(r'```sh\n(.*?)```', read('docs/API.md'), re.S)
    return [line for block in blocks for line in block.splitlines() if line.startswith('curl ')]


def route_of(line):
    path = re.search(r'"\$ISCHIA(/[^"?]*)', line).group(1)
    path = re.sub(r'\$(ID|RUNNING|STUDY)', '{id}', path)
    if '-X' in line:
        return re.search(r'-X (\w+)', line).group(1), path
    return ('POST' if ' -d ' in line or ' --data-binary ' in line else 'GET'), path


class Docs(unittest.TestCase):
    def test_every_route_has_a_curl_line(self):
        listed = subprocess.run(
            [PROGRAM, '--print-routes'], capture_output=True, text=True, check=True
        )
        routes = {
            tuple(line.split()[:2])
            for line in listed.stdout.splitlines()
            if not re.search(' (page|fhir|cds) ', line)
        }
        self.assertEqual(routes, {route_of(line) for line in curl_lines()})

    def test_what_needs_no_token_is_listed(self):
        listed = subprocess.run(
            [PROGRAM, '--print-routes'], capture_output=True, text=True, check=True
        )
        routes = [line.split() for line in listed.stdout.splitlines()]
        free = {words[1].removesuffix('{file}') for words in routes if words[-1] == 'open'}
        access = read('docs/API.md').split('\n## Access\n')[1].split('\n| scope')[0]
        self.assertEqual(set(re.findall('`(/[^`]*)`', access)), free)

    def study(self, service):
        design = {
            'name': 'docs',
            'design': {'kind': 'full'},
            'factors': [{'key': 'F', 'levels': [599, 599.5]}],
            'case': side(F=None),
        }
        return service.ask('POST', '/v1/studies', design).json()['id']

    def test_every_curl_line_works(self):
        with tempfile.TemporaryDirectory() as folder:
            emulator = os.path.join(folder, 'emulator.txt')
            write_emulator(emulator)
            with Service('--emulator', emulator) as service:
                service.until_ready()
                self.run_lines(service, folder)

    def run_lines(self, service, folder):
        environment = {
            **os.environ,
            'ISCHIA': service.origin,
            'CURL_HOME': folder,
            'ID': service.submit(F=250.5, subject='P-017', side='left')['id'],
            'RUNNING': service.submit(wait=0, F=599)['id'],
            'STUDY': self.study(service),
        }
        shutil.copy(os.path.join(ROOT, 'examples/table2.csv'), folder)
        shutil.copy(os.path.join(ROOT, 'examples/design_table1_composite.json'), folder)
        if PROXY:  # as a user would: once, for all that follow
            with open(os.path.join(folder, '.curlrc'), 'w', encoding='utf-8') as file:
                file.write(service.curl_options())
        lines = sorted(curl_lines(), key=lambda line: ('/cancel' not in line, 'DELETE' in line))
        for line in lines:
            done = subprocess.run(
                ['bash', '-c', line],
                env=environment,
                cwd=folder,
                timeout=PATIENCE_S,
                capture_output=True,
                text=True,
            )
            self.assertEqual(done.returncode, 0, f'{line}\n{done.stderr}')
        self.assertTrue(os.path.getsize(os.path.join(folder, 'report.html')) > 0)

    def test_the_manual_lists_the_options_of_the_program(self):
        printed = subprocess.run(
            [PROGRAM, '--print-man'], capture_output=True, text=True, check=True
        )
        self.assertIn(
            printed.stdout,
            read('docs/man/ischiad.8'),
            'write the output of `ischiad --print-man` into docs/man/ischiad.8',
        )

    def test_the_sample_configuration_is_the_default(self):
        sample = os.path.join(ROOT, 'deploy/ischiad.conf')
        given = subprocess.run(
            [PROGRAM, '--config', sample, '--print-config'],
            capture_output=True,
            text=True,
            check=True,
        )
        usual = subprocess.run(
            [PROGRAM, '--print-config'], capture_output=True, text=True, check=True
        )
        self.assertEqual(given.stdout, usual.stdout)

    def test_invariants_are_numbered_and_their_tests_exist(self):
        rows = re.findall(r'^\| I(\d+) \|.*\|(.*)\|$', read('docs/INVARIANTS.md'), re.M)
        self.assertEqual([int(number) for number, _ in rows], list(range(1, len(rows) + 1)))
        files = {name for _, _, names in os.walk(os.path.join(ROOT, 'tests')) for name in names}
        for number, tests in rows:
            named = re.findall(r'`(?:tests/\w+/)?(\w+\.(?:py|c))`', tests)
            self.assertTrue(named, f'I{number} has no test')
            for name in named:
                self.assertIn(name, files, f'I{number}')

    def test_operations_names_every_metric(self):
        page = read('docs/OPERATIONS.md')
        with Service() as service:
            metrics = service.get('/metrics').body.decode()
        for name in re.findall(r'# TYPE (\w+)', metrics):
            self.assertIn(f'`{name}`', page)


if __name__ == '__main__':
    unittest.main()
