/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <string.h>

#include "api/problem_doc.h"
#include "server/http/page.h"
#include "server/http/reply.h"
#include "server/http/routes.h"

/* GET /docs: every route and every problem, and a form to try them; nothing comes from elsewhere.
 * The tables are in the page itself; the script adds what openapi.json says about each route. */

static void put_route(struct text_out *out, const struct route *route)
{
    page_put(out, "<tr data-method=\"");
    page_escape(out, http_method_names[route->method]);
    page_put(out, "\" data-path=\"");
    page_escape(out, route->path);
    page_put(out, "\"><th scope=\"row\"><code>");
    page_escape(out, route->name);
    page_put(out, "</code></th><td>");
    page_escape(out, route->scope == 0             ? "open"
                     : route->scope == AUTH_READ   ? "read"
                     : route->scope == AUTH_ASSESS ? "assess"
                                                   : "admin");
    page_put(out, "</td><td class=\"summary\"></td></tr>\n");
}

static void put_problem(struct text_out *out, const struct problem_info *info)
{
    const char *anchor = strchr(info->type, '#');
    page_put(out, "<tr id=\"");
    page_escape(out, anchor == NULL ? info->type : anchor + 1);
    page_put(out, "\"><th scope=\"row\">");
    page_format(out, "%d", info->status);
    page_put(out, "</th><td>");
    page_escape(out, words_get(LANGUAGE_EN, info->title));
    page_put(out, "</td><td><code>");
    page_escape(out, info->type);
    page_put(out, "</code></td></tr>\n");
}

void handle_docs(struct call *call, struct http_response *ret)
{
    struct text_out out;
    page_begin(&out, LANGUAGE_EN, "Ischia: the service");
    page_put(&out, "<main>\n<h1>The Ischia service</h1>\n<p>The whole contract, for programs: "
                   "<a href=\"/openapi.json\">openapi.json</a> (OpenAPI 3.1).</p>\n"
                   "<h2>Routes</h2>\n<table>\n<thead><tr><th>route</th><th>token's scope</th>"
                   "<th>does</th></tr></thead>\n<tbody id=\"routes\">\n");
    for (size_t i = 0; i < route_count; i++)
        if (!routes[i].is_page) put_route(&out, &routes[i]);
    page_put(&out,
             "</tbody>\n</table>\n<section id=\"try\" hidden>\n<h2>Try it</h2>\n</section>\n"
             "<h2>Problems</h2>\n<p>Every error is a problem document (RFC 9457) of one of "
             "these types.</p>\n<table>\n<thead><tr><th>status</th><th>title</th><th>type</th>"
             "</tr></thead>\n<tbody>\n");
    for (int i = 0; i < PROBLEM_KIND_COUNT; i++) put_problem(&out, &problem_kinds[i]);
    page_put(&out, "</tbody>\n</table>\n<script src=\"/assets/docs.js\" defer></script>\n");
    page_end(&out);
    http_header_static(ret, "Cache-Control", "no-cache");
    reply_text(call->request, ret, 200, "text/html; charset=utf-8", &out);
}
