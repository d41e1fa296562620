/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_CASE_H
#define ISCHIA_SOLVER_CASE_H

#include <stdbool.h>
#include <stddef.h>

/*
 * One case: the seven measured numbers of one side, and the options of the model.
 *
 * The tables here are the only place where keys, units, limits and defaults live; the JSON and CSV
 * readers, the form, GET /v1/parameters and the docs all iterate them. What people call the inputs
 * stands with all other words, in words/.
 */

/* The seven inputs, in the order in which the paper and every table of ours list them. */
enum ischia_param {
    ISCHIA_R1,
    ISCHIA_R2,
    ISCHIA_EM,
    ISCHIA_EF,
    ISCHIA_MUM,
    ISCHIA_MUF,
    ISCHIA_F,
    ISCHIA_PARAM_COUNT
};

/* The options: those of the skin, then those of the model. All are plain numbers. */
enum ischia_option {
    ISCHIA_SKIN_MU,
    ISCHIA_SKIN_THICKNESS,
    ISCHIA_L_OVER_H,
    ISCHIA_BULK_RATIO,
    ISCHIA_FRICTION,
    ISCHIA_R2_SURFACE,
    ISCHIA_EMBED_OVER_R1,
    ISCHIA_OPTION_COUNT
};

enum ischia_resolution { ISCHIA_STANDARD, ISCHIA_FINE, ISCHIA_COARSE, ISCHIA_RESOLUTION_COUNT };

struct ischia_param_info {
    const char *key;     /* canonical JSON key: "muM"                                       */
    const char *unit;    /* "mm", "kPa", "N"                                                */
    double accepted_min; /* outside [accepted_min, accepted_max]: refused                   */
    double accepted_max;
    double studied_min; /* outside [studied_min, studied_max]: solved, with a warning      */
    double studied_max;
};

struct ischia_option_info {
    const char *group; /* "skin" or "model": the JSON object that holds it                */
    const char *key;   /* key inside that object                                          */
    const char *unit;  /* "1" when dimensionless                                          */
    double accepted_min;
    double accepted_max;
    double default_value;
};

extern const struct ischia_param_info ischia_params[ISCHIA_PARAM_COUNT];
extern const struct ischia_option_info ischia_options[ISCHIA_OPTION_COUNT];
extern const char *const ischia_resolution_names[ISCHIA_RESOLUTION_COUNT];

/* Named sets of options; [0] is "default". A preset gives every option a value. */
struct ischia_preset {
    const char *name;
    double option[ISCHIA_OPTION_COUNT];
};
enum { ISCHIA_PRESET_COUNT = 2 };
extern const struct ischia_preset ischia_presets[ISCHIA_PRESET_COUNT];

/* Name and version of the mechanical model; results of different versions are never mixed. */
#define ISCHIA_MODEL_NAME "macron2020-local"
enum { ISCHIA_MODEL_VERSION = 1 };

struct ischia_case {
    double param[ISCHIA_PARAM_COUNT];   /* in the units of ischia_params; F is the WHOLE side   */
    double option[ISCHIA_OPTION_COUNT]; /* in the units of ischia_options                       */
    enum ischia_resolution resolution;
};

/* A case with every option at its default, standard resolution, and all seven inputs NaN (so
 * that an input nobody set is found by ischia_case_is_valid). */
struct ischia_case ischia_case_default(void);

/* True when every number is finite and within `accepted`, and R2 >= R1. Asserted by the solver;
 * readers of documents report the faults one by one instead (ischia_case_faults). */
bool ischia_case_is_valid(const struct ischia_case *c);

/* What is wrong with a case, or worth a warning. The words for it are those of api/case_words.h. */
enum ischia_case_fault_kind {
    ISCHIA_CASE_MISSING,      /* a number nobody set                                          */
    ISCHIA_CASE_OUT_OF_RANGE, /* a number outside `accepted`                                  */
    ISCHIA_CASE_ORDER,        /* R2 is smaller than R1                                        */
    ISCHIA_CASE_UNSTUDIED,    /* a warning: an input outside `studied`                        */
    ISCHIA_CASE_FAULT_KIND_COUNT
};
struct ischia_case_fault {
    enum ischia_case_fault_kind kind;
    int index; /* an enum ischia_param, or ISCHIA_PARAM_COUNT + an enum ischia_option           */
};
enum { ISCHIA_CASE_FAULTS_MAX = ISCHIA_PARAM_COUNT + ISCHIA_OPTION_COUNT + 1 };

/* Writes all faults of c (a NaN input is missing) and returns how many there are. */
size_t ischia_case_faults(const struct ischia_case *c,
                          struct ischia_case_fault ret_faults[ISCHIA_CASE_FAULTS_MAX]);

/* Writes the warnings of a valid case, by input, and returns how many there are. */
size_t ischia_case_warnings(const struct ischia_case *c,
                            struct ischia_case_fault ret_warnings[ISCHIA_PARAM_COUNT]);

#endif
