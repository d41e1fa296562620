#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""FHIR R4 as record systems meet it: a client and two validators that nobody here wrote."""
import base64
import json
import re
import time
import unittest

import interop
from interop import FHIR, MEASURE, bundle, observation, parameters, post, resources
from service import PROXY, SIDE, Service, admin, direct_only, side

READ = ('RiskAssessment', 'DiagnosticReport', 'Provenance')


def issues(answer):
    outcome = answer.json()
    assert outcome['resourceType'] == 'OperationOutcome', outcome
    assert answer.type == 'application/fhir+json', answer.type
    return outcome['issue']


class Fhir(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        interop.install()
        cls.service = Service()
        cls.service.until_ready()
        cls.emitted = []

    @classmethod
    def tearDownClass(cls):
        cls.service.stop()

    def emit(self, answer):
        """Remembers a resource for the validators, which the last test runs once for all."""
        self.emitted.append(answer.json())
        return answer.json()

    def get(self, path, **headers):
        return self.service.get('/fhir/' + path, **headers)

    def assess(self, **changes):
        answer = post(self.service, parameters(**changes))
        self.assertEqual(answer.status, 200, answer.body)
        return self.emit(answer)

    def refused(self, body, status=422, headers=None):
        answer = post(self.service, body, headers)
        self.assertEqual(answer.status, status, answer.body)
        self.emit(answer)
        return issues(answer)

    @direct_only('the client knows neither authority nor token')
    def test_a_client_of_others_makes_the_whole_tour(self):
        self.assess(subject='Patient/tour', F=310)
        done = interop.node(
            'fhir_client.mjs',
            f'http://{self.service.address}/fhir',
            input=json.dumps(parameters(subject='Patient/tour', F=311)),
        )
        self.assertEqual(done.returncode, 0, done.stderr)
        told = json.loads(done.stdout)
        self.assertEqual(told['metadata']['fhirVersion'], '4.0.1')
        risk = told['read']
        self.assertEqual(risk['subject'], {'reference': 'Patient/tour'})
        self.assertEqual(
            [b['valueQuantity']['value'] for b in told['basis']], [*SIDE.values()][:6] + [311]
        )
        self.assertEqual(told['performer']['deviceName'][0]['name'], 'Ischia')
        self.assertEqual(told['report']['status'], 'final')
        self.assertEqual(told['definition']['code'], 'assess')
        self.assertEqual([r['id'] for r in resources(told['search'], 'RiskAssessment')],
                         [risk['id']])
        self.assertEqual(len(resources(told['next'], 'RiskAssessment')), 1)
        self.assertEqual(told['posted']['total'], 2)
        self.assertEqual(told['missing'], {'status': 404, 'outcome': 'OperationOutcome'})
        self.assertEqual(told['bad'], {'status': 422, 'outcome': 'OperationOutcome'})
        self.emitted.extend(v for v in told.values() if 'resourceType' in v)

    def test_every_resource_is_what_the_mapping_says(self):
        document = self.assess(F=320)
        risk = resources(document, 'RiskAssessment')[0]
        v1 = self.service.get('/v1/assessments/' + risk['id']).json()
        self.assertEqual(v1['subject'], '123')
        self.assertEqual(v1['side'], 'left')
        for kind in READ:
            answer = self.get(f'{kind}/{risk["id"]}')
            self.assertEqual(answer.status, 200)
            self.assertEqual(self.emit(answer), resources(document, kind)[0])
        numbers = {}
        for each in resources(document, 'Observation'):
            self.assertEqual(self.emit(self.get('Observation/' + each['id'])), each)
            self.assertEqual(each['bodySite']['coding'][0]['code'], '69030007')
            self.assertIn('7771000', each['bodySite']['coding'][1]['code'])
            code = each['code']['coding'][0]
            self.assertEqual(code['system'], MEASURE)
            numbers[code['code']] = each['valueQuantity']['value']
        strain = v1['result']['strain']
        self.assertEqual(numbers['eps_max'], strain['eps_max'])
        self.assertEqual(numbers['E_shear'], strain['E_shear_max'])
        self.assertEqual(numbers['E_comp'], strain['E_comp_max'])
        self.assertEqual(numbers['volume_both'], v1['result']['clusters']['both']['volume_mm3'])
        self.assertNotIn('force_compression', numbers)  # null in /v1: never crossed
        self.assertEqual(self.get(f'Observation/{risk["id"]}-force-compression').status, 404)
        prediction = risk['prediction'][0]
        self.assertNotIn('probabilityDecimal', prediction)
        self.assertNotIn('probabilityRange', prediction)
        # the fake worker's own "risk" is not looked at: band and words come from the numbers
        self.assertEqual(prediction['qualitativeRisk']['coding'][0]['code'], 'both')
        self.assertIn('Green-Lagrange shear strain', prediction['rationale'])
        notes = ' '.join(n['text'] for n in risk['note'])
        self.assertIn('animals', notes)
        self.assertIn('not a medical device', notes)
        self.assertEqual(len(risk['basis']), 7)
        report = resources(document, 'DiagnosticReport')[0]
        page = base64.b64decode(report['presentedForm'][0]['data']).decode()
        self.assertEqual(report['presentedForm'][0]['size'], len(page.encode()))
        self.assertIn('<h1>Tissue strain report', page)
        self.assertNotRegex(page, r'(src|href)=')

    def test_the_definitions_are_served(self):
        statement = self.emit(self.get('metadata'))
        kinds = {r['type'] for r in statement['rest'][0]['resource']}
        listed = interop.subprocess.run(
            [interop.os.environ['ISCHIAD'], '--print-routes'], capture_output=True, text=True,
            check=True,
        ).stdout
        self.assertEqual(kinds, set(re.findall(r'GET /fhir/(\w+)/\{file\}', listed)))
        searched = {
            r['type']
            for r in statement['rest'][0]['resource']
            if {'code': 'search-type'} in r['interaction']
        }
        self.assertEqual(searched, set(re.findall(r'GET /fhir/([A-Z]\w+) ', listed)))
        operation = self.emit(self.get('OperationDefinition/assess'))
        self.assertEqual(
            [p['name'] for p in operation['parameter'] if p['type'] == 'Quantity'],
            [*SIDE, *('sd.' + key for key in SIDE)],
        )
        for path in ('CodeSystem/measure', 'CodeSystem/band', 'CodeSystem/assessment',
                     'StructureDefinition/measure-observation',
                     'StructureDefinition/strain-risk-assessment', 'Device/ischia'):
            self.emit(self.get(path))
        self.assertEqual(self.get('CodeSystem/other').status, 404)

    def test_digits_are_kept_as_they_were_written(self):
        text = json.dumps(parameters(F=330)).replace('7.1,', '7.100,').replace('330', '3.30e2')
        answer = post(self.service, text.encode())
        self.assertEqual(answer.status, 200)
        self.assertIn(b'"value":7.100,', answer.body)
        self.assertIn(b'"value":3.30e2,', answer.body)
        again = post(self.service, parameters(F=330))
        self.assertIn(b'"value":7.1,', again.body)

    def test_units_are_converted_or_refused_never_assumed(self):
        body = parameters(F=340)
        by_name = {p['name']: p for p in body['parameter']}
        by_name['R1']['valueQuantity'] = interop.quantity(0.71, 'cm')
        by_name['muM']['valueQuantity'] = interop.quantity(8000, 'Pa')
        by_name['F']['valueQuantity'] = interop.quantity(0.34, 'kN')
        answer = post(self.service, body)
        self.assertEqual(answer.status, 200, answer.body)
        identity = resources(answer.json(), 'RiskAssessment')[0]['id']
        given = self.service.get('/v1/assessments/' + identity).json()['parameters']
        self.assertEqual(given, {**SIDE, 'F': 340})
        for quantity, code in (
            ({'value': 7.1}, 'required'),
            ({'value': 7.1, 'unit': 'mm'}, 'required'),
            ({'value': 7.1, 'code': 'mm'}, 'required'),
            ({'value': 7.1, 'system': 'urn:other', 'code': 'mm'}, 'required'),
            (interop.quantity(7.1, 'kPa'), 'not-supported'),
            (interop.quantity(7.1, 'furlong'), 'not-supported'),
            (interop.quantity('7.1', 'mm'), 'structure'),
            ({**interop.quantity(7.1, 'mm'), 'comparator': '<'}, 'not-supported'),
        ):
            by_name['R1']['valueQuantity'] = quantity
            found = self.refused(body)
            mine = [i for i in found if i['expression'] == ['Parameters.parameter[0]']]
            self.assertEqual([i['code'] for i in mine], [code], (quantity, found))

    def test_standard_deviations_are_taken(self):
        body = parameters(F=331)
        body['parameter'] += [
            {'name': 'sd.R2', 'valueQuantity': interop.quantity(0.6, 'cm')},
            {'name': 'sd.F', 'valueQuantity': interop.quantity(20, 'N')},
            {'name': 'sd.μM', 'valueQuantity': interop.quantity(500, 'Pa')},
        ]
        risk = resources(post(self.service, body).json(), 'RiskAssessment')[0]
        sd = self.service.get('/v1/assessments/' + risk['id']).json()['sd']
        self.assertEqual({k: v for k, v in sd.items() if v}, {'R2': 6, 'muM': 0.5, 'F': 20})
        body['parameter'].append({'name': 'sd', 'valueCode': 'usual'})
        body['parameter'].append({'name': 'sd.R1', 'valueQuantity': {'value': 1}})
        body['parameter'].append({'name': 'sd.muF', 'valueQuantity': interop.quantity(-1, 'kPa')})
        count = len(body['parameter'])
        where = {i['expression'][0] for i in self.refused(body)}
        self.assertEqual(where, {f'Parameters.parameter[{count - k}]' for k in (3, 2, 1)})

    def test_a_bundle_of_observations_is_taken(self):
        answer = post(self.service, bundle(side='right', F=350))
        self.assertEqual(answer.status, 200, answer.body)
        document = self.emit(answer)
        identity = resources(document, 'RiskAssessment')[0]['id']
        v1 = self.service.get('/v1/assessments/' + identity).json()
        self.assertEqual((v1['side'], v1['measured_at']), ('right', '2026-03-01T09:30:00Z'))
        self.assertEqual(v1['parameters'], {**SIDE, 'F': 350})
        later = bundle(F=353)  # the latest by the clock
        later['entry'][0]['resource']['effectiveDateTime'] = '2026-03-01T11:00:00+02:00'
        identity = resources(post(self.service, later).json(), 'RiskAssessment')[0]['id']
        measured = self.service.get('/v1/assessments/' + identity).json()['measured_at']
        self.assertEqual(measured, '2026-03-01T09:30:00Z')
        wrapped = parameters(F=None, side='left')
        wrapped['parameter'] = wrapped['parameter'][7 - 1:] + [
            {'name': 'observations', 'resource': bundle(F=351)}]
        self.assertEqual(post(self.service, wrapped).status, 200)
        others = bundle(F=352)
        others['entry'] += [
            {'resource': {'resourceType': 'Patient', 'name': [{'family': 'X'}]}},
            {'resource': {'resourceType': 'Observation', 'status': 'final',
                          'code': {'coding': [{'system': 'http://loinc.org', 'code': '1-8'}]}}},
        ]
        self.assertEqual(post(self.service, others).status, 200)

    def test_a_bundle_that_does_not_agree_is_refused(self):
        for change, code in (
            ({'status': 'entered-in-error'}, 'code-invalid'),
            ({'subject': {'reference': 'Patient/other'}}, 'invariant'),
            ({'bodySite': {'coding': [{'system': interop.SNOMED, 'code': '24028007'}]}},
             'invariant'),
            ({'code': {'coding': [{'system': MEASURE, 'code': 'R3'}]}}, 'not-found'),
            ({'modifierExtension': [{'url': 'urn:x', 'valueBoolean': True}]}, 'not-supported'),
            ({'valueQuantity': None}, 'structure'),
        ):
            body = bundle()
            body['entry'][3]['resource'].update(change)
            found = self.refused(body)
            self.assertIn(code, [i['code'] for i in found], (change, found))
            self.assertIn(['Bundle.entry[3].resource'], [i.get('expression') for i in found])
        twice = bundle()
        twice['entry'].append({'resource': observation('R1', 7.2)})
        self.assertEqual([i['code'] for i in self.refused(twice)], ['duplicate'])
        strange = bundle()
        for entry in strange['entry']:
            entry['resource']['code']['coding'][0]['system'] = 'urn:other'
        self.assertIn('urn:ischia:measure', self.refused(strange)[0]['diagnostics'])
        missing = self.refused(bundle(muM=None))
        self.assertEqual([i['code'] for i in missing], ['required'])

    def test_bad_parameters_are_named_all_at_once(self):
        body = parameters(R1=-3, muM=99, side='middle')
        body['parameter'].append({'name': 'mum', 'valueString': 'x'})
        body['parameter'].append({'name': 'wat', 'valueString': 'x'})
        found = self.refused(body)
        self.assertEqual(len(found), 5, found)
        self.assertIn('did you mean', json.dumps(found))
        for body in (
            {'resourceType': 'Patient'},
            {'resourceType': 'Parameters'},
            {'resourceType': 'Parameters', 'parameter': {}},
            {'resourceType': 'Parameters', 'parameter': [7, None, [], {'name': 7}]},
            {'resourceType': 'Bundle', 'entry': [1, {}, {'resource': 3}]},
            [], 7, 'x', None,
        ):
            self.refused(body)

    def test_the_person_is_given_back_and_never_logged(self):
        for reference, subject in (
            ({'reference': 'Patient/p-1.x'}, 'p-1.x'),
            ({'reference': 'https://ehr.example/fhir/Patient/9'}, None),
            ({'identifier': {'system': 'urn:oid:1.2.3', 'value': 'MRN-SECRET-7'}}, None),
            ({'reference': 'Patient/p-2', 'identifier': {'value': 'B'}}, 'p-2'),
        ):
            body = parameters(subject=None, F=360)
            body['parameter'].append(
                {'name': 'subject', 'valueReference': {**reference, 'display': 'Doe, Jane'}})
            document = post(self.service, body).json()
            self.emitted.append(document)
            risk = resources(document, 'RiskAssessment')[0]
            self.assertEqual(risk['subject'], reference)
            stored = self.service.get('/v1/assessments/' + risk['id']).json()['subject']
            self.assertRegex(stored, subject or '^x-[0-9a-f]{32}$')
            key = reference.get('reference', stored)
            found = self.get('RiskAssessment?subject=' + key).json()
            self.assertIn(risk['id'], [r['id'] for r in resources(found, 'RiskAssessment')])
        for bad in ({}, {'reference': 'Group/1'}, {'reference': 'Patient/'}, {'reference': 7},
                    {'reference': 'Patient/a b'}, {'reference': '#p'}, {'identifier': {}},
                    {'reference': 'Patient/1', 'type': 'Device'}, {'display': 'Jane Doe'},
                    {'reference': 'Patient/' + 'x' * 300}):
            body = parameters(subject=None)
            body['parameter'].append({'name': 'subject', 'valueReference': bad})
            text = json.dumps(self.refused(body))
            self.assertNotIn('Jane', text)
        for secret in ('ehr.example', 'SECRET', 'Doe', 'Patient/'):
            self.assertNotIn(secret, self.service.errors())
        self.assertNotIn('SECRET', admin(self.service.state, 'audit', 'list'))

    def test_answers_later_when_asked_to(self):
        answer = post(self.service, parameters(F=596), {'Prefer': 'respond-async'})
        self.assertEqual(answer.status, 202)
        self.assertEqual(answer.headers['Preference-Applied'], 'respond-async')
        self.emit(answer)
        where = answer.headers['Content-Location'].split(self.service.address)[1]
        steps = []
        while True:
            answer = self.service.get(where)
            if answer.status != 202:
                break
            steps.append(answer.headers['X-Progress'])
            self.assertIn('Retry-After', answer.headers)
            time.sleep(0.1)
        self.assertEqual(answer.status, 200)
        self.assertRegex(' '.join(steps), r'(queued|running), \d+ %')
        self.assertEqual(resources(answer.json(), 'RiskAssessment')[0]['status'], 'final')
        pending = post(self.service, parameters(F=599), {'Prefer': 'respond-async'})
        where = pending.headers['Content-Location'].split(self.service.address)[1]
        identity = where.rsplit('/', 1)[1]
        registered = self.emit(self.get('RiskAssessment/' + identity))
        self.assertEqual(registered['status'], 'registered')
        self.assertNotIn('prediction', registered)
        self.emit(self.get('DiagnosticReport/' + identity))
        for query, count in (('', 1), ('&date=lt1970-01-01', 0), ('&date=le2099', 0), ('&date=ge1969', 0),
                             ('&_lastUpdated=lt1970', 0), ('&_lastUpdated=ge1969', 1)):
            found = self.get(f'RiskAssessment?_id={identity}' + query).json()
            self.assertEqual(found['total'], count, query)
        self.assertEqual(self.get(f'Observation/{identity}-eps-max').status, 404)
        self.assertEqual(self.get(f'Observation/{identity}-R1').status, 200)
        self.assertEqual(self.service.ask('DELETE', where).status, 202)
        self.assertEqual(self.service.get(where).status, 409)
        self.assertEqual(self.emit(self.get('RiskAssessment/' + identity))['status'], 'cancelled')

    def test_what_it_says_it_can_do(self):
        (rest,) = self.emit(self.get('metadata'))['rest']
        of = {r['type']: r for r in rest['resource']}
        for kind in ('RiskAssessment', 'DiagnosticReport'):
            self.assertEqual([p['name'] for p in of[kind]['searchParam']],
                             ['subject', 'patient', 'date', '_lastUpdated', 'status', '_id'])
        definition = self.get('CodeSystem/band')
        self.assertNotIn('meta', definition.json())
        self.assertEqual({k: r['versioning'] for k, r in of.items()}, {
            **dict.fromkeys(('RiskAssessment', 'Observation', 'DiagnosticReport', 'Provenance'),
                            'versioned'),
            **dict.fromkeys(('Device', 'OperationDefinition', 'CodeSystem', 'StructureDefinition'),
                            'no-version')})

    def test_times_have_capital_letters(self):
        sent = side(F=360, measured_at='2026-03-01t09:30:00.5z')
        identity = self.service.ask('POST', '/v1/assessments', sent, {'Prefer': 'wait=60'}).json()['id']
        for path in (f'Observation/{identity}-R1', f'DiagnosticReport/{identity}'):
            answer = self.emit(self.get(path))
            self.assertEqual(answer['effectiveDateTime'], '2026-03-01T09:30:00.5Z')

    def test_a_solve_that_fails_says_so(self):
        answer = post(self.service, parameters(F=598))
        self.assertEqual(answer.status, 422)
        self.assertEqual(issues(answer)[0]['code'], 'processing')
        found = self.emit(self.get('RiskAssessment?status=cancelled'))
        failed = resources(found, 'RiskAssessment')[0]
        self.assertIn('diverged', failed['note'][0]['text'])
        self.emit(self.get('DiagnosticReport/' + failed['id']))

    def test_the_same_key_is_the_same_assessment(self):
        key = {'Idempotency-Key': 'visit-1'}
        first = post(self.service, parameters(F=370), key)
        second = post(self.service, parameters(F=370), key)
        self.assertEqual(first.headers['Location'], second.headers['Location'])
        self.assertEqual(issues(post(self.service, parameters(F=371), key))[0]['code'], 'conflict')

    def test_search(self):
        for n in range(3):
            self.assess(subject='Patient/search', F=380 + n)
        base = 'RiskAssessment?subject=Patient/search'
        seen, path = [], base + '&_count=2'
        while path:
            page = self.emit(self.get(path))
            seen += [r['id'] for r in resources(page, 'RiskAssessment')]
            links = {k['relation']: k['url'] for k in page['link']}
            path = links['next'].split('/fhir/')[1] if 'next' in links else None
        self.assertEqual(len(set(seen)), 3)
        now = self.get(f'RiskAssessment/{seen[0]}').json()['meta']['lastUpdated']
        day = now[:10]
        for query, count in (
            ('', 3),
            (f'&date={day}', 3),
            (f'&date=ge{day}&date=le{day}', 3),
            (f'&date=lt{day}', 0),
            (f'&date=gt{day}', 0),
            ('&date=ge2026', 3),
            ('&_lastUpdated=ge2099-01', 0),
            (f'&_lastUpdated=eb{day}', 0),
            ('&status=final', 3),
            ('&status=registered,cancelled', 0),
            ('&status=http://hl7.org/fhir/observation-status|final', 3),
            ('&status=unknown', 0),
            (f'&_id={seen[1]}', 1),
            ('&_id=x', 0),
            (f'&_id={seen[1]}&status=final', 1),
            (f'&_id={seen[1]}&status=cancelled', 0),
            (f'&_id={seen[1]}&date=lt{day}', 0),
            (f'&_id={seen[1]}&_id={seen[1].upper()}', 1),
            (f'&_id={seen[1]}&_id={seen[2]}', 0),
            # a comma is "or", a parameter that comes again "and"
            (f'&_id={seen[0]},{seen[2]}', 2),
            (f'&_id={seen[0]},x,{seen[2].upper()}&_id={seen[2]},{seen[1]}', 1),
            ('&_id=x,y', 0),
            ('&status=final,unknown', 3),
            ('&status=unknown,registered', 0),
            ('&status=final&status=cancelled', 0),
            (f'&date=lt{day},{day}', 3),
            (f'&date=lt{day},gt{day}', 0),
            (f'&_lastUpdated=ge2099,{day}T00:00:00Z,ge{day[:4]}', 3),
            ('&patient=nobody,search', 3),
            ('&patient=nobody%2CPatient/nobody', 0),
        ):
            found = self.get((base + query).replace('|', '%7C')).json()
            self.assertEqual(found['total'], count, query)
            self.assertEqual(found['type'], 'searchset')
        self.assertEqual(self.get('RiskAssessment?patient=search').json()['total'], 3)
        others = self.emit(self.get(f'RiskAssessment?patient=nobody&_id={seen[1]}'))
        self.assertEqual(others['total'], 0)
        self.assertNotIn('entry', others)  # FHIR has no empty arrays
        for several in ('subject=nobody,search', 'patient=Patient/search,Patient/search',
                        'subject:Patient=a%5C,b,search', 'subject=a%5C%5C,search'):
            page = self.get('RiskAssessment?' + several).json()
            self.assertEqual(page['total'], 3, several)
            link = page['link'][0]['url'].split('/fhir/')[1]
            self.assertEqual(self.get(link).json()['total'], 3, several)
        self.assertEqual(self.get('RiskAssessment?patient=search&subject=nobody').json()['total'], 0)
        reports = self.emit(self.get('DiagnosticReport?patient=search'))
        self.assertEqual(reports['total'], 3)
        form = {'Content-Type': 'application/x-www-form-urlencoded'}
        posted = self.service.ask(
            'POST', '/fhir/RiskAssessment/_search', b'subject=Patient%2Fsearch', form)
        self.assertEqual(posted.json()['total'], 3)
        for bad in ('date=yesterday', 'date=ne2026', 'status=maybe', '_count=0', '_count=501',
                    '_cursor=x', 'subject=', 'colour=red', 'date=2026-02-30', 'date=%zz',
                    'status=', '_id=', 'subject=,', 'status=final,', '_id=,x', 'date=2026,,2025',
                    'date=2026,yesterday', 'status=final,maybe', '_count=1,2'):
            answer = self.get('RiskAssessment?' + bad)
            self.assertEqual(answer.status, 400, bad)
            issues(answer)
        many = ','.join(seen * 11)  # 33 values
        (issue,) = issues(self.get('RiskAssessment?_id=' + many))
        self.assertEqual(issue['code'], 'too-costly')
        self.assertEqual(self.get('RiskAssessment?_id=' + many[:-37]).json()['total'], 3)
        lenient = self.get(base + '&colour=red', Prefer='handling=lenient')
        self.assertEqual(lenient.json()['total'], 3)
        self.assertNotIn('colour', lenient.json()['link'][0]['url'])

    def test_a_comma_of_the_value_itself_is_escaped(self):
        person = 'https://ehr.example/fhir/Patient/9,$1'
        risk = resources(self.assess(subject=person, F=384), 'RiskAssessment')[0]
        self.assertEqual(risk['subject'], {'reference': person})
        for written in (person.replace(',', '%5C,'), person.replace(',$', '%5C,%5C$')):
            page = self.emit(self.get('RiskAssessment?subject=' + written))
            self.assertEqual([r['id'] for r in resources(page, 'RiskAssessment')], [risk['id']])
            link = page['link'][0]['url'].split('/fhir/')[1]
            self.assertEqual(self.get(link).json()['total'], 1)

    def test_representations_and_errors(self):
        self.assertEqual(self.get('metadata?_format=json').status, 200)
        self.assertEqual(self.get('metadata?_format=application/fhir%2Bjson').status, 200)
        self.assertEqual(self.get('metadata', Accept='application/json').type, 'application/json')
        self.assertIn(b'\n  ', self.get('metadata?_pretty=true').body)
        long = b' ' * (256 * 1024 + 1)
        for answer, status, code in (
            (self.get('metadata?_format=xml'), 406, 'not-supported'),
            (self.get('metadata', Accept='application/fhir+xml'), 406, 'not-supported'),
            (post(self.service, b'<x/>', {'Content-Type': 'application/fhir+xml'}), 415,
             'not-supported'),
            (post(self.service, b'{'), 400, 'structure'),
            (post(self.service, b'{"a":1,"a":2}'), 422, 'duplicate'),
            (post(self.service, b'[' * 100), 400, 'structure'),
            (post(self.service, b'\xff'), 400, 'structure'),
            (post(self.service, long), 413, 'too-long'),
            (self.get('Patient/1'), 404, 'not-found'),
            (self.get(''), 404, 'not-found'),
            (self.get('RiskAssessment/1/_history/1'), 404, 'not-found'),
            (self.service.ask('PUT', '/fhir/RiskAssessment/1'), 405, 'not-supported'),
            (self.service.get('/fhir'), 404, 'not-found'),
            # Where tokens are needed any name will do.
            *(() if PROXY else (
                (self.service.get('/fhir/metadata', Host='evil.example'), 403, 'forbidden'),)),
        ):
            self.assertEqual(answer.status, status, answer.body)
            self.assertIn(code, [i['code'] for i in issues(answer)])
            self.emit(answer)
        self.assertEqual(self.service.get('/fhirx').type, 'application/problem+json')
        risk = resources(self.assess(F=390), 'RiskAssessment')[0]
        answer = self.get('RiskAssessment/' + risk['id'])
        self.assertEqual(answer.headers['ETag'], f'W/"{risk["meta"]["versionId"]}"')
        self.assertEqual(
            self.get('RiskAssessment/' + risk['id'], If_None_Match=answer.headers['ETag']).status,
            304)


    def test_zz_all_that_was_emitted_passes_both_validators(self):
        kinds = {d['resourceType'] for d in self.emitted}
        self.assertGreaterEqual(kinds, {*READ, 'Bundle', 'OperationOutcome', 'Observation'})
        self.assertEqual(interop.complaints(self.emitted), '')
        broken = {**self.emitted[0], 'status': 'maybe', 'type': 7}
        self.assertNotEqual(interop.complaints([broken]), '')


class Refusals(unittest.TestCase):
    @direct_only('has no token at first')
    def test_queue_full_rate_and_tokens_are_outcomes(self):
        with Service('--queue-limit', '1') as service:
            service.until_ready()
            later = {'Prefer': 'respond-async'}
            post(service, parameters(F=599), later)
            answers = [post(service, parameters(F=300 + n), later) for n in range(4)]
            full = [a for a in answers if a.status == 429]
            self.assertTrue(full)
            self.assertEqual(issues(full[0])[0]['code'], 'throttled')
            self.assertIn('Retry-After', full[0].headers)
        with Service('--rate-limit', '1', '--rate-burst', '2') as service:
            token = admin(service.state, 'token', 'create', 'scope=read').split()[-1]
            time.sleep(1.5)
            self.assertEqual(issues(service.get('/fhir/RiskAssessment'))[0]['code'], 'login')
            read = {'Authorization': 'Bearer ' + token}
            self.assertEqual(
                issues(post(service, parameters(), read))[0]['code'], 'forbidden')
            answers = [service.ask('GET', '/fhir/RiskAssessment', headers=read) for _ in range(5)]
            self.assertIn(429, [a.status for a in answers])
            self.assertEqual(
                issues([a for a in answers if a.status == 429][0])[0]['code'], 'throttled')


if __name__ == '__main__':
    unittest.main()
