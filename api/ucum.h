/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_UCUM_H
#define ISCHIA_API_UCUM_H

#include <stddef.h>

/*
 * Units as record systems write them (UCUM codes), turned into those of ischia_params. A unit that
 * the table does not know, or of another kind of quantity, is refused: none is ever assumed.
 */
enum { UCUM_DIGITS_BYTES = 80 };

enum ucum_answer {
    UCUM_CONVERTED,
    UCUM_UNKNOWN,   /* no such unit in the table                        */
    UCUM_OTHER_KIND /* a unit, but of something else than `to` measures */
};

/* digits: a JSON number. Powers of ten move the exponent only, so that "0.71" cm is exactly the
 * double of "7.1" mm; the same unit copies the digits as they are. ret is untouched on refusal. */
enum ucum_answer ucum_convert(const char *digits, const char *from, const char *to,
                              char ret[UCUM_DIGITS_BYTES]);

/* The units that can be turned into `to`, "mm, cm, m", for messages and docs. Returns buffer. */
const char *ucum_known(const char *to, char *buffer, size_t size);

/* Row `index` of the table, for docs and tests; NULL behind the last. */
struct ucum_unit {
    const char *code, *canonical; /* canonical: "mm", "kPa", "N"                     */
    int power;                    /* of ten: 1 code = factor * 10^power canonical    */
    double factor;                /* 1 where a power of ten says it all              */
};
const struct ucum_unit *ucum_unit_at(size_t index);

#endif
