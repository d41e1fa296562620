/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_ERROR_H
#define ISCHIA_SOLVER_ERROR_H

/*
 * Errors: a call that could not do its job returns a code and fills a struct
 * ischia_error where the failure happened; callers pass it up unreworded.
 *
 * A solve that does not converge is NOT an error: it is a result with a reason
 * (see enum ischia_reason in result.h).
 */

enum ischia_code {
    ISCHIA_OK = 0,
    ISCHIA_E_INPUT,     /* what the caller was given is not acceptable; say which field        */
    ISCHIA_E_MEMORY,    /* an allocation failed; nothing was changed                           */
    ISCHIA_E_IO,        /* a read or write failed; errno's words are in the message            */
    ISCHIA_E_NUMERIC,   /* a linear-algebra library reported a failure it should never report  */
    ISCHIA_E_CANCELLED, /* the observer asked to stop                                          */
    ISCHIA_E_LIMIT,     /* a documented limit (size, count, depth, time) was exceeded          */
    ISCHIA_E_STATE,     /* not possible in the present state (conflict, closed, not found)     */
    ISCHIA_CODE_COUNT
};

enum { ISCHIA_ERROR_MESSAGE_BYTES = 512 };

struct ischia_error {
    enum ischia_code code;
    char message[ISCHIA_ERROR_MESSAGE_BYTES]; /* one line of UTF-8, no trailing newline */
    const char *file;                         /* where it happened: for logs, not for users */
    int line;
};

/* Short lower-case word for a code ("input", "memory", ...), static storage; never NULL. */
const char *ischia_code_name(enum ischia_code code);

/* Fills *err (NULL allowed) with a printf-style message. Use FAIL, which adds the place. */
__attribute__((format(printf, 5, 6))) void ischia_fail(struct ischia_error *err,
                                                       enum ischia_code code, const char *file,
                                                       int line, const char *format, ...);

#define ISCHIA_MUST_CHECK __attribute__((warn_unused_result))

/* FAIL(err, code, format, ...): an expression whose value is the code, so that `return FAIL(...)`
 * is one statement. The code stands in it twice: a reader of the source (a compiler, an analyzer)
 * sees without the other file that a failure is not ISCHIA_OK. */
#define FAIL(err, code, ...)                                                                       \
    (ischia_fail((err), (code), __FILE__, __LINE__, __VA_ARGS__), (enum ischia_code)(code))

/* CHECK(condition, err, code, format, ...): returns the code when the condition is false. */
#define CHECK(condition, err, code, ...)                                                           \
    do {                                                                                           \
        if (!(condition)) return FAIL((err), (code), __VA_ARGS__);                                 \
    } while (0)

/* TRY(call): returns the callee's code from the function when it is not ISCHIA_OK. */
#define TRY(call)                                                                                  \
    do {                                                                                           \
        const enum ischia_code try_code_ = (call);                                                 \
        if (try_code_ != ISCHIA_OK) return try_code_;                                              \
    } while (0)

#endif
