#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The Debian package in a bare Debian 12: built from a clean clone without a network, installed,
started as its unit says, used with curl, upgraded and downgraded with the data kept, removed, purged.

Needs root, debootstrap and the Debian mirror. There is no systemd as process 1 in a chroot: the
service is started by under_unit.py, which says what that leaves out.

usage: package_test.py SOURCE-ROOT    ISCHIA_TEST_KEEP=FOLDER keeps the packages and the root there
"""
import contextlib
import hashlib
import json
import os
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time

PATIENCE_S = 300
SKIP = 77
HERE = os.path.dirname(os.path.abspath(__file__))
MIRROR = 'http://deb.debian.org/debian'
UNIT = 'lib/systemd/system/ischiad.service'
ENV = {'PATH': '/usr/sbin:/usr/bin:/sbin:/bin', 'LANG': 'C.UTF-8', 'HOME': '/root',
       'DEBIAN_FRONTEND': 'noninteractive'}


def run(*words, check=True, **options):
    done = subprocess.run(words, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          **options)
    if check and done.returncode != 0:
        raise AssertionError(f'{" ".join(words)}: {done.returncode}\n{done.stdout[-4000:]}')
    return done if not check else done.stdout


def cannot_run():
    """Why this machine cannot run the test; None when it can."""
    if os.geteuid() != 0:
        return 'needs root: chroot'
    for tool in ('debootstrap', 'dpkg-buildpackage', 'lintian', 'systemd-analyze', 'unshare', 'curl'):
        if shutil.which(tool) is None:
            return f'needs {tool} (deploy/packages.txt, section package)'
    if not os.path.exists('/etc/debian_version'):
        return 'needs Debian'
    return None


class Bench:
    """The packages, the bare Debian and the running service."""

    def __init__(self, source, folder):
        self.source, self.folder = source, folder
        self.root = os.path.join(folder, 'root')
        self.debs = {}
        self.process = None
        self.before = None

    # -------------------------------------------------------------------------- packages

    def clone(self, name):
        tree = os.path.join(self.folder, name)
        run('git', 'clone', '--quiet', self.source, tree)
        return tree

    def build(self, tree, name):
        page = os.path.join(self.source, 'static/dist')
        out = os.path.join(self.folder, name + '-deb')
        text = run('unshare', '--net', os.path.join(tree, 'deploy/build-deb.sh'), '--page', page, out)
        assert 'E: ' not in text and 'W: ' not in text, text[-3000:]
        found = [f for f in os.listdir(out) if re.fullmatch(r'ischia_[\d.]+_\w+\.deb', f)]
        assert len(found) == 1, found
        self.debs[name] = os.path.join(out, found[0])

    def build_present(self):
        self.build(self.clone('present'), 'present')

    def build_later(self):
        """The same program one release later, with one migration more."""
        tree = self.clone('later')
        store = os.path.join(tree, 'server/store')
        last = max(os.listdir(os.path.join(store, 'sqlite'))).removesuffix('.sql')
        name = f'{int(last[:4]) + 1:04d}_later'
        for engine in ('sqlite', 'postgresql'):
            with open(os.path.join(store, engine, name + '.sql'), 'w', encoding='utf-8') as file:
                file.write('-- SPDX-License-Identifier: GPL-3.0-or-later\n'
                           'CREATE TABLE later (id INTEGER PRIMARY KEY);\n')
        edit(os.path.join(store, 'meson.build'), f"'{last}'", f"'{last}', '{name}'")
        edit(os.path.join(tree, 'meson.build'), r"version: '[\d.]+'", "version: '9.0.0'")
        edit(os.path.join(tree, 'deploy/debian/changelog'), r'ischia \([^)]*\)', 'ischia (9.0.0)')
        git = ('git', '-C', tree, '-c', 'user.name=test', '-c', 'user.email=test@example.org')
        run(*git, 'add', '.')
        run(*git, 'commit', '--quiet', '-m', 'later')
        self.build(tree, 'later')

    # ------------------------------------------------------------------------------ root

    def bootstrap(self):
        run('debootstrap', '--variant=minbase', 'bookworm', self.root, MIRROR)
        shutil.copy('/etc/resolv.conf', os.path.join(self.root, 'etc/resolv.conf'))
        run('mount', '-t', 'proc', 'proc', os.path.join(self.root, 'proc'))
        run('mount', '--rbind', '/dev', os.path.join(self.root, 'dev'))
        self.clean = set(self.traces())

    def inside(self, *words, check=True):
        return run('chroot', self.root, *words, check=check, env=ENV, stdin=subprocess.DEVNULL)

    def path(self, name):
        return os.path.join(self.root, name.lstrip('/'))

    def install(self, name):
        shutil.copy(self.debs[name], self.path('tmp/ischia.deb'))
        self.inside('apt-get', 'install', '-y', '-q', '--no-install-recommends',
                    '--allow-downgrades', '/tmp/ischia.deb')
        os.remove(self.path('tmp/ischia.deb'))

    def traces(self):
        """Every path with the package's name, but for the logs of the package tools."""
        text = run('find', self.root, '-xdev', '-iname', '*ischia*',
                   '-not', '-path', '*/var/log/*', '-not', '-path', '*/var/cache/*')
        return [line[len(self.root):] for line in text.splitlines()]

    # --------------------------------------------------------------------------- service

    def as_service(self, *words, check=True):
        """An administration command, as the documentation says: as the service's user."""
        return self.inside('setpriv', '--reuid=ischia', '--regid=ischia', '--clear-groups',
                           'ischiad', '--config', '/etc/ischia/ischiad.conf', *words, check=check)

    def start(self):
        self.log = open(os.path.join(self.folder, 'ischiad.log'), 'ab')
        self.process = subprocess.Popen(
            [sys.executable, os.path.join(HERE, 'under_unit.py'), self.root, self.path(UNIT),
             '--listen', '127.0.0.1:0'],
            stdout=subprocess.PIPE, stderr=self.log, text=True)
        line = self.process.stdout.readline()
        assert line.startswith('listening on '), 'it did not start:\n' + self.errors()
        self.address = line.split()[-1]
        end = time.monotonic() + PATIENCE_S
        while self.curl('/readyz')[0] != 200:
            assert time.monotonic() < end, 'never ready:\n' + self.errors()
            time.sleep(0.1)

    def errors(self):
        with open(os.path.join(self.folder, 'ischiad.log'), encoding='utf-8') as file:
            return file.read()[-4000:]

    def stop(self):
        if self.process is None:
            return
        self.process.send_signal(signal.SIGTERM)
        status = self.process.wait(PATIENCE_S)
        self.process.stdout.close()
        self.log.close()
        self.process = None
        assert status == 0, status

    def curl(self, path, *words):
        text = run('curl', '--silent', '--show-error', '--max-time', str(PATIENCE_S),
                   '--write-out', '\n%{http_code}', *words, self.address + path)
        body, _, status = text.rpartition('\n')
        return int(status), body

    def database(self):
        return self.path('var/lib/ischia/ischia.sqlite')

    def schema(self):
        with contextlib.closing(sqlite3.connect(f'file:{self.database()}?mode=ro', uri=True)) as db:
            return db.execute('PRAGMA user_version').fetchone()[0]


def edit(path, pattern, to):
    with open(path, encoding='utf-8') as file:
        text = file.read()
    new, count = re.subn(pattern, to, text, count=1)
    assert count == 1, (path, pattern)
    with open(path, 'w', encoding='utf-8') as file:
        file.write(new)


def digest(path):
    with open(path, 'rb') as file:
        return hashlib.sha256(file.read()).hexdigest()


# ---------------------------------------------------------------------------------- steps

def built_without_a_network_and_lintian_is_silent(bench):
    bench.build_present()
    bench.build_later()


def installed_in_a_bare_debian(bench):
    bench.bootstrap()
    bench.inside('apt-get', 'update', '-q')
    bench.install('present')
    assert bench.inside('id', '-un', 'ischia').strip() == 'ischia'
    assert os.path.islink(bench.path('etc/systemd/system/multi-user.target.wants/ischiad.service'))
    assert 'openblas' in bench.inside('ldd', '/usr/bin/ischia')
    for page in ('man1/ischia.1.gz', 'man8/ischiad.8.gz'):
        # A minimal Debian may leave documentation out; dpkg knows what belongs there.
        assert '/usr/share/man/' + page in bench.inside('dpkg', '-L', 'ischia')
    for name in ('ischia', 'ischiad'):
        assert os.path.exists(bench.path('usr/share/bash-completion/completions/' + name))
    assert 'good' in bench.as_service('--check-config')


def the_installed_unit_is_hardened(bench):
    text = run('systemd-analyze', 'security', '--offline=yes', '--threshold=15', bench.path(UNIT))
    level = re.search(r'exposure level for ischiad.service: ([\d.]+)', text)
    assert float(level[1]) <= 1.5, level[0]
    assert 'ignoring' not in text, text
    print('# exposure level', level[1])


def started_as_its_unit_says_and_used_with_curl(bench):
    bench.start()
    with open(os.path.join(bench.source, 'examples/table2_1R.json'), encoding='utf-8') as file:
        side = file.read()
    status, body = bench.curl('/v1/assessments', '-H', 'Content-Type: application/json',
                              '-H', 'Prefer: wait=60', '-d', side)
    assert status in (201, 202), (status, body)
    path = json.loads(body)['links']['self']
    end = time.monotonic() + PATIENCE_S
    while json.loads(body)['status'] in ('queued', 'running'):
        assert time.monotonic() < end
        body = bench.curl(path, '-H', 'Prefer: wait=30')[1]
    document = json.loads(body)
    assert document['status'] == 'succeeded', document
    assert document['result']['numerics']['converged'] is True
    bench.before = {path: body, path + '/field.vtu': bench.curl(path + '/field.vtu')[1]}
    assert '<VTKFile' in bench.before[path + '/field.vtu']
    assert bench.curl('/')[0] == 200 and '/assets/app.js' in bench.curl('/')[1]
    print('# solved: eps_max', document['result']['strain']['eps_max'],
          'in', document['result']['numerics']['wall_s'], 's')
    state = os.stat(bench.path('var/lib/ischia'))
    assert state.st_mode & 0o777 == 0o700 and state.st_uid != 0


def a_token_closes_the_door(bench):
    said = bench.as_service('token', 'create', 'scope=admin', 'name=test')
    bench.token = re.search(r'ischia_[0-9a-f]{16}_\S+', said)[0]
    path = next(iter(bench.before))
    end = time.monotonic() + PATIENCE_S
    while bench.curl(path)[0] != 401:
        assert time.monotonic() < end, 'the token is not noticed'
        time.sleep(0.1)
    still_there(bench)


def still_there(bench):
    for path, body in bench.before.items():
        status, now = bench.curl(path, '-H', f'Authorization: Bearer {bench.token}')
        assert (status, now) == (200, body), (path, status)


def upgraded_with_data_and_settings_kept(bench):
    bench.stop()
    edit(bench.path('etc/ischia/ischiad.conf'), r'queue_limit = \d+', 'queue_limit = 321')
    old = bench.schema()
    bench.install('later')
    assert 'queue_limit = 321' in bench.as_service('--print-config')
    bench.start()
    assert json.loads(bench.curl('/version')[1])['version'] == '9.0.0'
    still_there(bench)
    assert bench.schema() == old + 1, (old, bench.schema())
    assert 'the chain holds' in bench.as_service('audit', 'verify')
    bench.stop()


def the_old_version_refuses_the_newer_store_and_changes_nothing(bench):
    before = digest(bench.database())
    bench.install('present')
    try:
        bench.start()
    except AssertionError as error:
        assert 'newer' in str(error), error
        bench.process.wait(PATIENCE_S)
        bench.process.stdout.close()
        bench.process = None
    else:
        raise AssertionError('it started')
    assert digest(bench.database()) == before


def upgraded_again_it_goes_on(bench):
    bench.install('later')
    bench.start()
    still_there(bench)
    bench.stop()


def removed_it_keeps_the_data_and_purged_it_leaves_nothing(bench):
    bench.inside('apt-get', 'remove', '-y', '-q', 'ischia')
    assert not os.path.exists(bench.path('usr/bin/ischiad'))
    assert os.path.exists(bench.database())
    bench.install('later')
    bench.start()
    still_there(bench)
    bench.stop()
    bench.inside('apt-get', 'purge', '-y', '-q', 'ischia')
    left = set(bench.traces()) - bench.clean
    assert not left, left
    assert not bench.inside('dpkg', '--list').count(' ischia ')


STEPS = (
    built_without_a_network_and_lintian_is_silent,
    installed_in_a_bare_debian,
    the_installed_unit_is_hardened,
    started_as_its_unit_says_and_used_with_curl,
    a_token_closes_the_door,
    upgraded_with_data_and_settings_kept,
    the_old_version_refuses_the_newer_store_and_changes_nothing,
    upgraded_again_it_goes_on,
    removed_it_keeps_the_data_and_purged_it_leaves_nothing,
)


def walk(bench):
    """Each step needs the one before: the first that fails ends the walk."""
    print(f'1..{len(STEPS)}', flush=True)
    for number, step in enumerate(STEPS, 1):
        started = time.monotonic()
        try:
            step(bench)
        except Exception as error:  # the report is the test's output
            print(f'not ok {number} - {step.__name__}')
            print('\n'.join('# ' + line for line in f'{type(error).__name__}: {error}'.splitlines()))
            return 1
        print(f'ok {number} - {step.__name__} ({time.monotonic() - started:.0f} s)', flush=True)
    return 0


def main(source):
    reason = cannot_run()
    if reason:
        print(reason)
        return SKIP
    if os.environ.get('ISCHIA_TEST_MOUNTS') != 'own':  # what is mounted ends with this process
        environment = {**os.environ, 'ISCHIA_TEST_MOUNTS': 'own'}
        os.execvpe('unshare', ['unshare', '--mount', '--propagation', 'private', sys.executable,
                               os.path.abspath(__file__), source], environment)
    keep = os.environ.get('ISCHIA_TEST_KEEP')
    folder = keep or tempfile.mkdtemp(prefix='ischia-package-')
    os.makedirs(folder, exist_ok=True)
    bench = Bench(os.path.realpath(source), folder)
    try:
        return walk(bench)
    finally:
        if bench.process is not None:
            bench.process.kill()
            bench.process.wait()
        for name in ('dev', 'proc'):
            run('umount', '--lazy', bench.path(name), check=False)
        if not keep:
            shutil.rmtree(folder)


if __name__ == '__main__':
    sys.exit(main(*sys.argv[1:]))
