#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""HL7 v2.5.1 over MLLP: what is acknowledged, what is refused and how, and that nothing is lost."""
import contextlib
import json
import os
import ssl
import subprocess
import tempfile
import time
import unittest

import hl7
import interop
from hl7 import FS, VT, Mllp, number, oru
from service import SIDE, Service, admin

ISCHIA = os.environ.get('ISCHIA', 'ischia')


class Hl7(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        interop.install()
        cls.service = Service('--hl7-listen', '127.0.0.1:0')
        cls.service.until_ready()
        cls.port = hl7.port_of(cls.service)

    @classmethod
    def tearDownClass(cls):
        cls.service.stop()

    def stored(self):
        changes = self.service.get('/v1/changes?limit=500').json()['items']
        return [c['change'] for c in changes].count('created')

    def last(self):
        return self.service.get('/v1/assessments?limit=1').json()['items'][0]

    def ask(self, text):
        with Mllp(self.port) as link:
            return link.ask(text)

    def refused(self, text, code, *errors):
        """Nothing is stored, and the acknowledgement says where and why."""
        before = self.stored()
        answer = self.ask(text)
        self.assertEqual(answer[0], code, answer)
        for error in errors:
            self.assertIn(error, answer[2])
        self.assertEqual(self.stored(), before)
        return answer

    def test_a_client_of_others_exchanges_messages(self):
        messages = [oru('node-1', F=301), oru('node-2', F=302), oru('node-3', muM=99)]
        done = interop.node('hl7_client.mjs', str(self.port), input=json.dumps(messages))
        self.assertEqual(done.returncode, 0, done.stderr)
        answers = json.loads(done.stdout)
        self.assertEqual([(a['type'], a['ack'], a['id']) for a in answers],
                         [('ACK', 'AA', 'node-1'), ('ACK', 'AA', 'node-2'),
                          ('ACK', 'AE', 'node-3')])

    def test_a_message_is_an_assessment(self):
        self.assertEqual(self.ask(oru('m-1', F=303, side='right')), ('AA', 'm-1', []))
        document = self.last()
        self.assertEqual(document['parameters'], {**SIDE, 'F': 303})
        self.assertEqual((document['subject'], document['side']), ('P-017', 'right'))
        self.assertNotIn('Doe', json.dumps(document))

    def test_numbers_as_hl7_writes_them(self):
        text = oru('n-1', R1='+07.10', R2='22.8', F='.304e3')
        self.refused(text, 'AE', ('OBX^7^5', '102', 'wrong_type'))
        self.assertEqual(self.ask(oru('n-2', R1='+07.10', eF='010.', F='304'))[0], 'AA')
        document = self.last()
        self.assertEqual(document['parameters'], {**SIDE, 'F': 304})
        digits = self.service.get(f'/fhir/Observation/{document["id"]}-R1').body
        self.assertIn(b'"value":7.10,', digits)

    def test_units_are_converted_or_refused(self):
        centimetres = oru('u-1', F=305).replace('|7.1|mm^^UCUM', '|0.71|cm')
        self.assertEqual(self.ask(centimetres)[0], 'AA')
        self.assertEqual(self.last()['parameters']['R1'], 7.1)
        for unit, code in (('', 'missing'), ('kPa^^UCUM', 'unsupported'),
                           ('mm^^ANS+', 'unsupported'), ('ell', 'unsupported')):
            answer = self.refused(oru('u-2').replace('|7.1|mm^^UCUM', '|7.1|' + unit), 'AE')
            self.assertIn(code, [e[2] for e in answer[2]], (unit, answer))

    def test_standard_deviations_are_taken(self):
        def message(control_id, *rows):
            return oru(control_id, F=332, extra=rows)

        spread = number(9, 'sd.R2', '0.6', 'cm'), number(10, 'sd.F', '20', 'N^^UCUM')
        self.assertEqual(self.ask(message('sd-1', *spread))[0], 'AA')
        given = {k: v for k, v in self.last()['sd'].items() if v}
        self.assertEqual(given, {'R2': 6, 'F': 20})
        typical = 'OBX|9|ST|sd^^99ISCHIA||typical||||||F'
        self.assertEqual(self.ask(message('sd-2', typical))[0], 'AA')
        self.assertEqual(self.last()['sd'], 'typical')
        unit = number(9, 'sd.R2', '6', '')
        self.refused(message('sd-3', unit), 'AE', ('OBX^9^6', '101', 'missing'))
        unknown = number(9, 'sd.eps_max', '6', '1')
        self.refused(message('sd-4', unknown), 'AE', ('OBX^9^3', '204', 'unknown'))

    def test_the_same_control_id_is_one_assessment(self):
        first = oru('twice', F=306)
        self.assertEqual(self.ask(first), ('AA', 'twice', []))
        before = self.stored()
        for _ in range(3):
            self.assertEqual(self.ask(first), ('AA', 'twice', []))
        self.assertEqual(self.stored(), before)
        self.refused(oru('twice', F=307), 'AE', ('MSH^1^10', '205', 'duplicate'))
        other = oru('twice', F=306).replace('|EHR|WARD|', '|EHR|OTHER|')
        self.assertEqual(self.ask(other), ('AA', 'twice', []))
        self.assertGreater(self.stored(), before)

    def test_what_is_not_for_us_is_rejected(self):
        head = 'MSH|^~\\&|EHR|WARD|ISCHIA||20260301||{}|r-1|{}|{}'
        for msh, error in (
            (head.format('ADT^A01', 'P', '2.5.1'), ('MSH^1^9', '200', 'message_type')),
            (head.format('ORU^R30', 'P', '2.5.1'), ('MSH^1^9', '200', 'message_type')),
            (head.format('ORU^R01', 'X', '2.5.1'), ('MSH^1^11', '202', 'processing_id')),
            (head.format('ORU^R01', 'P', '3'), ('MSH^1^12', '203', 'version')),
            (head.format('ORU^R01', 'P', ''), ('MSH^1^12', '203', 'version')),
            (head.replace('r-1', '').format('ORU^R01', 'P', '2.5.1'),
             ('MSH^1^10', '101', 'missing')),
            (head.replace('EHR', 'ISCHIA').format('ORU^R01', 'P', '2.5.1'),
             ('MSH^1^3', '102', 'own_message')),
        ):
            self.refused(oru('', msh=msh), 'AR', error)

    def test_character_sets(self):
        head = 'MSH|^~\\&|EHR|WARD|||20260301||ORU^R01|{}|P|2.5.1||||||{}'
        label = 'OBX|9|ST|label^^99ISCHIA||Größe||||||F'
        good = (('c-1', 'UNICODE UTF-8', 'utf-8'), ('c-2', '8859/1', 'latin-1'))
        for control_id, name, codec in good:
            text = oru('', msh=head.format(control_id, name), extra=[label], F=308)
            self.assertEqual(self.ask(text.encode(codec))[0], 'AA')
            self.assertEqual(self.last()['label'], 'Größe')
        for control_id, name, codec in (('c-3', 'UNICODE UTF-8', 'latin-1'), ('c-4', '', 'utf-8'),
                                        ('c-5', 'ASCII', 'latin-1'), ('c-6', '8859/7', 'utf-8'),
                                        ('c-7', 'UNICODE UTF-16', 'utf-16')):
            text = oru('', msh=head.format(control_id, name), extra=[label])
            self.refused(text.encode(codec), 'AR', ('MSH', '102', 'malformed'))

    def test_escapes_and_other_delimiters(self):
        label = 'OBX|9|ST|label^^99ISCHIA||a\\F\\b\\S\\c\\T\\d\\R\\e\\E\\f\\X2A\\||||||F'
        self.assertEqual(self.ask(oru('e-1', extra=[label], F=309))[0], 'AA')
        self.assertEqual(self.last()['label'], 'a|b^c&d~e\\f*')
        for bad in ('\\H\\bold', 'open\\F', '\\X0D\\', '\\XZZ\\', '\\Xff\\', '\\.br\\'):
            text = oru('e-2', extra=[f'OBX|9|ST|label^^99ISCHIA||{bad}||||||F'])
            self.refused(text, 'AE', ('OBX^9^5', '102', 'malformed'))
        table = str.maketrans('|^~\\&', '!:*?%')
        self.assertEqual(self.ask(oru('e-3', pid='7^^^HOSP', F=310).translate(table))[0], 'AA')
        self.assertRegex(self.last()['subject'], '^x-')

    def test_content_that_cannot_be_used(self):
        for text, error in (
            (oru('b', muM=None), ('OBX', '101', 'missing')),
            (oru('b', muM=99), ('OBX^5^5', '102', 'out_of_range')),
            (oru('b', R2=5, R1=6), ('OBX^2^5', '102', 'out_of_range')),
            (oru('b', side='middle'), ('OBX^8^5', '103', 'not_allowed')),
            (oru('b', extra=[number(9, 'R1', 7.2)]), ('OBX^9^5', '205', 'duplicate')),
            (oru('b', extra=['PID|1||other']), ('PID', '205', 'duplicate')),
            (oru('b', extra=['MSH|^~\\&|x']), ('MSH', '205', 'duplicate')),
            (oru('b', extra=['OBX|9|NM|R3^^99ISCHIA||1|mm^^UCUM|||||F']),
             ('OBX^9^3', '204', 'unknown')),
            (oru('b', R1='7.1~7.2'), ('OBX^1^5', '205', 'duplicate')),
            (oru('b', R1='7,1'), ('OBX^1^5', '102', 'wrong_type')),
            (oru('b', R1='""'), ('OBX^1^5', '102', 'wrong_type')),
            (oru('b', R1=''), ('OBX^1^5', '102', 'wrong_type')),
            (oru('b', R1='9' * 300), ('OBX^1^5', '102', 'wrong_type')),
            (oru('b', R1=None, extra=[number(9, 'R1', 7.1, status='X')]),
             ('OBX^8^11', '103', 'not_allowed')),
            (oru('b', R1=None, extra=[number(9, 'R1', 7.1, type='SN')]),
             ('OBX^8^5', '102', 'wrong_type')),
            (oru('b', pid='x' * 300), ('PID^1^3', '102', 'malformed')),
            (oru('b').replace('OBR|1|order-7|', 'OBR|1|order-7|x^ISCHIA'),
             ('OBR^1^3', '102', 'own_message')),
        ):
            self.refused(text, 'AE', error)
        everything = self.refused(oru('b', R1=-1, eM=999, F='x'), 'AE')
        self.assertEqual(len(everything[2]), 3)

    def test_other_segments_and_observations_are_left_alone(self):
        extra = ['NTE|1||free text', 'ZZZ|own|things', 'OBR|2|order-8',
                 'OBX|9|NM|8302-2^Height^LN||180|cm', 'OBX|10|NM|eps_max^^99ISCHIA||1|1^^UCUM|||||F']
        self.assertEqual(self.ask(oru('x-1', extra=extra, F=311))[0], 'AA')
        self.assertEqual(self.ask(oru('x-2', F=312).replace('\r', '\r\n'))[0], 'AA')
        self.assertEqual(self.ask(oru('x-3', F=313).replace('\r', '\n'))[0], 'AA')

    def test_frames(self):
        message = VT + oru('f-1', F=314).encode() + FS
        with Mllp(self.port) as link:  # a byte at a time
            for i in range(len(message)):
                link.send(message[i:i + 1])
            self.assertEqual(hl7.ack(link.read())[0], 'AA')
        with Mllp(self.port) as link:  # three in one piece, with noise between
            link.send(b'noise' + message + b'\r\n' + VT + oru('f-2', F=315).encode() + FS + message)
            self.assertEqual([hl7.ack(link.read())[:2] for _ in range(3)],
                             [('AA', 'f-1'), ('AA', 'f-2'), ('AA', 'f-1')])
        before = self.stored()
        with Mllp(self.port) as link:  # a new message before the last one has ended
            link.send(VT + oru('f-3', F=316).encode() + message)
            self.assertEqual(hl7.ack(link.read())[:2], ('AR', 'f-3'))
            self.assertEqual(hl7.ack(link.read())[:2], ('AA', 'f-1'))
        with Mllp(self.port) as link:  # FS without CR
            link.send(VT + oru('f-4', F=317).encode() + b'\x1cX')
            self.assertEqual(hl7.ack(link.read()), ('AR', 'f-4', [('MSH', '100', 'framing')]))
        with Mllp(self.port) as link:  # half a message and good-bye
            link.send(VT + oru('f-5', F=318).encode()[:200])
        for junk in (b'GET / HTTP/1.1\r\n' * 1000, b'\0' * 5000):
            with Mllp(self.port) as link:
                link.send(junk)
                self.assertEqual(hl7.ack(link.read())[0], 'AR')
                with contextlib.suppress(ConnectionResetError):  # bytes of it were not read
                    self.assertIsNone(link.read())
        with Mllp(self.port) as link:
            try:
                link.send(VT + b'M' * (300 * 1024))
                answer = link.read()
            except OSError:
                answer = None  # reset before the answer was read: the rest was still on its way
            if answer:
                self.assertEqual(hl7.ack(answer)[0], 'AR')
        for body in (b'', b'MSH', b'MSH|^~\\&|', b'MSH||||||||||', b'MSHaaaaaaaaa', b'\0', b'\xff\xfe',
                     b'PID|1', b'MSH|^~\\&' + b'|' * 1000, b'MSH|^~\\&|' + b'\rOBX' * 2000):
            self.refused(body, 'AR')
        self.assertEqual(self.stored(), before)

    def test_many_connections_and_those_that_say_nothing(self):
        silent = [Mllp(self.port) for _ in range(32)]
        with Mllp(self.port) as link:  # the thirty-third is turned away
            try:
                link.send(VT + oru('k-1').encode() + FS)
                self.assertIsNone(link.read())
            except OSError:
                pass
        for link in silent:
            link.socket.close()
        time.sleep(0.2)
        self.assertEqual(self.ask(oru('k-2', F=319))[0], 'AA')

    def test_nothing_of_the_person_is_logged(self):
        self.ask(oru('l-1', pid='SECRET-7^^^HOSP', F=320))
        document = self.last()
        self.assertRegex(document['subject'], '^x-[0-9a-f]{32}$')
        for secret in ('SECRET', 'Doe', 'order-7', 'EHR'):
            self.assertNotIn(secret, self.service.errors())
            self.assertNotIn(secret, admin(self.service.state, 'audit', 'list'))
        risk = self.service.get('/fhir/RiskAssessment/' + document['id']).json()
        self.assertEqual(risk['subject'], {'identifier': {'value': 'SECRET-7'}})

    def test_the_command_line_sends_a_side(self):
        def send(text, *words):
            return subprocess.run([ISCHIA, 'hl7', *words], input=text, capture_output=True,
                                  text=True, timeout=60)

        address = f'127.0.0.1:{self.port}'
        done = send(json.dumps({**SIDE, 'F': 321, 'subject': 'cli', 'side': 'left'}), 'send', address)
        self.assertEqual((done.returncode, done.stderr), (0, ''))
        self.assertIn('MSA|AA|', done.stdout)
        document = self.last()
        self.assertEqual((document['subject'], document['parameters']), ('cli', {**SIDE, 'F': 321}))
        shown = send(json.dumps(SIDE), 'message')
        self.assertEqual(shown.stdout.count('OBX|'), 7 + len(('resolution', 'model')))
        self.assertEqual(send(shown.stdout, 'send', address).returncode, 0)
        self.assertEqual(send('MSH|^~\\&|x', 'send', address).returncode, 1)
        self.assertEqual(send('{"R1": 1}', 'send', address).returncode, 2)
        self.assertEqual(send('MSH|^~\\&|', 'send', '127.0.0.1:1').returncode, 1)
        self.assertEqual(send('', 'send').returncode, 2)


class Start(unittest.TestCase):
    def test_tls_takes_only_those_with_a_certificate(self):
        with tempfile.TemporaryDirectory() as folder:
            certificate, key = hl7.tls_files(folder, subprocess.run)
            options = ('--tls-certificate', certificate, '--tls-key', key, '--hl7-tls',
                       '--hl7-client-ca', certificate, '--hl7-listen', '127.0.0.1:0')
            with Service(*options) as service:
                port = hl7.port_of(service)
                with Mllp(port, hl7.client_context(certificate, key)) as link:
                    self.assertEqual(link.ask(oru('t-1'))[0], 'AA')
                with self.assertRaises((ssl.SSLError, OSError, AssertionError)):
                    with Mllp(port, hl7.client_context(certificate)) as link:
                        link.ask(oru('t-2'))
                with Mllp(port) as link:
                    link.send(VT + oru('t-3').encode() + FS)
                    with self.assertRaises((OSError, AssertionError)):
                        self.assertIsNotNone(link.read())

    def test_a_port_beyond_this_machine_needs_a_certificate(self):
        with self.assertRaisesRegex(AssertionError, 'hl7_client_ca'):
            Service('--hl7-listen', '0.0.0.0:0')

    def test_a_full_queue_is_said_to_the_sender_who_sends_again(self):
        with Service('--hl7-listen', '127.0.0.1:0', '--queue-limit', '1') as service:
            service.until_ready()
            with Mllp(hl7.port_of(service)) as link:
                link.ask(oru('q-0', F=599))
                answers = [link.ask(oru(f'q-{n}', F=300 + n)) for n in range(1, 5)]
            self.assertIn(('MSH', '207', 'queue_full'),
                          [e for a in answers for e in a[2]], answers)
            self.assertIn('AR', [a[0] for a in answers])


if __name__ == '__main__':
    unittest.main()
