# SPDX-License-Identifier: GPL-3.0-or-later
"""A small emulator whose numbers can be worked out by hand, in the format of emulator/train.py."""
import hashlib
import json
import math

BOX = {
    'R1': (5, 9),
    'R2': (15, 63),
    'eM': (19, 39),
    'eF': (9, 35),
    'muM': (1, 8),
    'muF': (2.8, 8),
    'F': (192, 428),
}
CONSTANT = [0] * 7


def eps_max(case):
    """Value and half of the band."""
    low, high = BOX['R1']
    x = (2 * case['R1'] - low - high) / (high - low)
    low, high = (math.log(v) for v in BOX['muM'])
    y = (2 * math.log(case['muM']) - low - high) / (high - low)
    return 1.3 - 0.2 * x * y + 0.1 * (3 * y * y - 1) / 2, 0.1 * math.exp(0.5 * x)


def output(name, value, reach, power=1, **more):
    plain = {'mean': [[*CONSTANT, value]], 'spread': [[*CONSTANT, 0]]}
    return {'name': name, 'power': power, 'reach': reach, 'held_out_rms': 0.1, **plain, **more}


def write_emulator(path):
    document = {
        'model': {'name': 'macron2020-local', 'version': 1},
        'rows': 100,
        'trial': True,
        'case': {'model': 'default', 'resolution': 'coarse'},
        'inputs': {
            key: {'min': low, 'max': high, 'log': key == 'muM'} for key, (low, high) in BOX.items()
        },
        'outputs': [
            output(
                'eps_max',
                0,
                0.1,
                mean=[
                    [*CONSTANT, 1.3],
                    [1, 0, 0, 0, 1, 0, 0, -0.2],
                    [0, 0, 0, 0, 2, 0, 0, 0.1],
                ],
                spread=[[1, 0, 0, 0, 0, 0, 0, 0.5]],
            ),
            output('E_shear_max', 1.5, 0.1),
            output('E_comp_max', 0.49, 0.1),
            output('volume_shear_mm3', 100, 10, power=2),
            output('volume_compression_mm3', 70, 10, power=2),
            output('volume_both_mm3', 5, 10, power=2),
            output('seat_displacement_mm', 30, 2),
            output('force_shear_N', 250, 20),
        ],
    }
    body = json.dumps(document) + '\n'
    digest = hashlib.sha256(body.encode()).hexdigest()
    with open(path, 'w', encoding='ascii') as file:
        file.write(f'ischia emulator 2 sha256 {digest}\n{body}')
