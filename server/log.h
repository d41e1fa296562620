/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_LOG_H
#define ISCHIA_SERVER_LOG_H

#include <stdint.h>

/*
 * The daemon's log: one logfmt line a message (time=… level=… event=… key=value …) to stderr, or
 * to journald's own socket when stderr is connected to the journal (then as fields).
 *
 * Nothing that identifies a person is ever given to it: no subject, label, parameter, query
 * string or token. Ids of assessments are allowed. May be called from any thread.
 */

enum log_level { LOG_LEVEL_DEBUG, LOG_LEVEL_INFO, LOG_LEVEL_WARNING, LOG_LEVEL_ERROR };
extern const char *const log_level_names[]; /* NULL-ended */

/* Chooses stderr or the journal ($JOURNAL_STREAM). Without it messages go to stderr. */
void log_init(enum log_level least);
void log_set_level(enum log_level least);
void log_finish(void);

/* `event` is a short fixed phrase ("worker died"). `format` gives further logfmt pairs, "" for
 * none, e.g. "worker=%d signal=%d"; text values go through log_quote first. */
__attribute__((format(printf, 3, 4))) void log_event(enum log_level level, const char *event,
                                                     const char *format, ...);

/* A value quoted for logfmt ("a b" -> "\"a b\"", control characters escaped), cut to fit. Returns
 * ret, so that it can stand among the arguments of log_event. */
struct log_value {
    char text[320];
};
const char *log_quote(struct log_value *ret, const char *value);

#define LOG_DEBUG(...)   log_event(LOG_LEVEL_DEBUG, __VA_ARGS__)
#define LOG_INFO(...)    log_event(LOG_LEVEL_INFO, __VA_ARGS__)
#define LOG_WARNING(...) log_event(LOG_LEVEL_WARNING, __VA_ARGS__)
#define LOG_ERROR(...)   log_event(LOG_LEVEL_ERROR, __VA_ARGS__)

#endif
