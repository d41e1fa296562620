/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/study_response.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "api/case_words.h"
#include "api/csv.h"

#define AT(member) offsetof(struct ischia_result, member)

const struct study_response study_responses[] = {
    {"eps_max", AT(strain.eps_max), false, false},
    {"eps_max_error", AT(numerics.eps_max_error), false, false},
    {"eps_max_depth_mm", AT(strain.eps_max_depth_mm), false, false},
    {"E_shear_max", AT(strain.E_shear_max), false, false},
    {"E_comp_max", AT(strain.E_comp_max), false, false},
    {"volume_shear_mm3", AT(clusters[ISCHIA_OVER_SHEAR].volume_mm3), false, false},
    {"volume_compression_mm3", AT(clusters[ISCHIA_OVER_COMPRESSION].volume_mm3), false, false},
    {"volume_both_mm3", AT(clusters[ISCHIA_OVER_BOTH].volume_mm3), false, false},
    {"largest_both_mm3", AT(clusters[ISCHIA_OVER_BOTH].largest.volume_mm3), false, false},
    {"seat_displacement_mm", AT(seat.displacement_mm), false, false},
    {"contact_area_mm2", AT(seat.contact_area_mm2), false, false},
    {"mean_pressure_kPa", AT(seat.mean_pressure_kPa), false, false},
    {"peak_pressure_kPa", AT(seat.peak_pressure_kPa), false, false},
    {"force_shear_N", AT(threshold_force_shear_N), false, false},
    {"force_compression_N", AT(threshold_force_compression_N), false, false},
    {"force_residual", AT(numerics.force_residual), false, false},
    {"energy_residual", AT(numerics.energy_residual), false, false},
    {"det_F_min", AT(numerics.det_F_min), false, false},
    {"last_converged_F_N", AT(numerics.last_converged_F_N), false, true},
    {"newton_iterations", AT(numerics.newton_iterations), true, true},
    {"elements", AT(numerics.elements), true, true},
    {"dof", AT(numerics.dof), true, true},
};
const int study_response_count = sizeof study_responses / sizeof study_responses[0];
_Static_assert(sizeof study_responses / sizeof study_responses[0] <= STUDY_RESPONSES_MAX,
               "a plan has room for every response");

int study_response_find(const char *name)
{
    for (int i = 0; i < study_response_count; i++)
        if (strcmp(study_responses[i].name, name) == 0) return i;
    return -1;
}

static double value_of(const struct study_response *response, const struct ischia_result *result)
{
    const char *at = (const char *)result + response->offset;
    double number;
    int integer;
    if (response->is_int) {
        memcpy(&integer, at, sizeof integer);
        return integer;
    }
    memcpy(&number, at, sizeof number);
    return number;
}

/* The reason goes into a file of lines: one printable line. */
static void put_reason(struct text_out *out, const char *word, const char *detail)
{
    char reason[320], printable[320];
    (void)snprintf(reason, sizeof reason, "%s%s%s", word,
                   word[0] != '\0' && detail[0] != '\0' ? ": " : "", detail);
    csv_put_text(out, text_printable(reason, printable, sizeof printable), false);
}

double study_response_value(int response, const struct ischia_result *result)
{
    const struct study_response *r = &study_responses[response];
    return r->always || ischia_result_converged(result) ? value_of(r, result) : (double)NAN;
}

void study_response_put(struct text_out *out, const struct ischia_result *result, const char *word,
                        const char *detail, const int *chosen, int count)
{
    const bool succeeded = result != NULL && ischia_result_converged(result);
    csv_put_text(out, succeeded ? "succeeded" : "failed", true);
    put_reason(out, word, succeeded ? "" : detail);
    for (int i = 0; i < count; i++)
        csv_put_number(out, result != NULL ? study_response_value(chosen[i], result) : (double)NAN,
                       false);
}

void study_response_put_refused(struct text_out *out, const struct ischia_case *c, int count)
{
    struct ischia_case_fault faults[ISCHIA_CASE_FAULTS_MAX];
    struct ischia_fault first;
    const size_t n = ischia_case_faults(c, faults);
    assert(n > 0);
    case_fault_words(&first, LANGUAGE_EN, c, &faults[0]);
    csv_put_text(out, "refused", true);
    put_reason(out, first.code, first.detail);
    for (int i = 0; i < count; i++) csv_put_number(out, (double)NAN, false);
}
