#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""ischiad with the worker that really solves: shut in, stopped by a cancel, the same numbers from
another process, and drawings. The daemon in $ISCHIAD, the worker in $ISCHIA."""
import os
import sys
import unittest
import xml.etree.ElementTree as xml

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), '../api'))
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), '../crash'))
from crash import workers_of  # noqa: E402  (the path comes first)
from service import Service, eventually  # noqa: E402

WORKER = os.environ['ISCHIA']


def status_of(pid):
    with open(f'/proc/{pid}/status', encoding='ascii') as file:
        return dict(line.rstrip('\n').split(':\t', 1) for line in file if ':\t' in line)


class RealWorker(unittest.TestCase):
    def test_shut_in_and_stopped(self):
        with Service(worker=WORKER) as service:
            service.until_ready()
            (worker,) = workers_of(service.process.pid)
            status = status_of(worker)
            self.assertEqual((status['Seccomp'], status['NoNewPrivs']), ('2', '1'))
            self.assertEqual(sorted(os.listdir(f'/proc/{worker}/fd')), ['0', '1', '2', '3'])
            self.assertRegex(service.get('/version').json()['worker'], r'^[\d.]+, CHOLMOD [\d.]+')
            document = service.submit(wait=0, resolution='fine')
            service.until(document['id'], 'running')
            answer = service.ask('POST', document['links']['self'] + '/cancel')
            self.assertEqual(answer.json()['status'], 'cancelled')
            eventually(lambda: not os.path.exists(f'/proc/{worker}'), 'the worker to be gone')

    def solve_once(self):
        """The result of one side in a fresh store, without its times; and its drawings."""
        with Service(worker=WORKER) as service:
            service.until_ready()
            path = service.submit(wait=0)['links']['self']
            document = service.until(path.rsplit('/', 1)[1], 'succeeded')
            drawings = [service.get(path + end) for end in ('/section.svg', '/field.vtu')]
        for key in ('wall_s', 'cpu_s'):
            del document['result']['numerics'][key]
        return document['result'], drawings

    def test_the_same_numbers_from_another_process(self):
        first, drawings = self.solve_once()
        self.assertTrue(first['numerics']['converged'])
        self.assertLessEqual(first['numerics']['force_residual'], 1e-8)
        again, the_same = self.solve_once()
        self.assertEqual(again, first)
        for drawing, twin in zip(drawings, the_same):
            self.assertEqual(drawing.status, 200)
            self.assertEqual(drawing.body, twin.body)
        self.assertTrue(xml.fromstring(drawings[0].body).tag.endswith('svg'))
        self.assertEqual(xml.fromstring(drawings[1].body).tag, 'VTKFile')


if __name__ == '__main__':
    unittest.main()
