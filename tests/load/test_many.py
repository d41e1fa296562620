#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Much at once, judged: memory at rest, 1 000 open event streams, a list beside 10 000 queued
assessments. Rates are measured by bench_service.py; what is asserted here holds on a slow machine."""
import http.client
import json
import os
import re
import resource
import socket
import statistics
import sys
import threading
import time
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), '../api'))
from service import JSON, PATIENCE_S, Service, side  # noqa: E402  (the path comes first)

HANG = 599
STREAMS, QUEUED = 1000, 10000


def setUpModule():
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    if most < STREAMS + 100:
        raise unittest.SkipTest(f'only {most} open files are allowed')
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def resident_mib(service):
    with open(f'/proc/{service.process.pid}/status', encoding='ascii') as file:
        return int(re.search(r'VmRSS:\s+(\d+)', file.read()).group(1)) / 1024


def cpu_ms(service):
    """What all its threads have used."""
    with open(f'/proc/{service.process.pid}/stat', encoding='ascii') as file:
        user, system = file.read().rsplit(')', 1)[1].split()[11:13]
    return (int(user) + int(system)) * 1e3 / os.sysconf('SC_CLK_TCK')


class Many(unittest.TestCase):
    def test_an_idle_daemon_is_small(self):
        with Service('--workers', '2') as service:
            service.until_ready()
            service.submit(F=300.5)
            size = resident_mib(service)
            print(f'resident at rest: {size:.1f} MiB')
            self.assertLessEqual(size, 30)

    def test_a_thousand_event_streams(self):
        with Service() as service:
            service.until_ready()
            document = service.submit(wait=0, F=HANG)
            path = document['links']['self']
            service.until(document['id'], 'running')
            host, port = service.address.split(':')
            streams = []
            for _ in range(STREAMS):
                stream = socket.create_connection((host, int(port)), PATIENCE_S)
                stream.sendall(f'GET {path}/events HTTP/1.1\r\nHost: localhost\r\n\r\n'.encode())
                streams.append(stream)
            texts = [stream.recv(65536) for stream in streams]
            self.assertTrue(all(text.startswith(b'HTTP/1.1 200 OK') for text in texts))
            metrics = service.get('/metrics').body.decode()  # others are answered meanwhile
            self.assertIn(f'ischia_http_event_streams {STREAMS}\n', metrics)
            print(f'resident with {STREAMS} streams: {resident_mib(service):.1f} MiB')
            self.assertEqual(service.ask('POST', path + '/cancel').status, 200)
            for stream, text in zip(streams, texts):
                while b'event: done' not in text:
                    chunk = stream.recv(65536)
                    self.assertTrue(chunk, 'a stream ended without its end')
                    text += chunk
                stream.close()

    def fill(self, service, first):
        """Every eighth of the numbers, over one connection."""
        connection = http.client.HTTPConnection(service.address, timeout=PATIENCE_S)
        for number in range(first, QUEUED, 8):
            body = json.dumps(side(F=100 + number / 1000, subject=f'S-{number % 100}'))
            connection.request('POST', '/v1/assessments', body, JSON)
            answer = connection.getresponse()
            answer.read()
            assert answer.status == 202, answer.status
        connection.close()

    def test_a_list_beside_ten_thousand(self):
        with Service('--drain-timeout', '0') as service:
            service.until_ready()
            service.submit(wait=0, F=HANG)  # the one worker has enough to do
            threads = [threading.Thread(target=self.fill, args=(service, i)) for i in range(8)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
            metrics = service.get('/metrics').body.decode()
            self.assertIn(f'ischia_queue_depth {QUEUED}\n', metrics)
            page = service.get('/v1/assessments?limit=500').json()
            for query in ('limit=50', 'limit=500', 'status=queued', 'status=succeeded',
                          'subject=S-7', 'side=left', 'limit=50&cursor=' + page['next_cursor']):
                self.assert_quick(service, query)

    def assert_quick(self, service, query):
        """Under 50 ms a page, of the daemon's own processor time: others may hold it up."""
        times, before = [], cpu_ms(service)
        for _ in range(21):
            begun = time.monotonic()
            self.assertEqual(service.get('/v1/assessments?' + query).status, 200)
            times.append((time.monotonic() - begun) * 1e3)
        spent = (cpu_ms(service) - before) / len(times)
        print(f'{query}: {spent:.1f} ms of processor time, median {statistics.median(times):.1f} ms')
        self.assertLess(spent, 50, query)


if __name__ == '__main__':
    unittest.main()
