#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""deploy/container/Containerfile, step by step, without a container engine: each FROM is a bare
Debian by debootstrap, each RUN a command in it, and the end runs as its USER on a root that is
mounted read-only. What an engine adds (layers, namespaces, cgroups) is not tried.

usage: container_test.py SOURCE-ROOT    ISCHIA_TEST_KEEP=FOLDER keeps the roots there
"""
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
import urllib.request

from package_test import ENV, MIRROR, PATIENCE_S, SKIP, run

HERE = os.path.dirname(os.path.abspath(__file__))


def network_settings(root):
    """What this machine needs to reach npm, as an engine is told by --build-arg and a mount."""
    registry = run('npm', 'config', 'get', 'registry').splitlines()[-1]
    settings = {'npm_config_registry': registry}
    authorities = os.environ.get('NODE_EXTRA_CA_CERTS')
    if authorities:
        shutil.copy(authorities, os.path.join(root, 'tmp/authorities.crt'))
        settings['NODE_EXTRA_CA_CERTS'] = '/tmp/authorities.crt'
    return settings


def instructions(path):
    """(word, arguments) of each instruction, continued lines joined, comments gone."""
    with open(path, encoding='utf-8') as file:
        lines = [line for line in file if not line.startswith('#')]
    text = ''.join(lines).replace('\\\n', ' ')
    return [tuple(line.split(None, 1)) for line in text.splitlines() if line.strip()]


class Walk:
    def __init__(self, source, folder):
        self.source, self.folder = source, folder
        self.stages, self.root, self.environment, self.user = {}, None, dict(ENV), None
        self.entry = []

    def step(self, word, rest):
        """COPY, RUN, ENV ...: the method of that name."""
        getattr(self, word.lower())(rest)

    def from_(self, rest):
        image, _, name = rest.partition(' AS ')
        assert re.fullmatch(r'docker\.io/library/debian:bookworm(-slim)?', image), image
        self.root = os.path.join(self.folder, name or 'final')
        self.stages[name] = self.root
        self.environment, self.user = dict(ENV), None
        run('debootstrap', '--variant=minbase', 'bookworm', self.root, MIRROR)
        shutil.copy('/etc/resolv.conf', os.path.join(self.root, 'etc/resolv.conf'))
        run('mount', '-t', 'proc', 'proc', os.path.join(self.root, 'proc'))

    def run(self, rest):
        environment = {**self.environment, **network_settings(self.root)}
        run('chroot', self.root, 'sh', '-c', rest, env=environment, stdin=subprocess.DEVNULL)

    def copy(self, rest):
        words = shlex.split(rest)
        if words[0].startswith('--from='):
            base = self.stages[words.pop(0)[7:]]
            source = base + words[0]
        elif words[0] == '.':
            source = self.context()
        else:
            source = os.path.join(self.source, words[0])
        target = self.root + words[1]
        if os.path.isdir(source):
            run('cp', '-a', '--no-preserve=ownership', source.rstrip('/') + '/.', made(target))
        else:
            shutil.copy(source, target)

    def context(self):
        """What git has committed: what an engine is sent when .containerignore holds."""
        folder = os.path.join(self.folder, 'context')
        run('git', 'clone', '--quiet', self.source, folder)
        return folder

    def env(self, rest):
        self.environment.update(pair.split('=', 1) for pair in shlex.split(rest))

    def entrypoint(self, rest):
        self.entry = json.loads(rest)

    def nothing(self, _):
        pass

    volume = expose = stopsignal = nothing

    def set_user(self, rest):
        self.user = rest.split(':')

    def start(self):
        """The entry point as its user; only the state and /tmp's place may be written."""
        state = os.path.join(self.folder, 'state')
        os.mkdir(state)
        os.chown(state, *map(int, self.user))
        run('mount', '--rbind', self.root, self.root)  # with its /proc
        run('mount', '--bind', state, os.path.join(self.root, 'var/lib/ischia'))
        run('mount', '-o', 'remount,bind,ro', self.root)
        with open(os.path.join(self.folder, 'log'), 'wb') as log:
            return subprocess.Popen(
                ['chroot', f'--userspec={":".join(self.user)}', '--groups=', self.root, *self.entry,
                 '--listen', '127.0.0.1:0'],
                env=self.environment, stdout=subprocess.PIPE, stderr=log, text=True)

    def log(self):
        with open(os.path.join(self.folder, 'log'), encoding='utf-8') as file:
            return file.read()[-3000:]


def made(path):
    os.makedirs(path, exist_ok=True)
    return path


def solve(address, side):
    request = urllib.request.Request(address + '/v1/assessments', side,
                                     {'Content-Type': 'application/json', 'Prefer': 'wait=60'})
    with urllib.request.urlopen(request, timeout=PATIENCE_S) as answer:
        document = json.load(answer)
    end = time.monotonic() + PATIENCE_S
    while document['status'] in ('queued', 'running') and time.monotonic() < end:
        again = urllib.request.Request(address + document['links']['self'], headers={'Prefer': 'wait=30'})
        with urllib.request.urlopen(again, timeout=PATIENCE_S) as answer:
            document = json.load(answer)
    return document


def walk(source, folder):
    steps = instructions(os.path.join(source, 'deploy/container/Containerfile'))
    it = Walk(source, folder)
    names = {'FROM': it.from_, 'USER': it.set_user}
    for word, rest in steps:
        names.get(word, lambda text, w=word: it.step(w, text))(rest)
        print(f'# {word} {rest[:60]}', flush=True)
    print('ok 1 - every step can be done')
    assert int(it.user[0]) > 0
    writable = [f for f in (it.root + '/usr/bin/ischiad', it.root + '/usr/bin/ischia')
                if os.stat(f).st_uid == int(it.user[0])]
    assert not writable
    process = it.start()
    try:
        line = process.stdout.readline()
        assert line.startswith('listening on '), it.log()
        address = line.split()[-1]
        with open(os.path.join(source, 'examples/table2_1R.json'), 'rb') as file:
            document = solve(address, file.read())
        assert document['status'] == 'succeeded', (document, it.log())
        with urllib.request.urlopen(address + '/', timeout=PATIENCE_S) as answer:
            assert b'/assets/app.js' in answer.read()
        print('ok 2 - not root and on a read-only root it solves')
    finally:
        process.terminate()
        process.wait(PATIENCE_S)
    assert process.returncode == 0, it.log()
    print('ok 3 - SIGTERM ends it')


def main(source):
    if os.geteuid() != 0 or shutil.which('debootstrap') is None:
        print('needs root and debootstrap (deploy/packages.txt, section package)')
        return SKIP
    if os.environ.get('ISCHIA_TEST_MOUNTS') != 'own':
        environment = {**os.environ, 'ISCHIA_TEST_MOUNTS': 'own'}
        os.execvpe('unshare', ['unshare', '--mount', '--propagation', 'private', sys.executable,
                               os.path.abspath(__file__), source], environment)
    keep = os.environ.get('ISCHIA_TEST_KEEP')
    folder = made(keep) if keep else tempfile.mkdtemp(prefix='ischia-container-')
    print('1..3', flush=True)
    try:
        walk(os.path.realpath(source), folder)
        return 0
    except Exception as error:
        print('not ok - ' + '\n# '.join(f'{type(error).__name__}: {error}'.splitlines()))
        return 1
    finally:
        for name in os.listdir(folder):
            for inside in ('proc', 'var/lib/ischia', '.'):
                path = os.path.normpath(os.path.join(folder, name, inside))
                if os.path.ismount(path):
                    run('umount', '--lazy', path, check=False)
        if not keep:
            shutil.rmtree(folder, ignore_errors=True)


if __name__ == '__main__':
    sys.exit(main(*sys.argv[1:]))
