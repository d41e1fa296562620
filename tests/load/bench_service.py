#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""How much the service carries: requests a second with wrk, durable accepts, open event streams,
a long queue, slow clients beside quick ones, memory at rest. Prints what it measures; the marks are
for a machine of two cores that runs wrk too. Usage: bench_service.py [SECONDS]
"""
import os
import re
import socket
import subprocess
import sys
import tempfile
import threading
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), '../api'))
from service import Service, side  # noqa: E402  (the path comes first)

SECONDS = int(sys.argv[1]) if len(sys.argv) > 1 else 8
POST = '''
local n = 0
local salt = os.time() % 1000
request = function()
  n = n + 1
  local body = string.format('{"R1":7.1,"R2":22.8,"eM":%d.%03d,"eF":10,"muM":8,"muF":5,"F":%.6f}',
                             20, salt, 100 + n / 10000)
  return wrk.format("POST", "/v1/assessments", {["Content-Type"] = "application/json"}, body)
end
'''
missed = []


def mark(what, value, unit, limit, larger=True):
    good = value >= limit if larger else value <= limit
    print(
        f'{"ok    " if good else "MISSED"} {what}: {value:,.1f} {unit}'
        f' (mark: {"at least" if larger else "at most"} {limit:,})',
        flush=True,
    )
    if not good:
        missed.append(what)


def wrk(url, *options):
    text = subprocess.run(
        ['wrk', '-t1', f'-d{SECONDS}', '--latency', *options, url],
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    number, unit = re.search(r'99%\s+([\d.]+)(us|ms|s)', text).groups()
    p99_ms = float(number) * {'us': 1e-3, 'ms': 1, 's': 1e3}[unit]
    errors = re.search(r'Non-2xx or 3xx responses: (\d+)', text)
    return (
        float(re.search(r'Requests/sec:\s+([\d.]+)', text).group(1)),
        p99_ms,
        int(errors.group(1)) if errors else 0,
    )


def resident_mib(service):
    with open(f'/proc/{service.process.pid}/status', encoding='ascii') as file:
        return int(re.search(r'VmRSS:\s+(\d+)', file.read()).group(1)) / 1024


def reads(service):
    path = service.submit(F=300.5)['links']['self']
    rate, p99, errors = wrk(f'http://{service.address}{path}', '-c32')
    assert errors == 0
    mark('GET of an assessment', rate, 'requests/s', 20000)
    print(f'       p99 {p99:.2f} ms')


def accepts(service):
    with tempfile.NamedTemporaryFile('w', suffix='.lua') as script:
        script.write(POST)
        script.flush()
        rate, p99, errors = wrk(f'http://{service.address}', '-c64', '-s', script.name)
    assert errors == 0, f'{errors} were refused'
    mark('durable accepts', rate, 'requests/s', 1500)
    print(f'       p99 {p99:.2f} ms')
    depth = service.get('/metrics').body.decode()
    queued = int(float(re.search(r'^ischia_queue_depth (\S+)', depth, re.M).group(1)))
    times = []
    for _ in range(20):
        begun = time.monotonic()
        assert len(service.get('/v1/assessments?limit=50').json()['items']) == 50
        times.append((time.monotonic() - begun) * 1e3)
    print(f'       {queued} are queued')
    mark('a page of the list beside them, slowest of 20', max(times), 'ms', 50, larger=False)


def streams(service, count=1000):
    path = service.submit(wait=0, F=599, eM=21)['links']['self']
    host, port = service.address.split(':')
    opened = []
    begun = time.monotonic()
    for _ in range(count):
        connection = socket.create_connection((host, int(port)), timeout=10)
        connection.sendall(f'GET {path}/events HTTP/1.1\r\nHost: localhost\r\n\r\n'.encode())
        opened.append(connection)
    for connection in opened:
        assert b'200 OK' in connection.recv(4096)
    print(f'       {count} event streams opened in {time.monotonic() - begun:.2f} s')
    mark(f'resident memory with {count} streams', resident_mib(service), 'MiB', 100, larger=False)
    begun = time.monotonic()
    assert service.ask('POST', path + '/cancel').status == 200
    for connection in opened:
        text = b''
        while b'event: done' not in text:
            chunk = connection.recv(4096)
            assert chunk, 'a stream ended without its end'
            text += chunk
        connection.close()
    mark(f'all {count} streams told of the end', time.monotonic() - begun, 's', 2, larger=False)


def slow_clients(service):
    host, port = service.address.split(':')
    stop = threading.Event()

    def dawdle():
        while not stop.is_set():
            try:
                connection = socket.create_connection((host, int(port)), timeout=10)
                for byte in b'POST /v1/assessments HTTP/1.1\r\nHost: localhost\r\n':
                    if stop.wait(0.1):
                        break
                    connection.sendall(bytes([byte]))
                connection.close()
            except OSError:
                pass

    threads = [threading.Thread(target=dawdle) for _ in range(200)]
    for thread in threads:
        thread.start()
    rate, p99, errors = wrk(f'http://{service.address}/v1/parameters', '-c16')
    stop.set()
    for thread in threads:
        thread.join()
    assert errors == 0
    mark('p99 of others beside 200 slow clients', p99, 'ms', 50, larger=False)
    print(f'       at {rate:,.0f} requests/s')


def main():
    with Service('--queue-limit', '1000000') as service:
        service.until_ready()
        time.sleep(1)
        mark('resident memory at rest', resident_mib(service), 'MiB', 30, larger=False)
        reads(service)
        slow_clients(service)
        streams(service)
        accepts(service)
        print(f'       resident memory afterwards: {resident_mib(service):.1f} MiB')
    return 1 if missed else 0


if __name__ == '__main__':
    sys.exit(main())
