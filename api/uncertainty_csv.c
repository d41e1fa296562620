/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/uncertainty_csv.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "api/csv.h"
#include "api/uncertainty_doc.h"

enum { NAME_BYTES = 48 };

/* Of uncertainty_probabilities: a table wants the ends and the middle. */
static const int shown[] = {0, 2, 4};
enum { SHOWN_COUNT = sizeof shown / sizeof shown[0] };

static const struct share {
    const char *name;
    size_t offset;
} shares[] = {
    {"share_shear", offsetof(struct ischia_uncertainty, share_shear)},
    {"share_compression", offsetof(struct ischia_uncertainty, share_compression)},
    {"share_both", offsetof(struct ischia_uncertainty, share_both)},
};
enum { SHARE_COUNT = sizeof shares / sizeof shares[0] };

enum {
    FIRST_QUANTILE = 1,
    FIRST_SHARE = FIRST_QUANTILE + UNCERTAIN_COUNT * SHOWN_COUNT,
    MEASURE_BETTER = FIRST_SHARE + SHARE_COUNT,
    MEASURE_BETTER_INDEX,
    COLUMN_COUNT
};

static const char *column_name(int column, char ret[NAME_BYTES])
{
    if (column >= FIRST_QUANTILE && column < FIRST_SHARE) {
        const int at = column - FIRST_QUANTILE;
        const double percent = 100 * uncertainty_probabilities[shown[at % SHOWN_COUNT]];
        (void)snprintf(ret, NAME_BYTES, "%s_q%02.0f", uncertain_response[at / SHOWN_COUNT],
                       percent);
        return ret;
    }
    if (column >= FIRST_SHARE && column < MEASURE_BETTER) return shares[column - FIRST_SHARE].name;
    if (column == MEASURE_BETTER) return "measure_better";
    return column == MEASURE_BETTER_INDEX ? "measure_better_index" : "uncertainty";
}

void uncertainty_csv_put_header(struct text_out *out)
{
    char name[NAME_BYTES];
    for (int i = 0; i < COLUMN_COUNT; i++) csv_put_text(out, column_name(i, name), false);
}

bool uncertainty_csv_has_column(const char *name)
{
    char buffer[NAME_BYTES];
    for (int i = 0; i < COLUMN_COUNT; i++)
        if (strcmp(name, column_name(i, buffer)) == 0) return true;
    return false;
}

static void put_given(struct text_out *out, const struct ischia_uncertainty *u)
{
    enum ischia_param order[ISCHIA_PARAM_COUNT];
    const int largest = uncertainty_order(u, order) > 0 ? (int)order[0] : -1;
    for (int q = 0; q < UNCERTAIN_COUNT; q++)
        for (int k = 0; k < SHOWN_COUNT; k++) csv_put_number(out, u->quantile[q][shown[k]], false);
    for (int i = 0; i < SHARE_COUNT; i++) {
        double share;
        memcpy(&share, (const char *)u + shares[i].offset, sizeof share);
        csv_put_number(out, share, false);
    }
    csv_put_text(out, largest < 0 ? "" : ischia_params[largest].key, false);
    csv_put_number(out, largest < 0 ? (double)NAN : u->total[largest], false);
}

void uncertainty_csv_put(struct text_out *out, const struct ischia_uncertainty *u)
{
    csv_put_text(out, u == NULL ? "" : uncertainty_status_names[u->status], false);
    if (u != NULL && u->status == UNCERTAINTY_GIVEN) {
        put_given(out, u);
        return;
    }
    for (int i = FIRST_QUANTILE; i < COLUMN_COUNT; i++) csv_put_text(out, "", false);
}
