# SPDX-License-Identifier: GPL-3.0-or-later
"""A running ischiad for a test: its own state directory, a free port, a fake worker.

With TESTED_ON=postgresql every state directory has a database of its own on a throw-away server.

With TESTED_THROUGH=nginx every service stands behind nginx as deploy/nginx/ischia.conf has it:
clients speak TLS with the proxy and show a token, and the daemon believes the proxy only.
"""
import atexit
import http.client
import json
import os
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
import time
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
PROGRAM = os.environ.get('ISCHIAD', os.path.join(HERE, '../../build/server/ischiad'))
FAKE_WORKER = os.path.join(HERE, 'fake_worker.py')
JSON = {'Content-Type': 'application/json'}
# How long a test waits for what must happen: no expectation of speed, only something that hangs
# takes so long. The longest wait that the service itself grants is 60 s.
PATIENCE_S = 240
PROXY = os.environ.get('TESTED_THROUGH', '')
if PROXY:
    sys.path.append(os.path.join(HERE, '../proxy'))
    import front
ON_SERVER = os.environ.get('TESTED_ON', '') == 'postgresql'
if ON_SERVER:
    sys.path.append(os.path.join(HERE, '../postgresql'))
    import cluster
SIDE = {'R1': 7.1, 'R2': 22.8, 'eM': 31, 'eF': 10, 'muM': 8, 'muF': 5, 'F': 258}


# Behind a proxy a request without a token gets that of the tests; one that nobody has stays itself.
NOBODY = {'Authorization': 'Bearer nobody'}


def direct_only(reason):
    """For a test of what the daemon does on a connection of its own."""
    return unittest.skipIf(PROXY, f'not through a proxy: {reason}')


def file_only(reason):
    """For a test of what only a store in a file has."""
    return unittest.skipIf(ON_SERVER, f'not on PostgreSQL: {reason}')


class Databases:
    """One for each state directory, made when it is first asked for."""

    server = None
    names = {}

    @classmethod
    def url(cls, state):
        if cls.server is None:
            cluster.skip_without_server()
            cls.server = cluster.Cluster()
            atexit.register(cls.server.stop)
        if state not in cls.names:
            cls.names[state] = f'state_{len(cls.names)}'
            cls.server.sql(f'CREATE DATABASE {cls.names[state]}', database='postgres')
        return cls.server.url.replace('///ischia?', f'///{cls.names[state]}?')


def store_options(state):
    """Where the store of a state directory is, as options of ischiad."""
    return ('--store', Databases.url(state)) if ON_SERVER else ()


def sql(state, text, identity):
    """Runs SQL in the store, not as a daemon would; '{}' stands for the id. Returns what psql says,
    or the first value."""
    digits = identity.replace('-', '')
    if ON_SERVER:
        text = text.replace("'{}'", f"'\\x{digits}'::bytea")
        return Databases.server.sql('SET search_path = ischia; ' + text,
                                    database=Databases.names[state]).removeprefix('SET\n')
    database = sqlite3.connect(state + '/ischia.sqlite')
    rows = database.execute(text.replace("'{}'", f"x'{digits}'")).fetchall()
    database.commit()
    database.close()
    return str(rows[0][0]) if rows else ''


class SecureConnection(http.client.HTTPSConnection):
    """To the proxy, with the token unless the request has its own."""

    token = None

    def request(self, method, url, body=None, headers=None, **options):
        headers = dict(headers or {})
        if self.token and 'Authorization' not in headers:
            headers['Authorization'] = f'Bearer {self.token}'
        super().request(method, url, body, headers, **options)


def side(**changes):
    """The example side with changes; None leaves a key out."""
    return {k: v for k, v in {**SIDE, **changes}.items() if v is not None}


def eventually(holds, what):
    """Waits until holds() is true; returns what it said."""
    end = time.monotonic() + PATIENCE_S
    while not (said := holds()):
        assert time.monotonic() < end, f'waited {PATIENCE_S} s for {what}'
        time.sleep(0.02)
    return said


class Answer:
    def __init__(self, response, body):
        self.status = response.status
        self.headers = response.headers
        self.body = body

    @property
    def type(self):
        return (self.headers.get('Content-Type') or '').split(';')[0]

    def json(self):
        return json.loads(self.body)


def admin(state, *words, check=True):
    """Runs an administration command; returns its standard output."""
    command = [PROGRAM, '--state-dir', state, *store_options(state), *words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
    if check and done.returncode != 0:
        raise AssertionError(f'{words}: {done.returncode}: {done.stderr}')
    return done.stdout if check else done


def command_line(state, *options, listen='127.0.0.1:0', worker=FAKE_WORKER):
    """How a test starts the daemon; a later option wins."""
    usual = {
        '--listen': listen,
        '--state-dir': state,
        '--worker-program': worker,
        '--workers': '1',
        '--drain-timeout': '2',
    }
    if PROXY:
        options = ('--behind-proxy', '--proxy-addresses', '127.0.0.1', *options)
    return [PROGRAM, *(word for pair in usual.items() for word in pair), *store_options(state),
            *options]


class Service:
    def __init__(self, *options, state=None, worker=FAKE_WORKER, listen='127.0.0.1:0', env=None,
                 within=()):
        self.own_state = state is None
        self.state = state or tempfile.mkdtemp(prefix='ischia-test-')
        self.log = open(os.path.join(self.state, 'stderr.txt'), 'ab')
        self.process = subprocess.Popen(
            [*within, *command_line(self.state, *options, listen=listen, worker=worker)],
            stdout=subprocess.PIPE,
            stderr=self.log,
            text=True,
            env={**os.environ, **(env or {})},
        )
        line = self.process.stdout.readline()
        if not line.startswith('listening on '):
            self.process.wait(PATIENCE_S)
            raise AssertionError('did not start: ' + self.errors())
        self.address = line.split('://')[1].strip()
        self.scheme = line.split('://')[0].split()[-1]
        self.token = self.front = None
        if PROXY:
            self.go_behind_proxy()

    def go_behind_proxy(self):
        made = admin(self.state, 'token', 'create', 'scope=admin', 'name=of the tests')
        self.front = front.Front(self.address)
        self.address, self.scheme, self.token = self.front.address, 'https', made.strip()
        eventually(lambda: self.get('/metrics').status != 401, 'the token to be known')

    @property
    def origin(self):
        return f'{self.scheme}://{self.address}'

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()

    def errors(self):
        with open(self.log.name, encoding='utf-8', errors='replace') as file:
            return file.read()

    def connect(self, timeout=PATIENCE_S):
        if not self.front:
            return http.client.HTTPConnection(self.address, timeout=timeout)
        context = front.authority().context()
        connection = SecureConnection(self.address, timeout=timeout, context=context)
        connection.token = self.token
        return connection

    def open(self):
        """A bare connection, for what is no good request."""
        host, port = self.address.rsplit(':', 1)
        plain = socket.create_connection((host, int(port)), timeout=PATIENCE_S)
        if not self.front:
            return plain
        return front.authority().context().wrap_socket(plain, server_hostname=host)

    def raw_request(self, text):
        """Bytes of a request for open(), with the token where there is one."""
        shown = f'Host: localhost\r\nAuthorization: Bearer {self.token}\r\n'.encode()
        return text.replace(b'Host: localhost\r\n', shown) if self.token else text

    def ask(self, method, path, body=None, headers=None, timeout=PATIENCE_S):
        connection = self.connect(timeout)
        try:
            if isinstance(body, (dict, list)):
                body, headers = json.dumps(body).encode(), {**JSON, **(headers or {})}
            connection.request(method, path, body, headers or {})
            response = connection.getresponse()
            return Answer(response, response.read())
        finally:
            connection.close()

    def get(self, path, **headers):
        return self.ask('GET', path, headers={k.replace('_', '-'): v for k, v in headers.items()})

    def submit(self, wait=60, **changes):
        """Submits a side; returns the document, finished unless wait is 0."""
        headers = {'Prefer': f'wait={wait}'} if wait else {}
        answer = self.ask('POST', '/v1/assessments', side(**changes), headers)
        assert answer.status in (201, 202), (answer.status, answer.body)
        return answer.json()

    def until(self, identity, *statuses, seconds=PATIENCE_S):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            document = self.get(f'/v1/assessments/{identity}').json()
            if document['status'] in statuses:
                return document
            time.sleep(0.05)
        raise AssertionError(f'{identity} is {document["status"]}, not {statuses}')

    def until_ready(self, **headers):
        end = time.monotonic() + PATIENCE_S
        while self.ask('GET', '/readyz', headers=headers).status != 200:
            assert time.monotonic() < end, 'never ready'
            time.sleep(0.05)

    def kill(self):
        """kill -9; what it has stored stays."""
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()
        self.log.close()
        self.stop_proxy()

    def curl_options(self):
        """The content of a .curlrc that knows the proxy's authority and the token."""
        return (f'cacert = "{front.authority().certificate}"\n'
                f'header = "Authorization: Bearer {self.token}"\n')

    def stop_proxy(self):
        if self.front:
            self.front.stop()

    def signal(self, number):
        self.process.send_signal(number)

    def stop(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
        try:
            status = self.process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise
        self.process.stdout.close()
        self.log.close()
        self.stop_proxy()
        if status != 0:
            sys.stderr.write(self.errors())
        assert status == 0, f'ischiad ended with {status}'
        if self.own_state:
            shutil.rmtree(self.state, ignore_errors=True)
