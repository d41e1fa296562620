#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""kill -9 of daemons, of their workers and of the database server at random moments, while clients
use three daemons on one store: kill_fleet.py MOMENTS [SEED], the daemon in $ISCHIAD. Now and then a
daemon is frozen instead, for less or longer than its lease, and goes on as if nothing had happened.

Defends I1 to I4, I6, I13, I18, I20 and I21 of docs/INVARIANTS.md. Clients submit, wait, cancel,
erase, ask for studies and follow the changes at any of the daemons; what one has answered is a
promise of all. What was cut off, or answered 503, is asked again with the same Idempotency-Key, at
another daemon as often as not. A promise that is not kept is a FAULT; so is any answer that a client
could not expect, a 404 for what it has just been given above all.
"""
import random
import signal
import sys
import threading
import time

from crash import PATIENCE_S, kill_one_worker
from fleet import Cluster, Fleet, skip_without_server
from kill_service import (CANCEL_EVERY, ERASE_EVERY, FINAL, WAIT_EVERY, CutOff, World, all_changes,
                          ask, deed_of, judge_one, rows_of)
from service import admin, side

DAEMONS, CLIENTS, POINTS, STUDY_EVERY = 3, 6, 4, 40
PLACES = ('daemon', 'daemon', 'daemon', 'worker', 'worker', 'worker', 'database', 'freeze')
LEASE_S = 5


class Unanswered(Exception):
    """The daemon is there and cannot say: 503, 429."""


class Promises(World):
    def __init__(self):
        super().__init__()
        self.studies = {}  # number -> id
        self.refusals = 0


def expect(answer, world, good, also, what):
    """Its status is good, or one of also; 503 and 429 are no answer; anything else is a fault."""
    if answer.status in (503, 429):
        with world.lock:
            world.refusals += 1
        raise Unanswered
    if answer.status not in (*good, *also):
        with world.lock:
            world.faults.append(f'{what}: {answer.status}: {answer.body[:300]}')
    return answer.status in good


def submit(service, world, number):
    headers = {'Idempotency-Key': f'k-{number}'}
    if number % WAIT_EVERY == 0:
        headers['Prefer'] = 'wait=5'
    body = side(F=deed_of(number)[1], subject=f'N-{number}')
    answer = ask(service, 'POST', '/v1/assessments', body, headers)
    if not expect(answer, world, (201, 202), (), f'POST number {number}'):
        return None
    identity = answer.json()['id']
    with world.lock:
        known = world.accepted.setdefault(number, identity)
        if known != identity:
            world.faults.append(f'number {number} is {known} and {identity}')
    return identity


def table_of(number):
    head = 'row,R1,R2,eM,eF,muM,muF,F'
    rows = [f'{i},7.1,22.8,31,10,8,5,{round(400 + number / 1e3 + i / 1e5, 5)}'
            for i in range(POINTS)]
    return '\n'.join([head, *rows, ''])


def ask_for_study(service, world, number):
    headers = {'Idempotency-Key': f's-{number}', 'Content-Type': 'text/csv'}
    answer = ask(service, 'POST', f'/v1/studies?name=s{number}', table_of(number).encode(), headers)
    if expect(answer, world, (201, 202), (), f'study {number}'):
        with world.lock:
            known = world.studies.setdefault(number, answer.json()['id'])
            if known != answer.json()['id']:
                world.faults.append(f'study {number} is there twice')


def change(service, world, kept, method, path, identity, good):
    """A change is promised when it was answered, possible when it was not."""
    sure, perhaps = kept
    perhaps.add(identity)
    answer = ask(service, method, path)
    done = expect(answer, world, (good,), (404, 409), f'{method} {path}')
    if done:
        sure.add(identity)


def read_back(service, world, identity):
    """What one daemon has given is there at every other, unless it was erased meanwhile."""
    answer = ask(service, 'GET', '/v1/assessments/' + identity)
    expect(answer, world, (200,), (), f'GET {identity}')


def follow(service, world):
    since = max(world.changes, default=0)
    answer = ask(service, 'GET', f'/v1/changes?since={since}&limit=500')
    if expect(answer, world, (200,), (), 'GET changes'):
        with world.lock:
            for item in answer.json()['items']:
                world.changes[item['seq']] = (item['change'], item['id'])


def one_round(fleet, world, number):
    identity = submit(fleet, world, number)
    if identity is None:
        return
    path = '/v1/assessments/' + identity
    other = fleet.any
    read_back(other(), world, identity)
    if number % CANCEL_EVERY == 0:
        change(other(), world, (world.cancelled, world.perhaps_cancelled), 'POST',
               path + '/cancel', identity, 200)
    if number % ERASE_EVERY == 0:
        change(other(), world, (world.erased, world.perhaps_erased), 'DELETE', path, identity, 204)
    if number % 4 == 0:
        follow(other(), world)
    if number % STUDY_EVERY == 0:
        ask_for_study(other(), world, number)


class Router:
    """Stands for whichever daemon: each request goes to one that is said to run."""

    def __init__(self, fleet):
        self.fleet = fleet

    def any(self):
        return self

    def ask(self, *words, **more):
        daemon = self.fleet.any()
        if daemon is None:
            raise OSError('all are dead')
        return daemon.ask(*words, **more)


def use(router, world, over):
    try:
        while not over.is_set():
            number = world.next_number()
            try:
                one_round(router, world, number)
            except (CutOff, Unanswered):
                with world.lock:
                    if number not in world.accepted:
                        world.again.append(number)
                time.sleep(0.02)
    except Exception as error:  # a thread's failure must not go unseen
        world.faults.append(f'a client: {error!r}')


def wreck(fleet, server, world):
    """One moment: something dies, and is started again by whoever looks after it."""
    place = random.choice(PLACES)
    i = random.randrange(DAEMONS)
    if place == 'database':
        server.kill()
        time.sleep(random.uniform(0, 0.5))
        server.start()
    elif place == 'freeze':
        fleet.daemons[i].signal(signal.SIGSTOP)
        time.sleep(random.uniform(0, 2 * LEASE_S))
        fleet.daemons[i].signal(signal.SIGCONT)
    elif place == 'worker':
        kill_one_worker(fleet.daemons[i].process.pid)
    else:
        fleet.kill(i)
        time.sleep(random.uniform(0, 0.3))
        fleet.start(i)
    return place


def wait_for(holds, world, what):
    until = time.monotonic() + PATIENCE_S
    while not holds():
        assert not world.faults, world.faults[0]
        assert time.monotonic() < until, f'waited {PATIENCE_S} s for {what}'
        time.sleep(0.02)


def is_drained(server):
    return server.sql('SELECT (SELECT count(*) FROM ischia.assessment WHERE state < 2) + '
                      '(SELECT count(*) FROM ischia.study_point WHERE state < 2)') == '0'


def finish(router, world):
    """Asks again for what was never answered."""
    while world.again:
        number = world.next_number()
        try:
            submit(router, world, number)
        except (CutOff, Unanswered):
            world.again.append(number)
            time.sleep(0.1)


def judge_studies(service, world):
    faults = []
    for number, identity in world.studies.items():
        study = service.get('/v1/studies/' + identity)
        if study.status != 200:
            faults.append(f'study {number} was accepted and is lost: {study.status}')
            continue
        points = study.json()['points']
        results = service.get(f'/v1/studies/{identity}/results').body.decode()
        # a point whose workers were killed twice in a row, by this test, has failed
        if points['succeeded'] + results.count('killed by signal 9') != POINTS:
            faults.append(f'study {number} ended as {points}: {results}')
    return faults


def judge(service, world):
    rows, faults = rows_of(service), list(world.faults)
    for number, identity in world.accepted.items():
        if identity in world.erased:
            faults += [f'number {number} was erased and is back'] if identity in rows else []
        elif identity not in rows:
            if identity not in world.perhaps_erased:
                faults.append(f'number {number} was accepted and is lost')
        else:
            faults += judge_one(number, service.get('/v1/assessments/' + identity).json(), world)
    subjects = [row['subject'] for row in rows.values()]
    faults += [f'{subject} is there twice, under one Idempotency-Key'
               for subject in {s for s in subjects if subjects.count(s) > 1}]
    changes = all_changes(service)
    faults += [f'change {seq} was seen as {seen} and is {changes.get(seq)}'
               for seq, seen in world.changes.items() if changes.get(seq) != seen]
    last = max(world.changes, default=0)
    faults += [f'change {seq} came after {last} had been seen' for seq in changes
               if seq <= last and seq not in world.changes]
    for identity, row in rows.items():
        ends = [what for what, whose in changes.values() if whose == identity and what in FINAL]
        if ends != [row['status']]:
            faults.append(f'{identity} is {row["status"]}, but its ends are {ends}')
    return faults + judge_studies(service, world), rows


def judge_server(server, fleet):
    faults = []
    counted = server.sql('SELECT state, count(*) FROM ischia.assessment GROUP BY 1 ORDER BY 1')
    tally = server.sql('SELECT state, n FROM ischia.tally WHERE n <> 0 ORDER BY 1')
    if counted != tally:
        faults.append(f'tally {tally!r}, but there are {counted!r}')
    said = admin(fleet.states[0], '--store', fleet.url, 'audit', 'verify', check=False)
    if said.returncode != 0:
        faults.append('the audit log: ' + said.stdout + said.stderr)
    return faults


def storm(fleet, server, world, moments):
    router, over, died = Router(fleet), threading.Event(), []
    clients = [threading.Thread(target=use, args=(router, world, over)) for _ in range(CLIENTS)]
    for client in clients:
        client.start()
    try:
        for _ in range(moments):
            goal = len(world.accepted) + random.randint(1, 15)
            wait_for(lambda: len(world.accepted) >= goal, world, 'accepted requests')
            time.sleep(random.uniform(0, 0.2))
            died.append(wreck(fleet, server, world))
    finally:
        over.set()
        for client in clients:
            client.join()
    finish(router, world)
    wait_for(lambda: is_drained(server), world, 'the queue to be empty')
    return died


def main(moments, seed):
    skip_without_server()
    random.seed(seed)
    world = Promises()
    begun = time.monotonic()
    with Cluster() as server, Fleet(DAEMONS, server.url) as fleet:
        try:
            died = storm(fleet, server, world, moments)
            faults, rows = judge(fleet.daemons[0], world)
            faults += judge_server(server, fleet)
        except BaseException:
            for i, daemon in enumerate(fleet.daemons):
                print(f'--- daemon {i}', daemon.errors()[-3000:] if daemon else 'is dead')
            print('--- database', server.log())
            raise
    states = {status: sum(row['status'] == status for row in rows.values()) for status in FINAL}
    print(f'{moments} moments (seed {seed}) in {time.monotonic() - begun:.0f} s:',
          {place: died.count(place) for place in sorted(set(died))},
          f'{len(world.accepted)} accepted, {len(world.erased)} erased,',
          f'{len(world.studies)} studies, {world.refusals} refusals; states {states};',
          f'{len(world.changes)} changes followed')
    for fault in faults[:20]:
        print('FAULT', fault)
    assert len(world.accepted) > moments, 'hardly anything was accepted: no load'
    return 1 if faults else 0


if __name__ == '__main__':
    sys.exit(main(int(sys.argv[1]),
                  int(sys.argv[2]) if len(sys.argv) > 2 else random.randrange(10**6)))
