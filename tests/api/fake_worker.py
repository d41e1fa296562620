#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""A worker that solves nothing: it speaks the worker's protocol (docs/WORKER.md) so that tests of
the service need no mechanics and can ask for what a solver seldom does.

The force, to the whole number below, says what happens: 599 N never ends, 598 N ends in a problem,
597 N kills the worker, 596 N takes a second, 595 N until the file /tmp/ischia-gate-PID is there (PID
being the daemon's), 594 N takes memory until there is none; any other gives a result, always the
same but for what echoes the inputs. newton_iterations is the force in mN: whose result it is.
"""
import json
import os
import socket
import sys
import time

HANG, PROBLEM, DIE, SLOW, GATE, MEMORY = 599, 598, 597, 596, 595, 594


class Frames:
    def __init__(self, fd):
        self.socket = socket.socket(fileno=fd)
        self.input = self.socket.makefile('rb')

    def line(self):
        text = self.input.readline()
        if not text:
            sys.exit(0)
        return json.loads(text)

    def blob(self):
        header = self.input.readline()
        return self.input.read(int(header[1:]))

    def say(self, message):
        self.socket.sendall(json.dumps(message, separators=(',', ':')).encode() + b'\n')

    def give(self, data):
        self.socket.sendall(b'#%d\n' % len(data) + data)


def result_of(case):
    over = {
        'volume_mm3': 100.0,
        'count': 1,
        'largest': {
            'volume_mm3': 100.0,
            'eps_max': 1.2,
            'E_shear_max': 1.5,
            'E_comp_max': 0.47,
            'centroid_mm': [0, 0, case['eF'] + 1],
        },
    }
    # Beside the bone, above its lowest point: the skin is 1 mm thick.
    beside = {**over, 'largest': {**over['largest'], 'centroid_mm': [20, 0, case['eF'] + case['eM'] + 3.7]}}
    force = case['F']
    return {
        'strain': {'eps_max': 1.2, 'eps_max_depth_mm': 3.5, 'E_shear_max': 1.5, 'E_comp_max': 0.47},
        'clusters': {
            'shear': {'threshold': 0.75, **over},
            'compression': {'threshold': 0.45, **beside},
            'both': over,
        },
        'muscle_volume_mm3': 50000.0,
        'seat': {
            'displacement_mm': 30.0,
            'contact_area_mm2': 4400.0,
            'mean_pressure_kPa': 50.0,
            'peak_pressure_kPa': 90.0,
        },
        'load_curve': [
            {
                'F_N': force,
                'displacement_mm': 30.0,
                'eps_max': 1.2,
                'E_shear_max': 1.5,
                'E_comp_max': 0.47,
            }
        ],
        'threshold_force_N': {'shear': force / 2, 'compression': None},
        'risk': {'band': 'both', 'headline': 'x', 'reasons': [], 'caveats': []},
        'numerics': {
            'converged': True,
            'reason': 'converged',
            'elements': 1000,
            'dof': 3000,
            'load_steps': 1,
            'newton_iterations': round(force * 1000),
            'factorisations': 5,
            'force_residual': 1e-9,
            'energy_residual': 1e-4,
            'det_F_min': 0.5,
            'eps_max_error': 0.01,
            'last_converged_F_N': force,
            'wall_s': 0.05,
            'cpu_s': 0.05,
            'detail': '',
        },
        'model': {'name': 'macron2020-local', 'version': 1},
    }


def solve(frames, message):
    job, case = message['job'], message['case']
    force, wish = case['F'], int(case['F'])
    if wish == HANG:
        frames.say(
            {
                'say': 'progress',
                'job': job,
                'fraction': 0.25,
                'load_step': 1,
                'newton_iteration': 1,
                'F_N': 1.0,
                'message': 'hanging',
            }
        )
        time.sleep(3600)
    if wish == DIE:
        os._exit(3)
    kept = []
    while wish == MEMORY:
        kept.append(bytearray(16 << 20))
    while wish == GATE and not os.path.exists(f'/tmp/ischia-gate-{os.getppid()}'):
        time.sleep(0.02)
    steps = 5
    for i in range(steps):
        time.sleep((1.0 if wish == SLOW else 0.01) / steps)
        frames.say(
            {
                'say': 'progress',
                'job': job,
                'fraction': (i + 1) / steps,
                'load_step': i + 1,
                'newton_iteration': 2,
                'F_N': force * (i + 1) / steps,
                'message': 'load step',
            }
        )
    if wish == PROBLEM:
        frames.say({'say': 'problem', 'job': job})
        frames.say(
            {
                'type': '/docs#problem-not-converged',
                'title': 'The solve did not converge',
                'status': 422,
                'detail': 'It diverged as the test asked.',
                'reason': 'diverged_step',
                'last_converged_fraction': 0.5,
            }
        )
        return
    frames.say({'say': 'result', 'job': job})
    frames.say(result_of(case))
    frames.give(b'a field of displacements')


def render(frames, message):
    frames.blob()
    body = {
        'svg': b'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1 1" xml:lang="%s"/>\n'
        % message['lang'].encode(),
        'vtu': b'<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid"/>\n',
    }[message['as']]
    frames.say({'say': 'rendered', 'job': message['job']})
    frames.give(body)


def main():
    frames = Frames(int(sys.argv[sys.argv.index('--fd') + 1]))
    frames.say(
        {
            'say': 'hello',
            'protocol': 2,
            'program': 'fake',
            'model': 'macron2020-local',
            'model_version': 1,
        }
    )
    while True:
        message = frames.line()
        {'solve': solve, 'render': render}[message['op']](frames, message)


if __name__ == '__main__':
    main()
