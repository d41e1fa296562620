# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tests of hospital protocols share: the npm packages, and FHIR bodies of a side."""
import fcntl
import filecmp
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time  # noqa: F401  for the tests

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.join(HERE, '../..')
sys.path.insert(0, os.path.join(HERE, '../api'))
from service import SIDE  # noqa: E402

FHIR = {'Content-Type': 'application/fhir+json'}
UCUM = 'http://unitsofmeasure.org'
MEASURE = 'urn:ischia:measure'
SNOMED = 'http://snomed.info/sct'
UNITS = {'R1': 'mm', 'R2': 'mm', 'eM': 'mm', 'eF': 'mm', 'muM': 'kPa', 'muF': 'kPa', 'F': 'N'}
LATERALITY = {'left': '69030007:272741003=7771000', 'right': '69030007:272741003=24028007'}


def install():
    """npm ci, unless what the lock file names is there already; one test at a time does it."""
    lock, done = (
        os.path.join(HERE, name) for name in ('package-lock.json', 'node_modules/.ischia-lock')
    )
    with open(lock, 'rb') as turn:
        fcntl.flock(turn, fcntl.LOCK_EX)
        install_from(lock, done)


def install_from(lock, done):
    if os.path.exists(done) and filecmp.cmp(lock, done, shallow=False):
        return
    subprocess.run(
        ['npm', 'ci', '--ignore-scripts', '--no-audit', '--no-fund', '--loglevel=error'],
        cwd=HERE,
        check=True,
        timeout=300,
    )
    shutil.copyfile(lock, done)


def node(script, *arguments, **options):
    return subprocess.run(
        ['node', os.path.join(HERE, script), *arguments],
        capture_output=True,
        text=True,
        timeout=120,
        **options,
    )


def mapping():
    """The table of docs/INTEGRATION.md: every number that travels."""
    with open(os.path.join(ROOT, 'docs/INTEGRATION.md'), encoding='utf-8') as file:
        text = file.read()
    rows = re.findall(r'^\| `(\w+)` \| (in|out) \| `([^`]+)` \| `([^`]+)` \|', text, re.M)
    return [dict(zip(('code', 'way', 'unit', 'v1'), row)) for row in rows]


def quantity(value, unit):
    return {'value': value, 'unit': unit, 'system': UCUM, 'code': unit}


def parameters(subject='Patient/123', side='left', **changes):
    values = {**SIDE, **changes}
    listed = [
        {'name': key, 'valueQuantity': quantity(values[key], UNITS[key])}
        for key in UNITS
        if values[key] is not None
    ]
    if subject:
        listed.append({'name': 'subject', 'valueReference': {'reference': subject}})
    if side:
        listed.append({'name': 'side', 'valueCode': side})
    return {'resourceType': 'Parameters', 'parameter': listed}


def observation(key, value, unit=None, subject='Patient/123', side='left', **members):
    return {
        'resourceType': 'Observation',
        'status': 'final',
        'code': {'coding': [{'system': MEASURE, 'code': key}]},
        'subject': {'reference': subject},
        'effectiveDateTime': '2026-03-01T09:30:00Z',
        'valueQuantity': quantity(value, unit or UNITS[key]),
        'bodySite': {'coding': [{'system': SNOMED, 'code': LATERALITY[side]}]},
        **members,
    }


def bundle(side='left', subject='Patient/123', **changes):
    values = {**SIDE, **changes}
    return {
        'resourceType': 'Bundle',
        'type': 'collection',
        'entry': [
            {'resource': observation(key, values[key], side=side, subject=subject)}
            for key in UNITS
            if values[key] is not None
        ],
    }


def post(service, body, headers=None, path='/fhir/$assess'):
    data = body if isinstance(body, bytes) else json.dumps(body).encode()
    return service.ask('POST', path, data, {**FHIR, **(headers or {})})


def resources(document, kind):
    return [
        e['resource']
        for e in document.get('entry', [])
        if e['resource']['resourceType'] == kind
    ]


def complaints(documents):
    """What the two validators say about FHIR resources; '' when they pass."""
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, 'resources.json')
        with open(path, 'w', encoding='utf-8') as file:
            json.dump(documents, file)
        done = node('validate.mjs', path)
    return '' if done.returncode == 0 else done.stdout + done.stderr
