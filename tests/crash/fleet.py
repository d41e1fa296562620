# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tests of many daemons on one PostgreSQL server share."""
import os
import random
import sys
import tempfile
import threading
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, '../api'))
sys.path.insert(0, os.path.join(HERE, '../postgresql'))
from cluster import Cluster, skip_without_server  # noqa: E402,F401  (the path comes first)
from service import Service  # noqa: E402

WORKER = os.environ.get('FAKE_WORKER', os.path.join(HERE, '../api/fake_worker.py'))


class Fleet:
    """`count` daemons, each with a state directory of its own, on one store."""

    def __init__(self, count, url, workers=2, worker=WORKER, options=lambda i: (),
                 within=lambda i: ()):
        self.url, self.workers, self.worker = url, workers, worker
        self.options, self.within = options, within
        self.lock = threading.Lock()
        self.folder = tempfile.TemporaryDirectory(prefix='ischia-fleet-')
        self.states = [os.path.join(self.folder.name, str(i)) for i in range(count)]
        for state in self.states:
            os.mkdir(state)
        self.daemons = [None] * count
        for i in range(count):
            self.start(i)

    def start(self, i):
        """Starts the daemon; one that finds no database ends, and is started again, as its
        supervisor would."""
        end = time.monotonic() + 120
        while True:
            try:
                store = ('--store', self.url) if self.url else ()
                service = Service(*store, '--workers', str(self.workers), *self.options(i),
                                  state=self.states[i], worker=self.worker,
                                  within=self.within(i))
                break
            except AssertionError:
                if time.monotonic() > end:
                    raise
                time.sleep(0.2)
        with self.lock:
            self.daemons[i] = service

    def any(self):
        """One of those that are said to run."""
        with self.lock:
            running = [daemon for daemon in self.daemons if daemon is not None]
        return random.choice(running) if running else None

    def kill(self, i):
        with self.lock:
            daemon, self.daemons[i] = self.daemons[i], None
        daemon.kill()

    def stop(self):
        for daemon in self.daemons:
            if daemon is not None:
                daemon.stop()
        self.folder.cleanup()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()
