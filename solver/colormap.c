/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/colormap.h"

#include <math.h>

/* Evenly spaced; linear in between. The darkest eighth is left out: lines must show on it. */
static const unsigned char anchor[][3] = {
    {0xfc, 0xfd, 0xbf}, {0xfe, 0xc2, 0x87}, {0xfb, 0x88, 0x61}, {0xe5, 0x59, 0x64},
    {0xb5, 0x36, 0x7a}, {0x81, 0x25, 0x81}, {0x4f, 0x12, 0x7b}, {0x1c, 0x10, 0x44},
};
enum { ANCHORS = sizeof anchor / sizeof anchor[0] };

void colormap(double fraction, unsigned char ret_rgb[3])
{
    const double place = fmin(fmax(fraction, 0), 1) * (ANCHORS - 1);
    const int low = (int)fmin(place, ANCHORS - 2);
    const double t = place - low;
    for (int k = 0; k < 3; k++)
        ret_rgb[k] = (unsigned char)lrint((1 - t) * anchor[low][k] + t * anchor[low + 1][k]);
}
