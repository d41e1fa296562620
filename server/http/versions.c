/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/http/versions.h"

#include <gnu/libc-version.h>
#include <sodium.h>
#include <stddef.h>
#include <zlib.h>

#include "api/json.h"
#include "server/http/http.h"
#include "server/http/tls.h"
#include "server/outbound/web.h"

const struct version *versions(void)
{
    static const struct version rows[] = {
        {"libmicrohttpd", http_library_version}, {"GnuTLS", tls_library_version},
        {"libsodium", sodium_version_string},    {"zlib", zlibVersion},
        {"libcurl", web_library_version},        {"cJSON", json_library_version},
        {"glibc", gnu_get_libc_version},         {NULL, NULL},
    };
    return rows;
}
