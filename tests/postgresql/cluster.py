#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""A throw-away PostgreSQL server for tests, on a socket in a directory of its own.

    cluster.py COMMAND...   runs COMMAND with its address in $ISCHIA_TEST_POSTGRESQL

PostgreSQL does not run as root: then it runs as the user that the package made.
"""
import glob
import os
import pwd
import shutil
import signal
import subprocess
import sys
import tempfile
import time

PATIENCE_S = 120
SKIPPED = 77


def programs():
    """The directory of initdb and postgres, the newest version there is; None: not installed."""
    found = glob.glob('/usr/lib/postgresql/*/bin/initdb')
    found.sort(key=lambda path: int(path.split('/')[4]))
    return os.path.dirname(found[-1]) if found else None


def user_name():
    return 'postgres' if os.geteuid() == 0 else pwd.getpwuid(os.geteuid()).pw_name


class Cluster:
    """One server with the database `ischia`; `listen` also takes TCP at that address and port."""

    def __init__(self, listen=None, within=(), settings=None):
        self.programs = programs()
        self.user = user_name()
        self.within = list(within)
        self.listen = listen
        self.directory = tempfile.mkdtemp(prefix='ischia-pg-')
        self.data = os.path.join(self.directory, 'data')
        if os.geteuid() == 0:
            shutil.chown(self.directory, self.user)
        self.run('initdb', '-D', self.data, '-A', 'trust', '-E', 'UTF8', '--locale=C',
                 '--no-sync', '-U', 'ischia')
        host, port = listen or ('', 5432)
        with open(os.path.join(self.data, 'postgresql.conf'), 'a', encoding='utf-8') as file:
            for name, value in {
                'listen_addresses': f"'{host}'", 'port': port,
                'unix_socket_directories': f"'{self.directory}'", 'max_connections': 60,
                'shared_buffers': "'32MB'", **(settings or {}),
            }.items():
                file.write(f'{name} = {value}\n')
        if listen:
            with open(os.path.join(self.data, 'pg_hba.conf'), 'a', encoding='utf-8') as file:
                file.write('host all all 0.0.0.0/0 trust\n')
        self.process = None
        self.start()
        self.sql('CREATE DATABASE ischia', database='postgres')

    def run(self, program, *words):
        subprocess.run([os.path.join(self.programs, program), *words], check=True,
                       stdout=subprocess.DEVNULL, user=self.as_user(), cwd=self.directory)

    def as_user(self):
        return self.user if os.geteuid() == 0 else None

    @property
    def url(self):
        port = self.listen[1] if self.listen else 5432
        return f'postgresql:///ischia?host={self.directory}&port={port}&user=ischia'

    def start(self):
        """Starts the server and waits until it answers, its recovery done."""
        with open(os.path.join(self.directory, 'log'), 'ab') as log:
            # the server itself may open a network that only root may enter
            words = [*self.within, os.path.join(self.programs, 'postgres'), '-D', self.data]
            if self.within:
                words[len(self.within):len(self.within)] = [
                    'setpriv', '--reuid', self.user, '--regid', self.user, '--init-groups']
            self.process = subprocess.Popen(words, stdout=log, stderr=log, cwd=self.directory,
                                            user=None if self.within else self.as_user())
        end = time.monotonic() + PATIENCE_S
        while self.sql('SELECT 1', database='postgres', check=False) != '1':
            assert self.process.poll() is None, self.log()
            assert time.monotonic() < end, 'PostgreSQL does not answer: ' + self.log()
            time.sleep(0.05)

    def kill(self):
        """kill -9 of the server; its children see that it is gone and end."""
        self.process.kill()
        self.process.wait()
        self.wait_for_children()

    def wait_for_children(self):
        """A server refuses to start while one of the old one's children lives."""
        end = time.monotonic() + PATIENCE_S
        while self.has_children():
            assert time.monotonic() < end, 'children of a killed server live on'
            time.sleep(0.02)

    def has_children(self):
        for entry in glob.glob('/proc/[0-9]*/cwd'):
            try:
                if os.readlink(entry) == self.data:
                    return True
            except OSError:
                pass  # gone meanwhile
        return False

    def sql(self, text, database='ischia', check=True):
        """What psql prints of it, without decoration."""
        port = str(self.listen[1]) if self.listen else '5432'
        done = subprocess.run(
            ['psql', '-X', '-A', '-t', '-v', 'ON_ERROR_STOP=1', '-h', self.directory, '-p', port,
             '-U', 'ischia', '-d', database, '-c', text], capture_output=True, text=True,
            check=False)
        if check and done.returncode != 0:
            raise AssertionError(f'{text}: {done.stderr}')
        return done.stdout.strip()

    def log(self):
        with open(os.path.join(self.directory, 'log'), encoding='utf-8', errors='replace') as file:
            return file.read()[-2000:]

    def stop(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGQUIT)
            self.process.wait(PATIENCE_S)
        shutil.rmtree(self.directory, ignore_errors=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()


def skip_without_server():
    if programs() is None:
        print('SKIP: PostgreSQL is not installed')
        sys.exit(SKIPPED)


def main(words):
    skip_without_server()
    with Cluster() as cluster:
        if os.geteuid() == 0:
            os.chmod(cluster.directory, 0o755)
        environment = {**os.environ, 'ISCHIA_TEST_POSTGRESQL': cluster.url}
        return subprocess.run(words, env=environment, check=False).returncode


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
