/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/cli/options.h"

#include <stdio.h>
#include <string.h>

#include "api/text.h"

static void print_help(const struct cli_usage *usage)
{
    printf("Usage: ischia %s [OPTION]... %s\n\n%s\n\nOptions:\n", usage->command, usage->synopsis,
           usage->about);
    for (const struct cli_option *o = usage->options; o->name != NULL; o++) {
        char left[64], letter[8] = "    ";
        if (o->letter != 0) (void)snprintf(letter, sizeof letter, "-%c, ", o->letter);
        (void)snprintf(left, sizeof left, "%s%s%s%s", letter, o->name, o->value != NULL ? " " : "",
                       o->value != NULL ? o->value : "");
        printf("  %-26s %s\n", left, o->help);
    }
    printf("      %-22s %s\n", "--help", "show this and exit");
    printf("\nExit status: 0 done, 1 a solve failed, 2 bad input or usage.\n");
}

/* "ischia solve: --vtu needs a value; see ischia solve --help" */
static enum cli_parse bad_usage(const struct cli_usage *usage, const char *word, const char *what,
                                const char *hint)
{
    char shown[80];
    (void)fprintf(stderr, "ischia %s: %s %s%s; see ischia %s --help\n", usage->command,
                  text_printable(word, shown, sizeof shown), what, hint, usage->command);
    return CLI_BAD_USAGE;
}

static enum cli_parse unknown_option(const struct cli_usage *usage, const char *word)
{
    char hint[80] = "";
    int least = TEXT_NO_SLIP;
    for (const struct cli_option *o = usage->options; o->name != NULL; o++) {
        const int slips = text_slips(word, o->name);
        if (slips >= least) continue;
        least = slips;
        (void)snprintf(hint, sizeof hint, "; did you mean %s?", o->name);
    }
    return bad_usage(usage, word, "is not an option", hint);
}

/* What one argument says: "--name", "--name=value", "-j", "-j4". */
struct word {
    const struct cli_option *option;
    const char *value; /* in the same argument; NULL: none */
};

static bool matches_name(const char *argument, const char *name, struct word *ret)
{
    const size_t length = strlen(name);
    if (strncmp(argument, name, length) != 0) return false;
    if (argument[length] != '\0' && argument[length] != '=') return false;
    ret->value = argument[length] == '=' ? argument + length + 1 : NULL;
    return true;
}

static bool matches_letter(const char *argument, char letter, struct word *ret)
{
    if (letter == 0 || argument[1] != letter) return false;
    ret->value = argument[2] != '\0' ? argument + 2 : NULL;
    return true;
}

static bool find_option(const struct cli_usage *usage, const char *argument, struct word *ret)
{
    for (const struct cli_option *o = usage->options; o->name != NULL; o++)
        if (matches_name(argument, o->name, ret) || matches_letter(argument, o->letter, ret)) {
            ret->option = o;
            return true;
        }
    return false;
}

/* Takes the option at argv[*at], and its value behind it when it has one there. */
static enum cli_parse take_option(const struct cli_usage *usage, int argc, char **argv, int *at)
{
    struct word word;
    if (!find_option(usage, argv[*at], &word)) return unknown_option(usage, argv[*at]);
    const struct cli_option *o = word.option;
    if (o->flag != NULL) {
        if (word.value != NULL) return bad_usage(usage, o->name, "takes no value", "");
        *o->flag = true;
        return CLI_RUN;
    }
    if (word.value == NULL && *at + 1 < argc) word.value = argv[++*at];
    if (word.value == NULL || word.value[0] == '\0')
        return bad_usage(usage, o->name, "needs a value", "");
    *o->text = word.value;
    return CLI_RUN;
}

enum cli_parse cli_parse_options(const struct cli_usage *usage, int argc, char **argv,
                                 const char **ret_operands)
{
    int operands = 0;
    bool options_end = false;
    for (int i = 1; i < argc; i++) {
        const bool is_option = !options_end && argv[i][0] == '-' && argv[i][1] != '\0';
        if (is_option && strcmp(argv[i], "--") == 0) {
            options_end = true;
        } else if (is_option && strcmp(argv[i], "--help") == 0) {
            print_help(usage);
            return CLI_HELP_SHOWN;
        } else if (is_option) {
            const enum cli_parse taken = take_option(usage, argc, argv, &i);
            if (taken != CLI_RUN) return taken;
        } else if (operands == usage->operands_max) {
            return bad_usage(usage, argv[i], "is one operand too many", "");
        } else {
            ret_operands[operands++] = argv[i];
        }
    }
    return CLI_RUN;
}

bool cli_whole_number(const struct cli_usage *usage, const char *option, const char *text, int min,
                      int max, int *ret)
{
    double value = 0;
    char hint[64], what[64], shown[24];
    if (text_to_number(text, strlen(text), &value) && value >= min && value <= max &&
        value == (double)(int)value) {
        *ret = (int)value;
        return true;
    }
    (void)snprintf(hint, sizeof hint, "; accepted a whole number from %d to %d", min, max);
    (void)snprintf(what, sizeof what, "%s %s", option, text_printable(text, shown, sizeof shown));
    (void)bad_usage(usage, what, "is not accepted", hint);
    return false;
}
