#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Two daemons on one PostgreSQL server look like one to their clients."""
import os
import sys
import threading
import time
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, '../postgresql')]
from cluster import Cluster, skip_without_server  # noqa: E402  (the path comes first)
from service import PATIENCE_S, Service, admin, eventually, side  # noqa: E402

GATE, SLOW, HANG = 595, 596, 599


def workers_of(service):
    """Processes that solve for it now."""
    found = []
    for task in os.listdir(f'/proc/{service.process.pid}/task'):
        try:
            with open(f'/proc/{service.process.pid}/task/{task}/children', encoding='ascii') as file:
                found += file.read().split()
        except OSError:
            pass  # a thread that has just ended
    return set(found)


class Start(unittest.TestCase):
    def test_a_daemon_waits_for_its_database(self):
        with Cluster() as server:
            server.kill()
            later = threading.Timer(2, server.start)
            later.start()
            with Service('--store', server.url) as service:
                service.until_ready()
                self.assertIn('waiting for the database', service.errors())
            later.join()


class Two(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.server = Cluster()
        cls.addClassCleanup(cls.server.stop)
        cls.near, cls.far = (Service('--store', cls.server.url) for _ in range(2))
        for service in (cls.near, cls.far):
            cls.addClassCleanup(service.stop)
            service.until_ready()

    def owner_of(self, identity):
        """(the daemon that runs it, the other one), once it runs."""
        digits = identity.replace('-', '')
        ask = f"SELECT owner FROM ischia.assessment WHERE state = 1 AND id = '\\x{digits}'"
        number = eventually(lambda: self.server.sql(ask), 'it to run')
        first = self.server.sql('SELECT min(id) FROM ischia.daemon')
        return (self.near, self.far) if number == first else (self.far, self.near)

    def test_a_wait_ends_wherever_it_is_solved(self):
        for i in range(6):
            at, elsewhere = (self.near, self.far) if i % 2 else (self.far, self.near)
            made = at.submit(wait=0, F=SLOW + i / 100)
            begun = time.monotonic()
            answer = elsewhere.get(made['links']['self'], Prefer='wait=60')
            self.assertEqual(answer.json()['status'], 'succeeded', answer.body)
            self.assertLess(time.monotonic() - begun, 55, 'the wait ran out instead')

    def test_events_reach_who_listens_elsewhere(self):
        made = self.near.submit(wait=0, F=GATE + 0.25)
        owner, other = self.owner_of(made['id'])
        stream = other.open()
        self.addCleanup(stream.close)
        path = made['links']['self'] + '/events'
        stream.sendall(f'GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n'.encode())
        self.addCleanup(self.set_gate, owner, False)
        self.set_gate(owner, True)
        text = b''
        while b'event: done' not in text:
            chunk = stream.recv(4096)
            self.assertTrue(chunk, text)
            text += chunk
        self.assertIn(b'succeeded', text)

    @staticmethod
    def set_gate(service, is_open):
        path = f'/tmp/ischia-gate-{service.process.pid}'
        if is_open:
            with open(path, 'w', encoding='utf-8'):
                pass
        elif os.path.exists(path):
            os.unlink(path)

    def test_cancelled_elsewhere_means_that_the_process_is_gone(self):
        made = self.near.submit(wait=0, F=HANG + 0.5)
        owner, other = self.owner_of(made['id'])
        solving = workers_of(owner)
        self.assertEqual(other.ask('POST', made['links']['self'] + '/cancel').status, 200)
        eventually(lambda: not solving & workers_of(owner), 'its worker to be gone')
        self.assertEqual(owner.get(made['links']['self']).json()['status'], 'cancelled')
        owner.until_ready()

    def test_a_key_is_known_everywhere(self):
        key = {'Idempotency-Key': 'one'}
        body = side(F=123.5, subject='K')
        made = self.near.ask('POST', '/v1/assessments', body, key).json()['id']
        self.assertEqual(self.far.ask('POST', '/v1/assessments', body, key).json()['id'], made)
        other = self.far.ask('POST', '/v1/assessments', side(F=124.5, subject='K'), key)
        self.assertEqual(other.status, 422)

    def test_the_same_key_at_both_at_once_makes_one(self):
        for i in range(20):
            said, body = [], side(F=130 + i / 8)

            def ask(service, key=i, body=body, said=said):
                answer = service.ask('POST', '/v1/assessments', body,
                                     {'Idempotency-Key': f'both-{key}'})
                said.append(answer.json()['id'])

            threads = [threading.Thread(target=ask, args=(service,))
                       for service in (self.near, self.far)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
            self.assertEqual(len(set(said)), 1, said)

    def test_erased_here_is_gone_there(self):
        made = self.near.submit(F=125.5)
        self.assertEqual(self.far.get(made['links']['self']).status, 200)
        self.assertEqual(self.near.ask('DELETE', made['links']['self']).status, 204)
        self.assertEqual(self.far.get(made['links']['self']).status, 404)

    def test_a_study_is_solved_by_both_and_assessments_go_before_it(self):
        rows = [f'{i},7.1,22.8,31,10,8,5,{SLOW + i / 100}' for i in range(8)]
        table = 'row,R1,R2,eM,eF,muM,muF,F\n' + '\n'.join(rows) + '\n'
        made = self.near.ask('POST', '/v1/studies', table.encode(), {'Content-Type': 'text/csv'})
        self.assertEqual(made.status, 202, made.body)
        path = made.headers['Location']
        running = lambda: self.server.sql(
            'SELECT count(DISTINCT owner) FROM ischia.study_point WHERE state = 1') == '2'
        eventually(running, 'both to work on it')
        self.assertEqual(self.far.submit(F=127.5)['status'], 'succeeded')
        self.assertGreater(self.far.get(path).json()['points']['queued'], 0)
        points = lambda: self.near.get(path).json()['points']
        eventually(lambda: points()['succeeded'] == 8, 'the study to end')

    def test_a_token_made_beside_one_holds_at_both(self):
        with Cluster() as server:
            with Service('--store', server.url) as near, Service('--store', server.url) as far:
                token = admin(near.state, '--store', server.url, 'token', 'create').strip()
                for service in (near, far):
                    eventually(lambda s=service: s.get('/v1/changes').status == 401, 'the token')
                    shown = {'Authorization': f'Bearer {token}'}
                    self.assertEqual(service.ask('GET', '/v1/changes', headers=shown).status, 200)


if __name__ == '__main__':
    skip_without_server()
    assert PATIENCE_S > 60
    unittest.main()
