#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""bash's completions: every command and option that the programs have is offered, and fits the
place where it is offered."""
import os
import re
import shlex
import subprocess
import unittest

FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), '../../deploy/completion')
PROGRAMS = {'ischia': os.environ['ISCHIA'], 'ischiad': os.environ['ISCHIAD']}


def said(program, *words):
    return subprocess.run([PROGRAMS[program], *words], capture_output=True, text=True).stdout


def offered(program, *words):
    """What bash would offer for the last word."""
    typed = ' '.join(shlex.quote(word) for word in (PROGRAMS[program], *words))
    script = (f'source {shlex.quote(os.path.join(FOLDER, program))}\nCOMP_WORDS=({typed})\n'
              f'COMP_CWORD={len(words)}\n_{program}\nprintf "%s\\n" "${{COMPREPLY[@]}}"')
    done = subprocess.run(['bash', '--norc', '-c', script], capture_output=True, text=True,
                          check=True, cwd=FOLDER)
    assert not done.stderr, done.stderr
    return set(done.stdout.split())


class Completion(unittest.TestCase):
    def test_commands_of_ischia(self):
        commands = set(re.findall(r'^  ([a-z-]+)  ', said('ischia', 'help'), re.M))
        self.assertIn('solve', commands)
        self.assertEqual(offered('ischia', ''), commands)
        self.assertEqual(offered('ischia', 'help', ''), commands)
        self.assertEqual(offered('ischia', 'coh'), {'cohort'})
        self.assertEqual(offered('ischia', 'study', 'f'), {'factorial'})

    def test_options_of_every_command(self):
        for command in offered('ischia', '') - {'help', 'study'}:
            options = set(re.findall(r'--[a-z-]+', ' '.join(re.findall(
                r'^ +(?:-\w, )?--[a-z-]+', said('ischia', command, '--help'), re.M))))
            self.assertIn('--help', options, command)
            self.assertEqual(offered('ischia', command, '--'), options)
        self.assertIn('--shard', offered('ischia', 'study', 'factorial', '-'))
        self.assertEqual(offered('ischia', 'solve', '--resolution', ''), {'standard', 'fine', 'coarse'})

    def test_options_of_ischiad(self):
        options = {'--' + line.split(' =')[0].replace('_', '-')
                   for line in said('ischiad', '--print-config').splitlines()
                   if line and not line.startswith('#')}
        self.assertGreater(len(options), 40)
        self.assertFalse(options - offered('ischiad', '--'))
        self.assertEqual(offered('ischiad', '--tls'), {'--tls-certificate', '--tls-key'})

    def test_commands_of_ischiad(self):
        commands = set(re.findall(r'^  ([a-z]+) ', said('ischiad', '--help'), re.M))
        self.assertTrue({'token', 'audit', 'backup', 'restore'} <= commands)
        self.assertEqual(offered('ischiad', ''), commands)
        self.assertEqual(offered('ischiad', '--state-dir', '/x', 'token', ''),
                         {'create', 'list', 'revoke', 'forget'})
        self.assertEqual(offered('ischiad', 'backup', 'isch'), {'ischia', 'ischiad'}, 'files')


if __name__ == '__main__':
    unittest.main()
