/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/http/page.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/case_doc.h"
#include "server/http/query.h"
#include "server/http/reply.h"
#include "server/http/routes.h"

void page_put(struct text_out *out, const char *html) { text_put_string(out, html); }

void page_escape(struct text_out *out, const char *text)
{
    static const struct {
        char c;
        const char *entity;
    } entities[] = {{'&', "&amp;"}, {'<', "&lt;"}, {'>', "&gt;"}, {'"', "&quot;"}, {'\'', "&#39;"}};
    for (; *text != '\0'; text++) {
        const char *entity = NULL;
        for (size_t i = 0; i < sizeof entities / sizeof entities[0]; i++)
            if (*text == entities[i].c) entity = entities[i].entity;
        if (entity != NULL)
            page_put(out, entity);
        else
            text_put(out, text, 1);
    }
}

void page_format(struct text_out *out, const char *format, ...)
{
    char text[1024];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    page_escape(out, text);
}

void page_begin(struct text_out *out, const char *title)
{
    text_out_init(out);
    page_put(out, "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
                  "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
                  "<title>");
    page_escape(out, title);
    page_put(out, "</title>\n<link rel=\"stylesheet\" href=\"/assets/plain.css\">\n</head>\n"
                  "<body>\n<main>\n");
}

void page_end(struct text_out *out) { page_put(out, "</main>\n</body>\n</html>\n"); }

/* ------------------------------------------------------------------------------ form */

struct form {
    struct text_out *out;
    const char *sent; /* the body as a query string; NULL: none */
    const struct doc_faults *faults;
};

/* What was sent for a field; "" when nothing was. */
static void sent_value(const struct form *form, const char *key, char *ret, size_t size)
{
    ret[0] = '\0';
    if (form->sent != NULL) (void)query_find(form->sent, key, ret, size);
}

static bool has_fault(const struct form *form, const char *key)
{
    char pointer[80];
    (void)snprintf(pointer, sizeof pointer, "/%s", key);
    return form->faults != NULL && doc_faults_has(form->faults, pointer);
}

static void put_faults(const struct form *form, const char *key)
{
    char pointer[80];
    (void)snprintf(pointer, sizeof pointer, "/%s", key);
    for (size_t i = 0; form->faults != NULL && i < form->faults->count; i++) {
        const struct ischia_fault *fault = &form->faults->item[i];
        if (strcmp(fault->pointer, pointer) != 0) continue;
        page_put(form->out, "<p class=\"fault\" id=\"");
        page_escape(form->out, key);
        page_put(form->out, "-fault\">");
        page_escape(form->out, fault->detail);
        page_put(form->out, "</p>\n");
    }
}

/* Faults of no field of this form: an unknown key, an option. */
static void put_other_faults(const struct form *form)
{
    for (size_t i = 0; form->faults != NULL && i < form->faults->count; i++) {
        const struct ischia_fault *fault = &form->faults->item[i];
        bool shown = strcmp(fault->pointer, "/subject") == 0 ||
                     strcmp(fault->pointer, "/side") == 0 ||
                     strcmp(fault->pointer, "/measured_at") == 0;
        for (int p = 0; p < ISCHIA_PARAM_COUNT; p++)
            shown = shown || strcmp(fault->pointer + 1, ischia_params[p].key) == 0;
        if (shown) continue;
        page_put(form->out, "<p class=\"fault\">");
        page_escape(form->out, fault->detail);
        page_put(form->out, "</p>\n");
    }
}

static void put_label(const struct form *form, const char *key, const char *label)
{
    page_put(form->out, "<p><label for=\"");
    page_escape(form->out, key);
    page_put(form->out, "\">");
    page_escape(form->out, label);
    page_put(form->out, "</label>\n<input id=\"");
    page_escape(form->out, key);
    page_put(form->out, "\" name=\"");
    page_escape(form->out, key);
}

static void put_value(const struct form *form, const char *key)
{
    char value[256];
    sent_value(form, key, value, sizeof value);
    page_put(form->out, "\" value=\"");
    page_escape(form->out, value);
    page_put(form->out, "\"");
    if (has_fault(form, key)) {
        page_put(form->out, " aria-invalid=\"true\" aria-describedby=\"");
        page_escape(form->out, key);
        page_put(form->out, "-fault\"");
    }
    page_put(form->out, "></p>\n");
    put_faults(form, key);
}

static void put_parameter(const struct form *form, const struct ischia_param_info *info)
{
    char label[128];
    (void)snprintf(label, sizeof label, "%s %s (%s, %g to %g)", info->name, info->key, info->unit,
                   info->accepted_min, info->accepted_max);
    put_label(form, info->key, label);
    page_put(form->out, "\" inputmode=\"decimal\" required autocomplete=\"off\" title=\"");
    page_escape(form->out, info->description);
    put_value(form, info->key);
    page_put(form->out, "<p class=\"help\">");
    page_escape(form->out, info->description);
    page_put(form->out, "</p>\n");
}

static void put_sides(const struct form *form)
{
    char side[16];
    sent_value(form, "side", side, sizeof side);
    page_put(form->out, "<p><label for=\"side\">Side</label>\n<select id=\"side\" name=\"side\">\n"
                        "<option value=\"\">not given</option>\n");
    for (int i = 1; i < ISCHIA_SIDE_COUNT; i++) {
        page_put(form->out, "<option");
        if (strcmp(side, ischia_side_names[i]) == 0) page_put(form->out, " selected");
        page_put(form->out, ">");
        page_put(form->out, ischia_side_names[i]);
        page_put(form->out, "</option>\n");
    }
    page_put(form->out, "</select></p>\n");
    put_faults(form, "side");
}

static void put_form(const struct form *form)
{
    page_put(form->out,
             "<h1>Tissue under one ischium</h1>\n<p>Seven measured numbers of one side, each "
             "with a decimal point or a decimal comma.</p>\n<form method=\"post\" "
             "action=\"/v1/assessments\">\n");
    put_other_faults(form);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) put_parameter(form, &ischia_params[i]);
    put_sides(form);
    put_label(form, "subject", "Subject (a pseudonym, never a name; optional)");
    page_put(form->out, "\" maxlength=\"64\" autocomplete=\"off");
    put_value(form, "subject");
    put_label(form, "measured_at", "Measured on (YYYY-MM-DD; optional)");
    page_put(form->out, "\" autocomplete=\"off");
    put_value(form, "measured_at");
    page_put(form->out, "<p><button type=\"submit\">Assess</button></p>\n</form>\n"
                        "<p><a href=\"/docs\">How programs use this service</a></p>\n");
}

void page_form(struct call *call, const char *body, size_t size, const struct doc_faults *faults,
               struct http_response *ret)
{
    struct text_out out;
    char *sent = body == NULL ? NULL : strndup(body, size);
    const struct form form = {&out, sent, faults};
    page_begin(&out, "Ischia: assess one side");
    put_form(&form);
    page_end(&out);
    free(sent);
    http_header_static(ret, "Cache-Control", "no-store");
    reply_text(call->request, ret, faults == NULL ? 200 : 422, "text/html; charset=utf-8", &out);
}

/* ---------------------------------------------------------------------------- assets */

void page_asset(struct call *call, const struct asset *asset, struct http_response *ret)
{
    if (asset == NULL) {
        reply_refusal(call->request, ret, PROBLEM_NOT_FOUND, "There is nothing at this address.");
        return;
    }
    http_header_static(ret, "Cache-Control", "no-cache");
    (void)snprintf(ret->etag, sizeof ret->etag, "%s", asset->etag);
    if (reply_not_modified(call->request, ret)) return;
    http_body_static(ret, asset->type, asset->bytes, asset->size);
    ret->packed = asset->gzip;
    ret->packed_size = asset->gzip_size;
    ret->compressible = asset->gzip != NULL;
}

void handle_asset(struct call *call, struct http_response *ret)
{
    char name[sizeof call->rest + 8];
    (void)snprintf(name, sizeof name, "assets/%s", call->rest);
    page_asset(call, asset_find(name), ret);
}

/* The clinic page where the build has one, the plain form where it has not. */
void handle_home(struct call *call, struct http_response *ret)
{
    const struct asset *page = asset_find("index.html");
    if (page != NULL) {
        page_asset(call, page, ret);
    } else if (call->id_text[0] != '\0') {
        ret->status = 303;
        http_header(ret, "Location", "/v1/assessments/%s/report", call->id_text);
    } else {
        page_form(call, NULL, 0, NULL, ret);
    }
}

void handle_form(struct call *call, struct http_response *ret)
{
    page_form(call, NULL, 0, NULL, ret);
}
