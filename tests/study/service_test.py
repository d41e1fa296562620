#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The results of studies over HTTP are those of the command line: service_test.py PROGRAM
SOURCE_ROOT [unittest arguments], the daemon in $ISCHIAD. PROGRAM is `ischia` on a solver whose
eps_max is a known polynomial (tests/double)."""

import csv
import io
import json
import os
import subprocess
import sys
import tempfile
import unittest

POLYNOMIAL, ROOT = sys.argv[1], sys.argv[2]
sys.path.insert(0, os.path.join(ROOT, 'tests/api'))
from service import Service, eventually  # noqa: E402  (the path comes first)


def read(name):
    with open(os.path.join(ROOT, 'examples', name), 'rb') as file:
        return file.read()


class Case(unittest.TestCase):
    """Each class has a service of its own."""

    @classmethod
    def setUpClass(cls):
        cls.service = Service(worker=POLYNOMIAL)
        cls.service.until_ready()

    @classmethod
    def tearDownClass(cls):
        cls.service.stop()

    def start(self, body, query=''):
        kind = {'Content-Type': 'text/csv'} if isinstance(body, bytes) else {}
        answer = self.service.ask('POST', '/v1/studies' + query, body, kind)
        self.assertEqual(answer.status, 202, answer.body)
        return answer.headers['Location']

    def finish(self, study):
        eventually(lambda: self.service.get(study).json()['status'] == 'finished', study)

    def points_solved(self):
        lines = self.service.get('/metrics').body.decode().splitlines()
        name = 'ischia_study_points_total '
        return float(next(line for line in lines if line.startswith(name)).split()[1])


class Results(Case):
    def table(self, study):
        return self.service.get(study + '/results', Accept='text/csv').body.decode()

    def rows(self, study):
        return list(csv.DictReader(io.StringIO(self.table(study))))

    def command_line(self, *words, text):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, 'in')
            with open(path, 'wb') as file:
                file.write(text)
            out = os.path.join(folder, 'out.csv')
            words = [path if word == '{}' else word for word in words]
            subprocess.run([POLYNOMIAL, *words, '-o', out], capture_output=True, check=False)
            with open(out, encoding='utf-8', newline='') as file:
                return file.read()

    def test_a_design_gives_what_the_command_line_gives(self):
        text = json.loads(read('design_table1_composite.json'))
        text['factors'][0] = {'key': 'R1', 'levels': [5, 7, 16]}  # 16 mm is refused
        text = json.dumps(text).encode()
        study = self.start(json.loads(text))
        self.finish(study)
        ours = self.table(study).splitlines()
        theirs = self.command_line('study', 'factorial', '{}', '-q', text=text).splitlines()
        self.assertEqual(len(ours), 80)
        statuses = [line.split(',')[8] for line in ours[1:]]
        self.assertEqual({'succeeded', 'failed', 'refused'}, set(statuses))
        for mine, other, status in zip(ours, theirs, ['header', *statuses]):
            if status == 'failed':  # the same row and reason, in the words of a problem document
                self.assertEqual(mine.split(',')[:9], other.split(',')[:9])
                self.assertIn('diverged_step: ', mine)
            else:
                self.assertEqual(mine, other)
        failed = next(row for row in self.rows(study) if row['status'] == 'failed')
        self.assertEqual((failed['last_converged_F_N'], failed['eps_max']), ('300', ''))

    def test_a_cohort_gives_what_the_command_line_gives(self):
        text = read('table2.csv') + b'P,right,7,22,31,10,8,5\nQ,left,7,22,31,10,80,5,300\n"x\n'
        study = self.start(text, '?name=table2')
        self.finish(study)
        theirs = list(csv.reader(io.StringIO(self.command_line('cohort', '{}', text=text))))
        ours = list(csv.reader(io.StringIO(self.table(study))))
        self.assertEqual(len(ours), 1 + 26 + 3)
        self.assertEqual([row[:-1] for row in ours], [row[:-1] for row in theirs])  # not wall_s

    def test_json_says_the_same(self):
        study = self.start(read('table2.csv') + b'P,right,7,6,31,10,8,5,200\n', '?model=as-published')
        self.finish(study)
        document = self.service.get(study + '/results').json()
        self.assertEqual(document['columns'], read('table2.csv').decode().split()[0].split(','))
        self.assertEqual([item['row'] for item in document['items']], list(range(1, 28)))
        for item, row in zip(document['items'], self.rows(study)):
            self.assertEqual(item['cells'], [row[c] for c in document['columns']])
            self.assertEqual(item['status'], row['status'])
            if item['results'] is None:
                continue
            self.assertEqual(item['results']['eps_max'], float(row['eps_max']))
            self.assertEqual(item['model']['name'], 'as-published')
            self.assertEqual(item['model']['bulk_ratio'], 100)
        refused = document['items'][26]
        self.assertEqual((refused['status'], refused['parameters']), ('refused', None))
        self.assertIn('R2', refused['problem']['detail'])


class Known(Case):
    def test_what_is_known_is_not_solved_again(self):
        body = json.loads(read('design_table1_sobol.json'))
        body['design']['points'] = 20
        self.finish(self.start(body))
        # A point is counted just after it has ended.
        eventually(lambda: self.points_solved() == 20, 'the last point to be counted')
        again = self.start(body)
        self.finish(again)
        self.assertEqual(self.points_solved(), 20)
        self.assertEqual(self.service.get(again).json()['points']['succeeded'], 20)


unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
