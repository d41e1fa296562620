#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""run.sh as a newcomer meets it, with the programs that are built already: it shows a result of its
own service, and says in a line what is in its way."""
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.join(HERE, '../..')
sys.path.insert(0, os.path.join(HERE, '../api'))
from service import PATIENCE_S, PROGRAM, Service, admin  # noqa: E402  (the path comes first)


class FirstSteps(unittest.TestCase):
    def setUp(self):
        """A tree with run.sh in which nothing is left to install or to build."""
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = folder.name
        for name in ('deploy', 'build/release/server', 'bin'):
            os.makedirs(os.path.join(self.root, name))
        for name in ('run.sh', 'deploy/first_side.py'):
            shutil.copy(os.path.join(ROOT, name), os.path.join(self.root, name))
        os.symlink(os.path.join(ROOT, 'examples'), os.path.join(self.root, 'examples'))
        os.symlink(PROGRAM, os.path.join(self.root, 'build/release/server/ischiad'))
        self.write('deploy/packages.sh', 'install_packages() { :; }\n')
        self.write('build/release/build.ninja', '')
        self.write('bin/ninja', '#!/bin/sh\n')
        os.chmod(os.path.join(self.root, 'bin/ninja'), 0o755)

    def write(self, name, text):
        with open(os.path.join(self.root, name), 'w', encoding='utf-8') as file:
            file.write(text)

    def start(self, listen):
        environment = {**os.environ, 'PATH': os.path.join(self.root, 'bin') + ':' + os.environ['PATH'],
                       'ISCHIA_WORKER_PROGRAM': os.environ['ISCHIA']}
        return subprocess.Popen([os.path.join(self.root, 'run.sh'), listen], text=True, env=environment,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE)

    def test_a_side_is_solved_and_the_service_stays_until_it_is_ended(self):
        process = self.start('127.0.0.1:0')
        said = ''
        while 'Ctrl-C ends the service' not in said:
            line = process.stdout.readline()
            self.assertNotEqual(line, '', said)
            said += line
        self.assertIn('Muscle strain crosses both damage thresholds.', said)
        form = re.search(r'The form: +http://127\.0\.0\.1:(\d+)/\n', said)
        socket.create_connection(('127.0.0.1', int(form[1]))).close()
        with self.assertRaises(subprocess.TimeoutExpired):
            process.wait(timeout=1)
        process.send_signal(signal.SIGTERM)
        _, log = process.communicate(timeout=PATIENCE_S)
        self.assertIn('event="stopped"', log)
        self.assertNotIn('run.sh', log)

    def test_a_taken_port_is_the_reason_and_nobody_else_is_asked(self):
        other = Service()
        other.until_ready()
        process = self.start(other.address)
        said, log = process.communicate(timeout=PATIENCE_S)
        self.assertEqual((process.returncode, said), (1, ''))
        self.assertTrue(log.endswith(f'cannot listen on {other.address}: bind: Address already in use\n'), log)
        self.assertEqual(other.get('/v1/assessments').json()['items'], [])
        other.stop()

    def test_a_service_that_asks_for_a_token_says_so(self):
        state = os.path.join(self.root, 'data')
        os.mkdir(state)
        admin(state, 'token', 'create')
        process = self.start('127.0.0.1:0')
        for line in process.stderr:
            if 'There was no result' in line:
                break
            self.assertNotIn('Traceback', line)
            last = line
        self.assertRegex(last, r'^http://127\.0\.0\.1:\d+ answers 401: Send a token')
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=PATIENCE_S)


if __name__ == '__main__':
    unittest.main()
