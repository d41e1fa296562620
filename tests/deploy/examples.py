#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The unit, and the example for Caddy, as their own programs judge them."""
import glob
import os
import re
import shutil
import subprocess
import tempfile
import unittest

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), '../..')
UNIT = os.path.join(ROOT, 'deploy/ischiad.service')


def read(*path):
    with open(os.path.join(ROOT, *path), encoding='utf-8') as file:
        return file.read()


class Unit(unittest.TestCase):
    @unittest.skipUnless(shutil.which('systemd-analyze'), 'systemd is not installed')
    def test_the_unit_is_hardened_and_understood(self):
        done = subprocess.run(['systemd-analyze', 'security', '--offline=yes', '--threshold=15', UNIT],
                              capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertNotIn('ignoring', done.stdout + done.stderr)
        level = re.search(r'exposure level for ischiad.service: ([\d.]+)', done.stdout)
        self.assertLessEqual(float(level[1]), 1.5)

    def test_versions_agree(self):
        version = re.search(r"version: '([^']+)'", read('meson.build'))[1]
        self.assertEqual(re.match(r'ischia \(([^)]+)\)', read('deploy/debian/changelog'))[1], version)
        self.assertIn(f'/ischia:{version}\n', read('deploy/kubernetes/ischia.yaml'))

    def test_every_example_says_its_licence(self):
        for path in glob.glob(os.path.join(ROOT, 'deploy/*/*')):
            if re.search(r'\.(json|changelog)$|/debian/|/logrotate/', path) or os.path.isdir(path):
                continue
            with open(path, encoding='utf-8') as file:
                self.assertIn('SPDX-License-Identifier', file.readline() + file.readline(), path)


class Caddy(unittest.TestCase):
    @unittest.skipUnless(shutil.which('caddy'), 'caddy is not installed (package caddy)')
    def test_the_example_is_read_and_every_site_drops_or_sets_the_name(self):
        with tempfile.TemporaryDirectory() as folder:
            authority = os.path.join(folder, 'ca.pem')
            subprocess.run(['openssl', 'req', '-x509', '-newkey', 'ec', '-pkeyopt',
                            'ec_paramgen_curve:prime256v1', '-nodes', '-days', '1', '-subj', '/CN=x',
                            '-out', authority, '-keyout', os.path.join(folder, 'key')],
                           check=True, capture_output=True)
            text = read('deploy/caddy/Caddyfile').replace('/etc/ssl/ischia/clients-ca.pem', authority)
            path = os.path.join(folder, 'Caddyfile')
            with open(path, 'w', encoding='utf-8') as file:
                file.write(text)
            done = subprocess.run(['caddy', 'adapt', '--config', path, '--adapter', 'caddyfile'],
                                  capture_output=True, text=True, env={**os.environ, 'HOME': folder})
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertNotIn('not formatted', done.stderr)
            proxies = done.stdout.count('"127.0.0.1:8080"')
            names = done.stdout.count('X-Ischia-User')
            self.assertGreaterEqual(names, proxies, 'a way to the service without')


if __name__ == '__main__':
    unittest.main()
