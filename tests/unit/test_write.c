/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "solver/mesh.h"
#include "solver/solver.h"
#include "tests/unit/labels.h"

/* Row 1R of Table 2, coarse. */
static struct ischia_case row_1R(void)
{
    static const double param[ISCHIA_PARAM_COUNT] = {6.9, 19.7, 28, 10, 8.0, 5.0, 196};
    struct ischia_case c = ischia_case_default();
    memcpy(c.param, param, sizeof param);
    c.resolution = ISCHIA_COARSE;
    return c;
}

/* The undeformed field of a case. */
static struct ischia_field field_at_rest(const struct ischia_case *c)
{
    struct mesh mesh;
    assert_int_equal(mesh_local_init(&mesh, c, &mesh_divisions[c->resolution], NULL), ISCHIA_OK);
    struct ischia_field field = {.node_count = (size_t)mesh.node_count};
    field.displacement_mm = calloc(field.node_count * 3, sizeof *field.displacement_mm);
    assert_non_null(field.displacement_mm);
    mesh_finish(&mesh);
    return field;
}

struct page { /* what a writer wrote */
    FILE *out;
    char *text;
    size_t size;
};

static void page_open(struct page *page)
{
    page->out = open_memstream(&page->text, &page->size);
    assert_non_null(page->out);
}

static const char *page_text(struct page *page)
{
    assert_int_equal(fflush(page->out), 0);
    return page->text;
}

static void page_close(struct page *page)
{
    assert_int_equal(fclose(page->out), 0);
    free(page->text);
}

static void the_field_is_written_on_the_mesh_of_its_case(void **state)
{
    (void)state;
    const struct ischia_case c = row_1R();
    struct ischia_field field = field_at_rest(&c);
    struct page page;
    char points[64];
    page_open(&page);
    assert_int_equal(ischia_write_vtu(page.out, &c, &field, NULL), ISCHIA_OK);
    (void)snprintf(points, sizeof points, "NumberOfPoints=\"%zu\"", field.node_count);
    assert_non_null(strstr(page_text(&page), points));
    page_close(&page);
    page_open(&page);
    assert_int_equal(ischia_write_section_svg(page.out, &c, &field, &labels, NULL), ISCHIA_OK);
    assert_non_null(strstr(page_text(&page), "</svg>"));
    page_close(&page);
    free(field.displacement_mm);
}

static void a_field_of_another_case_is_refused(void **state)
{
    (void)state;
    struct ischia_case c = row_1R();
    struct ischia_field field = field_at_rest(&c);
    struct ischia_error err;
    struct page page;
    c.resolution = ISCHIA_STANDARD;
    page_open(&page);
    assert_int_equal(ischia_write_vtu(page.out, &c, &field, &err), ISCHIA_E_INPUT);
    assert_non_null(strstr(err.message, "nodes"));
    assert_int_equal(ischia_write_section_svg(page.out, &c, &field, &labels, &err), ISCHIA_E_INPUT);
    assert_int_equal(strlen(page_text(&page)), 0);
    page_close(&page);
    free(field.displacement_mm);
}

static void a_field_with_a_hole_is_refused(void **state)
{
    (void)state;
    const struct ischia_case c = row_1R();
    struct ischia_field field = field_at_rest(&c);
    struct ischia_error err;
    struct page page;
    field.displacement_mm[3 * 17 + 1] = (double)NAN;
    page_open(&page);
    assert_int_equal(ischia_write_section_svg(page.out, &c, &field, &labels, &err), ISCHIA_E_INPUT);
    assert_non_null(strstr(err.message, "node 17"));
    page_close(&page);
    free(field.displacement_mm);
}

static void the_deck_carries_a_quarter_of_the_force_and_the_options(void **state)
{
    (void)state;
    struct ischia_case c = row_1R();
    struct page page;
    c.option[ISCHIA_BULK_RATIO] = 20;
    page_open(&page);
    assert_int_equal(ischia_write_inp(page.out, &c, NULL), ISCHIA_OK);
    const char *text = page_text(&page);
    assert_non_null(strstr(text, "*CLOAD\nBONEREF, 3, -49\n"));
    assert_non_null(strstr(text, "NAME=MUSCLE\n*HYPERELASTIC, OGDEN, N=1\n0.008, 5, 12.5\n"));
    assert_non_null(strstr(text, "NAME=FAT\n*HYPERELASTIC, OGDEN, N=1\n0.005, 5, 20\n"));
    assert_non_null(strstr(text, "NAME=SKIN\n*HYPERELASTIC, OGDEN, N=1\n0.067, 5, 1.49253"));
    assert_non_null(strstr(text, "*FRICTION\n0.4, "));
    page_close(&page);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_field_is_written_on_the_mesh_of_its_case),
        cmocka_unit_test(a_field_of_another_case_is_refused),
        cmocka_unit_test(a_field_with_a_hole_is_refused),
        cmocka_unit_test(the_deck_carries_a_quarter_of_the_force_and_the_options),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
