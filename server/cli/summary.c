/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/cli/summary.h"

#include <math.h>

#include "api/risk.h"
#include "api/uncertainty_doc.h"

static void print_inputs(FILE *out, const struct ischia_request *request)
{
    const struct ischia_case *c = &request->values;
    (void)fprintf(out, "Side        %s%s%s%s%s\n",
                  request->subject[0] != '\0' ? request->subject : "(no subject given)",
                  request->side != ISCHIA_SIDE_NONE ? ", " : "", ischia_side_names[request->side],
                  request->label[0] != '\0' ? ", " : "", request->label);
    (void)fprintf(out, "Inputs     ");
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        (void)fprintf(out, " %s %g %s%s", ischia_params[i].key, c->param[i], ischia_params[i].unit,
                      i + 1 < ISCHIA_PARAM_COUNT ? "," : "\n");
}

static void print_strain(FILE *out, const struct ischia_result *r)
{
    const struct ischia_strain *s = &r->strain;
    (void)fprintf(out,
                  "Strain      eps_max      %.3f ± %.3f  engineering shear on the axis, %.1f mm "
                  "below the bone\n",
                  s->eps_max, r->numerics.eps_max_error, s->eps_max_depth_mm);
    (void)fprintf(out, "            E_shear_max  %.3f          Green-Lagrange, threshold %.2f\n",
                  s->E_shear_max, ISCHIA_E_SHEAR_THRESHOLD);
    (void)fprintf(out, "            E_comp_max   %.3f          Green-Lagrange, threshold %.2f\n",
                  s->E_comp_max, ISCHIA_E_COMP_THRESHOLD);
}

static void print_volume(FILE *out, const char *head, const char *name, double volume_mm3,
                         double muscle_mm3, double first_N)
{
    (void)fprintf(out, "%-11s %-12s %.0f mm³", head, name, volume_mm3);
    if (muscle_mm3 > 0)
        (void)fprintf(out, " (%.1f %% of the muscle)", 100 * volume_mm3 / muscle_mm3);
    if (!isnan(first_N)) (void)fprintf(out, ", first crossed at %.0f N", first_N);
    (void)fprintf(out, "\n");
}

static void print_volumes(FILE *out, const struct ischia_result *r)
{
    const struct ischia_cluster_set *set = r->clusters;
    print_volume(out, "Muscle over", "shear", set[ISCHIA_OVER_SHEAR].volume_mm3,
                 r->muscle_volume_mm3, r->threshold_force_shear_N);
    print_volume(out, "threshold", "compression", set[ISCHIA_OVER_COMPRESSION].volume_mm3,
                 r->muscle_volume_mm3, r->threshold_force_compression_N);
    print_volume(out, "", "both", set[ISCHIA_OVER_BOTH].volume_mm3, r->muscle_volume_mm3,
                 (double)NAN);
}

static void print_seat(FILE *out, const struct ischia_seat *seat)
{
    (void)fprintf(out,
                  "Seat        travel %.1f mm, contact %.0f mm², pressure mean %.1f kPa, peak %.1f "
                  "kPa\n",
                  seat->displacement_mm, seat->contact_area_mm2, seat->mean_pressure_kPa,
                  seat->peak_pressure_kPa);
}

static void print_risk(FILE *out, const struct ischia_case *c, const struct ischia_result *r)
{
    struct risk risk;
    risk_assess(&risk, c, r, LANGUAGE_EN);
    (void)fprintf(out, "Risk band   %s: %s\n", risk_bands[risk.band].name,
                  risk_headline(risk.band));
    for (size_t i = 0; i < RISK_CAVEAT_COUNT; i++)
        (void)fprintf(out, "%-11s %s\n", i == 0 ? "Note" : "", risk_caveat(i));
}

static void print_numerics(FILE *out, const struct ischia_case *c, const struct ischia_numerics *n)
{
    (void)fprintf(out,
                  "Solved      %s at %s resolution: %d elements, %d dof, %d load steps, %d "
                  "Newton iterations, %.2f s\n",
                  ischia_reason_name(n->reason), ischia_resolution_names[c->resolution],
                  n->elements, n->dof, n->load_steps, n->newton_iterations, n->wall_s);
    if (n->reason > 0)
        (void)fprintf(out,
                      "            force residual %.1e, energy residual %.1e, least det F %.3f\n",
                      n->force_residual, n->energy_residual, n->det_F_min);
    else
        (void)fprintf(out, "            the last converged force is %.4g N of %.4g N. %s\n",
                      n->last_converged_F_N, c->param[ISCHIA_F], n->detail);
}

static void print_interval(FILE *out, const char *head, const char *name, const char *unit,
                           int decimals, const double quantile[UNCERTAINTY_QUANTILES])
{
    if (isnan(quantile[0])) return;
    (void)fprintf(out, "%-11s %-12s %.*f, ", head, name, decimals, quantile[2]);
    if (isnan(quantile[UNCERTAINTY_QUANTILES - 1]))
        (void)fprintf(out, "%.*f%s or more\n", decimals, quantile[0], unit);
    else
        (void)fprintf(out, "%.*f to %.*f%s\n", decimals, quantile[0], decimals,
                      quantile[UNCERTAINTY_QUANTILES - 1], unit);
}

static void print_sources(FILE *out, const struct ischia_uncertainty *u)
{
    enum ischia_param order[ISCHIA_PARAM_COUNT];
    const int count = uncertainty_order(u, order);
    if (count == 0) return;
    (void)fprintf(out, "            spread of eps_max from");
    for (int i = 0; i < count; i++)
        (void)fprintf(out, "%s %s %.0f %%", i > 0 ? "," : "", ischia_params[order[i]].key,
                      100 * u->total[order[i]]);
    (void)fprintf(out, "\n");
}

static void print_shares(FILE *out, const struct ischia_uncertainty *u)
{
    if (isnan(u->share_shear) || isnan(u->share_compression)) return;
    (void)fprintf(out,
                  "            samples over the threshold: shear %.0f %%, compression %.0f %%\n",
                  100 * u->share_shear, 100 * u->share_compression);
}

/* Medians, and between which two numbers nine samples in ten lie. */
static void print_uncertainty(FILE *out, const struct ischia_uncertainty *u)
{
    if (u->status != UNCERTAINTY_GIVEN) {
        (void)fprintf(out, "Uncertainty none given: %s\n", uncertainty_status_names[u->status]);
        return;
    }
    print_interval(out, "Uncertainty", "eps_max", "", 3, u->quantile[UNCERTAIN_EPS_MAX]);
    print_interval(out, "(median and", "shear", " mm³", 0, u->quantile[UNCERTAIN_VOLUME_SHEAR]);
    print_interval(out, "5 to 95 %)", "compression", " mm³", 0,
                   u->quantile[UNCERTAIN_VOLUME_COMPRESSION]);
    print_shares(out, u);
    print_sources(out, u);
    (void)fprintf(out, "            beside it: error of the model's form, %.3f in eps_max\n",
                  ISCHIA_MODEL_FORM_EPS_MAX);
}

void summary_print(FILE *out, const struct ischia_request *request,
                   const struct ischia_result *result, const struct ischia_uncertainty *uncertainty)
{
    print_inputs(out, request);
    if (ischia_result_converged(result)) {
        print_strain(out, result);
        print_volumes(out, result);
        print_seat(out, &result->seat);
        if (uncertainty != NULL) print_uncertainty(out, uncertainty);
        print_risk(out, &request->values, result);
    }
    print_numerics(out, &request->values, &result->numerics);
}
