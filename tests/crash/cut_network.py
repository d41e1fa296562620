#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The cable between one daemon and the database is cut and mended: cut_network.py [ROUNDS].

In network namespaces of its own: the server and one daemon in one, the other daemon in another that
reaches the server over a pair of virtual interfaces and its clients over a second pair. A cut is
silent, as when a switch dies: packets leave and never arrive.

Defends I20 and I21 of docs/INVARIANTS.md: who is cut off says that it is not ready and refuses with
503; what it ran is given back within seconds and solved by the other; what it found meanwhile is
refused when it comes back, while the other still works on it; and then it takes part again.
"""
import os
import subprocess
import sys
import time

from crash import PATIENCE_S
from fleet import Cluster, Fleet, skip_without_server
from service import FAKE_WORKER, eventually, side

DATABASE, CUT_OFF = ('10.99.0.1', 5432), '10.99.0.2'
OUTSIDE, CLIENT_SIDE = '10.98.0.1', '10.98.0.2'
NOWHERE = '02:00:00:00:00:99'  # nobody has this address: what is sent there is lost
GATE = 595  # tests/api/fake_worker.py: solves until the daemon's gate is open
INSIDE = 'ISCHIA_CUT_NETWORK_INSIDE'


def run(*words):
    subprocess.run(words, check=True)


class Cable:
    """The other namespace, and the two pairs of interfaces that lead there."""

    def __init__(self):
        run('ip', 'link', 'set', 'lo', 'up')
        self.holder = subprocess.Popen(['unshare', '--net', 'sleep', 'infinity'])
        pid = str(self.holder.pid)
        own = os.readlink('/proc/self/ns/net')
        eventually(lambda: os.readlink(f'/proc/{pid}/ns/net') != own, 'a namespace')
        self.enter = ('nsenter', '-t', pid, '-n')
        run(*self.enter, 'ip', 'link', 'set', 'lo', 'up')
        for name, near, far in (('db', DATABASE[0], CUT_OFF), ('out', OUTSIDE, CLIENT_SIDE)):
            run('ip', 'link', 'add', f'{name}0', 'type', 'veth', 'peer', 'name', f'{name}1')
            run('ip', 'link', 'set', f'{name}1', 'netns', pid)
            run('ip', 'address', 'add', f'{near}/30', 'dev', f'{name}0')
            run('ip', 'link', 'set', f'{name}0', 'up')
            run(*self.enter, 'ip', 'address', 'add', f'{far}/30', 'dev', f'{name}1')
            run(*self.enter, 'ip', 'link', 'set', f'{name}1', 'up')

    def cut(self):
        run('ip', 'neigh', 'replace', CUT_OFF, 'lladdr', NOWHERE, 'dev', 'db0', 'nud', 'permanent')
        run(*self.enter, 'ip', 'neigh', 'replace', DATABASE[0], 'lladdr', NOWHERE, 'dev', 'db1',
            'nud', 'permanent')

    def mend(self):
        run('ip', 'neigh', 'del', CUT_OFF, 'dev', 'db0')
        run(*self.enter, 'ip', 'neigh', 'del', DATABASE[0], 'dev', 'db1')

    def close(self):
        self.holder.kill()
        self.holder.wait()


def set_gate(daemon, is_open):
    path = f'/tmp/ischia-gate-{daemon.process.pid}'
    if is_open:
        with open(path, 'w', encoding='utf-8'):
            pass
    elif os.path.exists(path):
        os.unlink(path)


def attempt_of(server, identity):
    return server.sql("SELECT state || ' ' || attempt FROM ischia.assessment "
                      f"WHERE id = '\\x{identity.replace('-', '')}'")


def changes_of(service, identity):
    items = service.get('/v1/changes?since=0&limit=500').json()['items']
    return [item['change'] for item in items if item['id'] == identity]


def check_refusal(answer):
    assert answer.status == 503, (answer.status, answer.body)
    assert answer.type == 'application/problem+json', answer.type


def one_round(fleet, server, cable, number):
    far, near = fleet.daemons
    for daemon in (far, near):
        set_gate(daemon, False)
    near.signal(19)  # stopped, so that the far one gets the job; not for as long as a lease
    identity = far.submit(wait=0, F=GATE + number / 1000)['id']
    far.until(identity, 'running')
    near.signal(18)
    eventually(lambda: attempt_of(server, identity) == '1 1', 'the far one to run it')
    cable.cut()
    cut_at = time.monotonic()
    eventually(lambda: attempt_of(server, identity) == '1 2', 'the near one to run it')
    back_after = time.monotonic() - cut_at
    asked_at = time.monotonic()
    check_refusal(far.get('/readyz'))
    check_refusal(far.ask('POST', '/v1/assessments', side(F=100 + number / 1000)))
    check_refusal(far.get('/v1/assessments/' + identity))
    assert far.get('/healthz').status == 200
    refused_in = time.monotonic() - asked_at
    near.until_ready()
    set_gate(far, True)  # it has found something, and nobody wants it any more
    time.sleep(2)
    cable.mend()
    mended_at = time.monotonic()
    far.until_ready()
    ready_after = time.monotonic() - mended_at
    other = far.submit(F=200 + number / 1000)  # takes part again; its stale result was offered
    assert other['status'] == 'succeeded', other
    assert attempt_of(server, identity) == '1 2', 'a stale result was taken'
    set_gate(near, True)
    assert near.until(identity, 'succeeded')['status'] == 'succeeded'
    said = changes_of(far, identity)
    assert said == ['created', 'started', 'requeued', 'started', 'succeeded'], said
    return back_after, refused_in, ready_after


def inside(rounds):
    cable = Cable()
    options = ('--behind-proxy', '--listen', CLIENT_SIDE + ':0')
    try:
        with Cluster(listen=DATABASE) as server:
            url = f'postgresql://ischia@{DATABASE[0]}:{DATABASE[1]}/ischia'
            with Fleet(2, url, workers=1, worker=FAKE_WORKER,
                       options=lambda i: options if i == 0 else (),
                       within=lambda i: cable.enter if i == 0 else ()) as fleet:
                for daemon in fleet.daemons:
                    daemon.until_ready()
                took = [one_round(fleet, server, cable, i + 1) for i in range(rounds)]
                for daemon in fleet.daemons:
                    set_gate(daemon, False)
    finally:
        cable.close()
    print(f'{rounds} cuts: the job was given to the other after',
          ', '.join(f'{back:.1f} s' for back, _, _ in took), '; three refusals took',
          ', '.join(f'{refused:.1f} s' for _, refused, _ in took), '; ready again after',
          ', '.join(f'{ready:.1f} s' for _, _, ready in took))
    assert all(back < PATIENCE_S / 10 for back, _, _ in took), took


def main(rounds):
    skip_without_server()
    if os.environ.get(INSIDE):
        return inside(rounds)
    tried = subprocess.run(['unshare', '--net', 'ip', 'link', 'add', 'a0', 'type', 'veth', 'peer',
                            'name', 'a1'], capture_output=True, text=True, check=False)
    if tried.returncode != 0:
        print('SKIP: no network namespaces here:', tried.stderr.strip())
        sys.exit(77)
    words = ['unshare', '--net', sys.executable, os.path.abspath(__file__), str(rounds)]
    sys.exit(subprocess.run(words, env={**os.environ, INSIDE: '1'}, check=False).returncode)


if __name__ == '__main__':
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 2)
