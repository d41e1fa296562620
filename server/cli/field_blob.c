/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/cli/field_blob.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

enum { HEAD_BYTES = 12, COMPONENTS = 3, NUMBER_BYTES = 4 };
static const char magic[4] = {'I', 'F', 'B', '1'};
static const double UNITS_PER_MM = 1048576.0; /* 2^20 */
static const double LIMIT_MM = 1000.0;

static uint32_t zigzag(int32_t value)
{
    return (uint32_t)value << 1 ^ (value < 0 ? UINT32_MAX : 0);
}

static int32_t unzigzag(uint32_t value) { return (int32_t)(value >> 1) ^ -(int32_t)(value & 1); }

/* plane[b * numbers + i] is byte b of number i. */
static enum ischia_code to_planes(const double *displacement_mm, size_t node_count,
                                  unsigned char *plane, struct ischia_error *err)
{
    const size_t numbers = COMPONENTS * node_count;
    for (size_t component = 0, i = 0; component < COMPONENTS; component++) {
        int32_t before = 0;
        for (size_t node = 0; node < node_count; node++, i++) {
            const double mm = displacement_mm[COMPONENTS * node + component];
            CHECK(fabs(mm) < LIMIT_MM, err, ISCHIA_E_LIMIT,
                  "a displacement of node %zu is not a number below %g mm", node, LIMIT_MM);
            const int32_t now = (int32_t)lround(mm * UNITS_PER_MM);
            const uint32_t difference = zigzag(now - before); /* below 2^31: |now| < 2^30 */
            for (size_t b = 0; b < NUMBER_BYTES; b++)
                plane[b * numbers + i] = (unsigned char)(difference >> (8 * b));
            before = now;
        }
    }
    return ISCHIA_OK;
}

static void put_head(unsigned char *bytes, size_t node_count)
{
    memcpy(bytes, magic, sizeof magic);
    for (size_t b = 0; b < 8; b++)
        bytes[sizeof magic + b] = (unsigned char)((uint64_t)node_count >> (8 * b));
}

static enum ischia_code pack(const unsigned char *plane, size_t node_count,
                             unsigned char **ret_bytes, size_t *ret_size, struct ischia_error *err)
{
    const uLong plane_size = (uLong)(COMPONENTS * NUMBER_BYTES * node_count);
    uLong packed_size = compressBound(plane_size);
    unsigned char *bytes = malloc(HEAD_BYTES + packed_size);
    CHECK(bytes != NULL, err, ISCHIA_E_MEMORY, "no memory for a field of %zu nodes", node_count);
    put_head(bytes, node_count);
    if (compress2(bytes + HEAD_BYTES, &packed_size, plane, plane_size, Z_DEFAULT_COMPRESSION) !=
        Z_OK) {
        free(bytes);
        return FAIL(err, ISCHIA_E_MEMORY, "no memory for a field of %zu nodes", node_count);
    }
    unsigned char *fitted = realloc(bytes, HEAD_BYTES + packed_size);
    *ret_bytes = fitted != NULL ? fitted : bytes;
    *ret_size = HEAD_BYTES + packed_size;
    return ISCHIA_OK;
}

enum ischia_code field_blob_encode(const double *displacement_mm, size_t node_count,
                                   unsigned char **ret_bytes, size_t *ret_size,
                                   struct ischia_error *err)
{
    CHECK(node_count > 0 && node_count <= FIELD_BLOB_NODES_MAX, err, ISCHIA_E_LIMIT,
          "a field of %zu nodes cannot be kept", node_count);
    unsigned char *plane = malloc(COMPONENTS * NUMBER_BYTES * node_count);
    CHECK(plane != NULL, err, ISCHIA_E_MEMORY, "no memory for a field of %zu nodes", node_count);
    enum ischia_code code = to_planes(displacement_mm, node_count, plane, err);
    if (code == ISCHIA_OK) code = pack(plane, node_count, ret_bytes, ret_size, err);
    free(plane);
    return code;
}

/* -------------------------------------------------------------------------------- decode */

/* Wraps around instead of overflowing: the bytes may say anything. */
static int32_t add_wrapping(int32_t a, int32_t b) { return (int32_t)((uint32_t)a + (uint32_t)b); }

static void from_planes(const unsigned char *plane, size_t node_count, double *displacement_mm)
{
    const size_t numbers = COMPONENTS * node_count;
    for (size_t component = 0, i = 0; component < COMPONENTS; component++) {
        int32_t now = 0;
        for (size_t node = 0; node < node_count; node++, i++) {
            uint32_t difference = 0;
            for (size_t b = 0; b < NUMBER_BYTES; b++)
                difference |= (uint32_t)plane[b * numbers + i] << (8 * b);
            now = add_wrapping(now, unzigzag(difference));
            displacement_mm[COMPONENTS * node + component] = now / UNITS_PER_MM;
        }
    }
}

static enum ischia_code read_head(const unsigned char *bytes, size_t size, size_t *ret_node_count,
                                  struct ischia_error *err)
{
    uint64_t node_count = 0;
    CHECK(size > HEAD_BYTES && memcmp(bytes, magic, sizeof magic) == 0, err, ISCHIA_E_INPUT,
          "not a stored field");
    for (size_t b = 0; b < 8; b++) node_count |= (uint64_t)bytes[sizeof magic + b] << (8 * b);
    CHECK(node_count > 0 && node_count <= FIELD_BLOB_NODES_MAX, err, ISCHIA_E_INPUT,
          "a stored field with an impossible number of nodes");
    /* zlib packs at most 1032 to 1: a small blob cannot make us take much memory */
    CHECK(COMPONENTS * NUMBER_BYTES * node_count / 1032 <= size, err, ISCHIA_E_INPUT,
          "a stored field with fewer bytes than its nodes need");
    *ret_node_count = (size_t)node_count;
    return ISCHIA_OK;
}

static enum ischia_code unpack(const unsigned char *bytes, size_t size, unsigned char *plane,
                               size_t plane_size, struct ischia_error *err)
{
    uLongf got = (uLongf)plane_size;
    uLong used = (uLong)(size - HEAD_BYTES);
    const int result = uncompress2(plane, &got, bytes + HEAD_BYTES, &used);
    CHECK(result != Z_MEM_ERROR, err, ISCHIA_E_MEMORY, "no memory for a stored field");
    CHECK(result == Z_OK && got == plane_size && used == size - HEAD_BYTES, err, ISCHIA_E_INPUT,
          "a stored field that is damaged");
    return ISCHIA_OK;
}

enum ischia_code field_blob_decode(const unsigned char *bytes, size_t size,
                                   double **ret_displacement_mm, size_t *ret_node_count,
                                   struct ischia_error *err)
{
    size_t node_count = 0;
    TRY(read_head(bytes, size, &node_count, err));
    const size_t plane_size = COMPONENTS * NUMBER_BYTES * node_count;
    unsigned char *plane = malloc(plane_size);
    double *displacement_mm = malloc(COMPONENTS * node_count * sizeof *displacement_mm);
    enum ischia_code code = ISCHIA_OK;
    if (plane == NULL || displacement_mm == NULL)
        code = FAIL(err, ISCHIA_E_MEMORY, "no memory for a stored field");
    if (code == ISCHIA_OK) code = unpack(bytes, size, plane, plane_size, err);
    if (code == ISCHIA_OK) from_planes(plane, node_count, displacement_mm);
    free(plane);
    if (code != ISCHIA_OK) {
        free(displacement_mm);
        return code;
    }
    *ret_displacement_mm = displacement_mm;
    *ret_node_count = node_count;
    return ISCHIA_OK;
}
