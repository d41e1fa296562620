#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""CDS Hooks 2.0: discovery, cards of what is stored, feedback, and tokens of trusted issuers."""
import json
import os
import tempfile
import time
import unittest

import interop
from interop import bundle, parameters, post
from service import JSON, Service, admin

HOOKS = {'ischia-patient-view': 'patient-view', 'ischia-order-select': 'order-select'}
PUBLIC = 'https://ischia.example'


def hook(service='ischia-patient-view', patient='123', prefetch=True, **changes):
    body = {
        'hook': HOOKS[service],
        'hookInstance': 'd1577c69-dfbe-44ad-ba6d-3e05e953b2ea',
        'context': {'userId': 'Practitioner/1', 'patientId': patient, 'selections': ['a'],
                    'draftOrders': {'resourceType': 'Bundle'}},
    }
    if prefetch is True:
        body['prefetch'] = {'observations': bundle()}
    elif prefetch is not None:
        body['prefetch'] = prefetch
    return {**body, **changes}


class Cds(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.service = Service('--public-url', PUBLIC, '--allowed-origins', 'https://ehr.example')
        cls.service.until_ready()
        for n, side in ((0, 'left'), (1, 'right'), (2, 'left')):
            answer = post(cls.service, parameters(F=300 + n, side=side))
            assert answer.status == 200, answer.body
            cls.last = answer.json()['entry'][0]['resource']['id']

    @classmethod
    def tearDownClass(cls):
        cls.service.stop()

    def ask(self, service, body):
        return self.service.ask('POST', '/cds-services/' + service, body)

    def test_discovery(self):
        services = self.service.get('/cds-services').json()['services']
        self.assertEqual({s['id']: s['hook'] for s in services}, HOOKS)
        for each in services:
            self.assertIn('{{context.patientId}}', each['prefetch']['observations'])
            self.assertTrue(each['title'] and each['description'])

    def test_the_last_stored_assessment_is_a_card(self):
        for service in HOOKS:
            begun = time.monotonic()
            answer = self.ask(service, hook(service))
            self.assertLess(time.monotonic() - begun, 0.5)
            self.assertEqual((answer.status, answer.type), (200, 'application/json'))
            (card,) = answer.json()['cards']
            self.assertEqual(card['uuid'], self.last)
            self.assertLess(len(card['summary']), 140)
            self.assertIn('Left ischium', card['summary'])
            self.assertEqual(card['indicator'], 'warning')
            self.assertIn('Right ischium, last assessed', card['detail'])
            self.assertIn('not a medical device', card['detail'])
            self.assertEqual(
                card['links'][0],
                {'label': 'Report', 'type': 'absolute',
                 'url': f'{PUBLIC}/v1/assessments/{self.last}/report'})
            self.assertTrue(card['source']['label'].startswith('Ischia'))

    def test_a_side_that_was_not_given(self):
        post(self.service, parameters(F=305, subject='Patient/sideless', side=None))
        (card,) = self.ask('ischia-patient-view', hook(patient='sideless')).json()['cards']
        self.assertRegex(card['summary'], r'^Ischium, side not given, \d{4}-\d\d-\d\d: Muscle')

    def test_no_hook_starts_a_solve(self):
        before = self.service.get('/v1/changes').json()['newest_seq']
        self.ask('ischia-patient-view', hook())
        self.assertEqual(self.ask('ischia-patient-view', hook(patient='nobody')).json(),
                         {'cards': []})
        self.assertEqual(self.service.get('/v1/changes').json()['newest_seq'], before)

    def test_newer_measurements_are_said_to_be_newer(self):
        (card,) = self.ask('ischia-patient-view', hook()).json()['cards']
        self.assertNotIn('newer than this assessment', card['detail'])
        newer = bundle()
        newer['entry'][2]['resource']['effectiveDateTime'] = '2999-12-31'
        (card,) = self.ask(
            'ischia-patient-view', hook(prefetch={'observations': newer})).json()['cards']
        self.assertIn('measurements of 2999-12-31, newer', card['detail'])

    def test_missing_data_are_412(self):
        for prefetch in (None, {}, {'observations': None}, {'other': bundle()},
                         {'observations': {'resourceType': 'OperationOutcome'}}):
            answer = self.ask('ischia-patient-view', hook(prefetch=prefetch))
            self.assertEqual(answer.status, 412, prefetch)
            self.assertEqual(answer.type, 'application/problem+json')
        empty = {'observations': {'resourceType': 'Bundle', 'type': 'searchset', 'total': 0}}
        self.assertEqual(self.ask('ischia-patient-view', hook(prefetch=empty)).status, 200)

    def test_bad_requests_are_400(self):
        for body in (hook(hook='order-select'), hook(hookInstance=7), hook(context=None),
                     hook(patient='a b'), hook(patient='x' * 300), hook(patient='Group/1'),
                     {}, [], hook(context={'userId': 'a', 'patientId': ['x']})):
            self.assertEqual(self.ask('ischia-patient-view', body).status, 400, body)
        no_orders = hook('ischia-order-select', context={'userId': 'a', 'patientId': 'b'})
        self.assertEqual(self.ask('ischia-order-select', no_orders).status, 400)
        self.assertEqual(
            self.service.ask('POST', '/cds-services/ischia-patient-view', b'{', JSON).status, 400)
        self.assertEqual(self.ask('other', hook()).status, 404)

    def test_feedback_is_stored_and_erased_with_its_assessment(self):
        mine = post(self.service, parameters(F=310, subject='Patient/f')).json()
        card = mine['entry'][0]['resource']['id']
        item = {
            'card': card,
            'outcome': 'overridden',
            'outcomeTimestamp': '2026-03-02T08:00:00Z',
            'overrideReason': {
                'reason': {'code': 'd7ecf885', 'system': 'urn:x', 'display': 'Not relevant'},
                'userComment': 'Seen "yesterday"'},
        }
        path = 'ischia-patient-view/feedback'
        self.assertEqual(self.ask(path, {'feedback': [item]}).status, 200)
        (stored,) = [json.loads(line) for line in
                     admin(self.service.state, 'feedback', 'list').splitlines()]
        self.assertEqual(stored['card'], card)
        self.assertEqual(stored['service'], 'ischia-patient-view')
        self.assertEqual(stored['feedback']['overrideReason'], item['overrideReason'])
        self.assertNotIn('yesterday', self.service.errors())
        for bad, status in (
            ({}, 400), ({'feedback': []}, 400), ({'feedback': [item] * 65}, 400),
            ({'feedback': [{**item, 'outcome': 'liked'}]}, 400),
            ({'feedback': [{**item, 'outcomeTimestamp': 'now'}]}, 400),
            ({'feedback': [{**item, 'card': 'x'}]}, 400), ({'feedback': [7]}, 400),
            ({'feedback': [{**item, 'card': '0192f0c1-0000-7000-8000-000000000000'}]}, 404),
        ):
            self.assertEqual(self.ask(path, bad).status, status, bad)
        self.assertEqual(len(admin(self.service.state, 'feedback', 'list').splitlines()), 1)
        self.assertEqual(self.service.ask('DELETE', '/v1/assessments/' + card).status, 204)
        self.assertEqual(admin(self.service.state, 'feedback', 'list'), '')

    def test_a_record_system_in_a_browser_may_ask_when_it_is_listed(self):
        for origin, allowed in (('https://ehr.example', True), ('https://evil.example', False)):
            headers = {'Origin': origin}
            answer = self.service.ask('OPTIONS', '/cds-services', headers=headers)
            self.assertEqual(answer.headers.get('Access-Control-Allow-Origin'),
                             origin if allowed else None)
            answer = self.service.ask(
                'POST', '/cds-services/ischia-patient-view', hook(), headers)
            self.assertEqual(answer.status, 200 if allowed else 403)


class Trust(unittest.TestCase):
    def test_only_tokens_of_trusted_issuers_are_taken(self):
        path = '/cds-services/ischia-patient-view'
        now = int(time.time())
        claims = {'iss': 'https://ehr.example', 'aud': PUBLIC + path, 'iat': now,
                  'exp': now + 300}
        wish = []

        def want(status, key='ec', alg='ES384', kid=None, **changes):
            made = {**claims, 'jti': str(len(wish)), **changes}
            wish.append((status, {'key': key, 'alg': alg, 'kid': kid or key,
                                  'claims': {k: v for k, v in made.items() if v is not None}}))

        want(200)
        want(200, key='rsa', alg='RS384')
        want(200, aud=['x', PUBLIC + path])
        want(401, jti='0')  # used before
        want(401, jti=None)
        want(401, exp=now - 120)
        want(401, iat=now + 600, exp=now + 900)
        want(401, nbf=now + 600)
        want(401, exp=now + 7200)
        want(401, aud=PUBLIC)
        want(401, aud=None)
        want(401, iss='https://other.example')
        want(401, key='stranger', kid='ec')
        want(401, kid='nobody')
        want(401, alg='none')
        want(401, alg='HS384')
        want(401, key='p256', alg='ES256', kid='ec')
        want(401, key='rsa', alg='RS256')
        keys = {'ec': 'ES384', 'rsa': 'RS384', 'stranger': 'ES384', 'p256': 'ES256',
                'short': 'RS1024'}
        done = interop.node(
            'jwt.mjs', input=json.dumps({'keys': keys, 'tokens': [w[1] for w in wish]}))
        made = json.loads(done.stdout)
        with tempfile.TemporaryDirectory() as folder:
            issuers = os.path.join(folder, 'issuers.json')

            def trusting(names):
                document = {'issuers': [{'iss': claims['iss'],
                                         'jwks': {'keys': [made['jwks'][n] for n in names]}}]}
                with open(issuers, 'w', encoding='utf-8') as file:
                    json.dump(document, file)

            options = ('--cds-issuers', issuers, '--public-url', PUBLIC,
                       '--allowed-hosts', 'ischia.example')
            for names in (['p256'], ['short'], []):
                trusting(names)
                with self.assertRaisesRegex(AssertionError, 'issuers.json'):
                    Service(*options)
            trusting(['ec', 'rsa'])
            with self.assertRaisesRegex(AssertionError, 'public_url'):
                Service('--cds-issuers', issuers)
            with Service(*options) as service:
                service.until_ready()
                for (status, token), text in zip(wish, made['tokens']):
                    answer = service.ask('POST', path, hook(), {'Authorization': 'Bearer ' + text})
                    self.assertEqual(answer.status, status, (token, answer.body))
                for header in ({}, {'Authorization': 'Bearer x'},
                               {'Authorization': 'Bearer ' + 'a.' * 5000},
                               {'Authorization': 'Basic eDp5'}):
                    self.assertEqual(service.ask('POST', path, hook(), header).status, 401)
                broken = made['tokens'][1][:-4] + 'AAAA'
                self.assertEqual(
                    service.ask('POST', path, hook(), {'Authorization': 'Bearer ' + broken}).status,
                    401)
                self.assertEqual(service.get('/cds-services').status, 200)
                # a token for one service opens neither the other nor the rest
                self.assertEqual(
                    service.ask('POST', '/cds-services/ischia-order-select', hook(),
                                {'Authorization': 'Bearer ' + made['tokens'][2]}).status, 401)
                self.assertNotIn('ehr.example', service.errors())


if __name__ == '__main__':
    unittest.main()
