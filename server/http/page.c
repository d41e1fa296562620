/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/http/page.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/case_doc.h"
#include "api/case_words.h"
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

void page_word(struct text_out *out, enum language language, enum word word)
{
    page_escape(out, words_get(language, word));
}

void page_fill(struct text_out *out, enum language language, enum word word,
               const struct word_value *values)
{
    char text[1024];
    page_escape(out, words_fill(text, sizeof text, language, word, values));
}

void page_begin(struct text_out *out, enum language language, const char *title)
{
    text_out_init(out);
    page_put(out, "<!doctype html>\n<html lang=\"");
    page_put(out, language_tags[language]);
    page_put(out, "\">\n<head>\n<meta charset=\"utf-8\">\n"
                  "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
                  "<title>");
    page_escape(out, title);
    page_put(out, "</title>\n<link rel=\"stylesheet\" href=\"/assets/plain.css\">\n</head>\n"
                  "<body>\n");
}

void page_languages(struct text_out *out, enum language language, const char *address)
{
    page_put(out, "<nav class=\"languages\" aria-label=\"");
    page_word(out, language, WORD_APP_LANGUAGE);
    page_put(out, "\">");
    for (int l = 0; l < LANGUAGE_COUNT; l++) {
        page_put(out, l == (int)language ? "<a aria-current=\"true\" lang=\"" : "<a lang=\"");
        page_put(out, language_tags[l]);
        page_put(out, "\" hreflang=\"");
        page_put(out, language_tags[l]);
        page_put(out, "\" href=\"");
        page_escape(out, address);
        page_put(out, "?lang=");
        page_put(out, language_tags[l]);
        page_put(out, "\">");
        page_word(out, (enum language)l, WORD_LANGUAGE_NAME);
        page_put(out, "</a>\n");
    }
    page_put(out, "</nav>\n");
}

void page_end(struct text_out *out) { page_put(out, "</main>\n</body>\n</html>\n"); }

/* ------------------------------------------------------------------------------ form */

struct form {
    struct text_out *out;
    enum language language;
    const char *lang_query;
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
                     strcmp(fault->pointer, "/side") == 0 || strcmp(fault->pointer, "/sd") == 0 ||
                     strcmp(fault->pointer, "/measured_at") == 0;
        for (int p = 0; p < ISCHIA_PARAM_COUNT; p++)
            shown = shown || strcmp(fault->pointer + 1, ischia_params[p].key) == 0;
        if (shown) continue;
        page_put(form->out, "<p class=\"fault\">");
        page_escape(form->out, fault->detail);
        page_put(form->out, "</p>\n");
    }
}

/* A label and the beginning of its control, up to the value of the last attribute. */
static void put_label(const struct form *form, const char *control, const char *key,
                      const char *label)
{
    page_put(form->out, "<p><label for=\"");
    page_escape(form->out, key);
    page_put(form->out, "\">");
    page_escape(form->out, label);
    page_put(form->out, "</label>\n<");
    page_put(form->out, control);
    page_put(form->out, " id=\"");
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

static void put_parameter(const struct form *form, const struct ischia_param_info *info,
                          const struct param_words *words)
{
    char label[160];
    (void)words_fill(label, sizeof label, form->language, WORD_DAEMON_FORM_LABEL,
                     WORDS(word_text("name", words_get(form->language, words->name)),
                           word_text("key", info->key), word_text("unit", info->unit),
                           word_number("min", info->accepted_min, 6),
                           word_number("max", info->accepted_max, 6)));
    put_label(form, "input", info->key, label);
    page_put(form->out, "\" inputmode=\"decimal\" required autocomplete=\"off\" title=\"");
    page_word(form->out, form->language, words->help);
    put_value(form, info->key);
    page_put(form->out, "<p class=\"help\">");
    page_word(form->out, form->language, words->help);
    page_put(form->out, "</p>\n");
}

struct choice {
    const char *value;
    enum word word;
};

static void put_choices(const struct form *form, const char *key, enum word label,
                        const struct choice *choices, size_t count)
{
    char sent[16];
    sent_value(form, key, sent, sizeof sent);
    put_label(form, "select", key, words_get(form->language, label));
    page_put(form->out, "\">\n");
    for (size_t i = 0; i < count; i++) {
        page_put(form->out, "<option value=\"");
        page_put(form->out, choices[i].value);
        page_put(form->out, strcmp(sent, choices[i].value) == 0 ? "\" selected>" : "\">");
        page_word(form->out, form->language, choices[i].word);
        page_put(form->out, "</option>\n");
    }
    page_put(form->out, "</select></p>\n");
    put_faults(form, key);
}

static void put_sides(const struct form *form)
{
    const struct choice sides[] = {
        {ischia_side_names[ISCHIA_SIDE_NONE], WORD_DAEMON_FORM_NO_SIDE},
        {ischia_side_names[ISCHIA_SIDE_LEFT], WORD_SIDE_LEFT},
        {ischia_side_names[ISCHIA_SIDE_RIGHT], WORD_SIDE_RIGHT},
    };
    put_choices(form, "side", WORD_LIST_SIDE, sides, sizeof sides / sizeof sides[0]);
}

static void put_deviations(const struct form *form)
{
    static const struct choice choices[] = {
        {"", WORD_FORM_SD_NONE},
        {"typical", WORD_FORM_SD_TYPICAL},
    };
    put_choices(form, "sd", WORD_UNCERTAIN_REPORT, choices, sizeof choices / sizeof choices[0]);
}

static void put_form(const struct form *form)
{
    const enum language language = form->language;
    page_put(form->out, "<main>\n<h1>");
    page_word(form->out, language, WORD_DAEMON_FORM_TITLE);
    page_put(form->out, "</h1>\n<p>");
    page_word(form->out, language, WORD_DAEMON_FORM_ABOUT);
    page_put(form->out, "</p>\n<form method=\"post\" action=\"/v1/assessments");
    page_put(form->out, form->lang_query);
    page_put(form->out, "\">\n");
    put_other_faults(form);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        put_parameter(form, &ischia_params[i], &param_words[i]);
    put_sides(form);
    put_label(form, "input", "subject", words_get(language, WORD_DAEMON_FORM_SUBJECT));
    page_put(form->out, "\" maxlength=\"64\" autocomplete=\"off");
    put_value(form, "subject");
    put_label(form, "input", "measured_at", words_get(language, WORD_DAEMON_FORM_MEASURED_AT));
    page_put(form->out, "\" autocomplete=\"off");
    put_value(form, "measured_at");
    put_deviations(form);
    page_put(form->out, "<p><button type=\"submit\">");
    page_word(form->out, language, WORD_DAEMON_FORM_SUBMIT);
    page_put(form->out, "</button></p>\n</form>\n<p><a href=\"/docs\">");
    page_word(form->out, language, WORD_DAEMON_FORM_PROGRAMS);
    page_put(form->out, "</a></p>\n");
}

void page_form(struct call *call, const char *body, size_t size, const struct doc_faults *faults,
               struct http_response *ret)
{
    struct text_out out;
    char *sent = body == NULL ? NULL : strndup(body, size);
    const enum language language = reply_language(call->request);
    const struct form form = {&out, language, call->lang_query, sent, faults};
    page_begin(&out, language, words_get(language, WORD_DAEMON_FORM_PAGE));
    /* A form that was refused is no address: in another language it would be empty. */
    if (body == NULL) page_languages(&out, language, "/form");
    put_form(&form);
    page_end(&out);
    free(sent);
    http_header_static(ret, "Cache-Control", "no-store");
    reply_put_language(call->request, ret);
    reply_text(call->request, ret, faults == NULL ? 200 : 422, "text/html; charset=utf-8", &out);
}

/* ---------------------------------------------------------------------------- assets */

void page_asset(struct call *call, const struct asset *asset, struct http_response *ret)
{
    if (asset == NULL) {
        reply_refusal(call->request, ret, PROBLEM_NOT_FOUND, WORD_DAEMON_REFUSAL_NO_ADDRESS, NULL);
        return;
    }
    http_header_static(ret, "Cache-Control", "no-cache");
    (void)snprintf(ret->etag, sizeof ret->etag, "%s", asset->etag);
    const bool is_known = reply_not_modified(call->request, ret);
    ret->compressible = asset->gzip != NULL;
    if (is_known) return;
    http_body_static(ret, asset->type, asset->bytes, asset->size);
    ret->packed = asset->gzip;
    ret->packed_size = asset->gzip_size;
}

void handle_asset(struct call *call, struct http_response *ret)
{
    char name[sizeof call->rest + 8];
    (void)snprintf(name, sizeof name, "assets/%s", call->rest);
    page_asset(call, asset_find(name), ret);
}

/* "list.html" is English, "list.fr.html" French. */
static const struct asset *clinic_page(const char *name, enum language language)
{
    char file[24];
    const bool english = language == LANGUAGE_EN;
    (void)snprintf(file, sizeof file, "%s%s%s.html", name, english ? "" : ".",
                   english ? "" : language_tags[language]);
    return asset_find(file);
}

/* False where the build has no clinic page. */
static bool send_clinic_page(struct call *call, const char *name, struct http_response *ret)
{
    const struct asset *page = clinic_page(name, reply_language(call->request));
    if (page == NULL) return false;
    reply_put_language(call->request, ret);
    page_asset(call, page, ret);
    return true;
}

void handle_home(struct call *call, struct http_response *ret)
{
    if (!send_clinic_page(call, "index", ret)) page_form(call, NULL, 0, NULL, ret);
}

void handle_past(struct call *call, struct http_response *ret)
{
    if (!send_clinic_page(call, "list", ret)) page_form(call, NULL, 0, NULL, ret);
}

/* "?plain=1": for who has no script. The page is the same file for every assessment and so cannot
 * link to the report of this one; it links to its own address. */
void handle_result(struct call *call, struct http_response *ret)
{
    char text[8];
    const bool plain = query_find(call->request->query, "plain", text, sizeof text) != QUERY_ABSENT;
    if (!plain && send_clinic_page(call, "result", ret)) return;
    ret->status = 303;
    http_header(ret, "Location", "/v1/assessments/%s/report%s", call->id_text, call->lang_query);
}

void handle_form(struct call *call, struct http_response *ret)
{
    page_form(call, NULL, 0, NULL, ret);
}
