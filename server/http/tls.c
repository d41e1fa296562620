/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/http/tls.h"

#include <gnutls/abstract.h>
#include <gnutls/gnutls.h>
#include <gnutls/x509.h>
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/*
 * Each handshake parses the texts again into objects of its own, which GnuTLS frees with the
 * session: nothing is shared between threads but two strings under a lock. Parsing costs a small
 * part of a handshake.
 */

enum { CHAIN_MAX = 16 };

static struct {
    pthread_mutex_t lock;
    char *certificate, *key;
} current = {.lock = PTHREAD_MUTEX_INITIALIZER};

struct pair {
    gnutls_pcert_st *chain; /* [length], gnutls_malloc'ed */
    unsigned length;
    gnutls_privkey_t key;
};

static gnutls_datum_t datum(const char *text)
{
    return (gnutls_datum_t){(unsigned char *)(uintptr_t)text, (unsigned)strlen(text)};
}

static void pair_finish(struct pair *pair)
{
    for (unsigned i = 0; i < pair->length; i++) gnutls_pcert_deinit(&pair->chain[i]);
    gnutls_free(pair->chain);
    if (pair->key != NULL) gnutls_privkey_deinit(pair->key);
}

static int parse_chain(struct pair *pair, const char *certificate)
{
    const gnutls_datum_t text = datum(certificate);
    unsigned length = CHAIN_MAX;
    pair->chain = gnutls_calloc(CHAIN_MAX, sizeof *pair->chain);
    if (pair->chain == NULL) return GNUTLS_E_MEMORY_ERROR;
    const int code =
        gnutls_pcert_list_import_x509_raw(pair->chain, &length, &text, GNUTLS_X509_FMT_PEM, 0);
    if (code >= 0) pair->length = length;
    return code;
}

static int parse_key(struct pair *pair, const char *key)
{
    const gnutls_datum_t text = datum(key);
    const int code = gnutls_privkey_init(&pair->key);
    if (code < 0) return code;
    return gnutls_privkey_import_x509_raw(pair->key, &text, GNUTLS_X509_FMT_PEM, NULL, 0);
}

/* On failure *ret is empty. */
static int parse(struct pair *ret, const char *certificate, const char *key)
{
    struct pair pair = {0};
    int code = parse_chain(&pair, certificate);
    if (code >= 0) code = parse_key(&pair, key);
    if (code < 0)
        pair_finish(&pair);
    else
        *ret = pair;
    return code;
}

static int retrieve(gnutls_session_t session, const struct gnutls_cert_retr_st *info,
                    gnutls_pcert_st **certificates, unsigned *count, gnutls_ocsp_data_st **ocsp,
                    unsigned *ocsp_count, gnutls_privkey_t *key, unsigned *flags)
{
    struct pair pair = {0};
    (void)session;
    (void)info;
    (void)pthread_mutex_lock(&current.lock);
    const int code = current.certificate == NULL ? GNUTLS_E_NO_CERTIFICATE_FOUND
                                                 : parse(&pair, current.certificate, current.key);
    (void)pthread_mutex_unlock(&current.lock);
    if (code < 0) return -1;
    *certificates = pair.chain;
    *count = pair.length;
    *ocsp = NULL;
    *ocsp_count = 0;
    *key = pair.key;
    *flags = GNUTLS_CERT_RETR_DEINIT_ALL;
    return 0;
}

void *tls_callback(void)
{
    gnutls_certificate_retrieve_function3 *const function = retrieve;
    return (void *)(uintptr_t)function;
}

/* As a server would: GnuTLS compares the certificate's public key with the private one. */
static enum ischia_code check_belong_together(const char *certificate, const char *key,
                                              struct ischia_error *err)
{
    const gnutls_datum_t certificate_text = datum(certificate), key_text = datum(key);
    gnutls_certificate_credentials_t credentials;
    CHECK(gnutls_certificate_allocate_credentials(&credentials) >= 0, err, ISCHIA_E_MEMORY,
          "no memory for the certificate");
    const int code = gnutls_certificate_set_x509_key_mem2(credentials, &certificate_text, &key_text,
                                                          GNUTLS_X509_FMT_PEM, NULL, 0);
    gnutls_certificate_free_credentials(credentials);
    CHECK(code >= 0, err, ISCHIA_E_INPUT,
          "tls_certificate and tls_key are not PEM files that belong together: %s",
          gnutls_strerror(code));
    return ISCHIA_OK;
}

static enum ischia_code find_expiry(const char *certificate, time_t *ret, struct ischia_error *err)
{
    const gnutls_datum_t text = datum(certificate);
    gnutls_x509_crt_t own;
    CHECK(gnutls_x509_crt_init(&own) >= 0, err, ISCHIA_E_MEMORY, "no memory for the certificate");
    const int code = gnutls_x509_crt_import(own, &text, GNUTLS_X509_FMT_PEM);
    const time_t expires = code < 0 ? 0 : gnutls_x509_crt_get_expiration_time(own);
    gnutls_x509_crt_deinit(own);
    CHECK(code >= 0, err, ISCHIA_E_INPUT, "tls_certificate is not a PEM file: %s",
          gnutls_strerror(code));
    *ret = expires;
    return ISCHIA_OK;
}

static void wipe(char *text)
{
    if (text != NULL) gnutls_memset(text, 0, strlen(text));
    free(text);
}

/* Takes over both strings. */
static void replace(char *certificate, char *key)
{
    (void)pthread_mutex_lock(&current.lock);
    char *const old_certificate = current.certificate, *const old_key = current.key;
    current.certificate = certificate;
    current.key = key;
    (void)pthread_mutex_unlock(&current.lock);
    free(old_certificate);
    wipe(old_key);
}

enum ischia_code tls_set(const char *certificate_pem, const char *key_pem, time_t *ret_expires,
                         struct ischia_error *err)
{
    struct pair pair = {0};
    TRY(check_belong_together(certificate_pem, key_pem, err));
    TRY(find_expiry(certificate_pem, ret_expires, err));
    const int code = parse(&pair, certificate_pem, key_pem);
    CHECK(code >= 0, err, ISCHIA_E_INPUT, "tls_certificate or tls_key cannot be used: %s",
          gnutls_strerror(code));
    pair_finish(&pair);
    char *certificate = strdup(certificate_pem), *key = strdup(key_pem);
    if (certificate == NULL || key == NULL) {
        free(certificate);
        wipe(key);
        return FAIL(err, ISCHIA_E_MEMORY, "no memory for the certificate");
    }
    replace(certificate, key);
    return ISCHIA_OK;
}

void tls_clear(void) { replace(NULL, NULL); }

const char *tls_library_version(void) { return gnutls_check_version(NULL); }
