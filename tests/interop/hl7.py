# SPDX-License-Identifier: GPL-3.0-or-later
"""HL7 v2 for tests: messages, a plain MLLP client, and a record system that takes results."""
import re
import socket
import ssl
import threading
import time

from interop import SIDE, UNITS

VT, FS = b'\x0b', b'\x1c\r'


def number(sequence, key, value, unit=None, **fields):
    f = {'type': 'NM', 'status': 'F', 'system': '99ISCHIA', 'time': '', **fields}
    unit = f'{UNITS[key]}^^UCUM' if unit is None else unit
    return (f'OBX|{sequence}|{f["type"]}|{key}^^{f["system"]}||{value}|{unit}|||||{f["status"]}'
            f'|||{f["time"]}')


def oru(control_id, pid='P-017', side='left', extra=(), msh=None, **changes):
    values = {**SIDE, **changes}
    segments = [
        msh or f'MSH|^~\\&|EHR|WARD|ISCHIA||20260301093000||ORU^R01^ORU_R01|{control_id}|P|2.5.1',
        f'PID|1||{pid}||Doe^Jane',
        'OBR|1|order-7||tissue-strain^^99ISCHIA|||20260301093000',
    ]
    segments += [number(i + 1, k, v) for i, (k, v) in enumerate(values.items()) if v is not None]
    if side:
        segments.append(f'OBX|8|ST|side^^99ISCHIA||{side}||||||F')
    return '\r'.join([*segments, *extra]) + '\r'


def fields(text):
    """The segments of a message, each cut into fields."""
    return [s.split('|') for s in text.strip('\r').split('\r')]


def ack(text):
    """(AA/AE/AR, control id, [(where, 0357 code, our code)])"""
    assert text is not None, 'the connection ended'
    rows = fields(text)
    msa = next(r for r in rows if r[0] == 'MSA')
    errors = [(r[2], r[3].split('^')[0], r[5].split('^')[0]) for r in rows if r[0] == 'ERR']
    return msa[1], msa[2], errors


class Mllp:
    """One connection."""

    def __init__(self, port, context=None):
        self.socket = socket.create_connection(('127.0.0.1', port), 10)
        if context:
            self.socket = context.wrap_socket(self.socket, server_hostname='localhost')
        self.rest = b''

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()

    def send(self, data):
        self.socket.sendall(data)

    def read(self):
        """The next framed answer, None at the end."""
        while FS not in self.rest:
            piece = self.socket.recv(65536)
            if not piece:
                return None
            self.rest += piece
        frame, self.rest = self.rest.split(FS, 1)
        assert frame[:1] == VT, frame
        return frame[1:].decode()

    def ask(self, text):
        data = text if isinstance(text, bytes) else text.encode()
        self.send(VT + data + FS)
        return ack(self.read())


def port_of(service):
    """The HL7 port that the log names."""
    for _ in range(100):
        found = re.search(r'mllp://127\.0\.0\.1:(\d+)', service.errors())
        if found:
            return int(found[1])
        time.sleep(0.05)
    raise AssertionError('no HL7 port')


class Peer(threading.Thread):
    """A record system: takes messages, answers AA (or what `answers` says next)."""

    def __init__(self, port=0, answers=(), context=None):
        super().__init__(daemon=True)
        self.listener = socket.create_server(('127.0.0.1', port))
        self.port = self.listener.getsockname()[1]
        self.answers, self.context, self.messages = list(answers), context, []
        self.start()

    def run(self):
        while True:
            try:
                connection, _ = self.listener.accept()
            except OSError:
                return
            threading.Thread(target=self.serve, args=(connection,), daemon=True).start()

    def serve(self, connection):
        data = b''
        try:
            if self.context:
                connection = self.context.wrap_socket(connection, server_side=True)
            while True:
                piece = connection.recv(65536)
                if not piece:
                    return
                data += piece
                while FS in data:
                    frame, data = data.split(FS, 1)
                    self.take(connection, frame[1:].decode())
        except OSError:
            return

    def take(self, connection, text):
        code = self.answers.pop(0) if self.answers else 'AA'
        if code == 'hang up':
            connection.close()
            return
        self.messages.append(text)
        control_id = fields(text)[0][9]
        answer = f'MSH|^~\\&|EHR|||||| ACK|1|P|2.5.1\rMSA|{code}|{control_id}\r'
        connection.sendall(VT + answer.encode() + FS)

    def wait(self, count, seconds=120):
        end = time.monotonic() + seconds
        while len(self.messages) < count:
            assert time.monotonic() < end, f'{len(self.messages)} of {count} arrived'
            time.sleep(0.05)
        return self.messages

    def close(self):
        self.listener.close()


def tls_files(folder, run):
    """A certificate for localhost, its key, signed by itself."""
    certificate, key = f'{folder}/certificate.pem', f'{folder}/key.pem'
    run(['openssl', 'req', '-x509', '-newkey', 'ec', '-pkeyopt', 'ec_paramgen_curve:P-256',
         '-nodes', '-days', '2', '-subj', '/CN=localhost', '-addext',
         'subjectAltName=DNS:localhost,IP:127.0.0.1', '-keyout', key, '-out', certificate],
        check=True, capture_output=True)
    return certificate, key


def client_context(certificate, key=None):
    context = ssl.create_default_context(cafile=certificate)
    if key:
        context.load_cert_chain(certificate, key)
    return context
