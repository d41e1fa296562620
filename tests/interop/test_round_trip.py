#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Both sides of subjects 1 to 4 of Table 2, really solved: in through FHIR, HL7 v2 and /v1, out
through all three, and every number the same to the last digit.

RESOLUTION says how fine (coarse unless said: seconds; standard: minutes)."""
import csv
import json
import os
import unittest

import hl7
import interop
from interop import bundle, parameters, post, resources
from service import Service

RESOLUTION = os.environ.get('RESOLUTION', 'coarse')
ISCHIA = os.environ.get('ISCHIA', 'ischia')


def sides():
    """(subject, side, {key: digits as in the table})"""
    with open(os.path.join(interop.ROOT, 'examples/table2.csv'), newline='',
              encoding='utf-8') as file:
        for row in csv.DictReader(file):
            if row['subject'] in ('table2-1', 'table2-2', 'table2-3', 'table2-4'):
                inputs = {k.split('_')[0]: v for k, v in row.items() if '_' in k}
                yield row['subject'], row['side'], inputs


def digits(body):
    """JSON with its numbers as they are written."""
    return json.loads(body, parse_float=str, parse_int=str)


def lookup(document, pointer):
    for key in pointer.strip('/').split('/'):
        document = document.get(key) if document is not None else None
    return document


class RoundTrip(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        interop.install()
        cls.peer = hl7.Peer()
        cls.service = Service(
            '--hl7-listen', '127.0.0.1:0', '--hl7-peer', f'127.0.0.1:{cls.peer.port}',
            worker=ISCHIA)
        cls.service.until_ready()
        cls.mapping = interop.mapping()

    @classmethod
    def tearDownClass(cls):
        cls.service.stop()
        cls.peer.close()

    def through_v1(self, identity):
        document = digits(self.service.get('/v1/assessments/' + identity).body)
        self.assertEqual(document['status'], 'succeeded')
        return {m['code']: lookup(document, m['v1']) for m in self.mapping}

    def through_fhir(self, identity):
        report = digits(self.service.get('/fhir/DiagnosticReport/' + identity).body)
        found = {m['code']: None for m in self.mapping}
        for each in report['result']:
            one = digits(self.service.get('/fhir/' + each['reference']).body)
            self.assertEqual(one['valueQuantity']['system'], interop.UCUM)
            found[one['code']['coding'][0]['code']] = one['valueQuantity']['value']
        return found

    def through_hl7(self, identity):
        """From the message that the peer was sent of itself."""
        found = {m['code']: None for m in self.mapping}
        for _ in range(200):
            for message in self.peer.messages:
                rows = hl7.fields(message)
                if next(r for r in rows if r[0] == 'OBR')[3].split('^')[0] != identity:
                    continue
                found.update({r[3].split('^')[0]: r[5] for r in rows
                              if r[0] == 'OBX' and r[2] == 'NM'})
                return found
            interop.time.sleep(0.1)
        raise AssertionError('the peer was not told')

    def check(self, identity, written):
        """written: the inputs' digits that FHIR and HL7 keep; None when they came through /v1."""
        v1, fhir, message = (f(identity) for f in (self.through_v1, self.through_fhir,
                                                   self.through_hl7))
        self.assertEqual(fhir, message)
        results = {k: v for k, v in v1.items() if k not in interop.UNITS}
        self.assertEqual({k: fhir[k] for k in results}, results)
        self.assertEqual({k: float(fhir[k]) for k in interop.UNITS},
                         {k: float(v1[k]) for k in interop.UNITS})
        if written:
            self.assertEqual({k: fhir[k] for k in interop.UNITS}, written)
        self.assertRegex(results['eps_max'], r'^0\.\d{6,}$|^\d\.\d{6,}$')
        return results

    def test_same_numbers_whatever_the_door(self):
        listed = list(sides())
        self.assertEqual(len(listed), 8)
        different = set()
        for subject, side, inputs in listed:
            with self.subTest(subject=subject, side=side):
                body = parameters(subject='Patient/' + subject, side=side,
                                  **{k: float(v) for k, v in inputs.items()})
                for each in body['parameter'][:7]:
                    each['valueQuantity']['value'] = '@' + inputs[each['name']] + '@'
                body['parameter'].append({'name': 'resolution', 'valueCode': RESOLUTION})
                text = json.dumps(body).replace('"@', '').replace('@"', '')
                answer = post(self.service, text.encode(), {'Prefer': 'respond-async'})
                self.assertEqual(answer.status, 202, answer.body)
                identity = answer.headers['Content-Location'].rsplit('/', 1)[1]
                self.service.until(identity, 'succeeded', seconds=600)
                results = self.check(identity, inputs)
                different.add(results['eps_max'])

                message = hl7.oru(f'rt-{subject}-{side}', pid=subject, side=side, extra=[
                    f'OBX|9|ST|resolution^^99ISCHIA||{RESOLUTION}||||||F'], **inputs)
                with hl7.Mllp(hl7.port_of(self.service)) as link:
                    self.assertEqual(link.ask(message)[0], 'AA')
                newest = self.service.get('/v1/assessments?limit=1').json()['items'][0]
                self.assertEqual((newest['subject'], newest['side']), (subject, side))
                self.service.until(newest['id'], 'succeeded', seconds=600)
                self.assertEqual(self.check(newest['id'], inputs), results)

                document = self.service.submit(
                    wait=60, subject=subject, side=side, resolution=RESOLUTION,
                    **{k: float(v) for k, v in inputs.items()})
                self.service.until(document['id'], 'succeeded', seconds=600)
                self.assertEqual(self.check(document['id'], None), results)
                found = self.service.get('/fhir/RiskAssessment?subject=Patient/' + subject).json()
                self.assertEqual(
                    len({identity, newest['id'], document['id']}
                        & {r['id'] for r in resources(found, 'RiskAssessment')}), 3)
        self.assertEqual(len(different), 8)

    def test_a_bundle_gives_the_same(self):
        subject, side, inputs = next(sides())
        values = {k: float(v) for k, v in inputs.items()}
        body = {'resourceType': 'Parameters', 'parameter': [
            {'name': 'observations', 'resource': bundle(side=side, **values)},
            {'name': 'resolution', 'valueCode': RESOLUTION}]}
        answer = post(self.service, body, {'Prefer': 'respond-async'})
        identity = answer.headers['Content-Location'].rsplit('/', 1)[1]
        self.service.until(identity, 'succeeded', seconds=600)
        one = self.check(identity, None)
        other = self.service.submit(wait=60, resolution=RESOLUTION, **values)
        self.assertEqual(self.check(other['id'], None), one)


if __name__ == '__main__':
    unittest.main()
