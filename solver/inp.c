/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * CalculiX reads at most 20 characters a number, so positions are written with 12 digits.
 * Its Ogden law is W = 2 mu / alpha^2 (l1^alpha + l2^alpha + l3^alpha - 3) + (J - 1)^2 / D1 with
 * isochoric stretches l: the convention of ours, with D1 = 2 / kappa.
 */
#include "solver/inp.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solver/faces.h"
#include "solver/kinematics.h"

static const char *const element_set[TISSUE_COUNT] = {
    [TISSUE_MUSCLE] = "MUSCLE",
    [TISSUE_FAT] = "FAT",
    [TISSUE_SKIN] = "SKIN",
};

/*
 * Contact is by penalty in CalculiX. The default normal stiffness lets the skin sink in by 1 um at
 * the highest pressures under a seated person (0.1 MPa), the stick slope lets it creep by 4 um.
 */
static const double default_contact_stiffness_MPa_mm = 100;
static const double default_stick_slope_MPa_mm = 10;

/* Young's modulus and Poisson's ratio of the seat's block; all its nodes are fixed, so any do. */
static const double seat_E_MPa = 1000, seat_nu = 0.3;

enum { SEAT_NODES = 8, LINE_NUMBERS_MAX = 12 };

/* Numbers of what comes after the mesh in the deck; everything counts from 1 there. */
static int reference_node(const struct mesh *mesh) { return mesh->node_count + 1; }
static int seat_node(const struct mesh *mesh, int i) { return mesh->node_count + 2 + i; }
static int seat_element(const struct mesh *mesh) { return mesh->element_count + 1; }

static void write_node(FILE *out, int number, double x, double y, double z)
{
    (void)fprintf(out, "%d, %.12g, %.12g, %.12g\n", number, x, y, z);
}

static void write_nodes(FILE *out, const struct mesh *mesh)
{
    (void)fputs("*NODE, NSET=BODY\n", out);
    for (int n = 0; n < mesh->node_count; n++)
        write_node(out, n + 1, mesh->X_mm[n][0], mesh->X_mm[n][1], mesh->X_mm[n][2]);
}

/* The block of the seat: far wider than the body can spread, its top face at z = 0. */
static void write_seat_and_reference(FILE *out, const struct mesh *mesh)
{
    double extent[3] = {0, 0, 0};
    for (int n = 0; n < mesh->node_count; n++)
        for (int d = 0; d < 3; d++) extent[d] = fmax(extent[d], mesh->X_mm[n][d]);
    const double width = fmax(extent[0], extent[1]), low = -width, high = 5 * width;
    (void)fputs("*NODE, NSET=BONEREF\n", out);
    write_node(out, reference_node(mesh), 0, 0, extent[2]);
    (void)fputs("*NODE, NSET=SEAT\n", out);
    for (int i = 0; i < SEAT_NODES; i++) {
        const int corner = i % 4;
        write_node(out, seat_node(mesh, i), corner == 1 || corner == 2 ? high : low,
                   corner >= 2 ? high : low, i < 4 ? -width : 0);
    }
    (void)fprintf(out, "*ELEMENT, TYPE=C3D8, ELSET=SEATBLOCK\n%d", seat_element(mesh));
    for (int i = 0; i < SEAT_NODES; i++) (void)fprintf(out, ", %d", seat_node(mesh, i));
    (void)fputc('\n', out);
}

static void write_elements(FILE *out, const struct mesh *mesh, enum tissue tissue)
{
    bool any = false;
    for (int e = 0; e < mesh->element_count; e++) {
        if (mesh->tissue[e] != tissue) continue;
        if (!any) (void)fprintf(out, "*ELEMENT, TYPE=C3D8, ELSET=%s\n", element_set[tissue]);
        any = true;
        (void)fprintf(out, "%d", e + 1);
        for (int a = 0; a < HEX_CORNERS; a++) (void)fprintf(out, ", %d", mesh->hex[e][a] + 1);
        (void)fputc('\n', out);
    }
}

static bool has_tissue(const struct mesh *mesh, enum tissue tissue)
{
    for (int e = 0; e < mesh->element_count; e++)
        if (mesh->tissue[e] == tissue) return true;
    return false;
}

static void write_material(FILE *out, const char *name, const struct inp_tissue *tissue,
                           double alpha)
{
    (void)fprintf(out,
                  "*MATERIAL, NAME=%s\n*HYPERELASTIC, OGDEN, N=1\n%.12g, %.12g, %.12g\n"
                  "*SOLID SECTION, ELSET=%s, MATERIAL=%s\n",
                  name, tissue->mu_MPa, alpha, 2 / tissue->kappa_MPa, name, name);
}

/* The nodes that carry the flag and none of the excluded ones. */
static void write_node_set(FILE *out, const struct mesh *mesh, const char *name,
                           enum node_flag flag, int excluded)
{
    int written = 0;
    (void)fprintf(out, "*NSET, NSET=%s\n", name);
    for (int n = 0; n < mesh->node_count; n++) {
        if (!(mesh->node_flags[n] & flag) || (mesh->node_flags[n] & excluded)) continue;
        (void)fprintf(out, "%d,%s", n + 1, ++written % LINE_NUMBERS_MAX == 0 ? "\n" : " ");
    }
    /* No line stays empty: Abaqus reads one as zeros. */
    if (written % LINE_NUMBERS_MAX != 0) (void)fputc('\n', out);
}

static void write_bone_equations(FILE *out, const struct mesh *mesh)
{
    for (int n = 0; n < mesh->node_count; n++)
        if (mesh->node_flags[n] & NODE_ON_BONE)
            (void)fprintf(out, "*EQUATION\n2\n%d, 3, 1., %d, 3, -1.\n", n + 1,
                          reference_node(mesh));
}

static bool same_face(const struct mesh *mesh, int face, const int quad[4])
{
    int nodes[FACE_CORNERS], found = 0;
    face_nodes(mesh, face, nodes);
    for (int i = 0; i < FACE_CORNERS; i++)
        for (int j = 0; j < FACE_CORNERS; j++) found += nodes[i] == quad[j];
    return found == FACE_CORNERS;
}

/* Chains the seat faces by their first node: first_quad[node], then next_quad[quad]; -1 ends. */
static void hang_quads(const struct mesh *mesh, int *first_quad, int *next_quad)
{
    for (int n = 0; n < mesh->node_count; n++) first_quad[n] = -1;
    for (int q = 0; q < mesh->seat_quad_count; q++) {
        const int node = mesh->seat_quad[q][0];
        next_quad[q] = first_quad[node];
        first_quad[node] = q;
    }
}

static bool is_seat_face(const struct mesh *mesh, int face, const int *first_quad,
                         const int *next_quad)
{
    int nodes[FACE_CORNERS];
    face_nodes(mesh, face, nodes);
    for (int i = 0; i < FACE_CORNERS; i++)
        for (int q = first_quad[nodes[i]]; q >= 0; q = next_quad[q])
            if (same_face(mesh, face, mesh->seat_quad[q])) return true;
    return false;
}

/* The faces that may touch the seat, as element and side. */
static enum ischia_code write_touching_surface(FILE *out, const struct mesh *mesh,
                                               struct ischia_error *err)
{
    int *first_quad = calloc((size_t)mesh->node_count, sizeof *first_quad);
    int *next_quad = calloc((size_t)mesh->seat_quad_count + 1, sizeof *next_quad);
    enum ischia_code code = ISCHIA_OK;
    if (first_quad == NULL || next_quad == NULL) {
        code = FAIL(err, ISCHIA_E_MEMORY, "out of memory for the contact surface");
        goto free_work;
    }
    hang_quads(mesh, first_quad, next_quad);
    (void)fputs("*SURFACE, NAME=OUTSIDE, TYPE=ELEMENT\n", out);
    for (int face = 0; face < HEX_SIDES * mesh->element_count; face++)
        if (is_seat_face(mesh, face, first_quad, next_quad))
            (void)fprintf(out, "%d, S%d\n", face / HEX_SIDES + 1, face % HEX_SIDES + 1);
free_work:
    free(next_quad);
    free(first_quad);
    return code;
}

static double given_or(double given, double otherwise) { return given > 0 ? given : otherwise; }

static void write_contact(FILE *out, const struct mesh *mesh, const struct inp_model *model)
{
    (void)fprintf(out,
                  "*SURFACE, NAME=SEATTOP, TYPE=ELEMENT\n%d, S2\n"
                  "*SURFACE INTERACTION, NAME=SEATCONTACT\n"
                  "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n%.12g\n",
                  seat_element(mesh),
                  given_or(model->contact_stiffness_MPa_mm, default_contact_stiffness_MPa_mm));
    if (model->friction > 0)
        (void)fprintf(out, "*FRICTION\n%.12g, %.12g\n", model->friction,
                      given_or(model->stick_slope_MPa_mm, default_stick_slope_MPa_mm));
    (void)fputs("*CONTACT PAIR, INTERACTION=SEATCONTACT, TYPE=NODE TO SURFACE\nOUTSIDE, SEATTOP\n",
                out);
}

static void write_step(FILE *out, const struct inp_model *model)
{
    (void)fputs("*STEP, NLGEOM, INC=2000\n*STATIC\n0.02, 1., 1e-7, 0.05\n", out);
    if (model->drive == INP_FORCE_N)
        (void)fprintf(out, "*CLOAD\nBONEREF, 3, %.12g\n", -model->drive_value);
    else
        (void)fprintf(out, "*BOUNDARY\nBONEREF, 3, 3, %.12g\n", -model->drive_value);
    (void)fputs("*NODE PRINT, NSET=BODY, FREQUENCY=100000\nU\n"
                "*NODE PRINT, NSET=BONEREF, FREQUENCY=1\nU, RF\n"
                "*NODE PRINT, NSET=SEAT, FREQUENCY=1, TOTALS=ONLY\nRF\n"
                "*EL PRINT, ELSET=TISSUE, FREQUENCY=100000\nE\n"
                "*NODE FILE, FREQUENCY=100000\nU\n*EL FILE, FREQUENCY=100000\nS, E\n*END STEP\n",
                out);
}

static void write_properties(FILE *out, const struct mesh *mesh, const struct inp_model *model)
{
    for (int t = 0; t < TISSUE_COUNT; t++)
        if (has_tissue(mesh, (enum tissue)t))
            write_material(out, element_set[t], &model->tissue[t], model->alpha);
    (void)fprintf(out,
                  "*MATERIAL, NAME=SEATBLOCK\n*ELASTIC\n%.12g, %.12g\n"
                  "*SOLID SECTION, ELSET=SEATBLOCK, MATERIAL=SEATBLOCK\n",
                  seat_E_MPa, seat_nu);
}

static void write_constraints(FILE *out, const struct mesh *mesh, bool bone_slides)
{
    /* What the bone holds already is not held twice. */
    const int excluded = bone_slides ? 0 : NODE_ON_BONE;
    write_node_set(out, mesh, "BONE", NODE_ON_BONE, 0);
    write_node_set(out, mesh, "SYMX", NODE_ON_X0, excluded);
    write_node_set(out, mesh, "SYMY", NODE_ON_Y0, excluded);
    write_bone_equations(out, mesh);
    (void)fputs("*BOUNDARY\nBONEREF, 1, 2\nSYMX, 1, 1\nSYMY, 2, 2\nSEAT, 1, 3\n", out);
    if (!bone_slides) (void)fputs("BONE, 1, 2\n", out);
}

enum ischia_code inp_write(FILE *out, const struct mesh *mesh, const struct inp_model *model,
                           struct ischia_error *err)
{
    (void)fprintf(out, "*HEADING\n%s; quarter model; mm, N, MPa\n", model->title);
    write_nodes(out, mesh);
    for (int t = 0; t < TISSUE_COUNT; t++) write_elements(out, mesh, (enum tissue)t);
    (void)fputs("*ELSET, ELSET=TISSUE\n", out);
    for (int t = 0; t < TISSUE_COUNT; t++)
        if (has_tissue(mesh, (enum tissue)t)) (void)fprintf(out, "%s,\n", element_set[t]);
    write_seat_and_reference(out, mesh);
    write_properties(out, mesh, model);
    write_constraints(out, mesh, model->bone_slides);
    TRY(write_touching_surface(out, mesh, err));
    write_contact(out, mesh, model);
    write_step(out, model);
    if (fflush(out) != 0 || ferror(out))
        return FAIL(err, ISCHIA_E_IO, "cannot write the input deck: %s", strerror(errno));
    return ISCHIA_OK;
}
