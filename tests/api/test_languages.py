#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""What people read comes in their language: pages, the section's picture, refusals. Without a word
about languages it is English, and what programs read is the same in every language."""
import json
import os
import re
import unittest
import urllib.parse

from service import HERE, SIDE, Service, direct_only, eventually, side

ABSENT = '/v1/assessments/01a201a9-49a6-75d9-8b79-1f36e7bd6914'
FORM = {'Content-Type': 'application/x-www-form-urlencoded', 'Accept': 'text/html'}


def words(tag):
    with open(os.path.join(HERE, '../../words', f'{tag}.json'), encoding='utf-8') as file:
        return json.load(file)


WORDS = {tag: words(tag) for tag in ('en', 'fr', 'de')}


class Languages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.service = Service('--emulator', 'none', '--study-limit', '100')
        cls.service.until_ready()
        answer = cls.service.ask('POST', '/v1/assessments', side(subject='P-1', side='left', R2=80),
                                 {'Prefer': 'wait=60'})
        cls.id = answer.json()['id']
        cls.path = f'/v1/assessments/{cls.id}'

    @classmethod
    def tearDownClass(cls):
        cls.service.stop()

    def in_language(self, answer, tag):
        """Says which language it is in, and that another client may get another."""
        self.assertEqual(answer.headers['Content-Language'], tag)
        self.assertIn('Accept-Language', ', '.join(answer.headers.get_all('Vary')))
        return answer

    def ask(self, path, tag, accept):
        headers = {} if accept is None else {'Accept-Language': accept}
        return self.in_language(self.service.ask('GET', path, headers=headers), tag)

    def test_the_header_says_what_the_client_reads(self):
        for accept, tag in (
            (None, 'en'), ('', 'en'), ('de', 'de'), ('fr-CA', 'fr'), ('DE-ch;q=0.8', 'de'),
            ('it, fr;q=0.3, de;q=0.7', 'de'), ('en-GB, de;q=0.9', 'en'), ('it', 'en'), ('*', 'en'),
            ('en;q=0, *', 'de'), ('de;q=0', 'en'), ('fra', 'en'), (';;,,-', 'en'),
            ('x' * 5000, 'en'),
        ):
            with self.subTest(accept=accept):
                body = self.ask(self.path + '/report', tag, accept).body.decode()
                self.assertIn(f'<html lang="{tag}">', body)
                self.assertIn(WORDS[tag]['report.title'], body)

    def test_the_address_comes_before_the_header(self):
        body = self.ask(self.path + '/report?lang=fr', 'fr', 'de').body.decode()
        self.assertIn('<html lang="fr">', body)
        self.assertIn(f'{self.path}/section.svg?lang=fr', body)
        picture = self.ask(self.path + '/section.svg?lang=de', 'de', 'fr')
        self.assertIn('xml:lang="de"', picture.body.decode())

    def test_an_unknown_language_is_refused_where_the_address_takes_one(self):
        for path in (self.path + '/report', self.path + '/section.svg', '/v1/parameters'):
            for tag in ('xx', 'DE', '', 'de&lang=fr', 'x' * 100):
                answer = self.service.get(f'{path}?lang={tag}')
                self.assertEqual(answer.status, 400, (path, tag))
                self.assertIn('en, de, fr', answer.json()['detail'])
        self.assertEqual(self.service.get(self.path + '?lang=fr').status, 400)
        self.assertEqual(self.service.get('/?lang=xx').status, 200)

    def test_each_language_has_a_tag_of_its_own(self):
        for path in ('/', self.path + '/section.svg', '/v1/parameters'):
            tags = {t: self.ask(path, t, t).headers['ETag'] for t in WORDS}
            self.assertEqual(len(set(tags.values())), len(tags), path)
            for tag in WORDS:
                again = self.service.get(path, Accept_Language=tag, If_None_Match=tags['fr'])
                self.assertEqual(again.status, 304 if tag == 'fr' else 200, (path, tag))
                self.in_language(again, tag)

    def test_a_file_without_words_is_one_file(self):
        answers = [self.service.get(self.path + '/field.vtu', Accept_Language=t) for t in WORDS]
        self.assertEqual(len({a.headers['ETag'] for a in answers}), 1)
        self.assertIsNone(answers[0].headers['Content-Language'])

    def test_refusals_are_worded_and_their_codes_stay(self):
        def refused(tag):
            answer = self.service.ask('POST', '/v1/assessments', side(R1=16, muM=None, colour='x'),
                                      {'Accept-Language': tag})
            return self.in_language(answer, tag).json()

        problems = {tag: refused(tag) for tag in WORDS}
        for tag, problem in problems.items():
            self.assertEqual(problem['type'], '/docs#problem-invalid')
            self.assertEqual(problem['title'], WORDS[tag]['daemon.problem.invalid'])
            self.assertEqual([(e['pointer'], e['code']) for e in problem['errors']],
                             [('/colour', 'unknown'), ('/R1', 'out_of_range'),
                              ('/muM', 'missing')])
            self.assertEqual(len({p['detail'] for p in problems.values()}), len(problems))
        details = {tag: p['errors'][2]['detail'] for tag, p in problems.items()}
        self.assertEqual(details['en'], 'muM is missing; accepted 0.5 to 30 kPa')
        self.assertIn('0,5 à 30 kPa', details['fr'])
        self.assertIn('0,5 bis 30 kPa', details['de'])

    def test_every_other_refusal_of_the_service(self):
        self.check_refusals(
            ('GET', '/nowhere', None, {}, 'daemon.refusal.no_address'),
            ('GET', ABSENT, None, {}, 'daemon.refusal.no_assessment'),
            ('GET', ABSENT + '/report', None, {}, 'daemon.refusal.no_assessment'),
            ('PUT', '/v1/assessments', None, {}, 'daemon.refusal.method'),
            ('GET', '/v1/assessments?side=up', None, {}, 'daemon.refusal.query'),
            ('GET', '/v1/assessments?cursor=zz', None, {}, 'daemon.refusal.query_cursor'),
            ('POST', '/v1/assessments', SIDE, {'Idempotency-Key': 'a b'}, None),
            ('POST', '/v1/assessments', b'{}', {'Content-Type': 'text/plain'}, None),
            ('GET', self.path + '/report?wait=x', None, {}, None),
            ('POST', '/v1/assessments', SIDE, {'Origin': 'http://elsewhere'},
             'daemon.refusal.origin'))

    def test_refusals_of_studies_and_estimates(self):
        kind = {'Content-Type': 'text/csv'}
        key = {**kind, 'Idempotency-Key': 'study'}

        def rows(force, count=1):
            row = ','.join(map(str, {**SIDE, 'F': force}.values()))
            return '\n'.join([','.join(SIDE)] + [row] * count).encode()

        def begun(body, status):
            where = self.service.ask('POST', '/v1/studies', body, key).headers['Location']
            eventually(lambda: self.service.get(where).json()['status'] == status, where)
            key['Idempotency-Key'] += 'x'
            return where

        ended, running = begun(rows(301), 'finished'), begun(rows(599, 60), 'running')
        self.check_refusals(
            ('POST', '/v1/studies?name=Jane%20Doe', rows(302), kind, 'daemon.refusal.study_name'),
            ('POST', '/v1/studies?name=x', {'name': 'x'}, {}, 'daemon.refusal.study_query'),
            ('POST', '/v1/studies?model=x&model=y', rows(302), kind, None),
            ('POST', '/v1/studies', rows(302), {**kind, 'Idempotency-Key': 'study'},
             'daemon.refusal.key_conflict'),
            ('POST', '/v1/studies', rows(303, 60), kind, None),  # full
            ('GET', '/v1/studies?limit=0', None, {}, None),
            ('POST', ended + '/cancel', None, {}, 'daemon.refusal.study_ended'),
            ('DELETE', running, None, {}, 'daemon.refusal.study_running'),
            ('GET', ended[:-1] + ('1' if ended[-1] == '0' else '0'), None, {},
             'daemon.refusal.no_study'),
            ('POST', '/v1/estimates', SIDE, {}, 'daemon.refusal.no_emulator'))
        answer = self.service.ask('POST', '/v1/studies', rows(303, 101),
                                  {**kind, 'Accept-Language': 'de'})
        self.assertEqual(answer.json()['errors'][0]['detail'], 'es sind mehr als 100 Zeilen')
        self.service.ask('POST', running + '/cancel')

    @direct_only('nginx says which host was asked')
    def test_a_strange_host(self):
        self.check_refusals(
            ('POST', '/v1/assessments', SIDE, {'Host': 'elsewhere'}, 'daemon.refusal.host'))

    def check_refusals(self, *cases):
        for method, path, body, headers, key in cases:
            details = {}
            for tag in WORDS:
                answer = self.service.ask(method, path, body, {**headers, 'Accept-Language': tag})
                self.assertGreaterEqual(answer.status, 400)
                details[tag] = self.in_language(answer, tag).json()['detail']
                if key is not None:
                    self.assertEqual(details[tag], WORDS[tag][key])
            self.assertEqual(len(set(details.values())), len(WORDS), details)
            self.assertNotRegex(''.join(details.values()), r'\{\w+\}')

    def test_a_document_is_a_record_and_english(self):
        for tag in WORDS:
            answer = self.service.get(self.path, Accept_Language=tag)
            document = answer.json()
            self.assertIsNone(answer.headers['Content-Language'])
            self.assertIn('the published study covers', document['warnings'][0]['detail'])
            self.assertEqual(answer.headers.get_all('Vary'), ['Accept-Encoding'])

    def test_protocols_of_programs_are_english(self):
        answer = self.service.get('/fhir/RiskAssessment/nothing', Accept_Language='fr')
        self.assertEqual(answer.status, 404)
        self.in_language(answer, 'en')
        answer = self.service.ask('POST', '/cds-services/ischia-patient-view', {'hook': 'x'},
                                  {'Accept-Language': 'fr'})
        self.in_language(answer, 'en')

    def test_names_and_helps_of_the_inputs(self):
        english = self.ask('/v1/parameters', 'en', None).json()
        french = self.ask('/v1/parameters?lang=fr', 'fr', 'de').json()
        for en, fr in zip(english['parameters'], french['parameters']):
            self.assertEqual(fr['name'], WORDS['fr'][f'daemon.param.{fr["key"]}.name'])
            self.assertNotEqual(en['description'], fr['description'])
            for key in ('key', 'unit', 'accepted', 'studied', 'aliases'):
                self.assertEqual(en[key], fr[key])

        def prose(value):
            """Every text that is there for people: the rest is the same in every language."""
            if isinstance(value, dict):
                found = [value[k] for k in ('name', 'description', 'headline')
                         if ' ' in str(value.get(k, ''))]
                return found + [t for v in value.values() for t in prose(v)]
            return [t for v in value for t in prose(v)] if isinstance(value, list) else []

        self.assertEqual(len(prose(english)), len(prose(french)))
        for en, fr in zip(prose(english), prose(french)):
            self.assertNotEqual(en, fr)

    def test_the_plain_form_and_its_answer_stay_in_the_language_of_the_address(self):
        page = self.ask('/form?lang=de', 'de', 'fr').body.decode()
        action = re.search(r'action="([^"]+)"', page)[1]
        self.assertEqual(action, '/v1/assessments?lang=de')
        self.assertIn('0,5 bis 30', page)
        body = urllib.parse.urlencode(side(muM='99,5', side='left'))
        refused = self.in_language(self.service.ask('POST', action, body, FORM), 'de')
        self.assertEqual(refused.status, 422)
        self.assertIn('muM ist 99,5 kPa; angenommen: 0,5 bis 30 kPa', refused.body.decode())
        self.assertIn('value="left" selected', refused.body.decode())
        body = urllib.parse.urlencode(side(muM='7,5', side='left'))
        taken = self.service.ask('POST', action, body, FORM)
        self.assertEqual(taken.status, 303)
        self.assertRegex(taken.headers['Location'], r'/report\?lang=de$')
        plain = self.service.ask('POST', '/v1/assessments', body, FORM)
        self.assertRegex(plain.headers['Location'], r'/report$')

    def test_a_report_that_waits_keeps_its_language(self):
        hanging = self.service.submit(wait=0, F=599)
        path = f'/v1/assessments/{hanging["id"]}'
        self.service.until(hanging['id'], 'running')
        page = self.ask(path + '/report?lang=fr', 'fr', 'de').body.decode()
        self.assertIn(WORDS['fr']['daemon.report.running'], page)
        self.assertIn('<input type="hidden" name="lang" value="fr">', page)
        field = self.ask(path + '/section.svg', 'fr', 'fr').json()
        self.assertIn('en cours', field['detail'])
        cancel = re.search(r'action="([^"]+cancel[^"]*)"', page)[1]
        answer = self.service.ask('POST', cancel, '', {**FORM, 'Accept': '*/*'})
        self.assertEqual((answer.status, answer.headers['Location']),
                         (303, path + '/report?lang=fr'))
        page = self.ask(path + '/report?lang=fr', 'fr', 'de').body.decode()
        self.assertIn(WORDS['fr']['daemon.report.no_result'], page)
        self.assertIn('annulée', page)

    def test_why_there_is_no_result(self):
        """The record is English; the page says it by the record's kind and numbers."""
        failed = self.service.submit(F=598)
        path = f'/v1/assessments/{failed["id"]}/report'
        document = self.service.until(failed['id'], 'failed')
        self.assertIn(document['problem']['detail'], self.ask(path, 'en', 'en').body.decode())
        for tag in ('fr', 'de'):
            page = self.ask(path, tag, tag).body.decode()
            self.assertNotIn(document['problem']['detail'], page)
            self.assertIn(WORDS[tag]['daemon.report.no_result'], page)
            self.assertIn(' 598 N', page)

    def test_nothing_english_is_left_in_a_report(self):
        """No text of the English file that differs from the other language's."""
        for tag in ('fr', 'de'):
            body = self.ask(self.path + '/report', tag, tag).body.decode()
            text = re.sub(r'<[^>]*>', '\n', body)
            for key, english in WORDS['en'].items():
                if english != WORDS[tag][key] and '{' not in english and len(english) > 7:
                    self.assertNotIn(english, text.split('\n'), key)
            numbers = re.sub(r'.*ISCHIA.*', '', text.replace('Ischia 0', 'ISCHIA'))
            self.assertNotRegex(numbers, r'\d\.\d')


if __name__ == '__main__':
    unittest.main()
