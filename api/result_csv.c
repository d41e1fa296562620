/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/result_csv.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "api/csv.h"

const char *const result_csv_columns[RESULT_CSV_COLUMN_COUNT] = {
    "status",
    "reason",
    "eps_max",
    "eps_max_error",
    "E_shear_max",
    "E_comp_max",
    "volume_shear_mm3",
    "volume_compression_mm3",
    "volume_both_mm3",
    "largest_both_mm3",
    "seat_displacement_mm",
    "contact_area_mm2",
    "mean_pressure_kPa",
    "peak_pressure_kPa",
    "force_shear_N",
    "force_compression_N",
    "newton_iterations",
    "wall_s",
};

/* The numbers, in the order of the columns behind status and reason. */
#define AT(member) offsetof(struct ischia_result, member)
static const size_t converged_numbers[] = {
    AT(strain.eps_max),
    AT(numerics.eps_max_error),
    AT(strain.E_shear_max),
    AT(strain.E_comp_max),
    AT(clusters[ISCHIA_OVER_SHEAR].volume_mm3),
    AT(clusters[ISCHIA_OVER_COMPRESSION].volume_mm3),
    AT(clusters[ISCHIA_OVER_BOTH].volume_mm3),
    AT(clusters[ISCHIA_OVER_BOTH].largest.volume_mm3),
    AT(seat.displacement_mm),
    AT(seat.contact_area_mm2),
    AT(seat.mean_pressure_kPa),
    AT(seat.peak_pressure_kPa),
    AT(threshold_force_shear_N),
    AT(threshold_force_compression_N),
};
enum { CONVERGED_NUMBERS = sizeof converged_numbers / sizeof converged_numbers[0] };
_Static_assert(RESULT_CSV_COLUMN_COUNT == 2 + CONVERGED_NUMBERS + 2,
               "status, reason, the numbers, newton_iterations, wall_s");

void result_csv_put_header(struct text_out *out, bool first)
{
    for (int i = 0; i < RESULT_CSV_COLUMN_COUNT; i++)
        csv_put_text(out, result_csv_columns[i], first && i == 0);
}

static double number_at(const struct ischia_result *result, size_t offset)
{
    double value;
    memcpy(&value, (const char *)result + offset, sizeof value);
    return value;
}

void result_csv_put(struct text_out *out, const char *status, const char *reason,
                    const struct ischia_result *result, bool first)
{
    const bool converged = result != NULL && ischia_result_converged(result);
    csv_put_text(out, status, first);
    csv_put_text(out, reason, false);
    for (int i = 0; i < CONVERGED_NUMBERS; i++)
        csv_put_number(out, converged ? number_at(result, converged_numbers[i]) : (double)NAN,
                       false);
    if (result == NULL) {
        csv_put_text(out, "", false);
        csv_put_text(out, "", false);
        return;
    }
    csv_put_integer(out, result->numerics.newton_iterations, false);
    csv_put_number(out, result->numerics.wall_s, false);
}
