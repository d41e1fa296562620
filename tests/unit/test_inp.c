/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "solver/inp.h"
#include "tests/unit/box_mesh.h"

static const struct box box = {{2, 3, 4}, {4, 6, 8}, 1, 1};

static const struct inp_model moderate = {
    .tissue =
        {[TISSUE_MUSCLE] = {8e-3, 0.16}, [TISSUE_FAT] = {5e-3, 0.1}, [TISSUE_SKIN] = {67e-3, 1.34}},
    .alpha = 5,
    .friction = 0.4,
    .drive = INP_FORCE_N,
    .drive_value = 49,
    .title = "test box",
};

static char *deck(const struct box *b, const struct inp_model *model)
{
    struct mesh mesh = box_mesh(b);
    char *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    assert_non_null(out);
    assert_int_equal(inp_write(out, &mesh, model, NULL), ISCHIA_OK);
    assert_int_equal(fclose(out), 0);
    box_mesh_free(&mesh);
    return text;
}

/* The data lines after the keyword line that starts so, up to the next keyword. */
static int data_lines(const char *text, const char *keyword)
{
    const char *at = strstr(text, keyword);
    int lines = 0;
    if (at == NULL) return -1;
    for (at = strchr(at, '\n') + 1; *at != '*' && *at != '\0'; at = strchr(at, '\n') + 1) lines++;
    return lines;
}

static void nodes_elements_and_sets_are_all_there(void **state)
{
    (void)state;
    char *text = deck(&box, &moderate);
    assert_int_equal(data_lines(text, "*NODE, NSET=BODY\n"), 3 * 4 * 5);
    assert_int_equal(data_lines(text, "*ELEMENT, TYPE=C3D8, ELSET=MUSCLE\n"), 12);
    assert_int_equal(data_lines(text, "*ELEMENT, TYPE=C3D8, ELSET=FAT\n"), 6);
    assert_int_equal(data_lines(text, "*ELEMENT, TYPE=C3D8, ELSET=SKIN\n"), 6);
    assert_int_equal(data_lines(text, "*NODE, NSET=SEAT\n"), 8);
    assert_int_equal(data_lines(text, "*SURFACE, NAME=OUTSIDE"), 6);
    /* Element (0, 0, 0) is the 19th: layers count from the top. Its lower face is S1. */
    assert_non_null(strstr(text, "\n19, 1, 2, 5, 4, 13, 14, 17, 16\n"));
    assert_non_null(strstr(text, "\n19, S1\n"));
    assert_null(strstr(text, "S3\n"));
    /* The bone has twelve nodes, a full line: no empty one follows, which Abaqus reads as zeros. */
    assert_null(strstr(text, "\n\n"));
    free(text);
}

static void materials_follow_the_convention(void **state)
{
    (void)state;
    char *text = deck(&box, &moderate);
    assert_non_null(strstr(text, "*MATERIAL, NAME=MUSCLE\n*HYPERELASTIC, OGDEN, N=1\n"
                                 "0.008, 5, 12.5\n"));
    assert_non_null(strstr(text, "*FRICTION\n0.4, "));
    assert_non_null(strstr(text, "*CLOAD\nBONEREF, 3, -49\n"));
    assert_non_null(strstr(text, "BONE, 1, 2\n"));
    free(text);
}

static void bone_nodes_follow_the_reference_node(void **state)
{
    (void)state;
    char *text = deck(&box, &moderate);
    int equations = 0;
    for (const char *at = text; (at = strstr(at, "*EQUATION")) != NULL; at++) equations++;
    assert_int_equal(equations, 3 * 4);
    assert_non_null(strstr(text, "*EQUATION\n2\n60, 3, 1., 61, 3, -1.\n"));
    /* A symmetry node on the bone (node 49 = (0, 0, 4)) is held once. */
    const char *symx = strstr(text, "*NSET, NSET=SYMX\n");
    assert_non_null(symx);
    assert_int_equal(strncmp(symx, "*NSET, NSET=SYMX\n1, 4, 7, 10, 13,", 33), 0);
    assert_null(strstr(symx, "49, 52, 55"));
    free(text);
}

static void options_leave_out_what_they_should(void **state)
{
    (void)state;
    const struct box plain = {{1, 1, 1}, {1, 1, 1}, 0, 0};
    struct inp_model model = moderate;
    model.friction = 0;
    model.bone_slides = true;
    model.drive = INP_DISPLACEMENT_MM;
    model.drive_value = 0.25;
    char *text = deck(&plain, &model);
    assert_null(strstr(text, "FRICTION"));
    assert_null(strstr(text, "BONE, 1, 2"));
    assert_null(strstr(text, "FAT"));
    assert_null(strstr(text, "*CLOAD"));
    assert_non_null(strstr(text, "*BOUNDARY\nBONEREF, 3, 3, -0.25\n"));
    /* A sliding bone holds no node in x and y: all four symmetry nodes must be held. */
    assert_non_null(strstr(text, "NSET=SYMX\n1, 3, 5, 7,"));
    free(text);
}

static void no_number_is_longer_than_twenty_characters(void **state)
{
    (void)state;
    const struct box odd = {{7, 7, 7}, {1e-3, 100.0 / 3, 1e5 / 7}, 0, 0};
    char *text = deck(&odd, &moderate);
    size_t length = 0;
    for (const char *at = text; *at != '\0'; at++) {
        length = strchr("0123456789.+-e", *at) != NULL ? length + 1 : 0;
        assert_true(length <= 20);
    }
    free(text);
}

static void a_full_disk_is_an_error(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(&box);
    struct ischia_error err;
    FILE *full = fopen("/dev/full", "w");
    assert_non_null(full);
    assert_int_equal(inp_write(full, &mesh, &moderate, &err), ISCHIA_E_IO);
    (void)fclose(full);
    box_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nodes_elements_and_sets_are_all_there),
        cmocka_unit_test(materials_follow_the_convention),
        cmocka_unit_test(bone_nodes_follow_the_reference_node),
        cmocka_unit_test(options_leave_out_what_they_should),
        cmocka_unit_test(no_number_is_longer_than_twenty_characters),
        cmocka_unit_test(a_full_disk_is_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
