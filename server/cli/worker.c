/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * ischia worker --fd N: serves one socket of ischiad until it closes. The messages are those of
 * server/frame.h. It never logs: what it has to say goes to the daemon.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "api/case_doc.h"
#include "api/problem_doc.h"
#include "api/result_doc.h"
#include "server/cli/field_blob.h"
#include "server/cli/options.h"
#include "server/cli/run.h"
#include "server/cli/section_words.h"
#include "server/cli/uncertain.h"
#include "server/cli/version.h"
#include "server/cli/worker_sandbox.h"
#include "server/frame.h"
#include "server/message.h"

enum { PROGRESS_EVERY_MS = 50, FD_MAX = 1 << 20 };

/* A sanitizer makes system calls of its own: those builds, never installed, are not shut in. */
#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define ISCHIA_HAS_SANITIZER
#endif
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || defined(ISCHIA_HAS_SANITIZER)
enum { SHUT_IN = 0 };
#else
enum { SHUT_IN = 1 };
#endif

struct worker {
    int fd;
    struct ischia_solver *solver;
    struct estimator *estimator; /* NULL: there is no emulator */
    struct frame_reader reader;
    struct frame_writer writer;
    int job;             /* being worked on */
    double said_at_ms;   /* when progress was last sent */
    bool daemon_is_gone; /* a message could not be sent */
};

static double now_ms(void)
{
    struct timespec t = {0};
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

/* ------------------------------------------------------------------------------ speaking */

static enum ischia_code send_all(struct worker *worker, struct ischia_error *err)
{
    bool empty;
    return frame_writer_flush(&worker->writer, worker->fd, &empty, err);
}

static enum ischia_code put(struct worker *worker, const struct message *message,
                            struct ischia_error *err)
{
    char *json = NULL;
    size_t size = 0;
    TRY(message_write(message, &json, &size, err));
    const enum ischia_code code = frame_put_json(&worker->writer, json, size, err);
    free(json);
    return code;
}

static enum ischia_code say_hello(struct worker *worker, struct ischia_error *err)
{
    struct message hello = {.kind = MESSAGE_HELLO,
                            .protocol = FRAME_PROTOCOL_VERSION,
                            .model_version = ISCHIA_MODEL_VERSION,
                            .model = ISCHIA_MODEL_NAME};
    version_of_worker(hello.program, sizeof hello.program);
    TRY(put(worker, &hello, err));
    return send_all(worker, err);
}

static enum ischia_code say_problem(struct worker *worker, const struct problem *problem,
                                    struct ischia_error *err)
{
    const struct message message = {.kind = MESSAGE_PROBLEM, .job = worker->job};
    char *text = NULL;
    TRY(problem_doc_text(&text, problem, err));
    enum ischia_code code = put(worker, &message, err);
    if (code == ISCHIA_OK) code = frame_put_json(&worker->writer, text, strlen(text), err);
    free(text);
    TRY(code);
    return send_all(worker, err);
}

static enum ischia_code say_error(struct worker *worker, const struct ischia_error *why,
                                  struct ischia_error *err)
{
    struct problem problem;
    if (why->code == ISCHIA_E_MEMORY)
        problem_init(&problem, PROBLEM_OUT_OF_MEMORY, "%s", why->message);
    else
        problem_from_error(&problem, why);
    return say_problem(worker, &problem, err);
}

static bool is_due(struct worker *worker)
{
    const double now = now_ms();
    if (now - worker->said_at_ms < PROGRESS_EVERY_MS) return false;
    worker->said_at_ms = now;
    return true;
}

/* False, which cancels the solve, when there is nobody left to tell. */
static bool on_progress(void *context, const struct ischia_progress *progress)
{
    struct worker *worker = context;
    if (!is_due(worker)) return true;
    struct message message = {.kind = MESSAGE_PROGRESS,
                              .job = worker->job,
                              .fraction = fmin(fmax(progress->fraction, 0.0), 1.0),
                              .load_step = progress->load_step,
                              .newton_iteration = progress->newton_iteration,
                              .F_N = fmax(progress->F_N, 0.0)};
    (void)text_printable(progress->message, message.text, sizeof message.text);
    struct ischia_error err;
    worker->daemon_is_gone =
        put(worker, &message, &err) != ISCHIA_OK || send_all(worker, &err) != ISCHIA_OK;
    return !worker->daemon_is_gone;
}

/* ------------------------------------------------------------------------------- solving */

struct solution {
    char *text; /* the result object */
    unsigned char *blob;
    size_t blob_size;
};

static enum ischia_code write_solution(const struct ischia_case *c,
                                       const struct uncertain_solution *solved,
                                       struct solution *ret, struct ischia_error *err)
{
    TRY(field_blob_encode(solved->field.displacement_mm, solved->field.node_count, &ret->blob,
                          &ret->blob_size, err));
    return result_doc_text(&ret->text, c, &solved->result, uncertain_of(solved), 0, err);
}

static enum ischia_code say_solution(struct worker *worker, const struct solution *solution,
                                     struct ischia_error *err)
{
    const struct message message = {.kind = MESSAGE_RESULT, .job = worker->job};
    TRY(put(worker, &message, err));
    TRY(frame_put_json(&worker->writer, solution->text, strlen(solution->text), err));
    TRY(frame_put_blob(&worker->writer, solution->blob, solution->blob_size, err));
    return send_all(worker, err);
}

static enum ischia_code say_solved(struct worker *worker, const struct ischia_case *c,
                                   const struct uncertain_solution *solved,
                                   struct ischia_error *err)
{
    if (!ischia_result_converged(&solved->result)) {
        struct problem problem;
        problem_from_result(&problem, c, &solved->result);
        return say_problem(worker, &problem, err);
    }
    struct solution solution = {0};
    struct ischia_error why = {0};
    const bool written = write_solution(c, solved, &solution, &why) == ISCHIA_OK;
    const enum ischia_code code =
        written ? say_solution(worker, &solution, err) : say_error(worker, &why, err);
    free(solution.text);
    free(solution.blob);
    return code;
}

static enum ischia_code solve(struct worker *worker, const struct ischia_request *request,
                              struct ischia_error *err)
{
    const struct ischia_observer observer = {.on_progress = on_progress, .context = worker};
    struct uncertain_solution solved;
    struct ischia_error why = {0};
    if (uncertain_solve(worker->solver, worker->estimator, request, &observer, &solved, &why) !=
        ISCHIA_OK) {
        CHECK(!worker->daemon_is_gone, err, ISCHIA_E_IO, "the daemon is gone");
        return say_error(worker, &why, err);
    }
    const enum ischia_code code = say_solved(worker, &request->values, &solved, err);
    ischia_field_finish(&solved.field);
    return code;
}

/* ------------------------------------------------------------------------------- drawing */

typedef enum ischia_code drawing_writer(FILE *out, const struct ischia_case *c,
                                        const struct ischia_field *field, enum language language,
                                        struct ischia_error *err);

static enum ischia_code write_vtu(FILE *out, const struct ischia_case *c,
                                  const struct ischia_field *field, enum language language,
                                  struct ischia_error *err)
{
    (void)language; /* for programs */
    return ischia_write_vtu(out, c, field, err);
}

static const struct {
    const char *as;
    drawing_writer *writer;
} drawings[] = {{"vtu", write_vtu}, {"svg", section_write}};

static drawing_writer *find_writer(const char *as)
{
    for (size_t i = 0; i < sizeof drawings / sizeof drawings[0]; i++)
        if (strcmp(drawings[i].as, as) == 0) return drawings[i].writer;
    return NULL;
}

/* Draws into memory: a worker has no files. *ret_text is the caller's to free. */
static enum ischia_code draw(drawing_writer *writer, enum language language,
                             const struct ischia_case *c, const struct ischia_field *field,
                             char **ret_text, size_t *ret_size, struct ischia_error *err)
{
    char *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    CHECK(out != NULL, err, ISCHIA_E_MEMORY, "no memory for a drawing");
    enum ischia_code code = writer(out, c, field, language, err);
    if (fclose(out) != 0 && code == ISCHIA_OK)
        code = FAIL(err, ISCHIA_E_MEMORY, "no memory for a drawing");
    if (code != ISCHIA_OK) {
        free(text);
        return code;
    }
    *ret_text = text;
    *ret_size = size;
    return ISCHIA_OK;
}

static enum ischia_code draw_blob(const struct message *order, const struct ischia_case *c,
                                  const struct frame *blob, char **ret_text, size_t *ret_size,
                                  struct ischia_error *err)
{
    drawing_writer *writer = find_writer(order->as);
    enum language language;
    struct ischia_field field = {0};
    CHECK(writer != NULL, err, ISCHIA_E_INPUT, "no drawing of the kind %s", order->as);
    CHECK(words_language(order->language, &language), err, ISCHIA_E_INPUT,
          "no words of the language %s", order->language);
    TRY(field_blob_decode((const unsigned char *)blob->bytes, blob->size, &field.displacement_mm,
                          &field.node_count, err));
    const enum ischia_code code = draw(writer, language, c, &field, ret_text, ret_size, err);
    free(field.displacement_mm);
    return code;
}

static enum ischia_code render(struct worker *worker, const struct message *order,
                               const struct ischia_case *c, const struct frame *blob,
                               struct ischia_error *err)
{
    const struct message message = {.kind = MESSAGE_RENDERED, .job = worker->job};
    struct ischia_error why = {0};
    char *text = NULL;
    size_t size = 0;
    if (draw_blob(order, c, blob, &text, &size, &why) != ISCHIA_OK)
        return say_error(worker, &why, err);
    enum ischia_code code = put(worker, &message, err);
    if (code == ISCHIA_OK) code = frame_put_blob(&worker->writer, text, size, err);
    free(text);
    TRY(code);
    return send_all(worker, err);
}

/* ------------------------------------------------------------------------------- serving */

static enum ischia_code do_order(struct worker *worker, const struct message *order,
                                 const struct frame *blob, struct ischia_error *err)
{
    struct ischia_request request;
    struct doc_faults faults;
    struct ischia_error why = {0};
    doc_faults_init(&faults);
    if (case_doc_read(&request, order->case_json, strlen(order->case_json), &json_limits_stored,
                      &faults, &why) != ISCHIA_OK)
        return say_error(worker, &why, err);
    if (faults.count > 0) {
        struct problem problem;
        problem_from_faults(&problem, &faults);
        return say_problem(worker, &problem, err);
    }
    worker->said_at_ms = 0;
    if (order->kind == MESSAGE_RENDER) return render(worker, order, &request.values, blob, err);
    return solve(worker, &request, err);
}

static enum ischia_code take_order(struct worker *worker, const struct message *order,
                                   struct ischia_error *err)
{
    struct frame blob = {.kind = FRAME_NONE};
    const bool renders = order->kind == MESSAGE_RENDER;
    CHECK(renders || order->kind == MESSAGE_SOLVE, err, ISCHIA_E_INPUT, "that is no order");
    if (renders) {
        TRY(frame_receive(&worker->reader, worker->fd, &blob, err));
        CHECK(blob.kind == FRAME_BLOB, err, ISCHIA_E_INPUT, "the field did not follow the order");
    }
    worker->job = order->job;
    return do_order(worker, order, &blob, err);
}

/* Until the daemon closes the socket. An error here is the end of the worker: the daemon sees it
 * and starts another one. */
static enum ischia_code serve(struct worker *worker, struct ischia_error *err)
{
    for (;;) {
        struct frame frame;
        struct message order;
        TRY(frame_receive(&worker->reader, worker->fd, &frame, err));
        if (frame.kind == FRAME_NONE) return ISCHIA_OK;
        CHECK(frame.kind == FRAME_JSON, err, ISCHIA_E_INPUT, "a blob where an order was due");
        TRY(message_read(frame.bytes, frame.size, &order, err));
        const enum ischia_code code = take_order(worker, &order, err);
        free(order.case_json);
        TRY(code);
    }
}

/* What needs files comes before the worker is shut in. */
static enum ischia_code run(struct worker *worker, const char *emulator, struct ischia_error *err)
{
    if (emulator != NULL) TRY(estimator_create(&worker->estimator, emulator, err));
    TRY(ischia_solver_create(&worker->solver, err));
    if (SHUT_IN) TRY(worker_sandbox_enter(worker->fd, err));
    TRY(say_hello(worker, err));
    return serve(worker, err);
}

int command_worker(int argc, char **argv)
{
    const char *fd_text = NULL, *emulator = NULL;
    const struct cli_option options[] = {
        {"--fd", 0, "N", "the descriptor of the socket to ischiad", &fd_text, NULL},
        {"--emulator", 0, "FILE", "a trained emulator, for uncertain inputs", &emulator, NULL},
        {0}};
    const struct cli_usage usage = {
        .command = "worker",
        .synopsis = "--fd N [--emulator FILE]",
        .about = "Solves and draws for ischiad, which starts it. Not for use by hand.",
        .options = options,
        .operands_max = 0,
    };
    struct worker worker = {0};
    const enum cli_parse parsed = cli_parse_options(&usage, argc, argv, NULL);
    if (parsed != CLI_RUN) return parsed == CLI_HELP_SHOWN ? EXIT_DONE : EXIT_BAD_INPUT;
    if (fd_text == NULL) {
        (void)fprintf(stderr, "ischia worker: --fd is missing: ischiad starts workers\n");
        return EXIT_BAD_INPUT;
    }
    if (!cli_whole_number(&usage, "--fd", fd_text, 0, FD_MAX, &worker.fd)) return EXIT_BAD_INPUT;
    struct ischia_error err = {0};
    frame_reader_init(&worker.reader, &frame_limits_default);
    const enum ischia_code code = run(&worker, emulator, &err);
    ischia_solver_destroy(worker.solver);
    estimator_destroy(worker.estimator);
    frame_reader_finish(&worker.reader);
    frame_writer_finish(&worker.writer);
    if (code != ISCHIA_OK) return (int)report_error("worker", &err);
    return EXIT_DONE;
}
