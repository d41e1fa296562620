#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""What record systems are told when an assessment ends: signed, once confirmed never again, and
all of it after they were away."""
import base64
import hashlib
import hmac
import http.server
import json
import os
import signal
import subprocess
import tempfile
import threading
import time
import unittest
import urllib.parse

import hl7
import interop
from interop import parameters, post
from service import SIDE, Service, admin, eventually

SECRET = b'a secret of more than 24 bytes'


class Receiver(threading.Thread):
    """An HTTP server that keeps what it is sent and answers as it was told to."""

    def __init__(self, port=0, answers=()):
        super().__init__(daemon=True)
        outer = self
        self.requests, self.answers = [], list(answers)

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_POST(self):
                body = self.rfile.read(int(self.headers['Content-Length']))
                status, answer = outer.answer(self.path, dict(self.headers), body)
                self.send_response(status)
                self.send_header('Content-Length', str(len(answer)))
                self.end_headers()
                self.wfile.write(answer)

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer(('127.0.0.1', port), Handler)
        self.port = self.server.server_address[1]
        self.start()

    def run(self):
        self.server.serve_forever(0.05)

    def answer(self, path, headers, body):
        status = self.answers.pop(0) if self.answers else 200
        self.requests.append((status, path, headers, body))
        return status, b'{}'

    def taken(self):
        return [r for r in self.requests if r[0] in (200, 201)]

    def wait(self, count, seconds=120):
        end = time.monotonic() + seconds
        while len(self.taken()) < count:
            assert time.monotonic() < end, f'{len(self.taken())} of {count} arrived'
            time.sleep(0.05)
        return self.taken()

    def close(self):
        self.server.shutdown()
        self.server.server_close()


class FhirServer(Receiver):
    """With a token endpoint (SMART Backend Services); keeps reports by identifier."""

    def __init__(self, **options):
        super().__init__(**options)
        self.tokens, self.assertions, self.reports = 0, [], {}

    def answer(self, path, headers, body):
        if path == '/token':
            form = urllib.parse.parse_qs(body.decode())
            self.assertions.append(form)
            self.tokens += 1
            return 200, json.dumps({'access_token': f'token-{self.tokens}', 'token_type': 'bearer',
                                    'expires_in': 300}).encode()
        if headers.get('Authorization') != f'Bearer token-{self.tokens}':
            self.requests.append((401, path, headers, body))
            return 401, b''
        status, answer = super().answer(path, headers, body)
        if status == 200:
            key = headers['If-None-Exist']
            status = 200 if key in self.reports else 201
            self.reports.setdefault(key, json.loads(body))
        return status, answer


def secret_file(folder):
    path = os.path.join(folder, 'secret')
    with open(path, 'wb') as file:
        file.write(SECRET + b'\n')
    return path


def is_signed(headers, body, secret=SECRET):
    text = f'{headers["webhook-id"]}.{headers["webhook-timestamp"]}.'.encode() + body
    mac = base64.b64encode(hmac.new(secret, text, hashlib.sha256).digest()).decode()
    return headers['webhook-signature'] == 'v1,' + mac


def free_port():
    with hl7.socket.create_server(('127.0.0.1', 0)) as s:
        return s.getsockname()[1]


class Webhook(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.secret = secret_file(folder.name)

    def options(self, port):
        return ('--webhook-url', f'http://127.0.0.1:{port}/hook', '--webhook-secret', self.secret,
                '--public-url', 'https://ischia.example', '--outbound-pause', '1')

    def test_each_end_is_told_once_and_signed(self):
        receiver = Receiver()
        self.addCleanup(receiver.close)
        with Service(*self.options(receiver.port)) as service:
            service.until_ready()
            done = service.submit(F=300, subject='P-SECRET', side='left')
            failed = service.submit(F=598)
            cached = service.submit(F=300, subject='other')
            hanging = service.submit(wait=0, F=599)
            service.until(hanging['id'], 'running')
            service.ask('POST', hanging['links']['self'] + '/cancel')
            told = {}
            for _, path, headers, body in receiver.wait(4):
                self.assertEqual(path, '/hook')
                self.assertTrue(is_signed(headers, body))
                self.assertFalse(is_signed(headers, body + b' '))
                self.assertLess(abs(int(headers['webhook-timestamp']) - time.time()), 60)
                self.assertNotIn(b'SECRET', body)
                document = json.loads(body)
                told[document['data']['id']] = document
            self.assertEqual(
                {i: d['type'] for i, d in told.items()},
                {done['id']: 'assessment.succeeded', failed['id']: 'assessment.failed',
                 cached['id']: 'assessment.succeeded', hanging['id']: 'assessment.cancelled'})
            self.assertEqual(told[done['id']]['data']['self'],
                             'https://ischia.example/v1/assessments/' + done['id'])
            time.sleep(1.5)
            self.assertEqual(len(receiver.requests), 4)
            eventually(lambda: admin(service.state, 'outbox', 'list') == '', 'an empty outbox')

    def test_refusals_are_tried_again_with_pauses(self):
        receiver = Receiver(answers=[500, 404, 429, 302])
        self.addCleanup(receiver.close)
        with Service(*self.options(receiver.port)) as service:
            service.until_ready()
            service.submit(F=301)
            receiver.wait(1)
            self.assertEqual([r[0] for r in receiver.requests], [500, 404, 429, 302, 200])
            self.assertEqual(len({r[2]['webhook-id'] for r in receiver.requests}), 1)
            receiver.answers = [410]  # Gone: given up, and kept for the operator
            service.submit(F=302)
            eventually(lambda: 'given-up' in admin(service.state, 'outbox', 'list'), 'giving up')
            self.assertIn('answered 410', admin(service.state, 'outbox', 'list'))
            self.assertEqual(admin(service.state, 'outbox', 'retry').strip(), '1')
            receiver.wait(2)

    def test_everything_arrives_after_the_receiver_was_away(self):
        port = free_port()
        count = 60
        service = Service(*self.options(port))
        service.until_ready()
        expected = [service.submit(F=300 + n / 8)['id'] for n in range(count // 2)]
        # what is told is taken from the changes, a moment after each
        eventually(lambda: len(admin(service.state, 'outbox', 'list').splitlines()) == count // 2,
                   'the outbox to hold what was missed')
        service.process.send_signal(signal.SIGKILL)  # nothing is lost with the daemon either
        service.process.wait()
        service.process.stdout.close()
        service.log.close()
        with Service(*self.options(port), state=service.state) as again:
            again.until_ready()
            expected += [again.submit(F=400 + n / 8)['id'] for n in range(count // 2)]
            time.sleep(1)
            receiver = Receiver(port)
            self.addCleanup(receiver.close)
            told = [json.loads(r[3])['data']['id'] for r in receiver.wait(count)]
            self.assertEqual(sorted(told), sorted(expected))
            self.assertEqual(len({r[2]['webhook-id'] for r in receiver.taken()}), count)
            again.until_ready()

    def test_a_target_that_is_new_is_told_what_is_new(self):
        receiver = Receiver()
        self.addCleanup(receiver.close)
        service = Service()
        service.until_ready()
        service.submit(F=310)
        service.own_state = False
        service.stop()
        with Service(*self.options(receiver.port), state=service.state) as again:
            again.until_ready()
            fresh = again.submit(F=311)['id']
            (request,) = receiver.wait(1)
            self.assertEqual(json.loads(request[3])['data']['id'], fresh)
            time.sleep(1.2)
            self.assertEqual(len(receiver.requests), 1)

    def test_what_is_erased_is_not_told(self):
        with Service(*self.options(free_port())) as service:
            service.until_ready()
            made = service.submit(F=312)
            time.sleep(1.2)
            self.assertIn(made['id'], admin(service.state, 'outbox', 'list'))
            self.assertEqual(service.ask('DELETE', made['links']['self']).status, 204)
            self.assertEqual(admin(service.state, 'outbox', 'list'), '')

    def test_a_secret_is_needed_and_may_be_written_as_receivers_do(self):
        with self.assertRaisesRegex(AssertionError, 'webhook_secret'):
            Service('--webhook-url', 'http://127.0.0.1:1/')
        with open(self.secret, 'w', encoding='utf-8') as file:
            file.write('short')
        with self.assertRaisesRegex(AssertionError, '24'):
            Service(*self.options(1))
        with open(self.secret, 'w', encoding='utf-8') as file:
            file.write('whsec_' + base64.b64encode(b'k' * 32).decode())
        receiver = Receiver()
        self.addCleanup(receiver.close)
        with Service(*self.options(receiver.port)) as service:
            service.until_ready()
            service.submit(F=313)
            (request,) = receiver.wait(1)
            self.assertTrue(is_signed(request[2], request[3], b'k' * 32))


class Push(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        interop.install()

    def test_a_report_is_created_once_by_a_backend_service(self):
        made = json.loads(interop.node('jwt.mjs', input=json.dumps(
            {'keys': {'ec': 'ES384', 'rsa': 'RS384'}})).stdout)
        for kind, algorithm in (('ec', 'ES384'), ('rsa', 'RS384')):
            with tempfile.TemporaryDirectory() as folder:
                key = os.path.join(folder, 'key.pem')
                with open(key, 'w', encoding='utf-8') as file:
                    file.write(made['pem'][kind])
                server = FhirServer()
                base = f'http://127.0.0.1:{server.port}'
                options = ('--push-url', base + '/r4', '--push-token-url', base + '/token',
                           '--push-client', 'ischia-1', '--push-key', key, '--push-key-id', kind,
                           '--outbound-pause', '1')
                with Service(*options) as service:
                    service.until_ready()
                    one = post(service, parameters(F=320)).json()['entry'][0]['resource']['id']
                    server.wait(1)
                    (form,) = server.assertions
                    self.assertEqual(form['grant_type'], ['client_credentials'])
                    self.assertEqual(form['scope'], ['system/DiagnosticReport.c'])
                    self.assertEqual(
                        form['client_assertion_type'],
                        ['urn:ietf:params:oauth:client-assertion-type:jwt-bearer'])
                    checked = interop.node('jwt.mjs', 'verify', input=json.dumps(
                        {'token': form['client_assertion'][0], 'jwk': made['jwks'][kind]}))
                    told = json.loads(checked.stdout)
                    self.assertTrue(told['valid'])
                    self.assertEqual(told['head'],
                                     {'alg': algorithm, 'kid': kind, 'typ': 'JWT'})
                    claims = told['claims']
                    self.assertEqual((claims['iss'], claims['sub'], claims['aud']),
                                     ('ischia-1', 'ischia-1', base + '/token'))
                    self.assertLessEqual(claims['exp'] - claims['iat'], 300)
                    server.answers = [503, 400]
                    two = post(service, parameters(F=321, subject=None)).json()
                    post(service, parameters(F=598))
                    server.wait(3)
                    self.assertEqual(server.tokens, 1)  # kept while it is good
                    server.tokens += 1  # the server forgets it: 401, and a new one is got
                    post(service, parameters(F=322))
                    server.wait(4)
                    self.assertIn(401, [r[0] for r in server.requests])
                    self.assertEqual(len(server.assertions), 2)
                reports = {r['id']: r for r in server.reports.values()}
                self.assertEqual(len(reports), 4)
                self.assertIn(two['entry'][0]['resource']['id'], reports)
                self.assertEqual(reports[one]['subject'], {'reference': 'Patient/123'})
                self.assertEqual(len(reports[one]['contained']), 1 + 7 + 13)
                self.assertEqual([r['status'] for r in reports.values()].count('cancelled'), 1)
                self.assertIn(f'identifier=urn:ietf:rfc:3986%7Curn:uuid:{one}', server.reports)
                self.assertEqual(interop.complaints([*reports.values()]), '')
                server.close()

    def test_a_key_of_another_kind_is_refused_at_the_start(self):
        made = json.loads(interop.node('jwt.mjs', input=json.dumps(
            {'keys': {'p256': 'ES256', 'short': 'RS1024'}})).stdout)
        with tempfile.TemporaryDirectory() as folder:
            for pem in (*made['pem'].values(), 'no key'):
                key = os.path.join(folder, 'key.pem')
                with open(key, 'w', encoding='utf-8') as file:
                    file.write(pem)
                with self.assertRaisesRegex(AssertionError, 'P-384'):
                    Service('--push-url', 'http://127.0.0.1:1', '--push-token-url',
                            'http://127.0.0.1:1', '--push-client', 'x', '--push-key', key)


class Hl7Peer(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        interop.install()

    def test_results_go_back_to_the_peer(self):
        peer = hl7.Peer(answers=['AA', 'AE', 'AR', 'hang up', 'AA'])
        self.addCleanup(peer.close)
        with Service('--hl7-listen', '127.0.0.1:0', '--hl7-peer', f'127.0.0.1:{peer.port}',
                     '--hl7-peer-application', 'EHR', '--outbound-pause', '1') as service:
            service.until_ready()
            with hl7.Mllp(hl7.port_of(service)) as link:
                link.ask(hl7.oru('b-1', pid='7^^^HOSP^MR', F='330.50', side='right'))
            (first,) = peer.wait(1)
            parsed = interop.node('hl7_client.mjs', 'parse', input=json.dumps({'text': first}))
            told = json.loads(parsed.stdout)
            self.assertEqual(told['type'], 'ORU')
            self.assertIn(['F', '330.50', 'N'], told['observations'])
            rows = hl7.fields(first)
            self.assertEqual(next(r for r in rows if r[0] == 'PID')[3], '7^^^HOSP^MR')
            self.assertEqual(rows[0][2:6], ['ISCHIA', '', 'EHR', ''])
            order = next(r for r in rows if r[0] == 'OBR')
            identity = order[3].split('^')[0]
            self.assertEqual((order[2], order[25]), ('order-7', 'F'))
            document = service.get('/v1/assessments/' + identity).json()
            values = {c.split('^')[0]: (v, u) for c, v, u in
                      [(r[3], r[5], r[6].split('^')[0]) for r in rows if r[0] == 'OBX']}
            self.assertEqual(values['F'], ('330.50', 'N'))
            self.assertEqual(values['side'][0], 'right')
            self.assertEqual(values['band'][0], 'both')
            self.assertEqual(float(values['eps_max'][0]), document['result']['strain']['eps_max'])
            self.assertIn('animals', ' '.join(r[3] for r in rows if r[0] == 'NTE'))
            # our own results are not assessed again, also under another name
            with hl7.Mllp(hl7.port_of(service)) as link:
                self.assertEqual(link.ask(first)[0], 'AR')
                self.assertEqual(link.ask(first.replace('|ISCHIA|', '|EHR|', 1))[0], 'AE')
            service.submit(F=598)
            messages = peer.wait(4)
            self.assertEqual(len({hl7.fields(m)[0][9] for m in messages[1:]}), 1)
            failed = hl7.fields(messages[-1])
            self.assertEqual(next(r for r in failed if r[0] == 'OBR')[25], 'X')
            time.sleep(1.5)
            self.assertEqual(len(peer.messages), 4)

    def test_everything_arrives_after_the_peer_was_away(self):
        port = free_port()
        with Service('--hl7-peer', f'127.0.0.1:{port}', '--outbound-pause', '1') as service:
            service.until_ready()
            expected = {service.submit(F=340 + n / 4)['id'] for n in range(12)}
            time.sleep(1)
            peer = hl7.Peer(port)
            self.addCleanup(peer.close)
            messages = peer.wait(12)
            self.assertEqual(
                {next(r for r in hl7.fields(m) if r[0] == 'OBR')[3].split('^')[0]
                 for m in messages}, expected)

    def test_tls_checks_whose_peer_it_is(self):
        with tempfile.TemporaryDirectory() as folder:
            certificate, key = hl7.tls_files(folder, subprocess.run)
            context = hl7.ssl.SSLContext(hl7.ssl.PROTOCOL_TLS_SERVER)
            context.load_cert_chain(certificate, key)
            peer = hl7.Peer(context=context)
            self.addCleanup(peer.close)
            options = ('--hl7-peer', f'localhost:{peer.port}', '--hl7-peer-tls',
                       '--outbound-pause', '1')
            with Service(*options) as service:
                service.until_ready()
                service.submit(F=350)
                time.sleep(2)
                self.assertEqual(peer.messages, [])
                self.assertIn('TLS', admin(service.state, 'outbox', 'list'))
            with Service(*options, '--outbound-ca', certificate) as service:
                service.until_ready()
                service.submit(F=351)
                peer.wait(1)


if __name__ == '__main__':
    unittest.main()
