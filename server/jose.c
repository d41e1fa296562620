/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/jose.h"

#include <gnutls/abstract.h>
#include <gnutls/crypto.h>
#include <gnutls/gnutls.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/base64.h"

enum { COORDINATE_BYTES = 48 /* of P-384 */, RSA_BITS_MIN = 2048, NUMBER_BYTES_MAX = 1024 };

struct jose_key {
    gnutls_pubkey_t public; /* one of the two */
    gnutls_privkey_t private;
    gnutls_sign_algorithm_t signature;
    const char *algorithm;
    char id[JOSE_KEY_ID_BYTES];
    pthread_mutex_t lock; /* gnutls does not promise that one object serves two threads */
};

static struct jose_key *create(void)
{
    struct jose_key *key = calloc(1, sizeof *key);
    if (key != NULL) (void)pthread_mutex_init(&key->lock, NULL);
    return key;
}

void jose_key_destroy(struct jose_key *key)
{
    if (key == NULL) return;
    if (key->public != NULL) gnutls_pubkey_deinit(key->public);
    if (key->private != NULL) gnutls_privkey_deinit(key->private);
    (void)pthread_mutex_destroy(&key->lock);
    free(key);
}

const char *jose_key_algorithm(const struct jose_key *key) { return key->algorithm; }
const char *jose_key_id(const struct jose_key *key) { return key->id; }

const char *jose_library_version(void) { return gnutls_check_version(NULL); }

/* ---------------------------------------------------------------------------- reading */

static const char *text_of(const struct json *object, const char *key)
{
    const struct json *value = json_member(object, key);
    return value != NULL && json_type_of(value) == JSON_STRING ? json_string(value) : "";
}

struct number {
    unsigned char bytes[NUMBER_BYTES_MAX];
    gnutls_datum_t datum;
};

static bool number_of(const struct json *jwk, const char *name, struct number *ret)
{
    const char *text = text_of(jwk, name);
    size_t size = 0;
    if (!base64url_decode(text, strlen(text), ret->bytes, sizeof ret->bytes, &size)) return false;
    ret->datum = (gnutls_datum_t){ret->bytes, (unsigned)size};
    return size > 0;
}

static bool import_elliptic(struct jose_key *key, const struct json *jwk)
{
    struct number x, y;
    key->algorithm = "ES384";
    key->signature = GNUTLS_SIGN_ECDSA_SHA384;
    return strcmp(text_of(jwk, "crv"), "P-384") == 0 && number_of(jwk, "x", &x) &&
           number_of(jwk, "y", &y) && x.datum.size == COORDINATE_BYTES &&
           y.datum.size == COORDINATE_BYTES &&
           gnutls_pubkey_import_ecc_raw(key->public, GNUTLS_ECC_CURVE_SECP384R1, &x.datum,
                                        &y.datum) == 0;
}

static bool import_rsa(struct jose_key *key, const struct json *jwk)
{
    struct number modulus, exponent;
    unsigned bits = 0;
    key->algorithm = "RS384";
    key->signature = GNUTLS_SIGN_RSA_SHA384;
    return number_of(jwk, "n", &modulus) && number_of(jwk, "e", &exponent) &&
           gnutls_pubkey_import_rsa_raw(key->public, &modulus.datum, &exponent.datum) == 0 &&
           gnutls_pubkey_get_pk_algorithm(key->public, &bits) == GNUTLS_PK_RSA &&
           bits >= RSA_BITS_MIN;
}

static bool import_jwk(struct jose_key *key, const struct json *jwk)
{
    const char *kind = text_of(jwk, "kty"), *use = text_of(jwk, "use"), *alg = text_of(jwk, "alg");
    if (strlen(text_of(jwk, "kid")) >= sizeof key->id) return false;
    (void)snprintf(key->id, sizeof key->id, "%s", text_of(jwk, "kid"));
    if (use[0] != '\0' && strcmp(use, "sig") != 0) return false;
    if (gnutls_pubkey_init(&key->public) != 0) return false;
    const bool good = strcmp(kind, "EC") == 0    ? import_elliptic(key, jwk)
                      : strcmp(kind, "RSA") == 0 ? import_rsa(key, jwk)
                                                 : false;
    return good && (alg[0] == '\0' || strcmp(alg, key->algorithm) == 0);
}

enum ischia_code jose_public_key(struct jose_key **ret, const struct json *jwk,
                                 struct ischia_error *err)
{
    struct jose_key *key = create();
    CHECK(key != NULL, err, ISCHIA_E_MEMORY, "no memory for a key");
    if (!import_jwk(key, jwk)) {
        jose_key_destroy(key);
        return FAIL(err, ISCHIA_E_INPUT,
                    "a key is neither EC on P-384 (ES384) nor RSA of %d bits or more (RS384)",
                    RSA_BITS_MIN);
    }
    *ret = key;
    return ISCHIA_OK;
}

static bool import_pem(struct jose_key *key, const char *pem)
{
    gnutls_datum_t text = {(unsigned char *)(size_t)pem, (unsigned)strlen(pem)};
    gnutls_ecc_curve_t curve = GNUTLS_ECC_CURVE_INVALID;
    unsigned bits = 0;
    if (gnutls_privkey_init(&key->private) != 0) return false;
    if (gnutls_privkey_import_x509_raw(key->private, &text, GNUTLS_X509_FMT_PEM, NULL, 0) != 0)
        return false;
    const int kind = gnutls_privkey_get_pk_algorithm(key->private, &bits);
    key->algorithm = kind == GNUTLS_PK_RSA ? "RS384" : "ES384";
    key->signature = kind == GNUTLS_PK_RSA ? GNUTLS_SIGN_RSA_SHA384 : GNUTLS_SIGN_ECDSA_SHA384;
    if (kind == GNUTLS_PK_RSA) return bits >= RSA_BITS_MIN;
    return kind == GNUTLS_PK_ECDSA &&
           gnutls_privkey_export_ecc_raw(key->private, &curve, NULL, NULL, NULL) == 0 &&
           curve == GNUTLS_ECC_CURVE_SECP384R1;
}

enum ischia_code jose_private_key(struct jose_key **ret, const char *pem, const char *key_id,
                                  struct ischia_error *err)
{
    struct jose_key *key = create();
    CHECK(key != NULL, err, ISCHIA_E_MEMORY, "no memory for a key");
    if (!import_pem(key, pem) || strlen(key_id) >= sizeof key->id ||
        strpbrk(key_id, "\"\\") != NULL) {
        jose_key_destroy(key);
        return FAIL(err, ISCHIA_E_INPUT,
                    "the private key is neither EC on P-384 (ES384) nor RSA of %d bits or more "
                    "(RS384), in PEM without a passphrase",
                    RSA_BITS_MIN);
    }
    (void)snprintf(key->id, sizeof key->id, "%s", key_id);
    *ret = key;
    return ISCHIA_OK;
}

/* -------------------------------------------------------------------------- verifying */

/* JWS has r and s behind each other, gnutls wants them as DER. */
static int verify(struct jose_key *key, const gnutls_datum_t *text, const unsigned char *signature,
                  size_t size)
{
    unsigned char copy[2 * COORDINATE_BYTES];
    gnutls_datum_t der = {NULL, 0};
    if (key->signature != GNUTLS_SIGN_ECDSA_SHA384) {
        gnutls_datum_t plain = {(unsigned char *)(size_t)signature, (unsigned)size};
        return gnutls_pubkey_verify_data2(key->public, key->signature, 0, text, &plain);
    }
    if (size != sizeof copy) return GNUTLS_E_PK_SIG_VERIFY_FAILED;
    memcpy(copy, signature, sizeof copy);
    const gnutls_datum_t r = {copy, COORDINATE_BYTES};
    const gnutls_datum_t s = {copy + COORDINATE_BYTES, COORDINATE_BYTES};
    int status = gnutls_encode_rs_value(&der, &r, &s);
    if (status == 0)
        status = gnutls_pubkey_verify_data2(key->public, key->signature, 0, text, &der);
    gnutls_free(der.data);
    return status;
}

bool jose_verify(struct jose_key *key, const char *text, size_t length,
                 const unsigned char *signature, size_t signature_size)
{
    const gnutls_datum_t datum = {(unsigned char *)(size_t)text, (unsigned)length};
    (void)pthread_mutex_lock(&key->lock);
    const int status = verify(key, &datum, signature, signature_size);
    (void)pthread_mutex_unlock(&key->lock);
    return status >= 0;
}

/* ---------------------------------------------------------------------------- signing */

/* A number of DER, which may have a zero before it or fewer bytes, as exactly 48 bytes. */
static bool put_coordinate(unsigned char ret[COORDINATE_BYTES], const gnutls_datum_t *number)
{
    const unsigned char *bytes = number->data;
    size_t size = number->size;
    while (size > 0 && bytes[0] == 0) {
        bytes++;
        size--;
    }
    if (size > COORDINATE_BYTES) return false;
    memset(ret, 0, COORDINATE_BYTES - size);
    memcpy(ret + COORDINATE_BYTES - size, bytes, size);
    return true;
}

static bool put_signature(struct text_out *out, const struct jose_key *key,
                          const gnutls_datum_t *signature)
{
    unsigned char pair[2 * COORDINATE_BYTES];
    gnutls_datum_t r = {NULL, 0}, s = {NULL, 0};
    if (key->signature != GNUTLS_SIGN_ECDSA_SHA384) {
        base64url_put(out, signature->data, signature->size);
        return true;
    }
    const bool good = gnutls_decode_rs_value(signature, &r, &s) == 0 && put_coordinate(pair, &r) &&
                      put_coordinate(pair + COORDINATE_BYTES, &s);
    if (good) base64url_put(out, pair, sizeof pair);
    gnutls_free(r.data);
    gnutls_free(s.data);
    return good;
}

static void put_head(struct text_out *out, const struct jose_key *key, const char *claims_json)
{
    char head[64 + JOSE_KEY_ID_BYTES];
    const int length =
        snprintf(head, sizeof head, "{\"alg\":\"%s\",\"kid\":\"%s\",\"typ\":\"JWT\"}",
                 key->algorithm, key->id);
    base64url_put(out, head, (size_t)length);
    text_put_string(out, ".");
    base64url_put(out, claims_json, strlen(claims_json));
}

enum ischia_code jose_sign(struct jose_key *key, const char *claims_json, char **ret_token,
                           struct ischia_error *err)
{
    struct text_out out;
    gnutls_datum_t signature = {NULL, 0};
    text_out_init(&out);
    put_head(&out, key, claims_json);
    if (out.failed) return text_out_take(&out, ret_token, NULL, err);
    const gnutls_datum_t text = {(unsigned char *)out.text, (unsigned)out.length};
    (void)pthread_mutex_lock(&key->lock);
    const int status =
        gnutls_privkey_sign_data2(key->private, key->signature, 0, &text, &signature);
    (void)pthread_mutex_unlock(&key->lock);
    text_put_string(&out, ".");
    const bool good = status == 0 && put_signature(&out, key, &signature);
    gnutls_free(signature.data);
    if (good) return text_out_take(&out, ret_token, NULL, err);
    text_out_finish(&out);
    return FAIL(err, ISCHIA_E_STATE, "a token cannot be signed: %s", gnutls_strerror(status));
}
