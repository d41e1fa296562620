/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/http/assets.h"

#include <assert.h>
#include <string.h>

const struct asset *asset_find(const char *name)
{
    for (const struct asset *asset = assets; asset->name != NULL; asset++)
        if (strcmp(asset->name, name) == 0) return asset;
    return NULL;
}

const struct asset *asset_openapi(void)
{
    const struct asset *asset = asset_find("openapi.json");
    assert(asset != NULL); /* the build embeds it */
    return asset;
}
