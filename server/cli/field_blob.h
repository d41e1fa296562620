/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_FIELD_BLOB_H
#define ISCHIA_SERVER_CLI_FIELD_BLOB_H

#include <stddef.h>

#include "solver/error.h"

/*
 * A solved displacement field as bytes that are kept. Each component is rounded to 2^-20 mm
 * (about 1 nm: far below what a drawing or ParaView shows, 2e-6 of strain in the finest element),
 * then written as the difference from the node before.
 *
 *   "IFB1"                                    4 bytes
 *   node count                                8 bytes, little-endian
 *   zlib stream of 12 * node count bytes: the differences of x for all nodes, then y, then z;
 *   each as a zig-zag 32-bit number; first the lowest bytes of all numbers, then the next, ...
 */

enum { FIELD_BLOB_NODES_MAX = 8 * 1000 * 1000 };

/* displacement_mm is [node_count][3]. *ret_bytes is the caller's to free. ISCHIA_E_LIMIT: a
 * component is not finite or is 1000 mm or more, or there are more nodes than
 * FIELD_BLOB_NODES_MAX. */
ISCHIA_MUST_CHECK enum ischia_code field_blob_encode(const double *displacement_mm,
                                                     size_t node_count, unsigned char **ret_bytes,
                                                     size_t *ret_size, struct ischia_error *err);

/* *ret_displacement_mm is [*ret_node_count][3], the caller's to free. ISCHIA_E_INPUT: these bytes
 * are not such a blob; nothing in them is trusted. */
ISCHIA_MUST_CHECK enum ischia_code
field_blob_decode(const unsigned char *bytes, size_t size, double **ret_displacement_mm,
                  size_t *ret_node_count, struct ischia_error *err);

#endif
