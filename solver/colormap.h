/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_COLORMAP_H
#define ISCHIA_SOLVER_COLORMAP_H

/*
 * Colour for a fraction 0 ... 1 (clamped): from light to dark in even steps of perceived lightness,
 * so that it reads the same in grey print and with any colour blindness. After matplotlib's
 * "magma", which is in the public domain (CC0), turned round.
 */
void colormap(double fraction, unsigned char ret_rgb[3]);

#endif
