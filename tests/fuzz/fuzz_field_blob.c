/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Anything that could stand in the store as a field. What is taken must come back the same. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "server/cli/field_blob.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    double *field = NULL, *again = NULL;
    unsigned char *bytes = NULL;
    size_t nodes = 0, bytes_size = 0, nodes_again = 0;
    struct ischia_error err;
    if (field_blob_decode(data, size, &field, &nodes, &err) != ISCHIA_OK) return 0;
    if (field_blob_encode(field, nodes, &bytes, &bytes_size, &err) == ISCHIA_OK) {
        MUST(field_blob_decode(bytes, bytes_size, &again, &nodes_again, &err) == ISCHIA_OK);
        MUST(nodes_again == nodes && memcmp(again, field, nodes * 3 * sizeof *field) == 0);
    }
    free(field);
    free(again);
    free(bytes);
    return 0;
}
