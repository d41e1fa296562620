#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a store costs: assessments accepted and solved a second with the store in a file, and on a
PostgreSQL server with one, two and three daemons. The workers solve nothing (tests/crash/
fake_worker.c), so that what is measured is the service and its store. Everything, the server and the
clients too, shares the processors of this machine. Usage: bench_fleet.py [SECONDS] [WORKERS]
"""
import os
import re
import subprocess
import sys
import tempfile
import threading
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, '../crash'))
from fleet import Cluster, Fleet, skip_without_server  # noqa: E402  (the path comes first)

SECONDS = int(sys.argv[1]) if len(sys.argv) > 1 else 6
WORKERS = int(sys.argv[2]) if len(sys.argv) > 2 else 2
POST = '''
local n = 0
request = function()
  n = n + 1
  local body = string.format('{"R1":7.1,"R2":22.8,"eM":%d,"eF":10,"muM":8,"muF":5,"F":%.6f}',
                             20 + SALT, 100 + n / 10000)
  return wrk.format("POST", "/v1/assessments", {["Content-Type"] = "application/json"}, body)
end
'''


def post(daemon, salt, rates):
    with tempfile.NamedTemporaryFile('w', suffix='.lua') as script:
        script.write(POST.replace('SALT', str(salt)))
        script.flush()
        text = subprocess.run(
            ['wrk', '-t1', '-c32', f'-d{SECONDS}', '-s', script.name, f'http://{daemon.address}'],
            check=True, capture_output=True, text=True).stdout
    refused = re.search(r'Non-2xx or 3xx responses: (\d+)', text)
    rate = float(re.search(r'Requests/sec:\s+([\d.]+)', text).group(1))
    rates.append(rate - (int(refused.group(1)) / SECONDS if refused else 0))


def unfinished(daemon):
    """How many assessments of the whole store are not over; each daemon's gauges are of all."""
    text = daemon.get('/metrics').body.decode()
    return sum(float(re.search(rf'^{name} (\S+)', text, re.M).group(1))
               for name in ('ischia_queue_depth', 'ischia_running'))


def measure(name, daemons, url):
    options = ('--queue-limit', '10000000', '--rate-limit', '0', '--audit', 'changes')
    with Fleet(daemons, url, workers=WORKERS, options=lambda i: options) as fleet:
        for daemon in fleet.daemons:
            daemon.until_ready()
        rates, threads = [], []
        for salt, daemon in enumerate(fleet.daemons):
            threads.append(threading.Thread(target=post, args=(daemon, salt, rates)))
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        begun, before = time.monotonic(), unfinished(fleet.daemons[0])
        time.sleep(SECONDS)
        passed, after = time.monotonic() - begun, unfinished(fleet.daemons[0])
        print(f'{name}: {sum(rates):,.0f} accepted/s, {(before - after) / passed:,.0f} solved/s '
              'after that', flush=True)
        for i in range(daemons):
            fleet.kill(i)


def main():
    skip_without_server()
    measure('file, 1 daemon', 1, None)
    for daemons in (1, 2, 3):
        with Cluster() as server:
            measure(f'PostgreSQL, {daemons} daemon{"s" * (daemons > 1)}', daemons, server.url)


if __name__ == '__main__':
    main()
