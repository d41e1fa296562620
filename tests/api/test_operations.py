#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""What those who run the service rely on: the service manager's protocol and its watchdog, the
journal, a renewed certificate, retention, and an audit log that shows tampering."""
import http.client
import os
import select
import signal
import socket
import sqlite3
import ssl
import subprocess
import sys
import tempfile
import time
import unittest

from service import PATIENCE_S, PROGRAM, Service, admin, direct_only, eventually, file_only, sql

JOURNAL = '/run/systemd/journal'


class Manager:
    """A service manager's end of $NOTIFY_SOCKET."""

    def __init__(self, path):
        self.path = path
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind('\0' + path[1:] if path.startswith('@') else path)
        self.socket.settimeout(PATIENCE_S)

    def next(self):
        return dict(line.split('=', 1) for line in self.socket.recv(4096).decode().splitlines())

    def until(self, key):
        """The next message that has the key, watchdog's aside."""
        while key not in (said := self.next()):
            assert 'WATCHDOG' in said, said
        return said

    def close(self):
        self.socket.close()


class ServiceManager(unittest.TestCase):
    def tells(self, path):
        manager = Manager(path)
        self.addCleanup(manager.close)
        with Service(env={'NOTIFY_SOCKET': path}) as service:
            self.assertEqual(manager.next(), {'READY': '1'})
            self.assertEqual(service.get('/healthz').status, 200)
            before_us = time.monotonic_ns() // 1000
            service.signal(signal.SIGHUP)
            said = manager.next()
            self.assertEqual(said['RELOADING'], '1')
            self.assertGreaterEqual(int(said['MONOTONIC_USEC']), before_us)
            self.assertEqual(manager.next(), {'READY': '1'})
            service.signal(signal.SIGTERM)
            self.assertEqual(manager.next(), {'STOPPING': '1'})
            self.assertEqual(service.process.wait(PATIENCE_S), 0)
            # without a watchdog nobody is told of life
            self.assertEqual(select.select([manager.socket], [], [], 0)[0], [])

    def test_ready_reloading_and_stopping_are_told(self):
        with tempfile.TemporaryDirectory() as folder:
            self.tells(folder + '/notify')
        self.tells(f'@ischia-test-{os.getpid()}')

    def test_a_manager_that_is_gone_does_no_harm(self):
        with Service(env={'NOTIFY_SOCKET': '/nonexistent/notify'}) as service:
            self.assertEqual(service.get('/healthz').status, 200)

    def test_the_watchdog_hears_of_life_and_of_its_end(self):
        with tempfile.TemporaryDirectory() as folder:
            manager = Manager(folder + '/notify')
            self.addCleanup(manager.close)
            watched = {'NOTIFY_SOCKET': manager.path, 'WATCHDOG_USEC': '4000000'}
            with Service(env=watched) as service:
                manager.until('READY')
                for _ in range(3):
                    self.assertEqual(manager.next(), {'WATCHDOG': '1'})
                service.signal(signal.SIGSTOP)  # it hangs
                try:
                    manager.socket.settimeout(0.1)
                    with self.assertRaises(TimeoutError):
                        while True:  # what was sent before it stopped
                            manager.next()
                    manager.socket.settimeout(4)  # what the manager would wait before it kills
                    with self.assertRaises(TimeoutError):
                        manager.next()
                finally:
                    service.signal(signal.SIGCONT)
                manager.socket.settimeout(PATIENCE_S)
                manager.until('WATCHDOG')

    def test_another_process_s_watchdog_is_not_fed(self):
        with tempfile.TemporaryDirectory() as folder:
            manager = Manager(folder + '/notify')
            self.addCleanup(manager.close)
            other = {'NOTIFY_SOCKET': manager.path, 'WATCHDOG_USEC': '100000', 'WATCHDOG_PID': '1'}
            with Service(env=other) as service:
                self.assertEqual(manager.next(), {'READY': '1'})
                service.signal(signal.SIGHUP)
                self.assertIn('RELOADING', manager.next())
                self.assertEqual(manager.next(), {'READY': '1'})


class Journal(unittest.TestCase):
    """In a mount namespace of its own, where this test is the journal."""

    def test_the_journal_is_sent_fields(self):
        inside = [
            'unshare', '--mount', '--propagation', 'private',
            sys.executable, os.path.abspath(__file__), 'as-journal',
        ]  # fmt: skip
        if os.geteuid() != 0:
            self.skipTest('only root can take the place of the journal')
        done = subprocess.run(inside, capture_output=True, text=True, timeout=PATIENCE_S * 2)
        if 'unshare failed' in done.stderr:
            self.skipTest(done.stderr.strip())
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn('2 lines to the journal, 1 to the file', done.stdout)


def messages_of(journal):
    """What has come, each message as its fields."""
    while select.select([journal], [], [], 0)[0]:
        yield dict(line.split('=', 1) for line in journal.recv(65536).decode().splitlines())


def be_the_journal():
    """Runs daemons whose standard error is, and is not, what $JOURNAL_STREAM names."""
    os.makedirs(JOURNAL, exist_ok=True)
    subprocess.run(['mount', '-t', 'tmpfs', 'tmpfs', JOURNAL], check=True)
    journal = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    journal.bind(JOURNAL + '/socket')
    with tempfile.TemporaryDirectory() as state:
        path = os.path.join(state, 'stderr.txt')
        with open(path, 'wb') as file:
            status = os.fstat(file.fileno())
        stream = f'{status.st_dev}:{status.st_ino}'
        with Service(state=state, env={'JOURNAL_STREAM': stream}):
            pass
        said = list(messages_of(journal))
        with open(path, encoding='utf-8') as file:
            assert file.read() == '', 'the journal had it, and the file too'
        listening = [m for m in said if 'event="listening"' in m['MESSAGE']]
        stopping = [m for m in said if 'event="stopping" signal=15' in m['MESSAGE']]
        assert len(listening) == len(stopping) == 1, said
        for message in listening + stopping:
            assert message['PRIORITY'] == '6', message
            assert message['SYSLOG_IDENTIFIER'] == 'ischiad', message
            assert message['MESSAGE'].startswith('level=info event='), message
        with Service(state=state, env={'JOURNAL_STREAM': '1:1'}):  # redirected since: a plain file
            pass
        assert not list(messages_of(journal)), 'the journal was told what is not its own'
        with open(path, encoding='utf-8') as file:
            lines = [line for line in file if 'event="listening"' in line]
    print(f'{len(listening + stopping)} lines to the journal, {len(lines)} to the file')


def make_certificate(folder, name):
    """A self-signed pair for localhost; the name is in it."""
    files = [os.path.join(folder, name + end) for end in ('.crt', '.key')]
    words = f'req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 1'
    subprocess.run(
        ['openssl', *words.split(), '-subj', '/CN=' + name, '-addext',
         'subjectAltName=DNS:localhost,IP:127.0.0.1', '-out', files[0], '-keyout', files[1]],
        check=True, capture_output=True,
    )  # fmt: skip
    return files


def shown_by(service):
    """The name in the certificate that a new connection is shown."""
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    host, port = service.address.rsplit(':', 1)
    with socket.create_connection((host, int(port)), PATIENCE_S) as plain:
        with context.wrap_socket(plain) as secure:
            der = secure.getpeercert(binary_form=True)
    text = subprocess.run(
        ['openssl', 'x509', '-inform', 'der', '-noout', '-subject'],
        input=der, capture_output=True, check=True,
    ).stdout  # fmt: skip
    return text.decode().strip().split('CN = ')[-1]


@direct_only('TLS of the service itself')
class Certificates(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = lambda name: os.path.join(folder.name, name)
        for name in ('old', 'new'):
            make_certificate(folder.name, name)
        self.options = ('--tls-certificate', self.path('used.crt'), '--tls-key', self.path('used.key'))

    def use(self, certificate, key):
        for name, end in ((certificate, '.crt'), (key, '.key')):
            with open(self.path(name + end), 'rb') as old, open(self.path('used' + end), 'wb') as new:
                new.write(old.read())

    def reload(self, service, times):
        service.signal(signal.SIGHUP)
        eventually(
            lambda: service.errors().count('event="options reloaded"') == times, 'the reload'
        )

    def test_a_renewed_certificate_is_shown_after_sighup(self):
        self.use('old', 'old')
        with Service(*self.options) as service:
            self.assertEqual(shown_by(service), 'old')
            host, port = service.address.rsplit(':', 1)
            context = ssl.create_default_context(cafile=self.path('old.crt'))
            kept = http.client.HTTPSConnection(host, int(port), context=context, timeout=PATIENCE_S)
            kept.request('GET', '/healthz')
            self.assertEqual(kept.getresponse().read().strip(), b'{"status":"alive"}')
            self.use('new', 'new')
            self.assertEqual(shown_by(service), 'old')
            self.reload(service, 1)
            self.assertEqual(shown_by(service), 'new')
            kept.request('GET', '/healthz')  # a connection under way goes on
            self.assertEqual(kept.getresponse().status, 200)
            kept.close()

    def test_a_bad_renewal_leaves_the_old_certificate(self):
        self.use('old', 'old')
        with Service(*self.options) as service:
            self.use('new', 'old')
            self.reload(service, 1)
            self.assertIn('certificate not reloaded', service.errors())
            self.assertEqual(shown_by(service), 'old')
            os.unlink(self.path('used.key'))
            self.reload(service, 2)
            self.assertEqual(shown_by(service), 'old')

    def test_a_pair_that_does_not_belong_together_is_refused_at_start(self):
        self.use('new', 'old')
        for action in ([], ['--check-config']):
            with tempfile.TemporaryDirectory() as state:
                done = subprocess.run(
                    [PROGRAM, '--state-dir', state, *self.options, *action],
                    capture_output=True, text=True, timeout=PATIENCE_S,
                )  # fmt: skip
            self.assertEqual(done.returncode, 2)
            self.assertIn('belong together', done.stderr)


class StandardOutput(unittest.TestCase):
    """What could not be printed is not said to be done."""

    def ends_on(self, redirection, *words):
        return subprocess.run(['/bin/sh', '-c', f'exec "$0" "$@" {redirection}', PROGRAM, *words],
                              capture_output=True, text=True, timeout=PATIENCE_S)  # fmt: skip

    def test_a_full_disk_is_a_failure(self):
        for words in (['--print-config'], ['--help'], ['--version'], ['--print-man']):
            done = self.ends_on('>/dev/full', *words)
            self.assertEqual(done.returncode, 1)
            self.assertIn('No space left', done.stderr)

    @file_only('the state directory is the store')
    def test_a_token_that_nobody_saw_is_revoked(self):
        for redirection in ('>/dev/full', '>&-'):
            with tempfile.TemporaryDirectory() as state:
                done = self.ends_on(redirection, '--state-dir', state, 'token', 'create')
                self.assertEqual(done.returncode, 1)
                self.assertIn('has been revoked', done.stderr)
                token = admin(state, 'token', 'list').splitlines()[1].split()
                self.assertNotEqual(token[4], '-')
                self.assertEqual(len(token), 5)


class Retention(unittest.TestCase):
    def left(self, service):
        return [item['id'] for item in service.get('/v1/assessments').json()['items']]

    def test_only_the_newest_are_kept(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, 'conf')
            with open(path, 'w', encoding='utf-8') as file:
                file.write('retention_count = 0\n')
            with Service('--config', path) as service:
                service.until_ready()
                made = [service.submit(F=100.5 + i)['id'] for i in range(5)]
                queued = service.submit(wait=0, F=599)['id']  # never old enough while it lives
                self.assertEqual(len(self.left(service)), 6)
                with open(path, 'w', encoding='utf-8') as file:
                    file.write('retention_count = 2\n')
                service.signal(signal.SIGHUP)
                kept = [queued, made[4], made[3]]
                eventually(lambda: self.left(service) == kept, 'the older ones to be erased')
                changes = service.get('/v1/changes?since=0&limit=500').json()['items']
                erased = [item['id'] for item in changes if item['change'] == 'erased']
                self.assertEqual(erased, made[:3])
                eventually(
                    lambda: 'event="retention" erased=3' in service.errors(), 'the log to say so'
                )

    def test_by_age(self):
        with tempfile.TemporaryDirectory() as state:
            with Service(state=state) as service:
                service.until_ready()
                old, young = (service.submit(F=100.5 + i)['id'] for i in range(2))
            self.grow_older(state, old, days=11)
            with Service('--retention-days', '10', state=state) as service:
                eventually(lambda: self.left(service) == [young], 'the old one to be erased')

    @staticmethod
    def grow_older(state, identity, days):
        ms = days * 86400000
        said = sql(
            state,
            f'UPDATE assessment SET created_ms = created_ms - {ms}, started_ms = started_ms - {ms},'
            f" finished_ms = finished_ms - {ms} WHERE id = '{{}}' RETURNING state",
            identity,
        )
        assert said.startswith('2'), said


class Audit(unittest.TestCase):
    @file_only('the copy that is tampered with is a file')
    def test_tampering_shows(self):
        with Service() as service:
            service.until_ready()
            for i in range(3):
                service.submit(F=100.5 + i)
            state = service.state
            eventually(lambda: len(self.rows(state)) >= 3, 'the audit log')
            self.assertIn('the chain holds', admin(state, 'audit', 'verify'))
            for tampering in (
                "UPDATE audit SET outcome = 'none' WHERE seq = 2",
                'DELETE FROM audit WHERE seq = 2',
                "UPDATE audit SET at_ms = at_ms + 1 WHERE seq = 1",
            ):
                copy = os.path.join(state, 'copy')
                admin(state, 'backup', copy)
                database = sqlite3.connect(copy)
                self.assertEqual(database.execute(tampering).rowcount, 1)
                database.commit()
                database.close()
                with tempfile.TemporaryDirectory() as other:
                    done = admin(other, 'restore', copy, check=False)
                    self.assertEqual(done.returncode, 0, done.stderr)
                    said = admin(other, 'audit', 'verify', check=False)
                self.assertEqual(said.returncode, 1, tampering)
                self.assertIn('the audit log was changed', said.stderr)
                os.unlink(copy)

    @staticmethod
    def rows(state):
        return admin(state, 'audit', 'list').splitlines()


if __name__ == '__main__':
    if sys.argv[1:] == ['as-journal']:
        be_the_journal()
    else:
        unittest.main()
