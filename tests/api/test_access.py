#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Who may do what: tokens and scopes, Host and Origin, rate limits, TLS, and what start refuses."""
import base64
import http.client
import json
import os
import re
import signal
import ssl
import subprocess
import tempfile
import time
import unittest

from service import (JSON, PATIENCE_S, PROGRAM, PROXY, Service, admin, direct_only, eventually,
                     file_only,
                     side, sql)

FORM = {'Content-Type': 'application/x-www-form-urlencoded'}


def bearer(token):
    return {'Authorization': f'Bearer {token}'}


class Tokens(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.service = Service()
        cls.service.until_ready()
        state = cls.service.state
        cls.path = cls.service.submit(F=100.5)['links']['self']
        cls.service.token = None  # each test shows its own, or none
        cls.tokens = {
            scope: admin(state, 'token', 'create', f'scope={scope}', f'name={scope}').strip()
            for scope in ('read', 'assess', 'read,assess', 'admin')
        }
        cls.expired = admin(state, 'token', 'create', 'scope=admin', 'expires=1s').strip()
        time.sleep(2.2)

    @classmethod
    def tearDownClass(cls):
        cls.service.stop()

    def test_the_matrix_of_scopes_and_routes(self):
        asks = {
            'read': [
                ('GET', self.path),
                ('GET', '/v1/assessments'),
                ('GET', '/v1/changes'),
                ('GET', '/metrics'),
                ('GET', self.path + '/events'),
                ('GET', self.path + '/report'),
                ('GET', self.path + '/section.svg'),
            ],
            'assess': [('POST', '/v1/assessments'), ('POST', self.path + '/cancel')],
            'admin': [('DELETE', '/v1/assessments/01a201a9-49a6-75d9-8b79-1f36e7bd6914')],
            'open': [
                ('GET', '/'),
                ('GET', '/healthz'),
                ('GET', '/readyz'),
                ('GET', '/version'),
                ('GET', '/openapi.json'),
                ('GET', '/docs'),
                ('GET', '/v1/parameters'),
            ],
        }
        holds = {
            'read': {'read'},
            'assess': {'assess'},
            'read,assess': {'read', 'assess'},
            'admin': {'read', 'assess', 'admin'},
        }
        for scope, requests in asks.items():
            for method, path in requests:
                body = side(F=101.5) if path == '/v1/assessments' and method == 'POST' else None
                answer = self.service.ask(method, path, body)
                self.assertEqual(answer.status == 401, scope != 'open', (method, path))
                for name, token in self.tokens.items():
                    answer = self.service.ask(method, path, body, bearer(token))
                    allowed = scope == 'open' or scope in holds[name]
                    self.assertEqual(answer.status == 403, not allowed, (name, method, path))
                    self.assertNotEqual(answer.status, 401)

    def test_a_refusal_says_how_to_show_a_token(self):
        answer = self.service.get('/v1/assessments')
        self.assertEqual((answer.status, answer.type), (401, 'application/problem+json'))
        self.assertIn('Bearer', answer.headers['WWW-Authenticate'])

    def test_a_browser_may_send_the_token_as_password(self):
        text = base64.b64encode(f'anyone:{self.tokens["read"]}'.encode()).decode()
        self.assertEqual(self.service.get(self.path, Authorization='Basic ' + text).status, 200)

    def test_wrong_tokens_are_refused(self):
        good = self.tokens['admin']
        for token in (
            '',
            'x',
            good[:-1],
            good + 'x',
            good[:-1] + ('A' if good[-1] != 'A' else 'B'),
            good.replace('ischia_', 'ischia_0', 1),
            self.expired,
            good.upper(),
        ):
            self.assertEqual(
                self.service.get(self.path, Authorization='Bearer ' + token).status, 401
            )
        for header in ('Basic !!!', 'Basic ', 'Digest x', 'Bearer', 'Basic ' + 'A' * 500):
            self.assertEqual(self.service.get(self.path, Authorization=header).status, 401)

    def test_the_secret_is_not_stored_and_revoking_works(self):
        state = self.service.state
        token = admin(state, 'token', 'create', 'name=short lived').strip()
        secret = token.split('_', 2)[2].encode()
        for folder, _, names in os.walk(state):
            for name in names:
                with open(os.path.join(folder, name), 'rb') as file:
                    self.assertNotIn(secret, file.read(), name)
        ask = lambda: self.service.ask('GET', self.path, headers=bearer(token)).status
        eventually(lambda: ask() == 200, 'a new token to be known')
        identity = token.split('_')[1]
        self.assertIn(identity, admin(state, 'token', 'list'))
        admin(state, 'token', 'revoke', identity)
        eventually(lambda: ask() == 401, 'a revoked token to be refused')
        again = admin(state, 'token', 'revoke', identity, check=False)
        self.assertEqual(again.returncode, 1)

    @direct_only('where no other token is in use')
    def test_revoking_or_expiry_of_the_last_token_opens_nothing(self):
        with Service() as service:
            ask = lambda **headers: service.get('/v1/assessments', **headers).status
            token = admin(service.state, 'token', 'create', 'scope=admin').strip()
            eventually(lambda: ask() == 401, 'the first token to shut the door')
            self.assertEqual(admin(service.state, 'token', 'forget').strip(), '0')
            admin(service.state, 'token', 'revoke', token.split('_')[1])
            eventually(lambda: ask(**bearer(token)) == 401, 'the revoking')
            admin(service.state, 'token', 'create', 'expires=1s')
            time.sleep(2.2)
            self.assertEqual(ask(), 401)
            self.assertEqual(admin(service.state, 'token', 'forget').strip(), '2')
            eventually(lambda: ask() == 200, 'the door to open when nothing is remembered')

    def make_tokens(self, state, count, expires_ms, letter):
        sql(state, f"""WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n
                       WHERE i < {count})
                       INSERT INTO token (id, name, digest, scopes, created_ms, expires_ms)
                       SELECT '{letter}' || i, 'many', (SELECT digest FROM token LIMIT 1), 1, 1,
                       {expires_ms} FROM n""", '')

    @direct_only('counts its tokens')
    def test_any_number_of_expired_tokens_and_no_more_that_hold_than_fit(self):
        with Service() as service:
            state = service.state
            token, other = (admin(state, 'token', 'create').strip() for _ in range(2))
            ask = lambda: service.get('/v1/assessments', **bearer(token)).status
            eventually(lambda: ask() == 200, 'a new token to be known')
            self.make_tokens(state, 4096, 1, 'x')
            admin(state, 'token', 'revoke', token.split('_')[1])
            eventually(lambda: ask() == 401, 'a revoked token to be refused')
            self.assertEqual(service.get('/v1/assessments', **bearer(other)).status, 200)
            self.make_tokens(state, 4095, 0, 'h')
            refused = admin(state, 'token', 'create', check=False)
            self.assertEqual(refused.returncode, 1)
            self.assertIn('revoke some first', refused.stderr)
            self.assertEqual(admin(state, 'token', 'forget').strip(), '4097')
            self.make_tokens(state, 2, 0, 'y')
            eventually(lambda: ask() == 401 and 'known=4096 unknown=2' in service.errors(),
                       'a line in the log')

    def test_everything_that_changes_or_reads_is_in_the_audit_log(self):
        token = self.tokens['read,assess']
        identity = token.split('_')[1]
        answer = self.service.ask(
            'POST',
            '/v1/assessments',
            side(F=102.5, subject='SECRET-9'),
            {**bearer(token), 'Prefer': 'wait=60'},
        )
        document = answer.json()
        self.service.ask('GET', document['links']['self'], headers=bearer(token))
        self.service.ask('DELETE', document['links']['self'], headers=bearer(token))
        for what, outcome in (
            ('assessment.create', '201'),
            ('assessment.read', 'ok'),
            ('access', '403'),
        ):
            line = f'who={identity} what={what} id={document["id"]} outcome={outcome}'
            eventually(
                lambda: re.search(line, admin(self.service.state, 'audit', 'list')), line
            )
        log = admin(self.service.state, 'audit', 'list')
        self.assertNotIn('SECRET-9', log)
        self.assertNotIn('SECRET-9', self.service.errors())
        metrics = self.service.ask('GET', '/metrics', headers=bearer(token)).body.decode()
        self.assertIn('ischia_http_requests_total', metrics)
        for trace in ('SECRET-9', document['id']):
            self.assertNotIn(trace, metrics)
        self.assertIn('the chain holds', admin(self.service.state, 'audit', 'verify'))


class Origins(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.service = Service(
            '--allowed-hosts', 'clinic.example', '--allowed-origins', 'https://portal.example'
        )
        cls.service.until_ready()

    @classmethod
    def tearDownClass(cls):
        cls.service.stop()

    def test_a_rebound_name_is_refused(self):
        port = self.service.address.split(':')[1]
        for host, status in (
            ('evil.example', 403),
            (f'evil.example:{port}', 403),
            ('', 403),
            (f'127.0.0.1:{port}', 200),
            ('localhost', 200),
            ('[::1]:1', 200),
            ('CLINIC.example', 200),
            ('127.0.0.1.evil.example', 403),
            ('localhost:x', 403),
            ('127.0.0.1@evil.example', 403),
        ):
            answer = self.service.get('/v1/parameters', Host=host)
            # nginx refuses a name that can be none before the service sees it.
            refused = PROXY and status == 403 and answer.status == 400
            self.assertTrue(answer.status == status or refused, (host, answer.status))

    def test_a_foreign_page_may_not_change_anything(self):
        own = self.service.origin
        cases = (
            ({'Origin': own}, 202),
            ({'Origin': 'https://portal.example'}, 202),
            ({'Origin': 'https://evil.example'}, 403),
            ({'Origin': 'null'}, 403),
            ({'Origin': own + '.evil.example'}, 403),
            ({'Sec-Fetch-Site': 'cross-site'}, 403),
            ({'Sec-Fetch-Site': 'same-site'}, 403),
            ({'Sec-Fetch-Site': 'same-origin'}, 202),
            ({}, 202),
        )
        for headers, status in cases:
            answer = self.service.ask('POST', '/v1/assessments', side(F=110.5), headers)
            self.assertEqual(answer.status, status, headers)
        answer = self.service.ask('POST', '/v1/assessments', b'R1=1', {**FORM, 'Origin': 'null'})
        self.assertEqual(answer.status, 403)
        self.assertEqual(
            self.service.get('/v1/parameters', Origin='https://evil.example').status, 200
        )
        self.assertIsNone(self.service.get('/v1/parameters').headers['Access-Control-Allow-Origin'])


class Rates(unittest.TestCase):
    @direct_only('says what a proxy says')
    def test_a_client_over_its_rate_is_429_and_others_are_not(self):
        with Service('--behind-proxy', '--rate-limit', '1', '--rate-burst', '10') as service:
            first = [
                service.get('/version', X_Forwarded_For='1.2.3.4, 203.0.113.7') for _ in range(60)
            ]
            statuses = [answer.status for answer in first]
            self.assertEqual(statuses[:10], [200] * 10)
            self.assertIn(429, statuses)
            refused = first[statuses.index(429)]
            self.assertEqual(refused.json()['type'], '/docs#problem-rate')
            self.assertGreaterEqual(int(refused.headers['Retry-After']), 1)
            self.assertEqual(service.get('/version', X_Forwarded_For='203.0.113.8').status, 200)
            eventually(
                lambda: service.get('/version', X_Forwarded_For='203.0.113.7').status == 200,
                'the client to be let in again',
            )

    @direct_only('has no proxy')
    def test_a_forwarded_address_counts_only_behind_a_proxy(self):
        with Service('--rate-limit', '1', '--rate-burst', '1') as service:
            for _ in range(5):
                self.assertEqual(service.get('/version', X_Forwarded_For='203.0.113.7').status, 200)

    @direct_only('says what a proxy says')
    def test_sighup_changes_the_rate(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, 'ischiad.conf')
            with open(path, 'w', encoding='utf-8') as file:
                file.write('behind_proxy = true\nrate_limit = 1\nrate_burst = 1\n')
            with Service('--config', path) as service:
                far = {'X_Forwarded_For': '203.0.113.9'}
                self.assertIn(429, [service.get('/version', **far).status for _ in range(30)])
                with open(path, 'w', encoding='utf-8') as file:
                    file.write('behind_proxy = true\nrate_limit = 0\nconnections = 3000\n')
                service.signal(signal.SIGHUP)
                eventually(
                    lambda: 'need_restart="connections"' in service.errors(), 'the reload'
                )
                self.assertEqual(
                    [service.get('/version', **far).status for _ in range(5)], [200] * 5
                )


class Reload(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = os.path.join(folder.name, 'ischiad.conf')

    def write(self, **options):
        with open(self.path, 'w', encoding='utf-8') as file:
            file.writelines(f'{name} = {value}\n' for name, value in options.items())

    def reload(self, service, **options):
        self.write(**options)
        service.signal(signal.SIGHUP)
        eventually(lambda: 'need_restart=""' in service.errors(), 'the reload')

    def test_the_queue_s_limit_follows_its_option(self):
        self.write(queue_limit=1000)
        with Service('--config', self.path) as service:
            ids = [service.submit(wait=0, F=599, eM=20 + i)['id'] for i in range(3)]
            service.until(ids[0], 'running')
            self.reload(service, queue_limit=2)
            answer = service.ask('POST', '/v1/assessments', side(F=599, eM=31))
            self.assertEqual(answer.status, 429)

    def test_how_long_keys_are_remembered_follows_its_option(self):
        self.write(idempotency_hours=3)
        with Service('--config', self.path) as service:

            def identity():
                key = {'Idempotency-Key': 'a-1'}
                answer = service.ask('POST', '/v1/assessments', side(F=130.5), key)
                return answer.json()['id']

            first = identity()
            sql(service.state, 'UPDATE idempotency SET created_ms = created_ms - 7200000', first)
            self.assertEqual(identity(), first)
            self.reload(service, idempotency_hours=1)
            self.assertNotEqual(identity(), first)


class Doors(unittest.TestCase):
    def refuses(self, *options):
        with tempfile.TemporaryDirectory() as state:
            done = subprocess.run(
                [PROGRAM, '--state-dir', state, *options],
                capture_output=True,
                text=True,
                timeout=PATIENCE_S,
            )
        self.assertEqual(done.returncode, 2, done.stderr)
        return done.stderr

    def certificate(self, folder):
        files = [os.path.join(folder, name) for name in ('cert.pem', 'key.pem')]
        subprocess.run(
            [
                'openssl',
                'req',
                '-x509',
                '-newkey',
                'ec',
                '-pkeyopt',
                'ec_paramgen_curve:prime256v1',
                '-nodes',
                '-days',
                '1',
                '-subj',
                '/CN=localhost',
                '-addext',
                'subjectAltName=DNS:localhost,IP:127.0.0.1',
                '-out',
                files[0],
                '-keyout',
                files[1],
            ],
            check=True,
            capture_output=True,
        )
        return files

    @direct_only('TLS of the service itself')
    def test_other_addresses_need_tokens_and_tls(self):
        self.assertIn('TLS is off', self.refuses('--listen', '0.0.0.0:0'))
        self.assertIn('TLS is off', self.refuses('--listen', '[::]:0'))
        with tempfile.TemporaryDirectory() as folder:
            cert, key = self.certificate(folder)
            tls = ('--tls-certificate', cert, '--tls-key', key)
            self.assertIn('there are no tokens', self.refuses('--listen', '0.0.0.0:0', *tls))
            self.assertIn('go together', self.refuses('--tls-key', key))
            state = os.path.join(folder, 'state')
            os.mkdir(state)
            token = admin(state, 'token', 'create', 'scope=read').strip()
            with Service(*tls, state=state, listen='0.0.0.0:0') as service:
                self.assertEqual(service.scheme, 'https')
                context = ssl.create_default_context(cafile=cert)
                port = int(service.address.rsplit(':', 1)[1])
                connection = http.client.HTTPSConnection(
                    'localhost', port, context=context, timeout=PATIENCE_S
                )
                connection.request('GET', '/v1/assessments', headers=bearer(token))
                response = connection.getresponse()
                self.assertEqual(response.status, 200)
                self.assertTrue(response.headers['Strict-Transport-Security'])
                self.assertIn(connection.sock.version(), ('TLSv1.3', 'TLSv1.2'))
                response.read()

                def status(method, body=None, headers=None):
                    connection.request(method, '/v1/assessments', body, headers or {})
                    answer = connection.getresponse()
                    answer.read()
                    return answer.status

                # Without its last token it lets nobody in, instead of everybody.
                admin(state, 'token', 'revoke', token.split('_')[1])
                eventually(lambda: status('GET', headers=bearer(token)) == 401, 'the revoking')
                self.assertEqual(status('GET'), 401)
                self.assertEqual(status('POST', json.dumps(side()).encode(), JSON), 401)
                self.assertEqual(admin(state, 'token', 'forget').strip(), '1')
                time.sleep(2.2)
                self.assertEqual(status('GET'), 401)
                connection.close()

    @direct_only('where the service itself listens')
    def test_behind_a_proxy_any_address_will_do(self):
        with Service('--behind-proxy', listen='0.0.0.0:0') as service:
            port = service.address.rsplit(':', 1)[1]
            connection = http.client.HTTPConnection('127.0.0.1', int(port), timeout=PATIENCE_S)
            connection.request('GET', '/healthz')
            self.assertEqual(connection.getresponse().status, 200)
            connection.close()

    def test_options_say_what_they_accept(self):
        for options, words in (
            (('--wrokers', '2'), "did you mean 'workers'?"),
            (('--workers', 'two'), 'accepted 0 to 1024 processes'),
            (('--wrokers',), "did you mean 'workers'?"),
            (('--workers',), 'needs a value'),
            (('--listen', 'nowhere'), 'is not HOST:PORT'),
            (('--listen', '127.0.0.1:70000'), 'not one of 0 to 65535'),
            (('--hl7-listen', '[::1]:'), 'not one of 0 to 65535'),
            (('--audit', 'some'), 'accepted off, changes, all'),
            (('--config', '/nonexistent'), 'cannot open'),
            (('--emulator', '/nonexistent'), 'cannot open'),
            (('--worker-program', '/nonexistent'), 'cannot run'),
            (('--state-dir', '/etc/passwd'), 'is not a directory'),
            (('start',), 'does not belong there'),
        ):
            with tempfile.TemporaryDirectory() as state:
                done = subprocess.run(
                    [PROGRAM, '--state-dir', state, '--check-config', *options],
                    capture_output=True,
                    text=True,
                    timeout=PATIENCE_S,
                )
            self.assertEqual(done.returncode, 2, options)
            self.assertIn(words, done.stderr)

    def test_good_options_are_said_to_be_good(self):
        with tempfile.TemporaryDirectory() as folder:
            state = os.path.join(folder, 'state')
            done = subprocess.run(
                [PROGRAM, '--state-dir', state, '--workers', '3', '--check-config'],
                capture_output=True,
                text=True,
                timeout=PATIENCE_S,
            )
            self.assertEqual((done.returncode, done.stderr), (0, ''))
            self.assertIn('good', done.stdout)
            self.assertFalse(os.path.exists(state), 'checking starts nothing')

    def test_later_sources_win(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, 'conf')
            with open(path, 'w', encoding='utf-8') as file:
                file.write('# a comment\nworkers = 3 # another\nqueue_limit=7\nrate_limit = 9\n')
            run = [PROGRAM, '--config', path, '--print-config', '--rate-limit=11']
            text = subprocess.run(
                run,
                capture_output=True,
                text=True,
                check=True,
                env={**os.environ, 'ISCHIA_QUEUE_LIMIT': '8', 'ISCHIA_OTHER': '1'},
            )
            for line in (
                'workers = 3',
                'queue_limit = 8',
                'rate_limit = 11',
                'listen = 127.0.0.1:8080',
            ):
                self.assertIn('\n' + line + '\n', '\n' + text.stdout)
            self.assertIn('ISCHIA_OTHER', text.stderr)
            again = os.path.join(folder, 'again')
            with open(again, 'w', encoding='utf-8') as file:
                file.write(text.stdout)
            check = subprocess.run(
                [PROGRAM, '--config', again, '--print-config'],
                capture_output=True,
                text=True,
                check=True,
            )
            self.assertEqual(check.stdout, text.stdout)


class Copies(unittest.TestCase):
    @file_only('pg_dump and pg_restore make the copies: tests/deploy/backup_drill.py')
    def test_backup_and_restore_while_it_runs(self):
        with Service() as service, tempfile.TemporaryDirectory() as folder:
            service.until_ready()
            path = service.submit(F=120.5, subject='B-1')['links']['self']
            copy = os.path.join(folder, 'copy')
            admin(service.state, 'backup', copy)
            self.assertEqual(admin(service.state, 'backup', copy, check=False).returncode, 1)
            self.assertEqual(service.ask('DELETE', path).status, 204)
            self.assertEqual(service.get(path).status, 404)
            admin(service.state, 'restore', copy)
            self.assertEqual(service.get(path).json()['subject'], 'B-1')
            with open(copy, 'r+b') as file:
                file.write(b'not a database')
            self.assertNotEqual(admin(service.state, 'restore', copy, check=False).returncode, 0)
            self.assertEqual(service.get(path).status, 200)

    def test_unknown_commands_are_explained(self):
        with tempfile.TemporaryDirectory() as state:
            done = admin(state, 'token', 'crate', check=False)
            self.assertEqual(done.returncode, 2)
            self.assertIn('token create', done.stderr)
            for word in ('=admin', 's=admin', 'scop=read', 'scopes=read', 'read', '', 'scope=',
                         'scope=all', 'expires=soon', 'expires=30d2'):
                done = admin(state, 'token', 'create', word, check=False)
                self.assertEqual((done.returncode, done.stdout), (2, ''), word)
                self.assertIn('token create', done.stderr)
            self.assertEqual(admin(state, 'token', 'list').count('\n'), 1)


if __name__ == '__main__':
    unittest.main()
