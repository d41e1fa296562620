/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <ctype.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "solver/section.h"
#include "solver/section_svg.h"
#include "tests/unit/box_mesh.h"
#include "tests/unit/labels.h"

static const struct box box = {{3, 2, 5}, {6, 8, 10}, 1, 1};

static void assert_near(double value, double expected)
{
    assert_true(fabs(value - expected) <= 1e-12 * (1 + fabs(expected)));
}

static void sections_hold_the_faces_on_their_plane(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(&box);
    double *u = box_alloc((size_t)mesh.node_count * 3, sizeof *u);
    const double expected_area[SECTION_PLANE_COUNT] = {6 * 10, 8 * 10};
    for (int plane = 0; plane < SECTION_PLANE_COUNT; plane++) {
        struct section s;
        double area = 0;
        int muscle = 0;
        assert_int_equal(section_init(&s, &mesh, (enum section_plane)plane, NULL), ISCHIA_OK);
        assert_int_equal(s.quad_count, box.n[plane] * box.n[2]);
        assert_int_equal(s.bone_node_count, box.n[plane] + 1);
        for (int q = 0; q < s.quad_count; q++) {
            double p[4][2];
            for (int a = 0; a < 4; a++) section_position(&s, &mesh, u, s.quad[q].node[a], p[a]);
            for (int a = 0; a < 4; a++)
                area += 0.5 * (p[a][0] * p[(a + 1) % 4][1] - p[a][1] * p[(a + 1) % 4][0]);
            muscle += s.quad[q].tissue == TISSUE_MUSCLE;
        }
        assert_near(fabs(area), expected_area[plane]);
        assert_int_equal(muscle, box.n[plane] * 3);
        for (int i = 0; i < s.bone_node_count; i++) {
            double at[2];
            section_position(&s, &mesh, u, s.bone_node[i], at);
            assert_near(at[0], box.size_mm[plane] * i / box.n[plane]);
            assert_near(at[1], 10);
        }
        section_finish(&s);
    }
    free(u);
    box_mesh_free(&mesh);
}

static void positions_are_deformed(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(&box);
    double A[3][3] = {{2, 0, 0}, {0, 3, 0}, {0, 0, 0.5}};
    double *u = box_displacement(&mesh, A), at[2];
    const struct section x0 = {.plane = SECTION_X0};
    section_position(&x0, &mesh, u, box_node(&box, 0, 2, 5), at);
    assert_near(at[0], 24);
    assert_near(at[1], 5);
    free(u);
    box_mesh_free(&mesh);
}

static void recovered_strain_is_exact_where_uniform_and_zero_outside_muscle(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(&box);
    box_distort(&mesh, 0.005);
    double A[3][3] = {{1.5, 0, 0}, {0, 1, 0}, {0, 0, 0.5}};
    double *u = box_displacement(&mesh, A);
    double *value = box_alloc((size_t)mesh.node_count, sizeof *value);
    struct strain_field field;
    assert_int_equal(strain_field_init(&field, &mesh, u, NULL), ISCHIA_OK);
    assert_int_equal(section_recover_shear(&mesh, &field, value, NULL), ISCHIA_OK);
    for (int k = 0; k <= box.n[2]; k++)
        assert_near(value[box_node(&box, 1, 1, k)], k < 2 ? 0 : 0.5);
    strain_field_finish(&field);
    free(value);
    free(u);
    box_mesh_free(&mesh);
}

static double polygon_area(const struct section_vertex *v, int count)
{
    double area = 0;
    for (int i = 0; i < count; i++) {
        const double *a = v[i].at_mm, *b = v[(i + 1) % count].at_mm;
        area += 0.5 * (a[0] * b[1] - a[1] * b[0]);
    }
    return area;
}

/* The unit square with value = x + y at its corners. */
static const struct section_vertex square[4] = {{{0, 0}, 0}, {{1, 0}, 1}, {{1, 1}, 2}, {{0, 1}, 1}};

static void clipped_areas_are_exact(void **state)
{
    (void)state;
    /* Where x + y >= level: the square less the corner triangle level^2/2 (level <= 1), or the
     * corner triangle (2 - level)^2/2. */
    static const struct {
        double level, area;
    } cases[] = {{-1, 1}, {0, 1}, {0.5, 0.875}, {1, 0.5}, {1.5, 0.125}, {2, 0}, {3, 0}};
    struct section_vertex triangle[SECTION_TRIANGLES][3], polygon[SECTION_CLIPPED_MAX];
    section_divide(square, triangle);
    for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        double area = 0;
        for (int t = 0; t < SECTION_TRIANGLES; t++)
            area += polygon_area(polygon, section_clip(triangle[t], cases[n].level, polygon));
        assert_near(area, cases[n].area);
    }
}

static void contours_lie_on_their_level(void **state)
{
    (void)state;
    struct section_vertex triangle[SECTION_TRIANGLES][3], end[2];
    double length = 0;
    section_divide(square, triangle);
    for (int t = 0; t < SECTION_TRIANGLES; t++) {
        if (!section_contour(triangle[t], 0.5, end)) continue;
        for (int i = 0; i < 2; i++) assert_near(end[i].at_mm[0] + end[i].at_mm[1], 0.5);
        length += hypot(end[1].at_mm[0] - end[0].at_mm[0], end[1].at_mm[1] - end[0].at_mm[1]);
    }
    assert_near(length, 0.5 * sqrt(2.0));
    assert_false(section_contour(triangle[0], 5, end));
}

/* --- the drawing ------------------------------------------------------------------------------ */

static struct ischia_case row_1R(void)
{
    static const double param[ISCHIA_PARAM_COUNT] = {6.9, 19.7, 28, 10, 8.0, 5.0, 196};
    struct ischia_case c = ischia_case_default();
    memcpy(c.param, param, sizeof param);
    return c;
}

/* A box sheared more and more towards the axis, drawn to memory; the caller frees it. */
static char *draw(void)
{
    struct mesh mesh = box_mesh(&box);
    const struct ischia_case c = row_1R();
    double *u = box_alloc((size_t)mesh.node_count * 3, sizeof *u);
    for (int n = 0; n < mesh.node_count; n++) {
        const double *X = mesh.X_mm[n];
        u[3 * n] = 0.2 * X[0] * (10 - X[2]);
        u[3 * n + 2] = -0.5 * X[2] / (1 + 0.2 * X[0]);
    }
    char *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    assert_non_null(out);
    assert_int_equal(section_svg_write(out, &c, &mesh, u, &labels, NULL), ISCHIA_OK);
    assert_int_equal(fclose(out), 0);
    assert_int_equal(strlen(text), size);
    free(u);
    box_mesh_free(&mesh);
    return text;
}

/* Every element is closed by its own name, in order. */
static void assert_balanced(const char *xml)
{
    enum { DEPTH_MAX = 16 };
    const char *open[DEPTH_MAX];
    int depth = 0;
    for (const char *at = strchr(xml, '<'); at != NULL; at = strchr(at + 1, '<')) {
        const char *end = strchr(at, '>');
        assert_non_null(end);
        if (at[1] == '?') continue;
        if (at[1] == '/') {
            if (depth == 0) {
                fail_msg("an end without a beginning: %.20s", at);
                return;
            }
            depth--;
            assert_int_equal(strncmp(open[depth], at + 2, (size_t)(end - at - 2)), 0);
        } else if (end[-1] != '/') {
            assert_true(depth < DEPTH_MAX);
            open[depth++] = at + 1;
        }
    }
    assert_int_equal(depth, 0);
}

static void the_drawing_is_whole_and_says_what_it_shows(void **state)
{
    (void)state;
    static const char *const wanted[] = {
        "<title id=\"title\">",
        "<desc id=\"desc\">",
        "role=\"img\"",
        ">plan y<",
        ">plan x<",
        "10 mm",
        "tøyning",
        ">&lt;titel&gt; &amp; co ]]&gt;<",
        "xml:lang=\"x-test\"",
        "R1 6,9 mm",
        "muM 8 kPa",
        "F 196 N",
        ">0,75<",
        ">= 0,75<",
        ">sete<",
        "id=\"half1-0\"",
    };
    static const char *const unwanted[] = {"nan", "inf", "-0.00 ", " -0.00", "e+", "e-0"};
    char *svg = draw();
    assert_balanced(svg);
    for (size_t i = 0; i < sizeof wanted / sizeof wanted[0]; i++)
        assert_non_null(strstr(svg, wanted[i]));
    for (size_t i = 0; i < sizeof unwanted / sizeof unwanted[0]; i++)
        assert_null(strstr(svg, unwanted[i]));
    const char *contour = strstr(svg, "id=\"threshold0\" d=\"M");
    assert_non_null(contour);
    free(svg);
}

static void the_same_field_gives_the_same_bytes(void **state)
{
    (void)state;
    char *a = draw(), *b = draw();
    assert_string_equal(a, b);
    free(a);
    free(b);
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
    assert_int_equal(section_svg_write(full, &c, &mesh, u, &labels, &err), ISCHIA_E_IO);
    (void)fclose(full);
    free(u);
    box_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sections_hold_the_faces_on_their_plane),
        cmocka_unit_test(positions_are_deformed),
        cmocka_unit_test(recovered_strain_is_exact_where_uniform_and_zero_outside_muscle),
        cmocka_unit_test(clipped_areas_are_exact),
        cmocka_unit_test(contours_lie_on_their_level),
        cmocka_unit_test(the_drawing_is_whole_and_says_what_it_shows),
        cmocka_unit_test(the_same_field_gives_the_same_bytes),
        cmocka_unit_test(a_full_disk_is_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
