/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/rate.h"

#include <pthread.h>
#include <sodium.h>
#include <stdlib.h>
#include <string.h>

enum { BUCKETS = 8192, LOCKS = 64 };

struct bucket {
    double level; /* requests that may be sent now */
    int64_t filled_ms;
    bool used;
};

struct rate {
    unsigned char key[crypto_shorthash_KEYBYTES]; /* secret: nobody can aim at another's slot */
    pthread_mutex_t lock[LOCKS];
    struct bucket bucket[BUCKETS];
};

enum ischia_code rate_create(struct rate **ret, struct ischia_error *err)
{
    CHECK(sodium_init() >= 0, err, ISCHIA_E_STATE, "libsodium could not start");
    struct rate *rate = calloc(1, sizeof *rate);
    CHECK(rate != NULL, err, ISCHIA_E_MEMORY, "no memory for the rate limits");
    crypto_shorthash_keygen(rate->key);
    for (int i = 0; i < LOCKS; i++) (void)pthread_mutex_init(&rate->lock[i], NULL);
    *ret = rate;
    return ISCHIA_OK;
}

void rate_destroy(struct rate *rate)
{
    if (rate == NULL) return;
    for (int i = 0; i < LOCKS; i++) (void)pthread_mutex_destroy(&rate->lock[i]);
    free(rate);
}

static void fill(struct bucket *bucket, int per_second, int burst, int64_t now_ms)
{
    const double added = (double)(now_ms - bucket->filled_ms) * per_second / 1000.0;
    bucket->level = bucket->used ? bucket->level + added : burst;
    if (bucket->level > burst) bucket->level = burst;
    bucket->filled_ms = now_ms;
    bucket->used = true;
}

int rate_take(struct rate *rate, const char *client, int per_second, int burst, int64_t now_ms)
{
    unsigned char hash[crypto_shorthash_BYTES];
    uint64_t slot = 0;
    (void)crypto_shorthash(hash, (const unsigned char *)client, strlen(client), rate->key);
    memcpy(&slot, hash, sizeof slot);
    struct bucket *bucket = &rate->bucket[slot % BUCKETS];
    pthread_mutex_t *lock = &rate->lock[slot % LOCKS];
    int wait_s = 0;
    (void)pthread_mutex_lock(lock);
    fill(bucket, per_second, burst, now_ms);
    if (bucket->level >= 1)
        bucket->level -= 1;
    else
        wait_s = 1 + (int)((1 - bucket->level) / per_second);
    (void)pthread_mutex_unlock(lock);
    return wait_s;
}
