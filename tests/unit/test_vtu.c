/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "solver/clusters.h"
#include "solver/vtu.h"
#include "tests/unit/box_mesh.h"

static const struct box box = {{2, 2, 3}, {4, 4, 6}, 1, 1};

static struct ischia_case row_1R(void)
{
    static const double param[ISCHIA_PARAM_COUNT] = {6.9, 19.7, 28, 10, 8.0, 5.0, 196};
    struct ischia_case c = ischia_case_default();
    memcpy(c.param, param, sizeof param);
    return c;
}

struct written {
    struct mesh mesh;
    double *u;
    char *text;
    size_t size;
};

/* A box stretched far over both thresholds, and its file. */
static struct written write_box(void)
{
    double A[3][3] = {{2, 0, 0}, {0, 2, 0}, {0.5, 0, 0.25}};
    struct written w = {.mesh = box_mesh(&box)};
    const struct ischia_case c = row_1R();
    w.u = box_displacement(&w.mesh, A);
    FILE *out = open_memstream(&w.text, &w.size);
    assert_non_null(out);
    assert_int_equal(vtu_write(out, &c, &w.mesh, w.u, NULL), ISCHIA_OK);
    assert_int_equal(fclose(out), 0);
    return w;
}

static void written_free(struct written *w)
{
    free(w->text);
    free(w->u);
    box_mesh_free(&w->mesh);
}

static int digit_value(char c)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const char *at = strchr(digits, c);
    return c != '\0' && at != NULL ? (int)(at - digits) : -1;
}

/* Decodes the array of that name; checks type, byte count and padding. Returns its bytes. */
static unsigned char *decode(const char *text, const char *type, const char *name, size_t bytes)
{
    char opening[128];
    (void)snprintf(opening, sizeof opening, "<DataArray type=\"%s\" Name=\"%s\"", type, name);
    const char *at = strstr(text, opening);
    assert_non_null(at);
    at = strchr(at, '>') + 1;
    unsigned char *data = box_alloc(bytes + 16, 1);
    size_t count = 0;
    uint32_t bits = 0;
    int digits = 0;
    for (; digit_value(*at) >= 0; at++) {
        bits = bits << 6 | (uint32_t)digit_value(*at);
        if (++digits % 4 == 1) continue;
        assert_true(count < bytes + 10);
        data[count++] = (unsigned char)(bits >> (2 * (3 - (digits - 1) % 4)));
    }
    while (*at == '=') at++, digits++;
    assert_int_equal(digits % 4, 0);
    assert_int_equal(strncmp(at, "</DataArray>", 12), 0);
    uint64_t header;
    memcpy(&header, data, sizeof header);
    assert_int_equal(header, bytes);
    assert_int_equal(count, bytes + 8);
    memmove(data, data + 8, bytes);
    return data;
}

static void points_are_deformed_and_the_displacement_gives_them_back(void **state)
{
    (void)state;
    struct written w = write_box();
    const size_t bytes = (size_t)w.mesh.node_count * 3 * sizeof(double);
    double *points = (double *)(void *)decode(w.text, "Float64", "Points", bytes);
    double *u = (double *)(void *)decode(w.text, "Float64", "displacement", bytes);
    assert_memory_equal(u, w.u, bytes);
    for (int i = 0; i < w.mesh.node_count * 3; i++)
        assert_true(points[i] == w.mesh.X_mm[i / 3][i % 3] + w.u[i]);
    free(points);
    free(u);
    written_free(&w);
}

static void cells_are_the_hexahedra_of_the_mesh(void **state)
{
    (void)state;
    struct written w = write_box();
    const size_t n = (size_t)w.mesh.element_count;
    int32_t *nodes = (int32_t *)(void *)decode(w.text, "Int32", "connectivity", n * 8 * 4);
    int32_t *offsets = (int32_t *)(void *)decode(w.text, "Int32", "offsets", n * 4);
    unsigned char *types = decode(w.text, "UInt8", "types", n);
    unsigned char *tissue = decode(w.text, "UInt8", "tissue", n);
    assert_memory_equal(nodes, w.mesh.hex, n * 8 * sizeof(int));
    assert_memory_equal(tissue, w.mesh.tissue, n);
    for (size_t e = 0; e < n; e++) {
        assert_int_equal(offsets[e], 8 * (e + 1));
        assert_int_equal(types[e], 12);
    }
    free(nodes);
    free(offsets);
    free(types);
    free(tissue);
    written_free(&w);
}

static void strains_and_clusters_are_those_of_the_field(void **state)
{
    (void)state;
    struct written w = write_box();
    const size_t n = (size_t)w.mesh.element_count;
    struct strain_field field;
    struct ischia_cluster_set sets[ISCHIA_CRITERION_COUNT];
    assert_int_equal(strain_field_init(&field, &w.mesh, w.u, NULL), ISCHIA_OK);
    assert_int_equal(clusters_find_all(&w.mesh, &field, sets, NULL), ISCHIA_OK);
    double *mean = (double *)(void *)decode(w.text, "Float64", "E_shear", n * 8);
    double *largest = (double *)(void *)decode(w.text, "Float64", "E_comp_max", n * 8);
    double *volume = (double *)(void *)decode(w.text, "Float64", "cluster_volume_mm3", n * 8);
    int32_t *id = (int32_t *)(void *)decode(w.text, "Int32", "cluster", n * 4);
    double sum = 0;
    for (size_t e = 0; e < n; e++) {
        const struct strain_measures *s = &field.cell[8 * e].strain;
        assert_true(fabs(mean[e] - s->green_lagrange_shear) < 1e-12);
        assert_true(fabs(largest[e] - s->green_lagrange_compression) < 1e-12);
        assert_int_equal(id[e], (int)e < w.mesh.muscle_count ? 1 : 0);
        sum += volume[e];
    }
    assert_true(sets[ISCHIA_OVER_BOTH].volume_mm3 > 0);
    assert_true(fabs(4 * sum - sets[ISCHIA_OVER_BOTH].volume_mm3) < 1e-9);
    free(mean);
    free(largest);
    free(volume);
    free(id);
    strain_field_finish(&field);
    written_free(&w);
}

static void the_inputs_are_in_the_file(void **state)
{
    (void)state;
    struct written w = write_box();
    assert_non_null(strstr(w.text, "Name=\"muM (kPa)\" NumberOfTuples=\"1\" format=\"ascii\">8<"));
    assert_non_null(strstr(w.text, "Name=\"F (N)\" NumberOfTuples=\"1\" format=\"ascii\">196<"));
    written_free(&w);
}

static void a_full_disk_is_an_error(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(&box);
    const struct ischia_case c = row_1R();
    struct ischia_error err;
    double *u = box_alloc((size_t)mesh.node_count * 3, sizeof *u);
    FILE *full = fopen("/dev/full", "w");
    assert_non_null(full);
    assert_int_equal(vtu_write(full, &c, &mesh, u, &err), ISCHIA_E_IO);
    assert_non_null(strstr(err.message, "No space left"));
    (void)fclose(full);
    free(u);
    box_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points_are_deformed_and_the_displacement_gives_them_back),
        cmocka_unit_test(cells_are_the_hexahedra_of_the_mesh),
        cmocka_unit_test(strains_and_clusters_are_those_of_the_field),
        cmocka_unit_test(the_inputs_are_in_the_file),
        cmocka_unit_test(a_full_disk_is_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
