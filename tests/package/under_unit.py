#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs a unit's ExecStart as systemd would, as far as that needs no systemd: its user, umask and
limits, no new privileges, the system calls, address families and memory that it may have.

Namespaces, cgroups and the watchdog are systemd's own work and are not tried here.

usage: under_unit.py ROOT UNIT [MORE WORDS OF THE COMMAND...]   as root; ROOT is a folder to chroot to
"""
import ctypes
import os
import pwd
import resource
import subprocess
import sys

ALLOW, ERRNO_EPERM = 0x7FFF0000, 0x00050000 | 1
NOT_EQUAL, LESS, EQUAL, MASKED_EQUAL = 1, 2, 4, 7
PROT_WRITE, PROT_EXEC, SHM_EXEC, CLONE_NEW = 2, 4, 0o100000, 0x7E020080
FAMILIES = {'AF_UNIX': 1, 'AF_INET': 2, 'AF_INET6': 10}
PR_SET_NO_NEW_PRIVS = 38


def read_unit(path):
    """{key: [values]} of the whole file: no key means two things in two sections."""
    options = {}
    with open(path, encoding='utf-8') as file:
        for line in file:
            key, equals, value = line.strip().partition('=')
            if equals and not key.startswith('#'):
                options.setdefault(key, []).append(value)
    return options


def group(name):
    """The system calls of "@name", groups in it included."""
    text = subprocess.run(['systemd-analyze', 'syscall-filter', name], check=True,
                          capture_output=True, text=True).stdout
    words = [line.strip() for line in text.splitlines()[1:]]
    return calls([word for word in words if word and not word.startswith('#')])


def calls(words):
    return {call for word in words for call in (group(word) if word[0] == '@' else {word})}


def allowed_calls(filters):
    """What SystemCallFilter= lines leave: the first kind is a list of what is allowed, `~` takes
    away, and later lines add again."""
    allowed = set()
    for line in filters:
        if line.startswith('~'):
            allowed -= calls(line[1:].split())
        else:
            allowed |= calls(line.split())
    return allowed | group('@default')


class Comparison(ctypes.Structure):
    _fields_ = [('argument', ctypes.c_uint), ('operator', ctypes.c_int),
                ('a', ctypes.c_uint64), ('b', ctypes.c_uint64)]


class Filter:
    """libseccomp, by its C interface."""

    def __init__(self):
        self.lib = ctypes.CDLL('libseccomp.so.2', use_errno=True)
        self.lib.seccomp_init.restype = ctypes.c_void_p
        self.lib.seccomp_load.argtypes = [ctypes.c_void_p]
        self.rule = self.lib.seccomp_rule_add_array
        self.rule.argtypes = [ctypes.c_void_p, ctypes.c_uint32, ctypes.c_int, ctypes.c_uint,
                              ctypes.POINTER(Comparison)]
        self.filters = []

    def start(self, default):
        self.filters.append(self.lib.seccomp_init(ctypes.c_uint32(default)))

    def add(self, action, call, *comparisons):
        number = self.lib.seccomp_syscall_resolve_name(call.encode())
        if number < 0:  # another architecture's
            return
        array = (Comparison * max(1, len(comparisons)))(*comparisons)
        done = self.rule(self.filters[-1], action, number, len(comparisons), array)
        if done != 0:
            raise OSError(-done, f'no rule for {call}')

    def load(self):
        for one in self.filters:
            if self.lib.seccomp_load(one) != 0:
                raise OSError('the filter cannot be loaded')


def build_filter(options):
    """One filter for each setting: all of them must agree, as systemd's."""
    filters = Filter()
    filters.start(ALLOW)
    if options.get('MemoryDenyWriteExecute') == ['yes']:
        both = PROT_WRITE | PROT_EXEC
        filters.add(ERRNO_EPERM, 'mmap', Comparison(2, MASKED_EQUAL, both, both))
        for call in ('mprotect', 'pkey_mprotect'):
            filters.add(ERRNO_EPERM, call, Comparison(2, MASKED_EQUAL, PROT_EXEC, PROT_EXEC))
        filters.add(ERRNO_EPERM, 'shmat', Comparison(2, MASKED_EQUAL, SHM_EXEC, SHM_EXEC))
    families = options.get('RestrictAddressFamilies', [''])[0].split()
    if families:
        known = sorted(FAMILIES[name] for name in families)
        filters.add(ERRNO_EPERM, 'socket', Comparison(0, 5, known[-1] + 1))
        for number in set(range(known[-1] + 1)) - set(known):
            filters.add(ERRNO_EPERM, 'socket', Comparison(0, EQUAL, number))
    filters.start(ERRNO_EPERM)
    for call in sorted(allowed_calls(options['SystemCallFilter'])):
        filters.add(ALLOW, call)
    return filters


def become(root, options, filters):
    user = options['User'][0]
    os.chroot(root)
    os.chdir('/')
    entry = pwd.getpwnam(user)
    state = os.path.join('/var/lib', options['StateDirectory'][0])
    os.makedirs(state, exist_ok=True)
    os.chown(state, entry.pw_uid, entry.pw_gid)
    os.chmod(state, int(options['StateDirectoryMode'][0], 8))
    for name in ('NOFILE', 'CORE'):
        which = getattr(resource, 'RLIMIT_' + name)
        most = resource.getrlimit(which)[1]  # this machine may not let root raise it
        value = int(options['Limit' + name][0])
        value = value if most == resource.RLIM_INFINITY else min(value, most)
        resource.setrlimit(which, (value, value))
    os.umask(int(options['UMask'][0], 8))
    os.setgroups([])
    os.setgid(entry.pw_gid)
    os.setuid(entry.pw_uid)
    if ctypes.CDLL(None).prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0:
        raise OSError('no_new_privs')
    filters.load()


def main(root, unit, *more):
    options = read_unit(unit)
    command = options['ExecStart'][0].split() + list(more)
    filters = build_filter(options)
    become(root, options, filters)
    os.execve(command[0], command, {'PATH': '/usr/sbin:/usr/bin:/sbin:/bin', 'LANG': 'C.UTF-8'})


if __name__ == '__main__':
    main(*sys.argv[1:])
