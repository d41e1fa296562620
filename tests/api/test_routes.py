#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Every route of the service, driven by a client: what it answers when all is well, and each
documented error."""
import csv
import gzip
import io
import json
import os
import re
import threading
import time
import unittest
import urllib.parse

from service import JSON, SIDE, Answer, Service, direct_only, eventually, side

HERE = os.path.dirname(os.path.abspath(__file__))
ABSENT = '/v1/assessments/01a201a9-49a6-75d9-8b79-1f36e7bd6914'


class Routes(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.service = Service('--queue-limit', '1000')
        cls.service.until_ready()

    @classmethod
    def tearDownClass(cls):
        cls.service.stop()

    def problem(self, answer, status):
        self.assertEqual(answer.status, status, answer.body)
        self.assertEqual(answer.type, 'application/problem+json')
        document = answer.json()
        self.assertEqual(document['status'], status)
        for key in ('type', 'title', 'detail', 'instance'):
            self.assertTrue(document[key], key)
        self.assertTrue(document['type'].startswith('/docs#problem-'))
        return document

    def errors(self, answer):
        return {(e['pointer'], e['code']) for e in self.problem(answer, 422)['errors']}

    # ------------------------------------------------------------------ submit

    def test_a_submission_is_accepted_and_solved(self):
        answer = self.service.ask(
            'POST', '/v1/assessments', side(F=200.5, subject='P-1', side='left')
        )
        self.assertEqual(answer.status, 202)
        document = answer.json()
        self.assertEqual(answer.headers['Location'], '/v1/assessments/' + document['id'])
        self.assertEqual(document['parameters'], side(F=200.5))
        done = self.service.until(document['id'], 'succeeded')
        self.assertEqual(done['result']['strain']['eps_max'], 1.2)
        self.assertEqual(done['progress'], 1)
        self.assertEqual(done['links']['field'], f'/v1/assessments/{done["id"]}/field.vtu')

    def test_prefer_wait_answers_with_the_finished_document(self):
        answer = self.service.ask('POST', '/v1/assessments', side(F=201.5), {'Prefer': 'wait=60'})
        self.assertEqual(answer.status, 201)
        self.assertEqual(answer.headers['Preference-Applied'], 'wait')
        self.assertEqual(answer.json()['status'], 'succeeded')

    def test_prefer_wait_gives_up_in_time(self):
        begun = time.monotonic()
        answer = self.service.ask(
            'POST', '/v1/assessments', side(F=599, eM=30), {'Prefer': 'wait=1'}
        )
        self.assertEqual(answer.status, 202)
        self.assertLess(time.monotonic() - begun, 50)
        self.assertGreaterEqual(time.monotonic() - begun, 0.9)
        self.assertEqual(
            self.service.ask('POST', answer.headers['Location'] + '/cancel').status, 200
        )

    def test_greek_spellings_are_the_same(self):
        for spelling in ('\u03bcM', '\u00b5M'):
            document = self.service.submit(muM=None, F=202.5, **{spelling: 8})
            self.assertEqual(document['parameters']['muM'], 8)
        twice = self.service.ask('POST', '/v1/assessments', side(**{'\u03bcM': 8}))
        self.assertIn('duplicate', {code for _, code in self.errors(twice)})

    def test_the_same_case_is_not_solved_twice(self):
        first = self.service.submit(F=203.5, subject='A')
        second = self.service.submit(F=203.5, subject='B')
        self.assertFalse(first['cached'])
        self.assertTrue(second['cached'])
        self.assertEqual(second['started_at'], second['finished_at'])
        self.assertIsNotNone(second['started_at'])
        self.assertNotEqual(first['id'], second['id'])
        self.assertEqual(first['result'], second['result'])

    def test_what_is_not_json_is_400(self):
        for body in (b'', b'{', b'{"R1":NaN}', b'{} x', b'\xff', b'{"R1":1,}', b"{'R1':1}"):
            answer = self.service.ask('POST', '/v1/assessments', body, JSON)
            self.problem(answer, 400)

    def test_all_faults_come_at_once(self):
        answer = self.service.ask(
            'POST',
            '/v1/assessments',
            side(muM=80, F='258', R1=None, muN=3, subject='Jane Doe', side='up'),
        )
        self.assertEqual(
            self.errors(answer),
            {
                ('/muM', 'out_of_range'),
                ('/F', 'wrong_type'),
                ('/R1', 'missing'),
                ('/muN', 'unknown'),
                ('/subject', 'malformed'),
                ('/side', 'not_allowed'),
            },
        )

    def test_json_that_is_more_than_is_taken_is_422(self):
        deep = json.dumps(SIDE)[:-1] + ', "label": ' + '[' * 16 + ']' * 16 + '}'
        nul = json.dumps(side(label='a\0b'))
        for path in ('/v1/assessments', '/v1/studies'):
            for body, code in ((deep, 'too_many'), (nul, 'malformed')):
                answer = self.service.ask('POST', path, body.encode(), JSON)
                self.assertIn(('', code), self.errors(answer))
        self.problem(self.service.ask('POST', '/v1/assessments', deep[:-1].encode(), JSON), 400)

    def test_a_duplicate_key_is_refused(self):
        body = json.dumps(SIDE)[:-1] + ', "F": 200}'
        self.assertIn(
            ('/F', 'duplicate'),
            self.errors(self.service.ask('POST', '/v1/assessments', body.encode(), JSON)),
        )

    def test_another_media_type_is_415(self):
        self.problem(
            self.service.ask('POST', '/v1/assessments', b'x', {'Content-Type': 'text/xml'}), 415
        )
        self.problem(self.service.ask('POST', '/v1/assessments', b'x', {}), 415)

    def test_a_packed_body_is_415(self):
        body = json.dumps(side(F=204.25)).encode()
        for path in ('/v1/assessments', '/v1/studies', '/v1/estimates', '/fhir/$assess'):
            packed = {**JSON, 'Content-Encoding': 'gzip'}
            answer = self.service.ask('POST', path, gzip.compress(body), packed)
            self.assertEqual(answer.status, 415, path)
            self.assertEqual(answer.headers['Accept-Encoding'], 'identity')
        plain = {**JSON, 'Content-Encoding': 'Identity'}
        self.assertEqual(self.service.ask('POST', '/v1/assessments', body, plain).status, 202)

    def test_too_large_a_body_is_413(self):
        for size in (64 * 1024 + 1, 3 * 1024 * 1024):
            answer = self.service.ask(
                'POST',
                '/v1/assessments',
                b' ' * 10,
                {**JSON, 'Content-Length': str(size), 'Expect': '100-continue'},
            )
            self.problem(answer, 413)
        answer = self.service.ask('POST', '/v1/assessments', b' ' * (64 * 1024 + 1), JSON)
        self.problem(answer, 413)

    def test_too_large_a_body_in_chunks_is_413(self):
        for asks in ({}, {'Expect': '100-continue'}):
            chunks = (b' ' * 8192 for _ in range(10))
            connection = self.service.connect()
            connection.request(
                'POST', '/v1/assessments', chunks, {**JSON, **asks}, encode_chunked=True
            )
            response = connection.getresponse()
            self.problem(Answer(response, response.read()), 413)
            connection.close()

    @direct_only('nginx has a limit of its own')
    def test_who_sends_far_too_much_is_told_so(self):
        for path, size in (
            ('/v1/assessments', 2_000_000),
            ('/v1/assessments', 10_000_000),
            ('/v1/studies', 1024 * 1024 + 1),
            ('/v1/studies', 20_000_000),
        ):
            self.problem(self.service.ask('POST', path, b' ' * size, JSON), 413)

    def test_a_body_of_the_largest_size_is_read(self):
        body = json.dumps(side(F=204.5)).encode().ljust(64 * 1024)
        self.assertEqual(self.service.ask('POST', '/v1/assessments', body, JSON).status, 202)

    def test_an_idempotency_key_gives_the_same_assessment(self):
        key = {'Idempotency-Key': 'visit-17'}
        first = self.service.ask('POST', '/v1/assessments', side(F=205.5), key)
        again = self.service.ask('POST', '/v1/assessments', side(F=205.5), key)
        self.assertEqual(first.json()['id'], again.json()['id'])
        other = self.problem(self.service.ask('POST', '/v1/assessments', side(F=206.5), key), 422)
        self.assertEqual(other['type'], '/docs#problem-idempotency')
        bad = self.service.ask(
            'POST', '/v1/assessments', side(F=207.5), {'Idempotency-Key': 'x' * 256}
        )
        self.problem(bad, 400)

    def test_a_form_is_answered_by_its_result_page(self):
        form = urllib.parse.urlencode(
            {**SIDE, 'F': 208.5, 'side': 'right', 'skin.mu': 100, 'subject': ''}
        ).encode()
        kind = {'Content-Type': 'application/x-www-form-urlencoded'}
        answer = self.service.ask('POST', '/v1/assessments', form, kind)
        self.assertEqual(answer.status, 303)
        page = self.service.get(answer.headers['Location'])
        self.assertEqual((page.status, page.type), (200, 'text/html'))
        document = self.service.get(answer.headers['Location'].rsplit('/', 1)[0]).json()
        self.assertEqual((document['side'], document['skin']['mu']), ('right', 100))
        wrong = self.service.ask('POST', '/v1/assessments', b'R1=1&F=x%zz', kind)
        self.problem(wrong, 400)
        wrong = self.service.ask('POST', '/v1/assessments', b'R1=99', kind)
        self.assertIn(('/R1', 'out_of_range'), self.errors(wrong))

    def test_a_decimal_comma_is_a_form_s_alone(self):
        kind = {'Content-Type': 'application/x-www-form-urlencoded'}
        form = urllib.parse.urlencode({**SIDE, 'R1': '6,5', 'F': ' 209,5\u202f'}).encode()
        answer = self.service.ask('POST', '/v1/assessments', form, kind)
        self.assertEqual(answer.status, 303)
        document = self.service.get(answer.headers['Location'].rsplit('/', 1)[0]).json()
        self.assertEqual((document['parameters']['R1'], document['parameters']['F']), (6.5, 209.5))
        form = urllib.parse.urlencode({**SIDE, 'R2': '1,234.5', 'eM': '31,,5'}).encode()
        answer = self.service.ask('POST', '/v1/assessments', form, kind)
        self.assertEqual(self.errors(answer), {('/R2', 'ambiguous'), ('/eM', 'ambiguous')})
        in_words = 'R2 is "1,234.5" with more than one decimal mark; write 1234.5 or 1234,5'
        self.assertEqual(answer.json()['errors'][0]['detail'], in_words)
        answer = self.service.ask('POST', '/v1/assessments', side(R1='6,5'))
        self.assertEqual(self.errors(answer), {('/R1', 'wrong_type')})
        json = {'Content-Type': 'application/json'}
        answer = self.service.ask('POST', '/v1/assessments', b'{"R1": 6,5}', json)
        self.problem(answer, 400)

    def test_a_browser_is_shown_its_faults_in_the_form(self):
        answer = self.service.ask(
            'POST',
            '/v1/assessments',
            b'R1=99&subject=%3Cb%3E&side=right&sd=typical',
            {
                'Content-Type': 'application/x-www-form-urlencoded',
                'Accept': 'text/html,application/xhtml+xml,*/*;q=0.8',
            },
        )
        self.assertEqual((answer.status, answer.type), (422, 'text/html'))
        page = answer.body.decode()
        self.assertIn('R1 is 99 mm; accepted 3 to 15 mm', page)
        self.assertIn('value="&lt;b&gt;"', page)
        self.assertNotIn('<b>', page)
        self.assertNotRegex(page, '&lt;(p|label|select)')
        for key, value in {'side': 'right', 'sd': 'typical'}.items():
            select = re.search(f'<select id="{key}" name="{key}">(.*?)</select>', page, re.S)
            self.assertEqual(re.findall('value="([^"]*)" selected', select[1]), [value])

    def test_a_full_queue_is_429(self):
        with Service('--queue-limit', '2') as service:
            hanging = [service.submit(wait=0, F=599, eM=20 + i)['id'] for i in range(2)]
            service.until(hanging[0], 'running')
            service.submit(wait=0, F=599, eM=30)
            answer = service.ask('POST', '/v1/assessments', side(F=599, eM=31))
            document = self.problem(answer, 429)
            self.assertEqual(document['type'], '/docs#problem-queue-full')
            self.assertGreater(int(answer.headers['Retry-After']), 0)

    # -------------------------------------------------------------------- read

    def test_an_unknown_assessment_is_404(self):
        for path in ('', '/events', '/field.vtu', '/section.svg', '/report'):
            self.problem(self.service.get(ABSENT + path), 404)
        self.problem(self.service.ask('POST', ABSENT + '/cancel'), 404)
        self.problem(self.service.ask('DELETE', ABSENT), 404)
        self.problem(self.service.get('/v1/assessments/not-an-id'), 404)
        for path in (ABSENT, '/v1/assessments/not-an-id'):
            self.assertIn('no assessment', self.service.get(path).json()['detail'])
        for path in (ABSENT.replace('assessments', 'studies'), '/v1/studies/not-an-id'):
            for below in ('', '/results'):
                answer = self.service.get(path + below)
                self.assertIn('no study', self.problem(answer, 404)['detail'])
        self.problem(self.service.get('/nothing'), 404)
        self.problem(self.service.get('/assets/../index.html'), 404)

    def test_etags_spare_the_body(self):
        path = self.service.submit(F=210.5)['links']['self']
        for where in (
            path,
            path + '/section.svg',
            path + '/field.vtu',
            '/v1/parameters',
            '/openapi.json',
            '/assets/plain.css',
        ):
            first = self.service.get(where)
            self.assertEqual(first.status, 200, where)
            again = self.service.get(where, If_None_Match=first.headers['ETag'])
            self.assertEqual((again.status, again.body), (304, b''), where)
            for name in ('ETag', 'Vary', 'Cache-Control', 'Content-Language'):
                self.assertEqual(again.headers.get_all(name), first.headers.get_all(name), name)
            other = self.service.get(where, If_None_Match='"other", W/"another"')
            self.assertEqual(other.status, 200)

    def test_gzip_is_the_same_document(self):
        path = self.service.submit(F=211.5)['links']['self']
        for where in (path, '/openapi.json', '/assets/docs.js'):
            plain = self.service.get(where)
            packed = self.service.get(where, Accept_Encoding='br, gzip;q=0.5')
            self.assertEqual(packed.headers['Content-Encoding'], 'gzip')
            self.assertEqual(gzip.decompress(packed.body), plain.body)
            self.assertEqual(packed.headers['Vary'], 'Accept-Encoding')
            self.assertNotEqual(packed.headers['ETag'], plain.headers['ETag'])
            plain_tag, packed_tag = plain.headers['ETag'], packed.headers['ETag']
            for known, accepted, told in (
                (packed_tag, 'gzip', packed_tag),
                (packed_tag, '', packed_tag),
                (plain_tag, 'gzip', plain_tag),
                (f'{plain_tag}, {packed_tag}', 'gzip', packed_tag),
                (f'{plain_tag}, {packed_tag}', '', plain_tag),
            ):
                again = self.service.get(where, If_None_Match=known, Accept_Encoding=accepted)
                self.assertEqual((again.status, again.headers['ETag']), (304, told), known)
                self.assertEqual(again.headers['Vary'], 'Accept-Encoding')
            refused = self.service.get(where, Accept_Encoding='gzip;q=0')
            self.assertIsNone(refused.headers['Content-Encoding'])

    def test_head_is_get_without_its_body(self):
        path = self.service.submit(F=212.5)['links']['self']
        for where in (path, '/v1/parameters', '/', '/healthz', '/assets/plain.css'):
            get, head = self.service.get(where), self.service.ask('HEAD', where)
            self.assertEqual((head.status, head.body), (200, b''))
            self.assertEqual(head.headers['Content-Length'], str(len(get.body)))

    def test_options_and_405_name_the_methods(self):
        for path, allowed in (
            ('/v1/assessments', 'GET, HEAD, POST, OPTIONS'),
            (ABSENT, 'GET, HEAD, DELETE, OPTIONS'),
            (ABSENT + '/cancel', 'POST, OPTIONS'),
            ('/healthz', 'GET, HEAD, OPTIONS'),
        ):
            answer = self.service.ask('OPTIONS', path)
            self.assertEqual((answer.status, answer.headers['Allow']), (204, allowed))
            answer = self.service.ask('PATCH', path)
            self.problem(answer, 405)
            self.assertEqual(answer.headers['Allow'], allowed)

    def test_a_representation_that_does_not_exist_is_406(self):
        for path in ('/v1/assessments', '/v1/parameters', '/healthz', '/metrics'):
            self.problem(self.service.get(path, Accept='image/png'), 406)

    def test_get_waits_for_the_end(self):
        document = self.service.submit(wait=0, F=596, eM=33)
        answer = self.service.ask('GET', document['links']['self'], headers={'Prefer': 'wait=60'})
        self.assertEqual(answer.json()['status'], 'succeeded')

    def test_many_wait_at_once(self):
        document = self.service.submit(wait=0, F=596, eM=34)
        seen = []

        def wait():
            answer = self.service.ask(
                'GET', document['links']['self'], headers={'Prefer': 'wait=60'}
            )
            seen.append(answer.json()['status'])

        threads = [threading.Thread(target=wait) for _ in range(50)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(seen, ['succeeded'] * 50)

    def test_a_solve_that_ends_badly_says_why(self):
        document = self.service.submit(F=598, eM=35)
        self.assertEqual(document['status'], 'failed')
        self.assertEqual(document['problem']['detail'], 'It diverged as the test asked.')
        self.assertIsNone(document['result'])
        self.problem(self.service.get(document['links']['self'] + '/field.vtu'), 409)
        page = self.service.get(document['links']['self'] + '/report').body.decode()
        self.assertIn('It diverged as the test asked.', page)

    def test_a_worker_that_dies_is_retried_once(self):
        document = self.service.submit(F=597, eM=36)
        self.assertEqual(document['status'], 'failed')
        self.assertTrue(document['problem']['type'].endswith('#problem-worker-died'))

    # ------------------------------------------------------------ cancel, erase

    def test_cancel_ends_a_running_solve(self):
        document = self.service.submit(wait=0, F=599, eM=40)
        path = document['links']['self']
        self.service.until(document['id'], 'running')
        self.problem(self.service.get(path + '/field.vtu'), 409)
        self.problem(self.service.ask('DELETE', path), 409)
        page = self.service.get(path + '/report').body.decode()
        self.assertIn('name="wait" value="60"', page)
        self.assertNotIn('http-equiv', page)  # a page never reloads by itself
        self.assertEqual(self.service.ask('POST', path + '/cancel').json()['status'], 'cancelled')
        self.assertEqual(self.service.ask('POST', path + '/cancel').status, 200)
        ended = f'event="assessment ended" id={document["id"]} status=cancelled end=cancelled'
        eventually(lambda: ended in self.service.errors(), ended)
        metrics = self.service.get('/metrics').body.decode()
        self.assertRegex(metrics, r'ischia_solve_seconds_count\{outcome="cancelled"\} [1-9]')
        self.assertEqual(self.service.submit(F=213.5)['status'], 'succeeded')

    def test_cancel_of_what_has_ended_is_409(self):
        path = self.service.submit(F=214.5)['links']['self']
        self.problem(self.service.ask('POST', path + '/cancel'), 409)

    def test_erase_leaves_nothing_to_read(self):
        path = self.service.submit(F=215.5, subject='Q-1')['links']['self']
        self.assertEqual(self.service.get(path).status, 200)
        self.assertEqual(self.service.ask('DELETE', path).status, 204)
        for suffix in ('', '/report', '/field.vtu', '/section.svg', '/events'):
            self.problem(self.service.get(path + suffix), 404)
        self.assertEqual(self.service.get('/v1/assessments?subject=Q-1').json()['items'], [])

    # ------------------------------------------------------------------- events

    def stream(self, path, last=None):
        """All of an event stream: [(id, event, data)]."""
        headers = {'Last-Event-ID': last} if last else {}
        answer = self.service.ask('GET', path + '/events', headers=headers)
        if answer.status == 204:
            return None
        self.assertEqual(answer.type, 'text/event-stream')
        events = []
        for block in answer.body.decode().split('\n\n'):
            fields = dict(line.split(': ', 1) for line in block.split('\n') if ': ' in line)
            if 'event' in fields:
                events.append((fields['id'], fields['event'], json.loads(fields['data'])))
        return events

    def test_events_tell_progress_and_the_end(self):
        document = self.service.submit(wait=0, F=596, eM=41)
        events = self.stream(document['links']['self'])
        kinds = [kind for _, kind, _ in events]
        self.assertEqual(kinds[-1], 'done')
        self.assertEqual(events[-1][2]['status'], 'succeeded')
        fractions = [data['fraction'] for _, kind, data in events if kind == 'progress']
        self.assertGreaterEqual(len(fractions), 5)
        self.assertEqual(fractions, sorted(fractions))
        self.assertEqual(set(events[1][2]) >= {'load_step', 'newton_iteration', 'message'}, True)

    def test_a_stream_goes_on_behind_the_last_event(self):
        path = self.service.submit(F=596, eM=42)['links']['self']
        events = self.stream(path)
        middle = len(events) // 2
        self.assertEqual(self.stream(path, events[middle][0]), events[middle + 1 :])
        self.assertIsNone(self.stream(path, events[-1][0]))

    def test_an_end_is_told_after_a_restart(self):
        service = Service()
        path = service.submit(F=216.5)['links']['self']
        own, service.own_state = service.own_state, False
        service.stop()
        with Service(state=service.state) as again:
            again.own_state = own
            answer = again.get(path + '/events')
            self.assertIn(b'event: done\ndata: {"status":"succeeded"', answer.body)
            last = re.search(rb'id: (\d+)', answer.body).group(1).decode()
            self.assertEqual(again.get(path + '/events', Last_Event_ID=last).status, 204)

    # -------------------------------------------------------------------- lists

    def test_lists_go_newest_first_and_page_by_page(self):
        made = [self.service.submit(F=300 + i, subject='L-1', side='left')['id'] for i in range(5)]
        seen, cursor = [], ''
        while True:
            page = self.service.get(f'/v1/assessments?subject=L-1&limit=2&cursor={cursor}').json()
            self.assertLessEqual(len(page['items']), 2)
            seen += [item['id'] for item in page['items']]
            cursor = page['next_cursor']
            if not cursor:
                break
        self.assertEqual(seen, made[::-1])
        self.assertEqual(
            self.service.get('/v1/assessments?subject=L-1&side=right').json()['items'], []
        )
        done = self.service.get('/v1/assessments?subject=L-1&status=succeeded').json()['items']
        self.assertEqual(len(done), 5)

    def test_a_list_as_csv(self):
        self.service.submit(F=310.5, subject='C-1', side='right', label='"quoted", with comma')
        answer = self.service.get('/v1/assessments?subject=C-1', Accept='text/csv')
        self.assertEqual(answer.type, 'text/csv')
        rows = list(csv.DictReader(io.StringIO(answer.body.decode())))
        self.assertEqual(len(rows), 1)
        self.assertEqual(
            (rows[0]['label'], rows[0]['F'], rows[0]['status'], rows[0]['eps_max']),
            ('"quoted", with comma', '310.5', 'succeeded', '1.2'),
        )

    def test_a_wrong_query_is_400(self):
        for query in (
            'limit=0',
            'limit=501',
            'limit=x',
            'side=up',
            'status=lost',
            'subject=a%20b',
            'cursor=junk',
            'limit=1&limit=2',
            'page=2',
            'subject=%zz',
            'subject=%ff',
        ):
            self.problem(self.service.get('/v1/assessments?' + query), 400)
        for query in ('since=-1', 'since=x', 'limit=0', 'from=3'):
            self.problem(self.service.get('/v1/changes?' + query), 400)

    def test_changes_come_in_order(self):
        before = self.service.get('/v1/changes?since=0&limit=1').json()['newest_seq']
        path = self.service.submit(F=320.5)['links']['self']
        self.service.ask('DELETE', path)
        page = self.service.get(f'/v1/changes?since={before}&limit=500').json()
        mine = [item for item in page['items'] if path.endswith(item['id'])]
        self.assertEqual(
            [item['change'] for item in mine], ['created', 'started', 'succeeded', 'erased']
        )
        numbers = [item['seq'] for item in page['items']]
        self.assertEqual(numbers, sorted(set(numbers)))
        self.assertEqual(page['last_seq'], numbers[-1])

    def test_following_the_changes_loses_none(self):
        for F in (321.5, 322.5):
            self.service.submit(F=F)
        whole = self.service.get('/v1/changes?since=0&limit=500').json()
        self.assertEqual(whole['last_seq'], whole['newest_seq'])
        seen, last = [], 0
        while items := (page := self.service.get(f'/v1/changes?since={last}&limit=2').json())['items']:
            last = page['last_seq']
            self.assertEqual(last, items[-1]['seq'])
            self.assertGreaterEqual(page['newest_seq'], last)
            seen += items
        self.assertEqual(seen[: len(whole['items'])], whole['items'])
        self.assertEqual(page['last_seq'], page['newest_seq'])

    def test_what_was_typed_is_no_formula_in_a_spreadsheet(self):
        for label, cell in (('=1+1', "'=1+1"), ('@a,"b"', '\'@a,"b"'), ('-', "'-"), ('a=1', 'a=1')):
            self.service.submit(label=label, subject='F-1')
            text = self.service.get('/v1/assessments?subject=F-1&limit=1', Accept='text/csv').body.decode()
            self.assertEqual(next(csv.DictReader(io.StringIO(text)))['label'], cell)

    # ----------------------------------------------------------- files and pages

    def test_drawings(self):
        path = self.service.submit(F=330.5)['links']['self']
        svg, vtu = self.service.get(path + '/section.svg'), self.service.get(path + '/field.vtu')
        self.assertEqual((svg.status, svg.type), (200, 'image/svg+xml'))
        self.assertEqual((vtu.status, vtu.type), (200, 'application/vnd.vtk.vtu'))
        self.assertIn(b'<svg', svg.body)
        self.assertNotIn(b'style', svg.body)  # attributes alone: the policy allows no inline style
        self.assertNotIn('unsafe', svg.headers['Content-Security-Policy'])
        self.assertIn(b'<VTKFile', vtu.body)

    def test_the_report_is_a_page_that_escapes(self):
        document = self.service.submit(
            F=331.5, label='<script>x</script>', subject='R-1', side='left'
        )
        path = document['links']['self']
        answer = self.service.get(path + '/report')
        page = answer.body.decode()
        self.assertEqual(answer.type, 'text/html')
        self.assertNotIn('<script', page)
        for text in (
            '&lt;script&gt;',
            'R-1',
            'Green\u2013Lagrange',
            'engineering',
            'section.svg',
            'animal',
            'Never compare',
            'Tissue strain report \u00b7 left side',
            'First at (F = 331.5 N)',
            'Largest, under the bone',
            'Name, date, signature',
            'model macron2020-local 1',
            document['id'],
            document['created_at'],
        ):
            self.assertIn(text, page)
        for where in (f'{document["parameters"]["eM"]:.1f} mm', '2.7 mm above the bone\u2019s lowest point'):
            self.assertIn(f'<td class="n long">100 mm\u00b3, {where}</td>', page)
        self.assertNotRegex(page, r'[>\s]-\d')
        parameters = self.service.get('/v1/parameters').json()['parameters']
        for parameter in parameters:  # name, key, value, unit
            value = document['parameters'][parameter['key']]
            row = f'{parameter["name"]}</th><td>{parameter["key"]}</td><td class="n">{value:g}</td>'
            self.assertIn(f'{row}<td>{parameter["unit"]}</td>', page)

    def test_the_report_says_how_it_was_computed(self):
        usual = self.service.submit(F=332.5)['links']['self']
        page = self.service.get(usual + '/report').body.decode()
        self.assertIn('Resolution: Standard</p>', page)
        other = self.service.submit(
            F=332.5, resolution='coarse', skin={'thickness': 2.5}, model='as-published'
        )['links']['self']
        said = 'Resolution: Coarse (a quick look) \u00b7 not the default: skin.thickness 2.5 mm, model.bulk_ratio 100'
        self.assertIn(said, self.service.get(other + '/report').body.decode())
        german = self.service.get(other + '/report?lang=de').body.decode()
        self.assertIn('nicht die Vorgabe: skin.thickness 2,5 mm', german)

    def test_the_reference_sides_were_computed_with_the_defaults(self):
        with open(os.path.join(HERE, '../../static/reference/table2.json'), encoding='utf-8') as f:
            reference = json.load(f)
        served = self.service.get('/v1/parameters').json()
        defaults = {'skin': {}, 'model': {}}
        for option in served['options']:
            defaults[option['group']][option['key']] = option['default']
        self.assertEqual(reference['options'], defaults)
        usual = [r['name'] for r in served['resolutions'] if r['default']]
        self.assertEqual([reference['resolution']], usual)

    def test_the_report_can_wait_for_the_end(self):
        document = self.service.submit(wait=0, F=596, eM=44.5)
        path = document['links']['self'] + '/report'
        waiting = self.service.get(path).body.decode()
        self.assertIn('Wait for the result', waiting)
        self.assertNotIn('Name, date, signature', waiting)
        self.assertIn('Name, date, signature', self.service.get(path + '?wait=60').body.decode())
        hanging = self.service.submit(wait=0, F=599, eM=45.5)['links']['self']
        self.service.until(hanging.rsplit('/', 1)[1], 'running')
        before = time.monotonic()
        self.assertIn('Being solved.', self.service.get(hanging + '/report?wait=1').body.decode())
        self.assertGreater(time.monotonic() - before, 0.9)
        form = {'Content-Type': 'application/x-www-form-urlencoded'}
        answer = self.service.ask('POST', hanging + '/cancel', b'', form)
        self.assertEqual((answer.status, answer.headers['Location']), (303, hanging + '/report'))
        again = self.service.ask('POST', path.removesuffix('/report') + '/cancel', b'', form)
        self.assertEqual(again.status, 303)  # too late: the report says how it ended
        for bad in ('61', '-1', 'x', '', '1&wait=2'):
            self.problem(self.service.get(f'{path}?wait={bad}'), 400)

    def test_a_page_keeps_its_policy_when_it_has_not_changed(self):
        page = self.service.get('/')
        again = self.service.get('/', If_None_Match=page.headers['ETag'])
        self.assertEqual(again.status, 304)
        self.assertNotIn('Content-Security-Policy', again.headers)  # a browser would take it over
        self.assertEqual(again.headers['X-Content-Type-Options'], 'nosniff')

    def test_pages_need_nothing_from_elsewhere(self):
        for path in ('/', '/form', '/docs', '/assessments'):
            answer = self.service.get(path)
            self.assertEqual((answer.status, answer.type), (200, 'text/html'), path)
            policy = answer.headers['Content-Security-Policy']
            self.assertIn("default-src 'none'", policy)
            self.assertNotIn('unsafe', policy)
            page = answer.body.decode()
            self.assertEqual(re.findall(r'(?:src|href)="(?!/(?!/)|[?#])[^"]*"', page), [], path)
            self.assertEqual(
                re.findall(r'<script(?!(?: type="module")? src=)|<style|\son\w+=|style="', page), [], path
            )
            for name in re.findall(r'(?:src|href)="(/assets/[^"]*)"', page):
                self.assertEqual(self.service.get(name).status, 200, name)

    def test_a_result_without_a_script_leads_to_its_report(self):
        identity = '0192f0c1-0000-7000-8000-000000000001'
        for query, language in (('plain=1', ''), ('plain=1&lang=fr', '?lang=fr')):
            answer = self.service.get(f'/assessments/{identity}?{query}')
            self.assertEqual(answer.status, 303)
            report = f'/v1/assessments/{identity}/report{language}'
            self.assertEqual(answer.headers['Location'], report)

    def test_the_plain_form_lists_every_parameter(self):
        page = self.service.get('/form').body.decode()
        for parameter in self.service.get('/v1/parameters').json()['parameters']:
            accepted = parameter['accepted']
            self.assertIn(f'name="{parameter["key"]}"', page)
            self.assertIn(
                f'({parameter["unit"]}, {accepted["min"]:g} to {accepted["max"]:g})', page
            )

    def test_the_service_about_itself(self):
        self.assertEqual(self.service.get('/healthz').json(), {'status': 'alive'})
        self.assertEqual(self.service.get('/readyz').json()['status'], 'ready')
        version = self.service.get('/version').json()
        self.assertEqual(version['model'], {'name': 'macron2020-local', 'version': 1})
        for name in ('libmicrohttpd', 'GnuTLS', 'libsodium', 'zlib', 'cJSON', 'store'):
            self.assertRegex(version['libraries'][name], r'\d+\.\d+')
        self.assertEqual(version['worker'], 'fake')
        metrics = self.service.get('/metrics').body.decode()
        for line in (
            'ischia_http_requests_total{route="GET /healthz",code="200"}',
            'ischia_solve_seconds_bucket{outcome="succeeded",le="+Inf"}',
            'ischia_queue_depth ',
            'ischia_worker_deaths_total ',
            'ischia_store_seconds_count{kind="accept"}',
        ):
            self.assertIn(line, metrics)
        for line in metrics.splitlines():
            self.assertRegex(line, r'^(# (HELP|TYPE) [a-z_]+ .+|[a-z_]+(\{.*\})? [-+0-9.eE]+)$')

    def test_every_answer_is_guarded(self):
        for path in ('/', '/v1/parameters', '/nothing', '/v1/assessments'):
            headers = self.service.get(path).headers
            self.assertEqual(headers['X-Content-Type-Options'], 'nosniff')
            self.assertEqual(headers['X-Frame-Options'], 'DENY')
            self.assertEqual(headers['Referrer-Policy'], 'same-origin')
            self.assertTrue(headers['Content-Security-Policy'])


if __name__ == '__main__':
    unittest.main()
