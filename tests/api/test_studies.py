#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Studies over HTTP: what is asked for and answered, that no assessment waits for one, limits and
access. What the results are is the matter of tests/study/service_test.py."""
import csv
import io
import tempfile
import unittest

from service import JSON, NOBODY, SIDE, Service, admin, eventually, side

CSV = {'Content-Type': 'text/csv'}
HANGS = 599


def design(points=None, **case):
    """A design of so many points, or of two, whose other numbers are the example side's."""
    many = {'kind': 'sobol', 'points': points or 2, 'seed': points or 2}
    return {
        'name': 'some',
        'design': many,
        'factors': [{'key': 'R1', 'min': 5, 'max': 9}],
        'case': side(R1=None, **case),
    }


class Case(unittest.TestCase):
    options = ('--workers', '1')

    @classmethod
    def setUpClass(cls):
        cls.service = Service(*cls.options)
        cls.service.until_ready()

    @classmethod
    def tearDownClass(cls):
        cls.service.stop()

    def submit(self, body, query='', status=202, **headers):
        kind = CSV if isinstance(body, bytes) else {}
        answer = self.service.ask('POST', '/v1/studies' + query, body, {**kind, **headers})
        self.assertEqual(answer.status, status, answer.body)
        return answer

    def start(self, body, query=''):
        return self.submit(body, query).headers['Location']

    def points(self, study):
        return self.service.get(study).json()['points']

    def until(self, study, **counts):
        def reached():
            points = self.points(study)
            return all(points[state] >= n for state, n in counts.items())

        eventually(reached, f'{study} to have {counts}')

    def finish(self, study):
        eventually(lambda: self.service.get(study).json()['status'] == 'finished', study)

    def rows(self, study):
        table = self.service.get(study + '/results', Accept='text/csv').body.decode()
        return list(csv.DictReader(io.StringIO(table)))

    def metric(self, name):
        lines = self.service.get('/metrics').body.decode().splitlines()
        return float(next(line.split()[1] for line in lines if line.startswith(name + ' ')))


class BehindAStudy(Case):
    options = ('--workers', '2')

    def test_an_assessment_is_solved_behind_200_points(self):
        yields = self.metric('ischia_study_yields_total')
        study = self.start(design(200, F=HANGS + 0.5))
        self.until(study, running=2)
        # every worker is kept by a point that never ends: nothing but making room helps
        self.assertEqual(self.service.submit(F=301)['status'], 'succeeded')
        self.assertEqual(self.metric('ischia_study_yields_total'), yields + 1)
        self.until(study, running=2)
        points = self.points(study)
        self.assertEqual((points['queued'], points['failed']), (198, 0))
        self.service.ask('POST', study + '/cancel')

    def test_two_assessments_take_two_places(self):
        study = self.start(design(200, F=HANGS + 0.25))
        self.until(study, running=2)
        first = self.service.submit(wait=0, F=596, eM=20)
        second = self.service.submit(wait=0, F=596, eM=21)
        for document in (first, second):
            self.service.until(document['id'], 'succeeded')
        self.service.ask('POST', study + '/cancel')

    def test_a_free_worker_is_used_and_nothing_is_stopped(self):
        yields = self.metric('ischia_study_yields_total')
        study = self.start(design(1, F=HANGS + 0.75))
        self.until(study, running=1)
        self.assertEqual(self.service.submit(F=302)['status'], 'succeeded')
        self.assertEqual(self.metric('ischia_study_yields_total'), yields)
        self.service.ask('POST', study + '/cancel')


class Life(Case):
    def test_progress_and_etag(self):
        study = self.start(design(3, F=210))
        self.finish(study)
        answer = self.service.get(study)
        document = answer.json()
        self.assertEqual((document['progress'], document['points']['succeeded']), (1, 3))
        self.assertLessEqual(document['started_at'], document['finished_at'])
        same = self.service.get(study, If_None_Match=answer.headers['ETag'])
        self.assertEqual((same.status, same.body), (304, b''))

    def test_partial_results_and_cancel(self):
        study = self.start(
            {**design(F=None), 'factors': [{'key': 'F', 'levels': [211, HANGS]}],
             'design': {'kind': 'full'}, 'case': side(F=None)}
        )
        self.until(study, succeeded=1, running=1)
        self.assertEqual([row['status'] for row in self.rows(study)], ['succeeded', 'running'])
        self.assertEqual(self.service.ask('DELETE', study).status, 409)
        for _ in range(2):  # twice is no fault
            answer = self.service.ask('POST', study + '/cancel')
            self.assertEqual((answer.status, answer.json()['status']), (200, 'cancelled'))
        self.assertEqual([row['status'] for row in self.rows(study)], ['succeeded', 'cancelled'])
        self.assertEqual(self.service.submit(F=212)['status'], 'succeeded')  # a worker is free
        self.assertEqual(self.service.ask('DELETE', study).status, 204)
        for method, path in (('GET', ''), ('GET', '/results'), ('DELETE', ''), ('POST', '/cancel')):
            self.assertEqual(self.service.ask(method, study + path).status, 404)

    def test_what_is_over_cannot_be_cancelled(self):
        study = self.start(design(2, F=213))
        self.finish(study)
        self.assertEqual(self.service.ask('POST', study + '/cancel').status, 409)

    def test_assessments_and_changes_do_not_know_of_it(self):
        before = self.service.get('/v1/changes?limit=500').json()['newest_seq']
        listed = [item['id'] for item in self.service.get('/v1/assessments').json()['items']]
        self.finish(self.start(design(5, F=214)))
        self.assertEqual(self.service.get('/v1/changes').json()['newest_seq'], before)
        after = [item['id'] for item in self.service.get('/v1/assessments').json()['items']]
        self.assertEqual(after, listed)

    def test_the_list_is_paged_newest_first(self):
        made = [self.start(design(1, F=220 + i)) for i in range(5)]
        seen, path = [], '/v1/studies?limit=2'
        while path:
            page = self.service.get(path).json()
            seen += [item['links']['self'] for item in page['items']]
            more = page['next_cursor']
            path = more and f'/v1/studies?limit=2&cursor={more}'
        self.assertEqual(seen[:5], made[::-1])
        self.assertEqual(len(seen), len(set(seen)))

    def test_a_key_makes_one_study(self):
        key = {'Idempotency-Key': 'study-1'}
        first = self.submit(design(2, F=230), **key).json()
        again = self.submit(design(2, F=230), **key).json()
        self.assertEqual(first['id'], again['id'])
        other = self.submit(design(2, F=231), status=422, **key)
        self.assertIn('idempotency', other.json()['type'])


class Refusals(Case):
    options = ('--workers', '1', '--study-limit', '100')

    def errors(self, answer):
        return {(e['pointer'], e['code']) for e in answer.json()['errors']}

    def test_all_faults_of_a_design_come_at_once(self):
        body = {**design(F=None), 'factors': [{'key': 'muX', 'levels': [1, 2]}], 'responses': ['x'],
                'seed': 3}
        answer = self.submit(body, status=422)
        self.assertEqual(
            self.errors(answer),
            {('/seed', 'unknown'), ('/factors/0', 'unknown'), ('/responses', 'unknown'),
             ('/case/F', 'missing'), ('/case/R1', 'missing')},
        )

    def test_a_factor_that_is_no_object(self):
        for factor in ([1], ['R1'], [[]], 1, 'R1', None, True):
            answer = self.submit({**design(), 'factors': [factor]}, status=422)
            self.assertIn(('/factors/0', 'wrong_type'), self.errors(answer), factor)

    def test_what_cannot_be_read(self):
        for body, headers, status in (
            (b'{', JSON, 400), (b'', JSON, 400), (b'', CSV, 400), (b'R1,R2\n1,2\n', CSV, 422),
            (b'a;b\n1;2\n', CSV, 422), (b'x', {'Content-Type': 'text/xml'}, 415), (b'x', {}, 415),
        ):
            answer = self.service.ask('POST', '/v1/studies', body, headers)
            self.assertEqual(answer.status, status, body)
            self.assertEqual(answer.type, 'application/problem+json')
        header = ','.join(SIDE).encode()
        for query, status in (('?model=printed', 422), ('?name=Jane%20Doe', 400), ('?names=x', 400)):
            self.submit(header + b'\n', query, status)
        self.submit(design(1), '?name=x', 400)  # a design has a name of its own

    def test_too_many_points(self):
        self.assertIn(('/design', 'out_of_range'), self.errors(self.submit(design(101), status=422)))
        rows = '\n'.join([','.join(SIDE)] + [','.join(map(str, SIDE.values()))] * 101)
        self.assertIn(('', 'out_of_range'), self.errors(self.submit(rows.encode(), status=422)))
        first = self.start(design(60, F=HANGS))
        full = self.submit(design(60, F=233), status=429)
        self.assertTrue(full.headers['Retry-After'])
        self.service.ask('POST', first + '/cancel')
        self.finish(self.start(design(60, F=233)))

    def test_the_size_of_a_body(self):
        answer = self.service.ask('POST', '/v1/studies', b' ' * (1024 * 1024 + 1), JSON)
        self.assertEqual(answer.status, 413)

    def test_pages_of_others_may_not_start_one(self):
        headers = {'Origin': 'https://evil.example'}
        self.submit(design(1, F=234), status=403, **headers)


class Access(unittest.TestCase):
    def test_scopes(self):
        with tempfile.TemporaryDirectory() as state:
            tokens = {}
            for scope in ('read', 'read,assess', 'read,assess,admin'):
                words = admin(state, 'token', 'create', 'name=x', f'scope={scope}').split()
                token = next(word for word in words if len(word) > 40)
                tokens[scope] = {'Authorization': f'Bearer {token}'}
            with Service(state=state) as service:
                service.until_ready(**tokens['read'])
                self.assertEqual(service.ask('POST', '/v1/studies', design(1), NOBODY).status,
                                 401)
                denied = service.ask('POST', '/v1/studies', design(1), tokens['read'])
                self.assertEqual(denied.status, 403)
                made = service.ask('POST', '/v1/studies', design(1), tokens['read,assess'])
                study = made.headers['Location']
                for path in ('/v1/studies', study, study + '/results'):
                    self.assertEqual(service.ask('GET', path, None, NOBODY).status, 401)
                    self.assertEqual(service.ask('GET', path, None, tokens['read']).status, 200)
                cancel = study + '/cancel'
                self.assertEqual(service.ask('POST', cancel, None, tokens['read']).status, 403)
                erase = service.ask('DELETE', study, None, tokens['read,assess'])
                self.assertEqual(erase.status, 403)
                log = admin(state, 'audit', 'list')
                self.assertIn('study.create', log)


if __name__ == '__main__':
    unittest.main()
