# SPDX-License-Identifier: GPL-3.0-or-later
"""nginx in front of a service, with the example configuration of deploy/nginx and a certificate
made for the test."""
import functools
import os
import re
import shutil
import socket
import ssl
import subprocess
import tempfile
import time

EXAMPLES = os.path.join(os.path.dirname(os.path.abspath(__file__)), '../../deploy/nginx')
PATIENCE_S = 240
MAIN = """
daemon off;
pid {folder}/nginx.pid;
error_log stderr warn;
worker_processes 1;
{user}
events {{ worker_connections 2048; }}
http {{
    access_log off;
    client_body_temp_path {folder}/body;
    proxy_temp_path {folder}/proxy;
    fastcgi_temp_path {folder}/fastcgi;
    uwsgi_temp_path {folder}/uwsgi;
    scgi_temp_path {folder}/scgi;
    include {folder}/ischia.conf;
}}
"""


def openssl(*words):
    subprocess.run(['openssl', *words], check=True, capture_output=True)


class Authority:
    """A certificate authority for one process of tests."""

    def __init__(self, folder):
        self.folder = folder
        self.certificate = self.path('ca.pem')
        openssl('req', '-x509', '-newkey', 'ec', '-pkeyopt', 'ec_paramgen_curve:prime256v1',
                '-nodes', '-days', '1', '-subj', '/CN=Test authority', '-out', self.certificate,
                '-keyout', self.path('ca.key'))

    def path(self, name):
        return os.path.join(self.folder, name)

    def issue(self, name, subject, *alternatives):
        """Certificate and key for a subject like "/O=Hospital/CN=nurse"."""
        files = self.path(name + '.pem'), self.path(name + '.key')
        openssl('req', '-newkey', 'ec', '-pkeyopt', 'ec_paramgen_curve:prime256v1', '-nodes',
                '-subj', subject, '-out', self.path(name + '.csr'), '-keyout', files[1])
        extension = self.path(name + '.ext')
        with open(extension, 'w', encoding='utf-8') as file:
            if alternatives:
                file.write('subjectAltName=' + ','.join(alternatives))
        openssl('x509', '-req', '-days', '1', '-in', self.path(name + '.csr'), '-CA',
                self.certificate, '-CAkey', self.path('ca.key'), '-CAcreateserial', '-extfile',
                extension, '-out', files[0])
        return files

    def context(self, *pair):
        """What a client trusts, and the certificate that it shows."""
        context = ssl.create_default_context(cafile=self.certificate)
        if pair:
            context.load_cert_chain(*pair)
        return context


@functools.cache
def authority():
    folder = tempfile.TemporaryDirectory(prefix='ischia-ca-')
    made = Authority(folder.name)
    made.keep = folder
    made.server = made.issue('server', '/CN=localhost', 'DNS:localhost', 'IP:127.0.0.1')
    return made


def free_port():
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return probe.getsockname()[1]


class Front:
    """A running nginx; address is where it listens."""

    def __init__(self, daemon, example='ischia.conf', sign_in=None):
        self.folder = tempfile.mkdtemp(prefix='ischia-nginx-')
        for _ in range(10):  # somebody else may take the port that was free
            self.address = f'127.0.0.1:{free_port()}'
            self.write(daemon, example, sign_in)
            if self.start():
                return
        raise AssertionError('nginx did not start: ' + self.errors())

    def write(self, daemon, example, sign_in):
        made = authority()
        with open(os.path.join(EXAMPLES, example), encoding='utf-8') as file:
            text = file.read()
        for pattern, to in (
            (r'listen 443 ', f'listen {self.address} '),
            (r'server 127\.0\.0\.1:8080;', f'server {daemon};'),
            # Tests count the service's connections, and wait for a slow client's end.
            (r'keepalive 16;', 'keepalive 1;'),
            (r'/etc/ssl/ischia/fullchain\.pem', made.server[0]),
            (r'/etc/ssl/ischia/privkey\.pem', made.server[1]),
            (r'include ischia-proxy\.inc', f'include {EXAMPLES}/ischia-proxy.inc'),
        ):
            text, count = re.subn(pattern, to, text)
            assert count, pattern
        text = text.replace('/etc/ssl/ischia/clients-ca.pem', made.certificate)
        text = text.replace('client_header_timeout 20s', 'client_header_timeout 5s')
        if sign_in:
            text = text.replace('127.0.0.1:4180', sign_in)
        main = MAIN.format(folder=self.folder, user='user root;' if os.geteuid() == 0 else '')
        for name, content in (('ischia.conf', text), ('nginx.conf', main)):
            with open(os.path.join(self.folder, name), 'w', encoding='utf-8') as file:
                file.write(content)

    def start(self):
        """True when it listens; False when it gave up."""
        self.log = open(os.path.join(self.folder, 'stderr.txt'), 'ab')
        self.process = subprocess.Popen(
            ['nginx', '-p', self.folder, '-e', 'stderr', '-c', self.folder + '/nginx.conf'],
            stderr=self.log,
        )
        end = time.monotonic() + PATIENCE_S
        pid = os.path.join(self.folder, 'nginx.pid')  # written when the address is its own
        while self.process.poll() is None and time.monotonic() < end:
            if os.path.exists(pid) and os.path.getsize(pid) > 0:
                return True
            time.sleep(0.02)
        self.log.close()
        return False

    def errors(self):
        with open(self.log.name, encoding='utf-8', errors='replace') as file:
            return file.read()

    def stop(self):
        self.process.terminate()
        self.process.wait(PATIENCE_S)
        self.log.close()
        shutil.rmtree(self.folder, ignore_errors=True)
