/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The writers of solver.h: from a case and a field, which travel between programs, to the mesh and
 * the displacements that the writers proper take.
 */
#include <assert.h>
#include <math.h>

#include "solver/inp.h"
#include "solver/mesh.h"
#include "solver/ogden.h"
#include "solver/section_svg.h"
#include "solver/solver.h"
#include "solver/units.h"
#include "solver/vtu.h"

/* Fields may come from a store: they are input, not ours to assert. */
static enum ischia_code check_field(const struct ischia_field *field, const struct mesh *mesh,
                                    struct ischia_error *err)
{
    const size_t nodes = (size_t)mesh->node_count;
    CHECK(field->node_count == nodes && field->displacement_mm != NULL, err, ISCHIA_E_INPUT,
          "the field has %zu nodes; the mesh of its case has %zu", field->node_count, nodes);
    for (size_t i = 0; i < 3 * nodes; i++)
        CHECK(isfinite(field->displacement_mm[i]), err, ISCHIA_E_INPUT,
              "the field's displacement of node %zu is not finite", i / 3);
    return ISCHIA_OK;
}

/* The mesh of the case, which the field must fit. *ret is the caller's to finish. */
static enum ischia_code begin(struct mesh *ret, const struct ischia_case *c,
                              const struct ischia_field *field, struct ischia_error *err)
{
    assert(ischia_case_is_valid(c));
    TRY(mesh_local_init(ret, c, &mesh_divisions[c->resolution], err));
    const enum ischia_code code = check_field(field, ret, err);
    if (code != ISCHIA_OK) mesh_finish(ret);
    return code;
}

enum ischia_code ischia_write_vtu(FILE *out, const struct ischia_case *c,
                                  const struct ischia_field *field, struct ischia_error *err)
{
    struct mesh mesh;
    TRY(begin(&mesh, c, field, err));
    const enum ischia_code code = vtu_write(out, c, &mesh, field->displacement_mm, err);
    mesh_finish(&mesh);
    return code;
}

enum ischia_code
ischia_write_section_svg(FILE *out, const struct ischia_case *c, const struct ischia_field *field,
                         const struct ischia_section_labels *labels, struct ischia_error *err)
{
    struct mesh mesh;
    TRY(begin(&mesh, c, field, err));
    const enum ischia_code code =
        section_svg_write(out, c, &mesh, field->displacement_mm, labels, err);
    mesh_finish(&mesh);
    return code;
}

static struct inp_model model_of(const struct ischia_case *c)
{
    struct inp_model model = {
        .alpha = OGDEN_ALPHA,
        .friction = c->option[ISCHIA_FRICTION],
        .contact_stiffness_MPa_mm = 1, /* stiffer contact makes CalculiX diverge on this model */
        .stick_slope_MPa_mm = 0.5,
        .drive = INP_FORCE_N,
        .drive_value = quarter_force_N(c->param[ISCHIA_F]),
        .title = "Ischia, " ISCHIA_MODEL_NAME,
    };
    const double mu_kPa[TISSUE_COUNT] = {
        [TISSUE_MUSCLE] = c->param[ISCHIA_MUM],
        [TISSUE_FAT] = c->param[ISCHIA_MUF],
        [TISSUE_SKIN] = c->option[ISCHIA_SKIN_MU],
    };
    for (int t = 0; t < TISSUE_COUNT; t++) {
        model.tissue[t].mu_MPa = MPa_from_kPa(mu_kPa[t]);
        model.tissue[t].kappa_MPa = c->option[ISCHIA_BULK_RATIO] * model.tissue[t].mu_MPa;
    }
    return model;
}

enum ischia_code ischia_write_inp(FILE *out, const struct ischia_case *c, struct ischia_error *err)
{
    struct mesh mesh;
    assert(ischia_case_is_valid(c));
    TRY(mesh_local_init(&mesh, c, &mesh_divisions[c->resolution], err));
    const struct inp_model model = model_of(c);
    const enum ischia_code code = inp_write(out, &mesh, &model, err);
    mesh_finish(&mesh);
    return code;
}
