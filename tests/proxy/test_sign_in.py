#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Who has signed in at the reverse proxy: what ischiad believes and from whom, and that the examples
of deploy/nginx (client certificates, a sign-in service) let nobody name themself."""
import http.client
import http.server
import os
import re
import sys
import tempfile
import threading
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [os.path.join(HERE, '../api'), HERE]
import front  # noqa: E402
from service import PATIENCE_S, Service, admin, eventually, side  # noqa: E402

HEADER = 'X-Ischia-User'
TRUSTING = ('--behind-proxy', '--proxy-addresses', '127.0.0.1', '--user-header', HEADER,
            '--user-admins', 'chief,other')
LIST = '/v1/assessments'


def named(*names):
    return {HEADER: names[0]} if names else {}


class Believed(unittest.TestCase):
    """The service alone; the tests speak as the proxy would, or as somebody who passes it by."""

    @classmethod
    def setUpClass(cls):
        cls.service = Service(*TRUSTING)
        cls.service.until_ready()

    @classmethod
    def tearDownClass(cls):
        cls.service.stop()

    def status(self, method, path, name=None, body=None, **headers):
        if name is not None:
            headers[HEADER] = name
        return self.service.ask(method, path, body, headers).status

    def test_a_name_opens_what_its_scopes_open(self):
        self.assertEqual(self.status('GET', LIST, 'nurse'), 200)
        self.assertEqual(self.status('POST', LIST, 'nurse', side(F=100.5)), 202)
        absent = LIST + '/01a201a9-49a6-75d9-8b79-1f36e7bd6914'
        self.assertEqual(self.status('DELETE', absent, 'nurse'), 403)
        self.assertEqual(self.status('DELETE', absent, 'chief'), 404)
        for namesake in ('Chief', 'chie', 'chief2', 'chief,other'):
            self.assertIn(self.status('DELETE', absent, namesake), (401, 403), namesake)

    def test_without_a_name_a_token_is_needed_though_none_was_made(self):
        with Service(*TRUSTING) as service:
            answer = service.get(LIST)
            self.assertEqual(answer.status, 401)
            self.assertIn('Bearer', answer.headers['WWW-Authenticate'])
            self.assertEqual(service.get(LIST, X_Ischia_User='').status, 401)
            self.assertEqual(service.get('/healthz').status, 200)
            token = admin(service.state, 'token', 'create', 'scope=read').strip()
            ask = lambda: service.get(LIST, Authorization='Bearer ' + token).status
            eventually(lambda: ask() == 200, 'the token to be known')

    def test_names_that_can_be_none_are_refused(self):
        for name in ('two words', 'a=b', 'x' * 65, 'quote"', 'semi;colon', 'n\u00e4me', '-\t-'):
            self.assertEqual(self.status('GET', LIST, name.encode('utf-8').decode('latin-1')), 401, name)
        for name in ('a', 'x' * 64, 'nurse@hospital.example', 'WARD\\nurse', 'a+b_c.d-e'):
            self.assertEqual(self.status('GET', LIST, name), 200, name)

    def test_two_names_are_none(self):
        connection = self.service.connect()
        for names in (('chief', 'nurse'), ('', 'chief'), ('chief', '')):
            connection.putrequest('GET', LIST)
            for name in names:
                connection.putheader(HEADER if name else HEADER.lower(), name)
            connection.endheaders()
            answer = connection.getresponse()
            answer.read()
            self.assertEqual(answer.status, 401, names)
        connection.close()

    def test_the_audit_log_names_them_and_tells_long_names_apart(self):
        path = self.service.ask('POST', LIST, side(F=101.5, subject='P-1'), named('nurse')).headers[
            'Location'
        ]
        long = ['y' * 63 + end for end in 'ab']
        for name in ('nurse', *long):
            self.assertEqual(self.status('GET', path, name), 200)
        for who in ('user:nurse what=assessment.create', 'user:nurse what=assessment.read',
                    *(f'user:{name} what=assessment.read' for name in long)):
            eventually(lambda: f'who={who}' in admin(self.service.state, 'audit', 'list'), who)
        self.assertNotIn('nurse', self.service.errors())

    def test_idempotency_keys_and_rates_are_each_persons_own(self):
        key = {'Idempotency-Key': 'morning'}
        made = [
            self.service.ask('POST', LIST, side(F=102.5), {**key, **named(name)}).json()['id']
            for name in ('nurse', 'nurse', 'chief')
        ]
        self.assertEqual(made[0], made[1])
        self.assertNotEqual(made[0], made[2])

    def test_from_elsewhere_a_name_means_nothing(self):
        elsewhere = [*TRUSTING[:1], '--proxy-addresses', '192.0.2.0/24, ::1', *TRUSTING[3:]]
        with Service(*elsewhere) as service:
            for name in ('nurse', 'chief'):
                self.assertEqual(service.get(LIST, X_Ischia_User=name).status, 401)
                self.assertEqual(service.ask('POST', LIST, side(), named(name)).status, 401)
        with Service('--behind-proxy', '--proxy-addresses', '192.0.2.1', '--rate-limit', '1',
                     '--rate-burst', '1') as service:
            for _ in range(5):  # nor an address: as this machine it has no rate
                answer = service.get('/version', X_Forwarded_For='203.0.113.7')
                self.assertEqual(answer.status, 200)

    def test_options_that_would_believe_anybody_are_refused(self):
        for options, words in (
            (('--user-header', HEADER), 'needs behind_proxy and proxy_addresses'),
            (('--user-header', HEADER, '--behind-proxy'), 'needs behind_proxy and proxy_addresses'),
            (('--proxy-addresses', '127.0.0.1'), 'proxy_addresses needs behind_proxy'),
            (('--behind-proxy', '--proxy-addresses', 'proxy.example'), 'is no address'),
            ((*TRUSTING, '--user-header', 'Authorization'), 'no other meaning'),
            ((*TRUSTING, '--user-header', 'X User'), 'no other meaning'),
            ((*TRUSTING, '--user-scopes', 'all'), 'accepted read, assess, admin'),
        ):
            with tempfile.TemporaryDirectory() as state:
                done = admin(state, *options, '--check-config', check=False)
            self.assertEqual(done.returncode, 2, options)
            self.assertIn(words, done.stderr)


class Behind(unittest.TestCase):
    """Through nginx, as the examples have it."""

    def through(self, example, **options):
        service = Service(*TRUSTING)
        self.addCleanup(service.stop)
        nginx = front.Front(service.address, example, **options)
        self.addCleanup(nginx.stop)
        return service, nginx

    def ask(self, nginx, path=LIST, pair=(), method='GET', **headers):
        context = front.authority().context(*pair)
        connection = http.client.HTTPSConnection(nginx.address, context=context, timeout=PATIENCE_S)
        try:
            connection.request(method, path, headers={k.replace('_', '-'): v for k, v in headers.items()})
            answer = connection.getresponse()
            answer.read()
            return answer
        finally:
            connection.close()

    def test_the_plain_example_drops_a_name_that_a_client_gives(self):
        _, nginx = self.through('ischia.conf')
        self.assertEqual(self.ask(nginx, '/healthz').status, 200)
        for spelling in ('X_Ischia_User', 'x_ischia_user', 'X_ISCHIA_USER'):
            self.assertEqual(self.ask(nginx, **{spelling: 'chief'}).status, 401, spelling)

    def test_a_certificate_names_its_bearer(self):
        service, nginx = self.through('ischia-mtls.conf')
        issue = front.authority().issue
        nurse = issue('nurse', '/O=Hospital/CN=nurse')
        self.assertEqual(self.ask(nginx, '/healthz').status, 400, 'no certificate')
        self.assertEqual(self.ask(nginx, pair=nurse).status, 200)
        absent = LIST + '/01a201a9-49a6-75d9-8b79-1f36e7bd6914'
        spoofed = self.ask(nginx, absent, nurse, 'DELETE', X_Ischia_User='chief')
        self.assertEqual(spoofed.status, 403)
        trick = issue('trick', '/CN=nurse/O=x,CN=chief')
        self.assertEqual(self.ask(nginx, absent, trick, 'DELETE').status, 401)
        service.until_ready()
        eventually(
            lambda: re.search(r'who=user:nurse what=access .*outcome=403',
                              admin(service.state, 'audit', 'list')),
            'the refusal in the audit log',
        )

    def test_a_sign_in_service_names_who_has_signed_in(self):
        sign_in = SignIn()
        self.addCleanup(sign_in.stop)
        service, nginx = self.through('ischia-sso.conf', sign_in=sign_in.address)
        self.assertEqual(self.ask(nginx).status, 401)
        self.assertEqual(self.ask(nginx, X_Ischia_User='chief').status, 401)
        away = self.ask(nginx, '/')
        self.assertEqual(away.status, 303)
        self.assertIn('/oauth2/start', away.headers['Location'])
        self.assertEqual(self.ask(nginx, Cookie='session=nurse').status, 200)
        absent = LIST + '/01a201a9-49a6-75d9-8b79-1f36e7bd6914'
        spoofed = self.ask(nginx, absent, (), 'DELETE', Cookie='session=nurse', X_Ischia_User='chief')
        self.assertEqual(spoofed.status, 403)
        self.assertEqual(self.ask(nginx, absent, (), 'DELETE', Cookie='session=chief').status, 404)
        wrong = 'Bearer ischia_0123456789abcdef_' + 'x' * 43
        refused = self.ask(nginx, Authorization=wrong, Cookie='session=nurse')
        self.assertEqual(refused.status, 401)
        token = admin(service.state, 'token', 'create', 'scope=read').strip()
        eventually(
            lambda: self.ask(nginx, Authorization='Bearer ' + token).status == 200,
            'the token to be known',
        )


class SignIn:
    """A sign-in service in which the cookie session=NAME is proof enough."""

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            name = re.search(r'session=(\w+)', self.headers.get('Cookie', ''))
            self.send_response(202 if name else 401)
            if name:
                self.send_header('X-Auth-Request-User', name[1])
            self.send_header('Content-Length', '0')
            self.end_headers()

        def log_message(self, *_):
            pass

    def __init__(self):
        self.server = http.server.ThreadingHTTPServer(('127.0.0.1', 0), self.Handler)
        self.address = f'127.0.0.1:{self.server.server_port}'
        self.thread = threading.Thread(target=self.server.serve_forever)
        self.thread.start()

    def stop(self):
        self.server.shutdown()
        self.thread.join()
        self.server.server_close()


if __name__ == '__main__':
    unittest.main()
