/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/eigen3.h"

#include "solver/eigen3_lanes.h"

void eigen3(const double A[3][3], double ret_value[3], double ret_vector[3][3])
{
    const lanes diagonal[3] = {lanes_all(A[0][0]), lanes_all(A[1][1]), lanes_all(A[2][2])};
    const lanes off[3] = {lanes_all(A[1][2]), lanes_all(A[2][0]), lanes_all(A[0][1])};
    struct eigen3 e;
    lanes vector[3][3];
    eigen3_init(&e, diagonal, off);
    eigen3_diagonalise(&e, 1);
    eigen3_vectors(&e, vector);
    for (int k = 0; k < 3; k++) {
        ret_value[k] = e.diagonal[k][0] * e.scale[0];
        for (int i = 0; i < 3; i++) ret_vector[i][k] = vector[i][k][0];
    }
}
