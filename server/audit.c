/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/audit.h"

#include <sodium.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "server/digest.h"

enum { MINUTE_MS = 60000 };
#define RECENT 4096U

struct audit {
    struct store *store;
    atomic_int mode;
    unsigned char key[crypto_shorthash_KEYBYTES];
    /* One slot holds the hash of (who, what, id, minute) that was recorded last; two that share a
     * slot push each other out, and are then recorded once too often. */
    atomic_ullong recent[RECENT];
};

enum ischia_code audit_create(struct audit **ret, struct store *store, struct ischia_error *err)
{
    CHECK(sodium_init() >= 0, err, ISCHIA_E_STATE, "libsodium could not start");
    struct audit *audit = calloc(1, sizeof *audit);
    CHECK(audit != NULL, err, ISCHIA_E_MEMORY, "no memory for the audit log");
    audit->store = store;
    atomic_store(&audit->mode, CONFIG_AUDIT_ALL);
    crypto_shorthash_keygen(audit->key);
    *ret = audit;
    return ISCHIA_OK;
}

void audit_destroy(struct audit *audit) { free(audit); }

void audit_set_mode(struct audit *audit, enum config_audit mode)
{
    atomic_store(&audit->mode, (int)mode);
}

static bool append(struct audit *audit, const char *who, const char *what, const char *id,
                   const char *outcome)
{
    const struct store_audit row = {
        .who = who, .what = what, .subject = id, .outcome = outcome, .detail = ""};
    return store_audit_append_later(audit->store, &row, NULL) == ISCHIA_OK;
}

bool audit_change(struct audit *audit, const char *who, const char *what, const char *id,
                  const char *outcome)
{
    if (atomic_load(&audit->mode) == CONFIG_AUDIT_OFF) return true;
    return append(audit, who, what, id, outcome);
}

/* True when the same was recorded in this minute; else remembers it. */
static bool seen_lately(struct audit *audit, const char *who, const char *what, const char *id,
                        int64_t now_ms)
{
    char text[256];
    unsigned char hash[crypto_shorthash_BYTES];
    unsigned long long value = 0;
    const int n = snprintf(text, sizeof text, "%s|%.48s|%.48s|%lld", who, what, id,
                           (long long)(now_ms / MINUTE_MS));
    if (n < 0 || (size_t)n >= sizeof text) return false;
    (void)crypto_shorthash(hash, (const unsigned char *)text, (unsigned long long)n, audit->key);
    memcpy(&value, hash, sizeof value);
    atomic_ullong *slot = &audit->recent[value % RECENT];
    return atomic_exchange(slot, value) == value;
}

bool audit_read(struct audit *audit, const char *who, const char *what, const char *id,
                int64_t now_ms)
{
    if (atomic_load_explicit(&audit->mode, memory_order_relaxed) != CONFIG_AUDIT_ALL) return true;
    if (seen_lately(audit, who, what, id, now_ms)) return true;
    return append(audit, who, what, id, "ok");
}

enum ischia_code audit_verify(struct store *store, FILE *out, struct ischia_error *err)
{
    struct store_audit_report report;
    char head[DIGEST_HEX_BYTES];
    TRY(store_audit_verify(store, &report, err));
    CHECK(report.first_bad_seq == 0, err, ISCHIA_E_STATE,
          "the audit log was changed: row %lld does not follow from the one before",
          (long long)report.first_bad_seq);
    digest_hex(report.head_hash, head);
    (void)fprintf(out, "%lld rows, the chain holds; head %lld %s\n", (long long)report.rows,
                  (long long)report.head_seq, head);
    return ISCHIA_OK;
}

static bool print_row(void *context, const struct store_audit *row)
{
    FILE *out = context;
    char date[32];
    const time_t when = (time_t)(row->at_ms / 1000);
    struct tm parts;
    (void)gmtime_r(&when, &parts);
    (void)strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%S", &parts);
    return fprintf(out, "seq=%lld time=%s.%03dZ who=%s what=%s id=%s outcome=%s\n",
                   (long long)row->seq, date, (int)(row->at_ms % 1000), row->who, row->what,
                   row->subject[0] == '\0' ? "-" : row->subject, row->outcome) >= 0;
}

enum ischia_code audit_list(struct store *store, FILE *out, struct ischia_error *err)
{
    return store_audit_list(store, 0, print_row, out, err);
}
