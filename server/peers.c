/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/peers.h"

#include <arpa/inet.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

enum { ADDRESS_BYTES = 16, ENTRY_BYTES = INET6_ADDRSTRLEN + 4 };

struct network {
    int family;
    unsigned bits;
    unsigned char address[ADDRESS_BYTES];
};

/* "10.0.0.0/8", "::1". */
static bool parse_network(char text[ENTRY_BYTES], struct network *ret)
{
    char *slash = strchr(text, '/');
    if (slash != NULL) *slash = '\0';
    ret->family = strchr(text, ':') == NULL ? AF_INET : AF_INET6;
    const unsigned most = ret->family == AF_INET ? 32 : 128;
    ret->bits = most;
    if (inet_pton(ret->family, text, ret->address) != 1) return false;
    if (slash == NULL) return true;
    char *end = NULL;
    const unsigned long bits = strtoul(slash + 1, &end, 10);
    const bool is_number = slash[1] >= '0' && slash[1] <= '9' && *end == '\0';
    ret->bits = (unsigned)bits;
    return is_number && bits <= most;
}

/* The entry that *at points to, without blanks; *at moves to the next. False at the end; an entry
 * that is too long comes out as "". */
static bool next_entry(const char **at, char ret[ENTRY_BYTES])
{
    static const char between[] = ", \t";
    *at += strspn(*at, between);
    const size_t length = strcspn(*at, between);
    if (length == 0) return false;
    ret[0] = '\0';
    if (length < ENTRY_BYTES) {
        memcpy(ret, *at, length);
        ret[length] = '\0';
    }
    *at += length;
    return true;
}

enum ischia_code peers_check(const char *list, struct ischia_error *err)
{
    char entry[ENTRY_BYTES], copy[ENTRY_BYTES];
    struct network network;
    while (next_entry(&list, entry)) {
        memcpy(copy, entry, sizeof copy);
        CHECK(parse_network(copy, &network), err, ISCHIA_E_INPUT,
              "'%.48s' is no address; write 192.0.2.7, 192.0.2.0/24 or 2001:db8::/32", entry);
    }
    return ISCHIA_OK;
}

static bool holds(const struct network *network, const struct network *address)
{
    if (network->family != address->family) return false;
    const size_t whole = network->bits / 8;
    if (memcmp(network->address, address->address, whole) != 0) return false;
    const unsigned rest = network->bits % 8;
    if (rest == 0) return true;
    const unsigned mask = 0xff00U >> rest & 0xffU;
    return (network->address[whole] & mask) == (address->address[whole] & mask);
}

bool peers_have(const char *list, const char *address)
{
    char entry[ENTRY_BYTES];
    struct network network, one;
    if (!next_entry(&address, entry) || !parse_network(entry, &one)) return false;
    while (next_entry(&list, entry))
        if (parse_network(entry, &network) && holds(&network, &one)) return true;
    return false;
}
