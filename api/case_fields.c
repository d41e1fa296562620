/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "api/case_keys.h"
#include "api/case_words.h"
#include "solver/study/sampling.h"

_Static_assert(KEY_COUNT <= 32, "case_doc_fields.seen has one bit for each key");

const char *const ischia_side_names[ISCHIA_SIDE_COUNT] = {
    [ISCHIA_SIDE_NONE] = "",
    [ISCHIA_SIDE_LEFT] = "left",
    [ISCHIA_SIDE_RIGHT] = "right",
};

void ischia_request_init(struct ischia_request *ret)
{
    *ret = (struct ischia_request){.values = ischia_case_default()};
    (void)snprintf(ret->preset, sizeof ret->preset, "%s", ischia_presets[0].name);
}

void case_doc_sd(const struct ischia_request *request, double ret[ISCHIA_PARAM_COUNT])
{
    if (request->sd_typical)
        sampling_sd_typical(&request->values, ret);
    else
        memcpy(ret, request->sd, sizeof request->sd);
}

/* ---- the keys ---- */

/* Names of the keys that are not inputs. Those of the options are built from ischia_options and
 * must be written out here, as a name is handed out for good; a test holds both together. */
static const char *const key_names[KEY_COUNT] = {
    [KEY_SUBJECT] = "subject",
    [KEY_SIDE] = "side",
    [KEY_MEASURED_AT] = "measured_at",
    [KEY_LABEL] = "label",
    [KEY_RESOLUTION] = "resolution",
    [KEY_MODEL] = "model",
    [KEY_SKIN] = "skin",
    [KEY_SD] = "sd",
    [KEY_FIRST_OPTION + ISCHIA_SKIN_MU] = "skin.mu",
    [KEY_FIRST_OPTION + ISCHIA_SKIN_THICKNESS] = "skin.thickness",
    [KEY_FIRST_OPTION + ISCHIA_L_OVER_H] = "model.L_over_h",
    [KEY_FIRST_OPTION + ISCHIA_BULK_RATIO] = "model.bulk_ratio",
    [KEY_FIRST_OPTION + ISCHIA_FRICTION] = "model.friction",
    [KEY_FIRST_OPTION + ISCHIA_R2_SURFACE] = "model.R2_surface",
    [KEY_FIRST_OPTION + ISCHIA_EMBED_OVER_R1] = "model.embed_over_R1",
    [KEY_FIRST_SD + ISCHIA_R1] = "sd.R1",
    [KEY_FIRST_SD + ISCHIA_R2] = "sd.R2",
    [KEY_FIRST_SD + ISCHIA_EM] = "sd.eM",
    [KEY_FIRST_SD + ISCHIA_EF] = "sd.eF",
    [KEY_FIRST_SD + ISCHIA_MUM] = "sd.muM",
    [KEY_FIRST_SD + ISCHIA_MUF] = "sd.muF",
    [KEY_FIRST_SD + ISCHIA_F] = "sd.F",
};

/* What other texts call our parameters: the paper's own second names, and plain words. */
static const struct synonym {
    const char *word, *key;
} synonyms[] = {
    {"RCCI1", "R1"},         {"RCCI2", "R2"},        {"eG", "eF"},
    {"muG", "muF"},          {"force", "F"},         {"patient", "subject"},
    {"date", "measured_at"}, {"mesh", "resolution"},
};

const char *case_key_name(int key)
{
    assert(key >= 0 && key < KEY_COUNT);
    return key < ISCHIA_PARAM_COUNT ? ischia_params[key].key : key_names[key];
}

/* "muM" for the Greek letter mu (U+03BC) and the micro sign (U+00B5) before M or F. */
static const char *without_greek(const char *spelling, char buffer[8])
{
    const bool greek =
        strncmp(spelling, "\xCE\xBC", 2) == 0 || strncmp(spelling, "\xC2\xB5", 2) == 0;
    if (!greek || strlen(spelling) > 4) return spelling;
    (void)snprintf(buffer, 8, "mu%s", spelling + 2);
    return buffer;
}

int case_key_find(const char *spelling)
{
    char buffer[8];
    const char *name = without_greek(spelling, buffer);
    for (int key = 0; key < KEY_COUNT; key++)
        if (strcmp(name, case_key_name(key)) == 0) return key;
    return KEY_NONE;
}

const char *case_doc_canonical_key(const char *key)
{
    const int found = case_key_find(key);
    return found != KEY_NONE ? case_key_name(found) : NULL;
}

const char *case_doc_column_key(const char *column)
{
    char name[TEXT_DISTANCE_LENGTH_MAX];
    const char *mark = strrchr(column, '_');
    const char *key = case_doc_canonical_key(column);
    if (key != NULL || mark == NULL || (size_t)(mark - column) >= sizeof name) return key;
    (void)snprintf(name, sizeof name, "%.*s", (int)(mark - column), column);
    const int found = case_key_find(name);
    if (found == KEY_NONE || found >= ISCHIA_PARAM_COUNT) return NULL;
    return strcmp(mark + 1, ischia_params[found].unit) == 0 ? case_key_name(found) : NULL;
}

/* "skin.thick" of "skin.thickness". */
static bool is_beginning(const char *name, const char *key)
{
    const size_t length = strlen(name);
    return length >= 4 && strncmp(name, key, length) == 0;
}

const char *case_doc_nearest_key(const char *key)
{
    char buffer[8];
    const char *name = without_greek(key, buffer), *nearest = NULL;
    int least = TEXT_NO_SLIP;
    for (size_t i = 0; i < sizeof synonyms / sizeof synonyms[0]; i++)
        if (text_distance(name, synonyms[i].word) == 0) return synonyms[i].key;
    for (int i = 0; i < KEY_COUNT; i++) {
        if (is_beginning(name, case_key_name(i))) return case_key_name(i);
        const int slips = text_slips(name, case_key_name(i));
        if (slips >= least) continue;
        least = slips;
        nearest = case_key_name(i);
    }
    return nearest;
}

/* ---- faults ---- */

/* "/skin/mu" for "skin.mu". */
static const char *key_pointer(int key, char buffer[DOC_POINTER_BYTES])
{
    (void)snprintf(buffer, DOC_POINTER_BYTES, "/%s", case_key_name(key));
    char *dot = strchr(buffer, '.');
    if (dot != NULL) *dot = '/';
    return buffer;
}

bool case_key_first_time(struct case_doc_fields *fields, int key, const char *spelling)
{
    char pointer[DOC_POINTER_BYTES];
    const unsigned bit = 1U << key;
    const bool first = (fields->seen & bit) == 0;
    fields->seen |= bit;
    if (first) return true;
    if (key >= KEY_FIRST_OPTION)
        (void)key_pointer(key, pointer);
    else
        (void)doc_pointer(pointer, sizeof pointer, "", spelling);
    if (!doc_faults_has(fields->faults, pointer))
        doc_faults_say(fields->faults, pointer, "duplicate",
                       strcmp(spelling, case_key_name(key)) == 0 ? WORD_DAEMON_FAULT_DUPLICATE
                                                                 : WORD_DAEMON_FAULT_DUPLICATE_AS,
                       WORDS(word_text("key", spelling), word_text("name", case_key_name(key))));
    return false;
}

static void append(char *text, size_t size, const char *word)
{
    const size_t used = strlen(text);
    (void)snprintf(text + used, size - used, "%s%s", used > 0 ? ", " : "", word);
}

static void accepted_range(enum language language, char *text, size_t size, double min, double max,
                           const char *unit)
{
    char spaced[16];
    (void)words_fill(text, size, language, WORD_DAEMON_FAULT_ACCEPTED_NUMBER,
                     WORDS(word_number("min", min, 6), word_number("max", max, 6),
                           word_text("unit", case_spaced_unit(unit, spaced))));
}

static void accepted_models(enum language language, char *text, size_t size)
{
    char names[64] = "";
    for (int i = 0; i < ISCHIA_PRESET_COUNT; i++)
        append(names, sizeof names, ischia_presets[i].name);
    (void)words_fill(text, size, language, WORD_DAEMON_FAULT_ACCEPTED_MODEL,
                     WORDS(word_text("names", names)));
}

/* What a key takes, in words. */
static const char *accepted(enum language language, int key, char *text, size_t size)
{
    static const enum word words[KEY_COUNT] = {
        [KEY_SUBJECT] = WORD_DAEMON_FAULT_ACCEPTED_SUBJECT,
        [KEY_MEASURED_AT] = WORD_DAEMON_FAULT_ACCEPTED_MEASURED_AT,
        [KEY_LABEL] = WORD_DAEMON_FAULT_ACCEPTED_LABEL,
        [KEY_SKIN] = WORD_DAEMON_FAULT_ACCEPTED_SKIN,
        [KEY_SD] = WORD_DAEMON_FAULT_ACCEPTED_SD,
    };
    text[0] = '\0';
    if (key < ISCHIA_PARAM_COUNT) {
        const struct ischia_param_info *p = &ischia_params[key];
        accepted_range(language, text, size, p->accepted_min, p->accepted_max, p->unit);
    } else if (key >= KEY_FIRST_SD) {
        const enum ischia_param input = (enum ischia_param)(key - KEY_FIRST_SD);
        accepted_range(language, text, size, 0, sampling_sd_max(input), ischia_params[input].unit);
    } else if (key >= KEY_FIRST_OPTION) {
        const struct ischia_option_info *o = &ischia_options[key - KEY_FIRST_OPTION];
        accepted_range(language, text, size, o->accepted_min, o->accepted_max, o->unit);
    } else if (key == KEY_RESOLUTION) {
        for (int i = 0; i < ISCHIA_RESOLUTION_COUNT; i++)
            append(text, size, ischia_resolution_names[i]);
    } else if (key == KEY_SIDE) {
        for (int i = ISCHIA_SIDE_LEFT; i < ISCHIA_SIDE_COUNT; i++)
            append(text, size, ischia_side_names[i]);
    } else if (key == KEY_MODEL) {
        accepted_models(language, text, size);
    } else {
        (void)snprintf(text, size, "%s", words_get(language, words[key]));
    }
    return text;
}

void case_key_refuse(struct case_doc_fields *fields, int key, const char *code, const char *given)
{
    const enum language language = fields->faults->language;
    char pointer[DOC_POINTER_BYTES], text[128], shown[48];
    (void)key_pointer(key, pointer);
    if (doc_faults_has(fields->faults, pointer)) return; /* one fault a value is enough */
    doc_faults_say(fields->faults, pointer, code, WORD_DAEMON_FAULT_REFUSED,
                   WORDS(word_text("key", case_key_name(key)),
                         word_text("given", text_printable(given, shown, sizeof shown)),
                         word_text("accepted", accepted(language, key, text, sizeof text))));
}

void case_key_unknown(struct case_doc_fields *fields, const char *pointer, const char *spelling)
{
    char known[128] = "", shown[40];
    const char *nearest = case_doc_nearest_key(spelling);
    (void)text_printable(spelling, shown, sizeof shown);
    if (nearest != NULL) {
        doc_faults_say(fields->faults, pointer, "unknown", WORD_DAEMON_FAULT_NEAREST,
                       WORDS(word_text("key", shown), word_text("nearest", nearest)));
        return;
    }
    for (int key = 0; key <= KEY_SD; key++) append(known, sizeof known, case_key_name(key));
    doc_faults_say(fields->faults, pointer, "unknown", WORD_DAEMON_FAULT_UNKNOWN,
                   WORDS(word_text("key", shown), word_text("known", known)));
}

/* ---- values ---- */

static void set_sd(struct case_doc_fields *fields, int key, double value)
{
    const enum ischia_param input = (enum ischia_param)(key - KEY_FIRST_SD);
    char given[TEXT_NUMBER_BYTES];
    fields->request->has_sd = true;
    if (value >= 0 && value <= sampling_sd_max(input)) {
        fields->sd[input] = value;
        return;
    }
    case_key_refuse(fields, key, "out_of_range", text_from_number(value, given));
}

void case_key_set_number(struct case_doc_fields *fields, int key, double value)
{
    char given[TEXT_NUMBER_BYTES];
    assert(key < ISCHIA_PARAM_COUNT || key >= KEY_FIRST_OPTION);
    if (!isfinite(value)) {
        (void)snprintf(given, sizeof given, "%g", value);
        case_key_refuse(fields, key, "not_finite", given);
    } else if (key < ISCHIA_PARAM_COUNT) {
        fields->request->values.param[key] = value;
    } else if (key >= KEY_FIRST_SD) {
        set_sd(fields, key, value);
    } else {
        fields->option[key - KEY_FIRST_OPTION] = value;
    }
}

static bool has_control_character(const char *text)
{
    for (; *text != '\0'; text++)
        if ((unsigned char)*text < 0x20 || *text == 0x7F ||
            ((unsigned char)text[0] == 0xC2 && (unsigned char)text[1] < 0xA0))
            return true;
    return false;
}

static bool set_subject(struct ischia_request *request, const char *value)
{
    if (!text_is_pseudonym(value)) return false;
    (void)snprintf(request->subject, sizeof request->subject, "%s", value);
    return true;
}

static bool set_side(struct ischia_request *request, const char *value)
{
    for (int side = ISCHIA_SIDE_LEFT; side < ISCHIA_SIDE_COUNT; side++)
        if (strcmp(value, ischia_side_names[side]) == 0) {
            request->side = (enum ischia_side)side;
            return true;
        }
    return false;
}

static bool set_measured_at(struct ischia_request *request, const char *value)
{
    if (strlen(value) >= sizeof request->measured_at || !text_is_date_or_time(value)) return false;
    (void)snprintf(request->measured_at, sizeof request->measured_at, "%s", value);
    return true;
}

static bool set_label(struct ischia_request *request, const char *value)
{
    if (text_character_count(value) > ISCHIA_LABEL_CHARACTERS_MAX || has_control_character(value))
        return false;
    (void)snprintf(request->label, sizeof request->label, "%s", value);
    return true;
}

static bool set_resolution(struct ischia_request *request, const char *value)
{
    for (int i = 0; i < ISCHIA_RESOLUTION_COUNT; i++)
        if (strcmp(value, ischia_resolution_names[i]) == 0) {
            request->values.resolution = (enum ischia_resolution)i;
            return true;
        }
    return false;
}

static bool set_model(struct ischia_request *request, const char *value)
{
    for (int i = 0; i < ISCHIA_PRESET_COUNT; i++)
        if (strcmp(value, ischia_presets[i].name) == 0) {
            (void)snprintf(request->preset, sizeof request->preset, "%s", value);
            memcpy(request->values.option, ischia_presets[i].option, sizeof request->values.option);
            return true;
        }
    return false;
}

static bool set_typical_sd(struct ischia_request *request, const char *value)
{
    if (strcmp(value, "typical") != 0) return false;
    request->has_sd = request->sd_typical = true;
    return true;
}

static const struct text_setter {
    bool (*set)(struct ischia_request *request, const char *value);
    const char *code;
    bool may_echo; /* what a person may have typed by mistake (a name) is not repeated */
} text_setters[KEY_COUNT] = {
    [KEY_SUBJECT] = {set_subject, "malformed", false},
    [KEY_SIDE] = {set_side, "not_allowed", true},
    [KEY_MEASURED_AT] = {set_measured_at, "malformed", true},
    [KEY_LABEL] = {set_label, "malformed", false},
    [KEY_RESOLUTION] = {set_resolution, "not_allowed", true},
    [KEY_MODEL] = {set_model, "not_allowed", true},
    [KEY_SD] = {set_typical_sd, "not_allowed", true},
};

static const char *quoted(const char *value, char *buffer, size_t size)
{
    char shown[28];
    (void)snprintf(buffer, size, "\"%s\"", text_printable(value, shown, sizeof shown));
    return buffer;
}

void case_key_set_text(struct case_doc_fields *fields, int key, const char *value)
{
    const struct text_setter *setter = &text_setters[key];
    char given[32];
    assert(setter->set != NULL);
    if (setter->set(fields->request, value)) return;
    case_key_refuse(fields, key, setter->code,
                    setter->may_echo
                        ? quoted(value, given, sizeof given)
                        : words_get(fields->faults->language, WORD_DAEMON_FAULT_WRONG));
}

/* ---- field by field ---- */

void case_doc_fields_init(struct case_doc_fields *ret, struct ischia_request *request,
                          struct doc_faults *faults)
{
    *ret = (struct case_doc_fields){.request = request, .faults = faults};
    ischia_request_init(request);
    for (int i = 0; i < ISCHIA_OPTION_COUNT; i++) ret->option[i] = (double)NAN;
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) ret->sd[i] = (double)NAN;
}

/* Two decimal marks: what was meant cannot be known, so say how to write it. */
static void refuse_ambiguous(struct case_doc_fields *fields, int key, const char *value)
{
    char pointer[DOC_POINTER_BYTES], shown[28];
    doc_faults_say(fields->faults, key_pointer(key, pointer), "ambiguous",
                   WORD_DAEMON_FAULT_AMBIGUOUS,
                   WORDS(word_text("key", case_key_name(key)),
                         word_text("value", text_printable(value, shown, sizeof shown))));
}

static enum text_typed read_number_text(const struct case_doc_fields *fields, const char *value,
                                        double *ret)
{
    if (fields->typed) return text_to_typed_number(value, ret);
    return text_to_number(value, strlen(value), ret) ? TEXT_TYPED_NUMBER : TEXT_TYPED_NO_NUMBER;
}

static void set_number_text(struct case_doc_fields *fields, int key, const char *value)
{
    double number;
    char given[32];
    const enum text_typed kind = read_number_text(fields, value, &number);
    if (kind == TEXT_TYPED_NUMBER)
        case_key_set_number(fields, key, number);
    else if (kind == TEXT_TYPED_AMBIGUOUS)
        refuse_ambiguous(fields, key, value);
    else
        case_key_refuse(fields, key, "wrong_type", quoted(value, given, sizeof given));
}

static void set_trimmed(struct case_doc_fields *fields, int key, const char *value)
{
    if (key < ISCHIA_PARAM_COUNT || key >= KEY_FIRST_OPTION)
        set_number_text(fields, key, value);
    else if (text_setters[key].set != NULL)
        case_key_set_text(fields, key, value);
    else /* a group: "skin" */
        case_key_refuse(fields, key, "unsupported",
                        words_get(fields->faults->language, WORD_DAEMON_FAULT_GIVEN));
}

void case_doc_fields_set(struct case_doc_fields *fields, const char *key, const char *value)
{
    char trimmed[ISCHIA_LABEL_BYTES + 1], pointer[DOC_POINTER_BYTES];
    const int found = case_key_find(key);
    if (found == KEY_NONE) {
        (void)doc_pointer(pointer, sizeof pointer, "", key);
        case_key_unknown(fields, pointer, key);
        return;
    }
    if (!case_key_first_time(fields, found, key)) return;
    value += strspn(value, " \t\r\n");
    size_t length = strlen(value);
    while (length > 0 && strchr(" \t\r\n", value[length - 1]) != NULL) length--;
    if (length == 0) return;
    if (length >= sizeof trimmed) length = sizeof trimmed - 1; /* longer than any value may be */
    (void)snprintf(trimmed, sizeof trimmed, "%.*s", (int)length, value);
    set_trimmed(fields, found, trimmed);
}

void case_doc_fields_set_defaults(struct case_doc_fields *fields,
                                  const struct case_doc_defaults *defaults)
{
    if (defaults->resolution != NULL)
        case_doc_fields_set(fields, "resolution", defaults->resolution);
    if (defaults->model != NULL) case_doc_fields_set(fields, "model", defaults->model);
}

/* What was given for one input holds over what is typical. */
static void end_sd(struct case_doc_fields *fields)
{
    struct ischia_request *request = fields->request;
    double sd[ISCHIA_PARAM_COUNT];
    bool given = false;
    case_doc_sd(request, sd);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        given = given || !isnan(fields->sd[i]);
        if (!isnan(fields->sd[i])) sd[i] = fields->sd[i];
    }
    if (!given || fields->faults->count > 0) return;
    request->sd_typical = false;
    memcpy(request->sd, sd, sizeof request->sd);
}

void case_doc_fields_end(struct case_doc_fields *fields)
{
    double *option = fields->request->values.option;
    for (int i = 0; i < ISCHIA_OPTION_COUNT; i++)
        if (!isnan(fields->option[i])) option[i] = fields->option[i];
    doc_faults_add_case(fields->faults, &fields->request->values);
    end_sd(fields);
}
