/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/hl7/link.h"

#include <errno.h>
#include <fcntl.h>
#include <gnutls/gnutls.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "server/address.h"

struct link_tls {
    gnutls_certificate_credentials_t credentials;
    bool needs_peer; /* a server that asks its clients for a certificate */
};

struct link {
    int fd;
    gnutls_session_t session; /* NULL: plain */
};

/* ------------------------------------------------------------------------ certificates */

enum ischia_code link_tls_create(struct link_tls **ret, const char *certificate, const char *key,
                                 const char *ca, struct ischia_error *err)
{
    struct link_tls *tls = calloc(1, sizeof *tls);
    CHECK(tls != NULL, err, ISCHIA_E_MEMORY, "no memory for certificates");
    int status = gnutls_certificate_allocate_credentials(&tls->credentials);
    if (status == 0 && certificate != NULL) {
        const gnutls_datum_t chain = {(unsigned char *)(size_t)certificate,
                                      (unsigned)strlen(certificate)};
        const gnutls_datum_t secret = {(unsigned char *)(size_t)key, (unsigned)strlen(key)};
        status = gnutls_certificate_set_x509_key_mem(tls->credentials, &chain, &secret,
                                                     GNUTLS_X509_FMT_PEM);
    }
    if (status >= 0 && ca != NULL) {
        const gnutls_datum_t trust = {(unsigned char *)(size_t)ca, (unsigned)strlen(ca)};
        status =
            gnutls_certificate_set_x509_trust_mem(tls->credentials, &trust, GNUTLS_X509_FMT_PEM);
        tls->needs_peer = true;
    } else if (status >= 0 && certificate == NULL) {
        status = gnutls_certificate_set_x509_system_trust(tls->credentials);
    }
    if (status < 0) link_tls_destroy(tls);
    CHECK(status >= 0, err, ISCHIA_E_INPUT, "the certificates cannot be used: %s",
          gnutls_strerror(status));
    *ret = tls;
    return ISCHIA_OK;
}

void link_tls_destroy(struct link_tls *tls)
{
    if (tls == NULL) return;
    if (tls->credentials != NULL) gnutls_certificate_free_credentials(tls->credentials);
    free(tls);
}

/* ------------------------------------------------------------------------------ opening */

static int64_t now_ms(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

static bool wait_for(const struct link *link, short events, int64_t until_ms)
{
    struct pollfd p = {.fd = link->fd, .events = events};
    for (;;) {
        const int64_t left = until_ms - now_ms();
        const int n = poll(&p, 1, left < 0 ? 0 : (int)left);
        if (n > 0) return true;
        if (n == 0 || errno != EINTR) return false;
    }
}

static short wanted(const struct link *link)
{
    return gnutls_record_get_direction(link->session) != 0 ? POLLOUT : POLLIN;
}

static int shake_hands(struct link *link, int timeout_ms)
{
    const int64_t until_ms = now_ms() + timeout_ms;
    for (;;) {
        const int status = gnutls_handshake(link->session);
        if (status == 0 || gnutls_error_is_fatal(status) != 0) return status;
        if (!wait_for(link, wanted(link), until_ms)) return GNUTLS_E_TIMEDOUT;
    }
}

static int begin_tls(struct link *link, struct link_tls *tls, const char *host, int timeout_ms)
{
    int status = gnutls_init(&link->session,
                             (host == NULL ? GNUTLS_SERVER : GNUTLS_CLIENT) | GNUTLS_NONBLOCK);
    if (status == 0)
        status = gnutls_priority_set_direct(link->session,
                                            "NORMAL:-VERS-ALL:+VERS-TLS1.3:+VERS-TLS1.2", NULL);
    if (status == 0)
        status = gnutls_credentials_set(link->session, GNUTLS_CRD_CERTIFICATE, tls->credentials);
    if (status != 0) return status;
    if (host != NULL) {
        (void)gnutls_server_name_set(link->session, GNUTLS_NAME_DNS, host, strlen(host));
        gnutls_session_set_verify_cert(link->session, host, 0);
    } else if (tls->needs_peer) {
        gnutls_certificate_server_set_request(link->session, GNUTLS_CERT_REQUIRE);
        gnutls_session_set_verify_cert(link->session, NULL, 0);
    }
    gnutls_transport_set_int(link->session, link->fd);
    return shake_hands(link, timeout_ms);
}

/* host: of the server that was called; NULL: we are the server. */
static enum ischia_code open_link(struct link **ret, int fd, struct link_tls *tls, const char *host,
                                  int timeout_ms, struct ischia_error *err)
{
    const int on = 1, flags = fcntl(fd, F_GETFL);
    struct link *link = calloc(1, sizeof *link);
    if (link == NULL) {
        (void)close(fd);
        return FAIL(err, ISCHIA_E_MEMORY, "no memory for a connection");
    }
    link->fd = fd;
    (void)setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    (void)fcntl(fd, F_SETFL, flags | O_NONBLOCK);
    const int status = tls == NULL ? 0 : begin_tls(link, tls, host, timeout_ms);
    if (status != 0) link_close(link);
    CHECK(status == 0, err, ISCHIA_E_IO, "TLS: %s", gnutls_strerror(status));
    *ret = link;
    return ISCHIA_OK;
}

enum ischia_code link_accept(struct link **ret, int fd, struct link_tls *tls, int timeout_ms,
                             struct ischia_error *err)
{
    return open_link(ret, fd, tls, NULL, timeout_ms, err);
}

static bool connect_to(const struct addrinfo *where, int *ret_fd, int timeout_ms)
{
    struct link link = {
        .fd = socket(where->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)};
    int cause = 0;
    socklen_t size = sizeof cause;
    if (link.fd < 0) return false;
    if (connect(link.fd, where->ai_addr, where->ai_addrlen) != 0 &&
        (errno != EINPROGRESS || !wait_for(&link, POLLOUT, now_ms() + timeout_ms) ||
         getsockopt(link.fd, SOL_SOCKET, SO_ERROR, &cause, &size) != 0 || cause != 0)) {
        (void)close(link.fd);
        return false;
    }
    *ret_fd = link.fd;
    return true;
}

enum ischia_code link_connect(struct link **ret, const char *address, struct link_tls *tls,
                              int timeout_ms, struct ischia_error *err)
{
    struct address peer;
    int fd = -1;
    TRY(address_find(address, &peer, err));
    for (const struct addrinfo *a = peer.where; fd < 0 && a != NULL; a = a->ai_next)
        (void)connect_to(a, &fd, timeout_ms);
    address_finish(&peer);
    CHECK(fd >= 0, err, ISCHIA_E_IO, "cannot connect to %.80s", address);
    return open_link(ret, fd, tls, peer.text.host, timeout_ms, err);
}

void link_close(struct link *link)
{
    if (link == NULL) return;
    if (link->session != NULL) {
        (void)gnutls_bye(link->session, GNUTLS_SHUT_WR);
        gnutls_deinit(link->session);
    }
    (void)close(link->fd);
    free(link);
}

void link_cut(struct link *link) { (void)shutdown(link->fd, SHUT_RDWR); }

/* ------------------------------------------------------------------- reading and writing */

static ssize_t read_some(struct link *link, char *bytes, size_t size, bool *ret_again)
{
    if (link->session == NULL) {
        const ssize_t n = recv(link->fd, bytes, size, 0);
        *ret_again = n < 0 && (errno == EAGAIN || errno == EINTR);
        return n;
    }
    const ssize_t n = gnutls_record_recv(link->session, bytes, size);
    *ret_again = n < 0 && gnutls_error_is_fatal((int)n) == 0;
    return n;
}

ssize_t link_read(struct link *link, char *bytes, size_t size, int timeout_ms)
{
    const int64_t until_ms = now_ms() + timeout_ms;
    for (;;) {
        bool again = false;
        const ssize_t n = read_some(link, bytes, size, &again);
        if (n >= 0) return n;
        if (!again) return LINK_BROKEN;
        if (!wait_for(link, link->session == NULL ? POLLIN : wanted(link), until_ms))
            return LINK_TIMED_OUT;
    }
}

static ssize_t write_some(struct link *link, const char *bytes, size_t size, bool *ret_again)
{
    if (link->session == NULL) {
        const ssize_t n = send(link->fd, bytes, size, MSG_NOSIGNAL);
        *ret_again = n < 0 && (errno == EAGAIN || errno == EINTR);
        return n;
    }
    const ssize_t n = gnutls_record_send(link->session, bytes, size);
    *ret_again = n < 0 && gnutls_error_is_fatal((int)n) == 0;
    return n;
}

bool link_write(struct link *link, const char *bytes, size_t size, int timeout_ms)
{
    const int64_t until_ms = now_ms() + timeout_ms;
    while (size > 0) {
        bool again = false;
        const ssize_t n = write_some(link, bytes, size, &again);
        if (n > 0) {
            bytes += n;
            size -= (size_t)n;
            continue;
        }
        if (!again || !wait_for(link, link->session == NULL ? POLLOUT : wanted(link), until_ms))
            return false;
    }
    return true;
}
