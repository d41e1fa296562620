/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_ASSETS_H
#define ISCHIA_SERVER_ASSETS_H

#include <stddef.h>

/* Files that are part of the program: embedded at build by embed_assets.py. */
struct asset {
    const char *name; /* "assets/app.js"; NULL ends a table */
    const char *type;
    const char *etag; /* strong, with its quotes */
    const char *bytes;
    size_t size;
    const char *gzip; /* the same, compressed; NULL when that gains nothing */
    size_t gzip_size;
};

/* NULL when there is none of this name. */
const struct asset *asset_find(const char *name);
const struct asset *asset_openapi(void); /* the contract: always there */

/* The generated table: the bundle of static/dist, openapi.json and the /docs page. */
extern const struct asset assets[];

#endif
