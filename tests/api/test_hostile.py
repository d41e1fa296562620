#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Clients that mean harm, or are merely broken: none costs anybody else anything."""
import json
import os
import random
import re
import signal
import socket
import ssl
import threading
import time
import unittest

from service import PATIENCE_S, Service, direct_only, eventually, side

REQUEST_TIMEOUT_S = 5  # far more than a request needs, so that being held up shows
# The other end does not listen any more; through a proxy that is said by TLS.
GONE = (ConnectionResetError, BrokenPipeError, ssl.SSLEOFError, ssl.SSLZeroReturnError)
BODY = json.dumps(side(F=130.5)).encode()


class Hostile(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.service = Service(
            '--request-timeout',
            str(REQUEST_TIMEOUT_S),
            '--idle-timeout',
            '8',
            '--connections',
            '300',
            '--connections-per-address',
            '250',
        )
        cls.service.until_ready()

    @classmethod
    def tearDownClass(cls):
        cls.service.stop()

    def setUp(self):
        """What the test before left behind is gone soon."""
        eventually(lambda: self.connections() <= 3, 'connections that were left to be closed')

    def tearDown(self):
        self.assertIsNone(self.service.process.poll(), self.service.errors()[-2000:])

    def connections(self):
        text = self.service.get('/metrics').body.decode()
        return int(re.search(r'^ischia_http_connections (\d+)', text, re.M).group(1))

    def test_those_who_leave_in_the_middle_are_forgotten(self):
        with Service('--request-timeout', '3000', '--idle-timeout', '3000') as service:
            for text in (
                b'',
                b'GET /hea',
                b'POST /v1/assessments HTTP/1.1\r\nHost: localhost\r\n'
                b'Content-Type: application/json\r\nContent-Length: 99\r\n\r\n{',
            ):
                for _ in range(20):
                    connection = service.open()
                    connection.sendall(service.raw_request(text))
                    connection.close()
            eventually(
                lambda: 'ischia_http_connections 1\n' in service.get('/metrics').body.decode(),
                'connections that were left to be forgotten',
            )

    def open(self):
        return self.service.open()

    def read_all(self, connection):
        text = b''
        try:
            while chunk := connection.recv(65536):
                text += chunk
        except GONE:
            pass
        connection.close()
        return text

    def raw(self, text):
        connection = self.open()
        try:
            connection.sendall(self.service.raw_request(text))
        except GONE:
            pass  # refused before it was whole
        return self.read_all(connection)

    def is_alive(self):
        """Answers others at once: before it has given up on those who are slow."""
        begun = time.monotonic()
        self.assertEqual(self.service.get('/healthz').status, 200)
        self.assertLess(time.monotonic() - begun, REQUEST_TIMEOUT_S - 1)

    def test_a_slow_head_is_cut_off(self):
        connections = [self.open() for _ in range(20)]
        for connection in connections:
            connection.sendall(b'GET / HTTP/1.1\r\nHost: localhost\r\n')

        def none_is_open():
            for connection in list(connections):
                try:
                    connection.sendall(b'X: y\r\n')
                except OSError:
                    connections.remove(connection)
                    connection.close()
            self.is_alive()
            time.sleep(0.2)
            return not connections

        eventually(none_is_open, 'slow heads to be cut off')
        for connection in connections:
            connection.close()

    def test_a_slow_body_is_408(self):
        connection = self.open()
        connection.sendall(
            self.service.raw_request(
                b'POST /v1/assessments HTTP/1.1\r\nHost: localhost\r\n'
                b'Content-Type: application/json\r\nContent-Length: 200\r\n\r\n{'
            )
        )
        text = self.read_all(connection)
        self.assertTrue(text.startswith(b'HTTP/1.1 408 '), text)
        head, body = text.split(b'\r\n\r\n', 1)
        self.assertIn(b'application/problem+json', head)
        self.assertIn(f'Content-Length: {len(body)}'.encode(), head)
        self.assertEqual(json.loads(body)['status'], 408)

    def test_half_a_body_and_gone(self):
        for _ in range(50):
            connection = self.open()
            connection.sendall(
                self.service.raw_request(
                    b'POST /v1/assessments HTTP/1.1\r\nHost: localhost\r\n'
                    b'Content-Type: application/json\r\nContent-Length: 500\r\n\r\n' + BODY
                )
            )
            connection.close()
        self.is_alive()
        self.assertNotIn('130.5', self.service.get('/v1/assessments').body.decode())

    @direct_only('nginx reads on for a while, so that its refusal is heard')
    def test_an_endless_body_is_ended(self):
        connection = self.open()
        connection.sendall(
            self.service.raw_request(
                b'POST /v1/assessments HTTP/1.1\r\nHost: localhost\r\n'
                b'Content-Type: application/json\r\nTransfer-Encoding: chunked\r\n\r\n'
            )
        )
        sent = 0
        try:
            while sent < 128 << 20:
                connection.sendall(b'8000\r\n' + b' ' * 0x8000 + b'\r\n')
                sent += 0x8000
        except OSError:
            pass
        self.assertLess(sent, 64 << 20)
        connection.close()
        self.is_alive()

    def test_a_huge_head_is_refused(self):
        text = self.raw(
            b'GET / HTTP/1.1\r\nHost: localhost\r\n' + b'X-A: ' + b'a' * 20000 + b'\r\n\r\n'
        )
        self.assertTrue(text.startswith(b'HTTP/1.1 431 '), text[:80])
        self.assertIn(b'application/problem+json', text)
        text = self.raw(b'GET /' + b'a' * 100000 + b' HTTP/1.1\r\nHost: localhost\r\n\r\n')
        self.assertRegex(text[:13], rb'HTTP/1.1 4\d\d|')
        self.is_alive()

    def test_what_is_not_http_is_refused(self):
        for text in (
            b'\0' * 100,
            b'GET\r\n\r\n',
            b'GET / HTTP/9.9\r\n\r\n',
            b'\x16\x03\x01\x02\x00\x01',
            b'GET / HTTP/1.1\r\n\r\n',
            b'POST /v1/assessments HTTP/1.1\r\nHost: localhost\r\n' b'Content-Length: -1\r\n\r\n',
            b'GET /%00 HTTP/1.1\r\nHost: localhost\r\n\r\n',
            b'GET /%2e%2e/%2e%2e/etc/passwd HTTP/1.1\r\nHost: localhost\r\n\r\n',
            b'BREW / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n',
        ):
            connection = self.open()
            connection.sendall(text)
            connection.shutdown(socket.SHUT_WR)
            answer = self.read_all(connection)
            self.assertNotIn(b' 200 ', answer[:20], text)
        self.is_alive()

    def test_a_refusal_is_json_whatever_was_sent(self):
        torn = b'{"' + b'a' * 36 + '\u00e9\u00e9\u00e9'.encode() + b'": x}'
        get = b'GET %s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n'
        post = (
            b'POST %s HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n'
            b'Connection: close\r\nContent-Length: %d\r\n\r\n%s'
        )
        accented = '\u00e9'.encode()
        for text in (
            get % b'/v1/\xff',
            get % (b'/v1/' + accented * 200),
            get % b'/fhir/\xff',
            get % b'/v1/assessments?\xff=1',
            get % (b'/v1/assessments?' + b'k' * 59 + accented * 9 + b'=1'),
            get % (b'/fhir/RiskAssessment?' + b'k' * 59 + accented * 9 + b'=1'),
            post % (b'/v1/assessments', len(torn), torn),
            post % (b'/fhir/$assess', len(torn), torn),
        ):
            answer = self.raw(text)
            head, body = answer.split(b'\r\n\r\n', 1)
            self.assertRegex(head, rb'^HTTP/1.1 40[04] ')
            document = json.loads(body.decode())
            self.assertRegex(document.get('instance', '/v1/'), r'^/v1/[!-~]*$')

    def test_two_lengths_do_not_smuggle_a_request(self):
        text = self.raw(
            b'POST /v1/assessments HTTP/1.1\r\nHost: localhost\r\n'
            b'Content-Type: application/json\r\nContent-Length: 4\r\n'
            b'Transfer-Encoding: chunked\r\nConnection: close\r\n\r\n'
            b'0\r\n\r\nGET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n'
        )
        self.assertNotIn(b'alive', text)

    @direct_only('nginx judges heads by itself')
    def test_a_head_that_reads_two_ways_is_400(self):
        good = json.dumps(side(F=131.5)).encode()
        for head in (
            b'GET /healthz HTTP/1.1\r\nHost: localhost\r\nHost: localhost\r\n\r\n',
            b'GET /healthz HTTP/1.1\r\nHost: localhost\r\nhost: evil.example\r\n\r\n',
            b'POST /v1/assessments HTTP/1.1\r\nHost: localhost\r\n'
            b'Content-Type: application/json\r\n'
            b'Content-Length: 0\r\nContent-Length: %d\r\n\r\n' % len(good) + good,
            b'POST /v1/assessments HTTP/1.1\r\nHost: localhost\r\n'
            b'Content-Type: application/json\r\n'
            b'Content-Length: %d\r\nContent-Length: 4\r\n\r\n' % len(good) + good,
        ):
            # Its end closes the connection: nothing behind it is taken for a request.
            text = self.raw(head + b'GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n')
            self.assertTrue(text.startswith(b'HTTP/1.1 400 '), text[:200])
            self.assertEqual(text.count(b'HTTP/1.1 '), 1, text)
            self.assertEqual(json.loads(text.split(b'\r\n\r\n', 1)[1])['status'], 400)
        self.assertNotIn('131.5', self.service.get('/v1/assessments').body.decode())

    @direct_only('nginx passes the path alone')
    def test_a_target_with_its_authority(self):
        own = self.service.address.encode()
        for target, host, status in (
            (b'http://%s/healthz' % own, own, 200),
            (b'HTTP://localhost/healthz', own, 200),
            (b'http://%s/healthz' % own, b'evil.example', 200),  # Host is what the target says
            (b'http://%s' % own, own, 200),
            (b'http://%s?lang=de' % own, own, 200),
            (b'http://%s/v1/parameters?lang=xx' % own, own, 400),
            (b'http://%s/nothing' % own, own, 404),
            (b'http://evil.example/healthz', own, 403),
            (b'http:///healthz', own, 403),
            (b'http://user@%s/healthz' % own, own, 403),
            (b'ftp://%s/healthz' % own, own, 404),
        ):
            text = self.raw(
                b'GET %s HTTP/1.1\r\nHost: %s\r\nConnection: close\r\n\r\n' % (target, host)
            )
            self.assertTrue(text.startswith(b'HTTP/1.1 %d ' % status), (target, text[:300]))

    def test_pipelined_requests_are_answered_in_order(self):
        text = self.raw(
            b'GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n' * 5
            + b'GET /version HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n'
        )
        self.assertEqual(text.count(b'HTTP/1.1 200 OK'), 6)
        self.assertGreater(text.index(b'"program"'), text.rindex(b'alive'))

    @direct_only('connections of the service itself')
    def test_one_address_cannot_take_every_connection(self):
        connections = []
        try:
            for _ in range(280):
                connections.append(self.open())

            def refused():
                count = 0
                for connection in connections:
                    connection.setblocking(False)
                    try:
                        count += connection.recv(1) == b''
                    except BlockingIOError:
                        pass
                    except ConnectionResetError:
                        count += 1
                return count

            eventually(lambda: refused() >= 20, '20 connections to be refused')
        finally:
            for connection in connections:
                connection.close()
        eventually(self.is_let_in, 'others to be let in')

    def is_let_in(self):
        try:
            return self.service.get('/healthz').status == 200
        except OSError:
            return False

    def test_those_who_do_not_read_their_streams(self):
        document = self.service.submit(wait=0, F=599, eM=25)
        path = document['links']['self'].encode()
        streams = []
        for _ in range(100):
            connection = self.open()
            connection.sendall(
                self.service.raw_request(
                    b'GET ' + path + b'/events HTTP/1.1\r\nHost: localhost\r\n'
                    b'Connection: close\r\n\r\n'
                )
            )
            streams.append(connection)
        self.is_alive()
        for connection in streams[::2]:
            connection.close()
        self.assertEqual(self.service.ask('POST', path.decode() + '/cancel').status, 200)
        for connection in streams[1::2]:
            self.assertIn(b'event: done', self.read_all(connection))
        self.is_alive()

    def test_waiters_that_leave(self):
        document = self.service.submit(wait=0, F=599, eM=26)
        path = document['links']['self'].encode()
        for _ in range(50):
            connection = self.open()
            connection.sendall(
                self.service.raw_request(
                    b'GET ' + path + b' HTTP/1.1\r\nHost: localhost\r\nPrefer: wait=30\r\n\r\n'
                )
            )
            connection.close()
        self.assertEqual(self.service.ask('POST', path.decode() + '/cancel').status, 200)
        self.is_alive()

    def test_noise(self):
        rng = random.Random(7)
        good = (
            b'POST /v1/assessments?x=1 HTTP/1.1\r\nHost: localhost\r\n'
            b'Content-Type: application/json\r\n'
            b'Content-Length: %d\r\n\r\n' % len(BODY)
        ) + BODY
        for _ in range(150):
            text = bytearray(good)
            for _ in range(rng.randint(1, 8)):
                text[rng.randrange(len(text))] = rng.randrange(256)
            connection = self.open()
            connection.sendall(bytes(text[: rng.randint(1, len(text))]))
            connection.close()
        self.is_alive()


class Stopping(unittest.TestCase):
    def test_sigterm_lets_a_running_solve_finish(self):
        service = Service('--drain-timeout', str(PATIENCE_S))
        service.until_ready()
        document = service.submit(wait=0, F=595, eM=27)
        service.until(document['id'], 'running')
        waited = []

        def wait():
            answer = service.ask('GET', document['links']['self'], headers={'Prefer': 'wait=60'})
            waited.append(answer.json()['status'])

        thread = threading.Thread(target=wait)
        thread.start()
        service.signal(signal.SIGTERM)
        eventually(lambda: service.get('/readyz').status == 503, 'the signal to be taken')
        refused = service.ask('POST', '/v1/assessments', side())
        self.assertEqual(
            (refused.status, refused.json()['type']), (503, '/docs#problem-unavailable')
        )
        self.assertTrue(refused.headers['Retry-After'])
        with open(f'/tmp/ischia-gate-{service.process.pid}', 'xb') as gate:
            self.addCleanup(os.unlink, gate.name)
        thread.join()
        self.assertEqual(waited, ['succeeded'])
        service.stop()

    def test_a_solve_over_the_drain_time_returns_to_the_queue(self):
        service = Service('--drain-timeout', '1')
        service.until_ready()
        running = service.submit(wait=0, F=599, eM=28)
        service.until(running['id'], 'running')
        queued = [service.submit(wait=0, F=140.5 + i)['id'] for i in range(3)]
        service.own_state = False
        service.stop()
        with Service(state=service.state) as again:
            self.assertEqual(
                again.ask('POST', f'/v1/assessments/{running["id"]}/cancel').status, 200
            )
            for identity in queued:
                again.until(identity, 'succeeded')
            again.own_state = True

    def test_streams_end_when_it_stops(self):
        service = Service('--drain-timeout', '0')
        service.until_ready()
        path = service.submit(wait=0, F=599, eM=29)['links']['self']
        connection = service.connect()
        connection.request('GET', path + '/events')
        response = connection.getresponse()
        reader = threading.Thread(target=response.read)
        reader.start()
        service.stop()
        reader.join(PATIENCE_S)
        self.assertFalse(reader.is_alive())
        connection.close()

    def test_a_second_daemon_on_the_same_store_is_refused(self):
        with Service() as service:
            with self.assertRaises(AssertionError) as refused:
                Service(state=service.state)
            self.assertIn('did not start', str(refused.exception))
            self.assertEqual(service.get('/healthz').status, 200)
            self.assertTrue(os.path.isdir(service.state))


if __name__ == '__main__':
    unittest.main()
