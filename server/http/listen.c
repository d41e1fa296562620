/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/http/listen.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netdb.h>
#include <netinet/in.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "server/address.h"

#define MAPPED_PREFIX "::ffff:"

static enum ischia_code resolve(const char *address, struct addrinfo **ret,
                                struct ischia_error *err)
{
    struct address_text parts;
    const struct addrinfo hints = {.ai_family = AF_UNSPEC,
                                   .ai_socktype = SOCK_STREAM,
                                   .ai_flags = AI_PASSIVE | AI_NUMERICSERV};
    TRY(address_split(address, &parts, err));
    const int cause = getaddrinfo(parts.host, parts.port, &hints, ret);
    CHECK(cause == 0, err, ISCHIA_E_INPUT, "listen is '%.80s': %s", address, gai_strerror(cause));
    return ISCHIA_OK;
}

static void describe(const struct sockaddr *bound, socklen_t size, char ret[LISTEN_ADDRESS_BYTES])
{
    char host[INET6_ADDRSTRLEN + 16] = "?", port[8] = "?";
    (void)getnameinfo(bound, size, host, sizeof host, port, sizeof port,
                      NI_NUMERICHOST | NI_NUMERICSERV);
    (void)snprintf(ret, LISTEN_ADDRESS_BYTES,
                   bound->sa_family == AF_INET6 ? "[%.40s]:%s" : "%.40s:%s", host, port);
}

static enum ischia_code listen_on(const struct addrinfo *where, int fd,
                                  char ret_address[LISTEN_ADDRESS_BYTES], struct ischia_error *err)
{
    struct sockaddr_storage bound = {0};
    socklen_t size = sizeof bound;
    const int on = 1;
    (void)setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    CHECK(bind(fd, where->ai_addr, where->ai_addrlen) == 0, err, ISCHIA_E_IO, "bind: %s",
          strerror(errno));
    CHECK(listen(fd, SOMAXCONN) == 0, err, ISCHIA_E_IO, "listen: %s", strerror(errno));
    CHECK(getsockname(fd, (struct sockaddr *)&bound, &size) == 0, err, ISCHIA_E_IO,
          "getsockname: %s", strerror(errno));
    describe((const struct sockaddr *)&bound, size, ret_address);
    return ISCHIA_OK;
}

enum ischia_code listen_open(const char *address, int *ret_fd,
                             char ret_address[LISTEN_ADDRESS_BYTES], struct ischia_error *err)
{
    struct addrinfo *where = NULL;
    struct ischia_error cause;
    TRY(resolve(address, &where, err));
    const int fd = socket(where->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    enum ischia_code code = fd < 0 ? FAIL(&cause, ISCHIA_E_IO, "socket: %s", strerror(errno))
                                   : listen_on(where, fd, ret_address, &cause);
    freeaddrinfo(where);
    if (code == ISCHIA_OK) {
        *ret_fd = fd;
        return ISCHIA_OK;
    }
    if (fd >= 0) (void)close(fd);
    return FAIL(err, code, "cannot listen on %.80s: %.200s", address, cause.message);
}

static bool is_loopback(const struct sockaddr *address)
{
    char text[INET6_ADDRSTRLEN];
    listen_peer_text(address, text, sizeof text);
    return listen_text_is_loopback(text);
}

enum ischia_code listen_is_loopback(const char *address, bool *ret, struct ischia_error *err)
{
    struct addrinfo *where = NULL;
    bool loopback = true;
    TRY(resolve(address, &where, err));
    for (const struct addrinfo *a = where; a != NULL; a = a->ai_next)
        loopback = loopback && is_loopback(a->ai_addr);
    freeaddrinfo(where);
    *ret = loopback;
    return ISCHIA_OK;
}

void listen_peer_text(const struct sockaddr *peer, char *ret, size_t size)
{
    char text[INET6_ADDRSTRLEN] = "?";
    if (peer != NULL && peer->sa_family == AF_INET)
        (void)inet_ntop(AF_INET, &((const struct sockaddr_in *)(const void *)peer)->sin_addr, text,
                        sizeof text);
    if (peer != NULL && peer->sa_family == AF_INET6)
        (void)inet_ntop(AF_INET6, &((const struct sockaddr_in6 *)(const void *)peer)->sin6_addr,
                        text, sizeof text);
    const bool mapped = strncmp(text, MAPPED_PREFIX, sizeof MAPPED_PREFIX - 1) == 0;
    (void)snprintf(ret, size, "%s", mapped ? text + sizeof MAPPED_PREFIX - 1 : text);
}

bool listen_text_is_loopback(const char *numeric)
{
    enum { LOOPBACK_NET = 127 };
    struct in_addr v4;
    struct in6_addr v6;
    /* Whole addresses only: "127.0.0.1.example" is a name that anybody may own. */
    if (inet_pton(AF_INET, numeric, &v4) == 1) return ntohl(v4.s_addr) >> 24 == LOOPBACK_NET;
    return inet_pton(AF_INET6, numeric, &v6) == 1 && IN6_IS_ADDR_LOOPBACK(&v6);
}
