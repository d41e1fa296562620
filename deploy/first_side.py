#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Submits one side to a running service and prints what came of it.

Usage: first_side.py ADDRESS FILE.json
"""
import json
import signal
import sys
import time
import urllib.error
import urllib.request


def ask(address, path, body=None):
    headers = {'Content-Type': 'application/json', 'Prefer': 'wait=30'}
    request = urllib.request.Request(address + path, body, headers)
    with urllib.request.urlopen(request, timeout=90) as response:
        return json.load(response)


def await_worker(address, seconds=60):
    """503 means: not yet."""
    end = time.monotonic() + seconds
    while True:
        try:
            return ask(address, '/readyz')
        except urllib.error.HTTPError as refusal:
            if refusal.code != 503 or time.monotonic() > end:
                raise
            time.sleep(0.2)


def words_of(refusal):
    """The detail of its problem document, or what HTTP says."""
    try:
        return json.load(refusal)['detail']
    except (ValueError, KeyError, TypeError):
        return refusal.reason


def show(document):
    given = ', '.join(f'{key} {value:g}' for key, value in document['parameters'].items())
    print(f'\nOne side of a sitting person ({given}):')
    result = document['result']
    if result is None:
        problem = document['problem'] or {'detail': document['status']}
        print(f'  no result: {problem["detail"]}')
        return 1
    strain, numerics = result['strain'], result['numerics']
    print(f'  {result["risk"]["headline"]}')
    print(
        f'  eps_max (engineering shear on the axis)   {strain["eps_max"]:.3f}'
        f' +- {numerics["eps_max_error"]:.3f}'
    )
    print(
        f'  E_shear, E_comp (Green-Lagrange, largest) {strain["E_shear_max"]:.3f},'
        f' {strain["E_comp_max"]:.3f}'
    )
    print(
        f'  muscle over both thresholds               '
        f'{result["clusters"]["both"]["volume_mm3"]:.0f} mm3'
    )
    print(
        f'  solved in {numerics["wall_s"]:.1f} s, {numerics["newton_iterations"]} Newton iterations'
    )
    return 0


def submit(address, path):
    await_worker(address)
    with open(path, 'rb') as file:
        document = ask(address, '/v1/assessments', file.read())
    while document['status'] in ('queued', 'running'):
        print(f'solving, {100 * document["progress"]:.0f} % of the force …', flush=True)
        document = ask(address, document['links']['self'])
    status = show(document)
    print(
        f'\nThe form:     {address}/\nThis side:    {address}{document["links"]["self"]}/report\n'
        f'For programs: {address}/docs\nCtrl-C ends the service; its data stay in ./data.',
        flush=True,
    )
    return status


def main():
    address, path = sys.argv[1:3]
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends it without more words
    try:
        return submit(address, path)
    except urllib.error.HTTPError as refusal:
        print(f'{address} answers {refusal.code}: {words_of(refusal)}', file=sys.stderr)
    except OSError as fault:
        print(f'{address} does not answer: {fault}', file=sys.stderr)
    return 1


if __name__ == '__main__':
    sys.exit(main())
