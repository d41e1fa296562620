/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/parameters_doc.h"

#include <stdio.h>
#include <string.h>

#include "api/case_doc.h"
#include "api/case_words.h"
#include "api/json.h"
#include "api/risk.h"
#include "solver/study/sampling.h"

static void put_range(struct json_out *out, const char *key, double min, double max)
{
    json_open_object(out, key);
    json_put_number(out, "min", min);
    json_put_number(out, "max", max);
    json_close_object(out);
}

static void write_model(struct json_out *out, enum language language)
{
    (void)language;
    json_open_object(out, "model");
    json_put_string(out, "name", ISCHIA_MODEL_NAME);
    json_put_integer(out, "version", ISCHIA_MODEL_VERSION);
    json_close_object(out);
}

/* Those keys that begin with "mu" may also be written with the Greek letter or the micro sign. */
static void write_aliases(struct json_out *out, const char *key)
{
    static const char *const greek[] = {"\xCE\xBC", "\xC2\xB5"};
    char alias[16];
    json_open_array(out, "aliases");
    for (size_t i = 0; strncmp(key, "mu", 2) == 0 && i < sizeof greek / sizeof greek[0]; i++) {
        (void)snprintf(alias, sizeof alias, "%s%s", greek[i], key + 2);
        json_put_string(out, NULL, alias);
    }
    json_close_array(out);
}

/* Which standard deviations are accepted, and what "typical" stands for. */
static void write_sd(struct json_out *out, enum ischia_param input)
{
    json_open_object(out, "sd");
    json_put_number(out, "max", sampling_sd_max(input));
    json_open_object(out, "typical");
    json_put_number(out, "absolute", sampling_typical[input].absolute);
    json_put_number(out, "relative", sampling_typical[input].relative);
    json_close_object(out);
    json_close_object(out);
}

static void write_parameters(struct json_out *out, enum language language)
{
    json_open_array(out, "parameters");
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        const struct ischia_param_info *p = &ischia_params[i];
        json_open_object(out, NULL);
        json_put_string(out, "key", p->key);
        json_put_string(out, "name", words_get(language, param_words[i].name));
        write_aliases(out, p->key);
        json_put_string(out, "unit", p->unit);
        json_put_string(out, "description", words_get(language, param_words[i].help));
        put_range(out, "accepted", p->accepted_min, p->accepted_max);
        put_range(out, "studied", p->studied_min, p->studied_max);
        write_sd(out, (enum ischia_param)i);
        json_close_object(out);
    }
    json_close_array(out);
}

static void write_options(struct json_out *out, enum language language)
{
    char pointer[DOC_POINTER_BYTES];
    json_open_array(out, "options");
    for (int i = 0; i < ISCHIA_OPTION_COUNT; i++) {
        const struct ischia_option_info *o = &ischia_options[i];
        (void)snprintf(pointer, sizeof pointer, "/%s/%s", o->group, o->key);
        json_open_object(out, NULL);
        json_put_string(out, "group", o->group);
        json_put_string(out, "key", o->key);
        json_put_string(out, "pointer", pointer);
        json_put_string(out, "unit", o->unit);
        json_put_string(out, "description", words_get(language, option_words[i]));
        put_range(out, "accepted", o->accepted_min, o->accepted_max);
        json_put_number(out, "default", o->default_value);
        json_close_object(out);
    }
    json_close_array(out);
}

static void write_preset_group(struct json_out *out, const char *group,
                               const struct ischia_preset *preset)
{
    json_open_object(out, group);
    for (int i = 0; i < ISCHIA_OPTION_COUNT; i++)
        if (strcmp(ischia_options[i].group, group) == 0)
            json_put_number(out, ischia_options[i].key, preset->option[i]);
    json_close_object(out);
}

static const enum word preset_words[ISCHIA_PRESET_COUNT] = {WORD_DAEMON_PRESET_DEFAULT,
                                                            WORD_DAEMON_PRESET_PUBLISHED};

static void write_presets(struct json_out *out, enum language language)
{
    json_open_array(out, "presets");
    for (int i = 0; i < ISCHIA_PRESET_COUNT; i++) {
        json_open_object(out, NULL);
        json_put_string(out, "name", ischia_presets[i].name);
        json_put_string(out, "description", words_get(language, preset_words[i]));
        write_preset_group(out, "skin", &ischia_presets[i]);
        write_preset_group(out, "model", &ischia_presets[i]);
        json_close_object(out);
    }
    json_close_array(out);
}

static void write_resolutions(struct json_out *out, enum language language)
{
    (void)language;
    json_open_array(out, "resolutions");
    for (int i = 0; i < ISCHIA_RESOLUTION_COUNT; i++) {
        json_open_object(out, NULL);
        json_put_string(out, "name", ischia_resolution_names[i]);
        json_put_bool(out, "default", i == ISCHIA_STANDARD);
        json_close_object(out);
    }
    json_close_array(out);
}

/* What goes with a side: who, which and when. */
static void write_fields(struct json_out *out, enum language language)
{
    static const struct {
        const char *key, *pattern;
        enum word description;
        int max_length;
    } fields[] = {
        {"subject", "^[A-Za-z0-9._-]{1,64}$", WORD_DAEMON_FIELD_SUBJECT, 64},
        {"side", "^(left|right)$", WORD_DAEMON_FIELD_SIDE, 5},
        {"measured_at", NULL, WORD_DAEMON_FIELD_MEASURED_AT, ISCHIA_MEASURED_AT_BYTES - 1},
        {"label", NULL, WORD_DAEMON_FIELD_LABEL, ISCHIA_LABEL_CHARACTERS_MAX},
    };
    json_open_array(out, "fields");
    for (size_t i = 0; i < sizeof fields / sizeof fields[0]; i++) {
        json_open_object(out, NULL);
        json_put_string(out, "key", fields[i].key);
        json_put_string(out, "description", words_get(language, fields[i].description));
        json_put_string(out, "pattern", fields[i].pattern);
        json_put_integer(out, "max_length", fields[i].max_length);
        json_close_object(out);
    }
    json_close_array(out);
}

static void write_risk(struct json_out *out, enum language language)
{
    json_open_object(out, "thresholds");
    json_put_number(out, "E_shear", ISCHIA_E_SHEAR_THRESHOLD);
    json_put_number(out, "E_comp", ISCHIA_E_COMP_THRESHOLD);
    json_put_string(out, "measure", "green_lagrange");
    json_close_object(out);
    json_open_array(out, "bands");
    for (int i = 0; i < RISK_BAND_COUNT; i++) {
        json_open_object(out, NULL);
        json_put_string(out, "name", risk_bands[i].name);
        json_put_string(out, "headline", words_get(language, risk_bands[i].headline));
        json_close_object(out);
    }
    json_close_array(out);
    json_open_array(out, "caveats");
    for (size_t i = 0; i < RISK_CAVEAT_COUNT; i++)
        json_put_string(out, NULL, words_get(language, risk_caveats[i]));
    json_close_array(out);
}

enum ischia_code parameters_doc_text(char **ret_text, enum language language, int indent,
                                     struct ischia_error *err)
{
    static void (*const parts[])(struct json_out *, enum language) = {
        write_model,       write_parameters, write_options, write_presets,
        write_resolutions, write_fields,     write_risk,
    };
    struct json_out out;
    json_out_init(&out, indent);
    json_open_object(&out, NULL);
    for (size_t i = 0; i < sizeof parts / sizeof parts[0]; i++) parts[i](&out, language);
    json_close_object(&out);
    return json_out_take(&out, ret_text, NULL, err);
}
