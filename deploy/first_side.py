#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Submits one side to a running service and prints what came of it.

Usage: first_side.py ADDRESS FILE.json
"""
import json
import sys
import time
import urllib.error
import urllib.request


def ask(address, path, body=None):
    headers = {'Content-Type': 'application/json', 'Prefer': 'wait=30'}
    request = urllib.request.Request(address + path, body, headers)
    with urllib.request.urlopen(request, timeout=90) as response:
        return json.load(response)


def await_service(address, seconds=60):
    end = time.monotonic() + seconds
    while True:
        try:
            return ask(address, '/readyz')
        except (urllib.error.URLError, ConnectionError):
            if time.monotonic() > end:
                raise
            time.sleep(0.2)


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


def main():
    address, path = sys.argv[1:3]
    await_service(address)
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


if __name__ == '__main__':
    sys.exit(main())
