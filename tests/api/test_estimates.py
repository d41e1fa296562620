#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""POST /v1/estimates: numbers of the trained emulator, in the request; none where it knows nothing,
and none without one."""
import os
import subprocess
import tempfile
import unittest

from emulator_file import BOX, eps_max, write_emulator
from service import JSON, NOBODY, PATIENCE_S, Service, admin, command_line, side

INSIDE = side(R1=7, R2=40, eM=29, eF=22, muM=4, muF=5, F=300)


class Estimates(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = os.path.join(cls.folder.name, 'emulator.txt')
        write_emulator(cls.path)
        cls.service = Service('--emulator', cls.path)
        cls.service.until_ready()

    @classmethod
    def tearDownClass(cls):
        cls.service.stop()
        cls.folder.cleanup()

    def ask(self, body, status=200):
        answer = self.service.ask('POST', '/v1/estimates', body)
        self.assertEqual(answer.status, status, answer.body)
        return answer.json()

    def codes(self, document):
        return {(w['code'], w['pointer']) for w in document['warnings']}

    def test_the_numbers_are_those_of_the_file(self):
        for changes in ({}, {'R1': 5}, {'R1': 9, 'muM': 8}, {'F': 427.5, 'R1': 6.2}):
            document = self.ask({**INSIDE, **changes})
            value, half = eps_max({**INSIDE, **changes})
            got = document['strain']['eps_max']
            self.assertAlmostEqual(got['value'], value, places=12)
            self.assertAlmostEqual(got['low'], value - half, places=12)
            self.assertAlmostEqual(got['high'], value + half, places=12)

    def test_it_says_that_it_is_an_estimate_and_whose(self):
        document = self.ask(INSIDE)
        self.assertEqual(document['kind'], 'estimate')
        self.assertEqual(document['parameters'], INSIDE)
        self.assertEqual(document['emulator']['rows'], 100)
        self.assertEqual(len(document['emulator']['sha256']), 64)
        self.assertEqual(self.codes(document), {('trial_emulator', '')})
        self.assertNotIn('result', document)
        self.assertNotIn('id', document)

    def test_limits_of_nature_hold(self):
        document = self.ask(INSIDE)
        self.assertEqual(document['strain']['E_comp_max'], {'value': 0.49, 'low': 0.39, 'high': 0.5})
        self.assertEqual(document['clusters']['both']['volume_mm3']['low'], 0)
        # a threshold whose force is beyond the case's own is not reached
        self.assertEqual(document['threshold_force_N']['shear']['value'], 250)
        self.assertIsNone(self.ask({**INSIDE, 'F': 249})['threshold_force_N']['shear'])
        self.assertIsNone(document['threshold_force_N']['compression'])  # not in the file

    def test_outside_its_training_it_gives_none(self):
        low, high = BOX['R1']
        for changes, expected in (
            ({'R1': low - 0.1}, {('outside_training', '/R1')}),
            ({'R1': high + 0.1, 'muM': 9}, {('outside_training', '/R1'), ('outside_training', '/muM')}),
            ({'model': 'as-published'}, {('other_model', '/model')}),
            ({'skin': {'mu': 100}}, {('other_model', '/model')}),
        ):
            document = self.ask({**INSIDE, **changes})
            for group in ('strain', 'clusters', 'seat', 'threshold_force_N'):
                self.assertIsNone(document[group])
            self.assertLessEqual(expected, self.codes(document))

    def test_faults_are_those_of_an_assessment(self):
        errors = self.ask({**INSIDE, 'muM': 80, 'muN': 1}, 422)['errors']
        self.assertEqual({e['pointer'] for e in errors}, {'/muM', '/muN'})
        self.assertEqual(self.service.ask('POST', '/v1/estimates', b'{', JSON).status, 400)
        form = {'Content-Type': 'application/x-www-form-urlencoded'}
        self.assertEqual(self.service.ask('POST', '/v1/estimates', b'R1=7', form).status, 415)

    def test_nothing_is_stored_or_queued(self):
        self.ask({**INSIDE, 'subject': 'P-9'})
        self.assertEqual(self.service.get('/v1/assessments').json()['items'], [])
        self.assertEqual(self.service.get('/v1/changes').json()['last_seq'], 0)


class Intervals(unittest.TestCase):
    """The cache gives back no interval that another emulator, or none, made."""

    def test_another_emulator_solves_again(self):
        bare, uncertain = {}, {'sd': 'typical'}
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, 'emulator.txt')
            write_emulator(path)
            ask = lambda service, sd: service.submit(**INSIDE, **sd)['cached']
            with Service('--emulator', 'none', state=folder) as service:
                self.assertEqual([ask(service, sd) for sd in (bare, uncertain)], [False, False])
                self.assertEqual([ask(service, sd) for sd in (bare, uncertain)], [True, True])
            for solved in (False, True):
                with Service('--emulator', path, state=folder) as service:
                    self.assertEqual(ask(service, bare), True)
                    self.assertEqual(ask(service, uncertain), solved)


class WhatIf(unittest.TestCase):
    """POST /v1/estimates/what-if: the same numbers along one input."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        path = os.path.join(cls.folder.name, 'emulator.txt')
        write_emulator(path)
        cls.service = Service('--emulator', path)
        cls.service.until_ready()

    @classmethod
    def tearDownClass(cls):
        cls.service.stop()
        cls.folder.cleanup()

    def sweep(self, query='', **changes):
        answer = self.service.ask('POST', '/v1/estimates/what-if' + query, {**INSIDE, **changes})
        self.assertEqual(answer.status, 200, answer.body)
        return answer.json()

    def test_each_point_is_the_estimate_there(self):
        document = self.sweep('?parameter=muM&points=9')
        self.assertEqual((document['kind'], document['parameter']), ('what_if', 'muM'))
        self.assertEqual([p['at'] for p in document['points']], [1 + 7 * k / 8 for k in range(9)])
        for point in document['points']:
            value, half = eps_max({**INSIDE, 'muM': point['at']})
            got = point['strain']['eps_max']
            self.assertAlmostEqual(got['value'], value, places=12)
            self.assertAlmostEqual(got['high'], value + half, places=12)

    def test_force_is_the_usual_one(self):
        document = self.sweep()
        self.assertEqual((document['parameter'], document['unit']), ('F', 'N'))
        self.assertEqual(len(document['points']), 41)
        self.assertEqual((document['points'][0]['at'], document['points'][-1]['at']), BOX['F'])
        # crossed at 250 N: below that the threshold is not reached
        crossed = [p['threshold_force_N']['shear'] for p in document['points']]
        self.assertEqual([c is not None for c in crossed], [p['at'] >= 250 for p in document['points']])
        self.assertEqual(self.sweep(F=200)['target_force_N']['shear']['value'], 250)

    def test_margins_are_thresholds_less_strains(self):
        margin = self.sweep('?points=2')['points'][0]['margin']
        self.assertAlmostEqual(margin['shear']['value'], 0.75 - 1.5)
        self.assertAlmostEqual(margin['shear']['low'], 0.75 - 1.6)
        self.assertAlmostEqual(margin['compression']['high'], 0.45 - 0.39)
        self.assertAlmostEqual(margin['compression']['low'], 0.45 - 0.5)

    def test_points_are_cases(self):
        document = self.sweep('?parameter=R2', R1=8)
        self.assertEqual(document['points'][0]['at'], 15)  # the box, above R1
        document = self.sweep('?parameter=R1', R2=15)
        self.assertEqual(document['points'][-1]['at'], 9)

    def test_outside_there_are_none(self):
        document = self.sweep(R1=4)
        self.assertEqual(document['points'], [])
        self.assertIsNone(document['target_force_N'])
        self.assertIn('outside_training', [w['code'] for w in document['warnings']])
        # the input itself may lie outside: its range is what is asked about
        self.assertEqual(len(self.sweep('?parameter=R1', R1=4)['points']), 41)

    def test_queries_that_make_no_sense(self):
        for query in ('?parameter=skin', '?parameter=', '?points=1', '?points=202', '?points=x'):
            answer = self.service.ask('POST', '/v1/estimates/what-if' + query, INSIDE)
            self.assertEqual(answer.status, 400, query)
        german = self.service.ask('POST', '/v1/estimates/what-if?points=x', INSIDE,
                                  {'Accept-Language': 'de'}).json()
        self.assertEqual(german['detail'], 'parameter ist eines von R1, R2, eM, eF, muM, muF, F, und '
                                           'points eine ganze Zahl von 2 bis 201.')


class Installing(unittest.TestCase):
    def test_without_one_there_are_none(self):
        with Service('--emulator', 'none') as service:
            answer = service.ask('POST', '/v1/estimates', INSIDE)
            self.assertEqual(answer.status, 404)
            self.assertIn('No trained emulator is in use', answer.json()['detail'])

    def test_a_damaged_one_is_refused_at_start(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, 'emulator.txt')
            write_emulator(path)
            with open(path, encoding='ascii') as file:
                good = file.read()
            for text, words in (
                (good.replace('250', '251'), 'does not match its checksum'),
                ('{}', 'does not begin as a trained emulator does'),
            ):
                with open(path, 'w', encoding='ascii') as file:
                    file.write(text)
                command = command_line(os.path.join(folder, 'state'), '--emulator', path)
                done = subprocess.run(
                    command, capture_output=True, text=True, timeout=PATIENCE_S, check=False
                )
                self.assertEqual(done.returncode, 2)
                self.assertIn(words, done.stderr)

    def test_a_token_to_read_is_not_enough(self):
        with tempfile.TemporaryDirectory() as state:
            words = admin(state, 'token', 'create', 'name=x', 'scope=read').split()
            token = {'Authorization': 'Bearer ' + next(w for w in words if len(w) > 40)}
            with Service(state=state) as service:
                self.assertEqual(service.ask('POST', '/v1/estimates', INSIDE, token).status, 403)
                self.assertEqual(service.ask('POST', '/v1/estimates', INSIDE, NOBODY).status,
                                 401)


if __name__ == '__main__':
    unittest.main()
