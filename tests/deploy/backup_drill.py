#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The drill that everybody should have done before the disk is gone: a copy is made while work goes
on, the machine is lost, the copy is put back elsewhere and goes on. And the log is rotated."""
import os
import shutil
import stat
import subprocess
import sys
import tempfile
import threading
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
DEPLOY = os.path.join(HERE, '../../deploy')
sys.path[:0] = [os.path.join(HERE, '../api'), os.path.join(HERE, '../postgresql')]
from cluster import Cluster, programs  # noqa: E402  (the path comes first)
from service import PATIENCE_S, PROGRAM, Service, admin, eventually  # noqa: E402


def backup(state, folder, keep=None, program=PROGRAM, **variables):
    """Runs the script as its unit does; returns what it said."""
    config = os.path.join(folder, 'ischiad.conf')
    with open(config, 'w', encoding='utf-8') as file:
        file.write(f'state_dir = {state}\n')
    words = [os.path.join(DEPLOY, 'backup/ischia-backup'), folder, *([str(keep)] if keep else [])]
    environment = {**os.environ, 'ISCHIAD': program, 'ISCHIA_CONFIG_FILE': config,
                   **variables}
    return subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE_S,
                          env=environment)


def copies(folder, end='.db'):
    return sorted(name for name in os.listdir(folder) if name.endswith(end))


class Drill(unittest.TestCase):
    def test_a_copy_made_under_load_can_be_put_back_elsewhere(self):
        with tempfile.TemporaryDirectory() as folder:
            service = Service('--workers', '2')
            service.until_ready()
            done = [service.submit(F=100 + i / 8, subject=f'D-{i}') for i in range(20)]
            token = admin(service.state, 'token', 'create', 'scope=admin').strip()
            shown = {'Authorization': 'Bearer ' + token}
            eventually(lambda: service.get('/v1/changes').status == 401, 'the token to be known')
            go_on = threading.Event()

            def load():
                i = 0
                while not go_on.is_set():
                    body = {**done[0]['parameters'], 'F': 200 + i / 64}
                    assert service.ask('POST', '/v1/assessments', body, shown).status == 202
                    i += 1

            thread = threading.Thread(target=load)
            thread.start()
            said = backup(service.state, folder)
            go_on.set()
            thread.join()
            self.assertEqual(said.returncode, 0, said.stdout + said.stderr)
            self.assertIn('the chain holds', said.stdout)
            service.kill()
            shutil.rmtree(service.state)

            [copy] = copies(folder)
            mode = os.stat(os.path.join(folder, copy)).st_mode
            self.assertEqual(stat.S_IMODE(mode) & 0o077, 0, 'nobody else may read it')
            elsewhere = tempfile.mkdtemp(prefix='ischia-test-')
            self.addCleanup(shutil.rmtree, elsewhere, ignore_errors=True)
            admin(elsewhere, 'restore', os.path.join(folder, copy))
            with Service('--workers', '2', state=elsewhere) as again:
                again.until_ready()
                for document in done:
                    found = again.ask('GET', document['links']['self'], headers=shown).json()
                    self.assertEqual(found, document)
                self.assertEqual(again.get('/v1/assessments').status, 401, 'tokens came along')
                waiting = lambda: again.ask(
                    'GET', '/v1/assessments?status=queued&limit=1', headers=shown
                ).json()['items']
                eventually(lambda: not waiting(), 'what waited at the time of the copy')
            self.assertIn('the chain holds', admin(elsewhere, 'audit', 'verify'))

    def test_old_copies_go_when_a_good_one_has_come(self):
        with Service() as service, tempfile.TemporaryDirectory() as folder:
            service.until_ready()
            for i in range(4):
                with open(os.path.join(folder, f'ischia-2020-01-0{i + 1}T000000Z.db'), 'wb'):
                    pass
            said = backup(service.state, folder, keep=3)
            self.assertEqual(said.returncode, 0, said.stderr)
            kept = copies(folder)
            self.assertEqual(kept[:2], [f'ischia-2020-01-0{i}T000000Z.db' for i in (3, 4)])
            self.assertEqual(len(kept), 3)

    def test_the_trial_never_goes_into_the_store_that_the_environment_names(self):
        with Service() as service, tempfile.TemporaryDirectory() as folder:
            service.until_ready()
            later = os.path.join(folder, 'later')  # something happens between the copy and its trial
            with open(later, 'w', encoding='utf-8') as file:
                file.write(f'#!/bin/sh\n"{PROGRAM}" "$@" || exit\ncase $3 in backup) '
                           f'"{PROGRAM}" --state-dir "{service.state}" token create name=later ;; esac\n')
            os.chmod(later, 0o700)
            said = backup(service.state, folder, program=later, ISCHIA_STORE=service.state)
            self.assertEqual(said.returncode, 0, said.stderr)
            self.assertIn('later', admin(service.state, 'token', 'list'))

    def test_a_copy_that_fails_the_trial_is_set_apart_and_nothing_is_thrown_away(self):
        with Service() as service, tempfile.TemporaryDirectory() as folder:
            service.until_ready()
            old = 'ischia-2020-01-01T000000Z.db'
            with open(os.path.join(folder, old), 'wb'):
                pass
            worse = os.path.join(folder, 'worse')  # writes a copy that is cut off
            with open(worse, 'w', encoding='utf-8') as file:
                file.write(f'#!/bin/sh\n"{PROGRAM}" "$@" || exit\n'
                           'case $3 in backup) truncate -s 5000 "$4" ;; esac\n')
            os.chmod(worse, 0o700)
            said = backup(service.state, folder, keep=1, program=worse)
            self.assertEqual(said.returncode, 1, said.stdout)
            self.assertIn('cannot be restored', said.stderr)
            self.assertEqual(copies(folder), [old])
            self.assertEqual(len(copies(folder, '.bad')), 1)


@unittest.skipUnless(programs(), 'PostgreSQL is not installed')
class ServerDrill(unittest.TestCase):
    """The same for a store on a PostgreSQL server, with the server's own means."""

    def test_a_dump_made_under_load_can_be_put_back_on_another_server(self):
        with Cluster() as server, tempfile.TemporaryDirectory() as folder:
            dump = os.path.join(folder, 'dump')
            with Service('--store', server.url, '--workers', '2') as service:
                service.until_ready()
                done = [service.submit(F=100 + i / 8, subject=f'D-{i}') for i in range(20)]
                go_on = threading.Event()

                def load():
                    i = 0
                    while not go_on.is_set():
                        body = {**done[0]['parameters'], 'F': 200 + i / 64}
                        assert service.ask('POST', '/v1/assessments', body).status == 202
                        i += 1

                thread = threading.Thread(target=load)
                thread.start()
                subprocess.run(['pg_dump', '--format=custom', '--schema=ischia', '--file', dump,
                                server.url], check=True, timeout=PATIENCE_S)
                go_on.set()
                thread.join()
            server.stop()
            with Cluster() as other:
                subprocess.run(['pg_restore', '--exit-on-error', '--dbname', other.url, dump],
                               check=True, timeout=PATIENCE_S)
                self.go_on_there(other.url, done)

    def go_on_there(self, url, done):
        with Service('--store', url, '--workers', '2') as again:
            again.until_ready()
            for document in done:
                self.assertEqual(again.get(document['links']['self']).json(), document)
            waiting = lambda: [
                item
                for status in ('queued', 'running')
                for item in again.get(f'/v1/assessments?status={status}&limit=1').json()['items']
            ]
            eventually(lambda: not waiting(), 'what waited or ran at the time of the dump')
            again.submit(F=333.5)  # numbers go on where they were
            self.assertIn('the chain holds', admin(again.state, '--store', url, 'audit', 'verify'))


class Rotation(unittest.TestCase):
    @unittest.skipUnless(shutil.which('logrotate'), 'logrotate is not installed')
    def test_the_log_goes_on_in_an_emptied_file(self):
        with open(os.path.join(DEPLOY, 'logrotate/ischiad'), encoding='utf-8') as file:
            text = file.read()
        with Service() as service, tempfile.TemporaryDirectory() as folder:
            service.until_ready()
            log = os.path.join(service.state, 'stderr.txt')
            self.assertIn('event="listening"', service.errors())
            config = os.path.join(folder, 'rotate')
            with open(config, 'w', encoding='utf-8') as file:
                own = text.replace('/var/log/ischia/*.log', log)
                file.write(own.replace('    su ischia ischia\n', ''))  # the test's own user
            os.chmod(config, 0o600)
            subprocess.run(['logrotate', '--force', '--state', folder + '/state', config],
                           check=True, capture_output=True, timeout=PATIENCE_S)
            with open(log + '.1', encoding='utf-8') as file:
                self.assertIn('event="listening"', file.read())
            self.assertNotIn('event="listening"', service.errors())
            service.submit(F=150.5)
            eventually(lambda: 'assessment ended' in service.errors(), 'the log to go on')
            with open(log, 'rb') as file:
                self.assertNotIn(b'\0', file.read(), 'written where it was cut off')


if __name__ == '__main__':
    unittest.main()
