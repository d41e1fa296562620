/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A worker for tests that does what it is told, good or bad. The case's member "do" says what:
 *   solve (default)  progress, then a result whose newton_iterations is the case's "n"
 *   slow             the same after "ms" milliseconds
 *   diverge          a problem
 *   crash, killed    dies by SIGSEGV, by SIGKILL        exit    leaves with status 3
 *   hang             says nothing any more              close   closes its socket and lives on
 *   memory           takes memory until there is none, then says so in a problem
 *   babble           bytes that are no frame            bad_json, bad_result, bad_job, bad_blob
 *   stale            a good answer, to a job that it does not have
 *   die_after        a good result, then SIGSEGV
 *   unconverged      calls a diverged result a result
 * A real case has no such member: then the force says it, as of tests/api/fake_worker.py: 598 N
 * diverges, 597 N crashes, 596 N is slow, and newton_iterations is the force in mN.
 * A first argument changes how it starts: no_hello, exit_first, die_after_hello, wrong_version.
 */
#include <math.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "api/json.h"
#include "api/problem_doc.h"
#include "api/result_doc.h"
#include "server/frame.h"
#include "server/message.h"

struct fake {
    int fd;
    struct frame_writer writer;
    struct message order;
    struct json *given; /* the order's case */
};

static void require(bool holds)
{
    if (!holds) _exit(9); /* a fault of the test itself */
}

static void sleep_ms(double ms)
{
    struct timespec rest = {(time_t)(ms / 1000), (long)(fmod(ms, 1000.0) * 1e6)};
    while (nanosleep(&rest, &rest) != 0) continue;
}

static void flush_writer(struct fake *fake)
{
    bool empty;
    if (frame_writer_flush(&fake->writer, fake->fd, &empty, NULL) != ISCHIA_OK) _exit(0);
}

static void say(struct fake *fake, struct message message)
{
    char *json = NULL;
    size_t size = 0;
    require(message_write(&message, &json, &size, NULL) == ISCHIA_OK);
    require(frame_put_json(&fake->writer, json, size, NULL) == ISCHIA_OK);
    free(json);
    flush_writer(fake);
}

static void say_raw(struct fake *fake, const char *bytes)
{
    require(write(fake->fd, bytes, strlen(bytes)) == (ssize_t)strlen(bytes));
}

static double number_of(const struct fake *fake, const char *key, double otherwise)
{
    const struct json *value = json_member(fake->given, key);
    return value != NULL && json_type_of(value) == JSON_NUMBER ? json_number(value) : otherwise;
}

/* A converged result with every number in its physical range. */
static struct ischia_result make_result(const struct fake *fake)
{
    struct ischia_result result = {0};
    result.strain = (struct ischia_strain){0.9, 1.0, 0.6, 0.3};
    result.muscle_volume_mm3 = 1000.0;
    result.seat = (struct ischia_seat){10.0, 500.0, 20.0, 40.0};
    result.load_curve[0] = (struct ischia_load_point){258.0, 10.0, 0.9, 0.6, 0.3};
    result.load_curve_count = 1;
    result.threshold_force_shear_N = (double)NAN;
    result.threshold_force_compression_N = (double)NAN;
    result.numerics = (struct ischia_numerics){.reason = ISCHIA_CONVERGED,
                                               .elements = 8,
                                               .dof = 81,
                                               .load_steps = 1,
                                               .factorisations = 1,
                                               .det_F_min = 0.9,
                                               .eps_max_error = 0.01,
                                               .last_converged_F_N = 258.0};
    const double force_mN = round(1e3 * number_of(fake, "F", 1e-3));
    result.numerics.newton_iterations = (int)number_of(fake, "n", force_mN);
    return result;
}

static struct ischia_case make_case(void)
{
    static const double side[ISCHIA_PARAM_COUNT] = {7.1, 22.8, 31.0, 10.0, 8.0, 5.0, 258.0};
    struct ischia_case c = ischia_case_default();
    memcpy(c.param, side, sizeof side);
    return c;
}

static void say_result(struct fake *fake, const struct ischia_result *result)
{
    const struct ischia_case c = make_case();
    char *text = NULL;
    size_t size;
    require(result_doc_text(&text, &c, result, NULL, 0, NULL) == ISCHIA_OK);
    size = strlen(text);
    struct message message = {.kind = MESSAGE_RESULT, .job = fake->order.job};
    char *json = NULL;
    size_t json_size = 0;
    require(message_write(&message, &json, &json_size, NULL) == ISCHIA_OK);
    require(frame_put_json(&fake->writer, json, json_size, NULL) == ISCHIA_OK);
    require(frame_put_json(&fake->writer, text, size, NULL) == ISCHIA_OK);
    require(frame_put_blob(&fake->writer, "field", 5, NULL) == ISCHIA_OK);
    free(json);
    free(text);
    flush_writer(fake);
}

static void say_progress(struct fake *fake, double fraction)
{
    struct message message = {
        .kind = MESSAGE_PROGRESS, .job = fake->order.job, .fraction = fraction, .load_step = 1};
    (void)stpcpy(message.text, "pressing");
    say(fake, message);
}

static void do_solve(struct fake *fake)
{
    const struct ischia_result result = make_result(fake);
    say_progress(fake, 0.5);
    sleep_ms(number_of(fake, "ms", (int)number_of(fake, "F", 0.0) == 596 ? 1000.0 : 0.0));
    say_result(fake, &result);
}

static void say_problem(struct fake *fake, enum problem_kind kind)
{
    struct problem problem;
    char *text = NULL;
    problem_init(&problem, kind, "as the test wished");
    require(problem_doc_text(&text, &problem, NULL) == ISCHIA_OK);
    say(fake, (struct message){.kind = MESSAGE_PROBLEM, .job = fake->order.job});
    require(frame_put_json(&fake->writer, text, strlen(text), NULL) == ISCHIA_OK);
    free(text);
    flush_writer(fake);
}

static void do_diverge(struct fake *fake) { say_problem(fake, PROBLEM_NOT_CONVERGED); }

static void do_crash(struct fake *fake)
{
    (void)fake;
    (void)signal(SIGSEGV, SIG_DFL); /* not a sanitizer's report */
    (void)raise(SIGSEGV);
}

static void do_killed(struct fake *fake)
{
    (void)fake;
    (void)raise(SIGKILL);
}

static void do_exit(struct fake *fake)
{
    (void)fake;
    _exit(3);
}

static void do_hang(struct fake *fake)
{
    (void)fake;
    for (;;) (void)pause();
}

static void do_close(struct fake *fake)
{
    (void)close(fake->fd);
    do_hang(fake);
}

static void do_memory(struct fake *fake)
{
    enum { CHUNK = 1 << 20, CHUNKS = 4096 };
    static void *kept[CHUNKS]; /* reachable, so that they are really there */
    int got = 0;
    while (got < CHUNKS && (kept[got] = malloc(CHUNK)) != NULL) {
        memset(kept[got], 1, CHUNK);
        got++;
    }
    while (got > 0) free(kept[--got]);
    say_problem(fake, PROBLEM_OUT_OF_MEMORY);
}

static void do_babble(struct fake *fake)
{
    say_raw(fake, "segmentation fault? not at all\n");
    do_hang(fake);
}

static void do_bad_json(struct fake *fake)
{
    say_raw(fake, "{\"say\":\"result\",\"job\":}\n");
    do_hang(fake);
}

static void do_bad_result(struct fake *fake)
{
    say(fake, (struct message){.kind = MESSAGE_RESULT, .job = fake->order.job});
    say_raw(fake, "{\"strain\":{\"eps_max\":0.5}}\n#5\nfield");
}

static void do_bad_job(struct fake *fake)
{
    say(fake, (struct message){.kind = MESSAGE_RESULT, .job = fake->order.job});
    say_raw(fake, "#3\nabc");
    do_hang(fake);
}

static void do_bad_blob(struct fake *fake)
{
    say(fake, (struct message){.kind = MESSAGE_RESULT, .job = fake->order.job});
    say_raw(fake, "{}\n#99999999999\n");
    do_hang(fake);
}

static void do_stale(struct fake *fake)
{
    const struct ischia_result result = make_result(fake);
    fake->order.job++;
    say_result(fake, &result);
    do_hang(fake);
}

static void do_die_after(struct fake *fake)
{
    do_solve(fake);
    do_crash(fake);
}

static void do_unconverged(struct fake *fake)
{
    struct ischia_result result = make_result(fake);
    result.numerics.reason = ISCHIA_DIVERGED_STEP;
    say_result(fake, &result);
}

static const struct {
    const char *name;
    void (*act)(struct fake *fake);
} acts[] = {
    {"solve", do_solve},
    {"slow", do_solve},
    {"diverge", do_diverge},
    {"crash", do_crash},
    {"killed", do_killed},
    {"exit", do_exit},
    {"hang", do_hang},
    {"close", do_close},
    {"memory", do_memory},
    {"babble", do_babble},
    {"bad_json", do_bad_json},
    {"bad_result", do_bad_result},
    {"bad_job", do_bad_job},
    {"bad_blob", do_bad_blob},
    {"stale", do_stale},
    {"die_after", do_die_after},
    {"unconverged", do_unconverged},
};

static const char *wish_of(const struct fake *fake)
{
    static const struct {
        int force_N;
        const char *name;
    } forces[] = {{598, "diverge"}, {597, "crash"}, {596, "slow"}};
    const struct json *name = json_member(fake->given, "do");
    if (name != NULL) return json_string(name);
    const int force_N = (int)number_of(fake, "F", 0.0);
    for (size_t i = 0; i < sizeof forces / sizeof forces[0]; i++)
        if (forces[i].force_N == force_N) return forces[i].name;
    return "solve";
}

static void act(struct fake *fake)
{
    const char *wished = wish_of(fake);
    for (size_t i = 0; i < sizeof acts / sizeof acts[0]; i++)
        if (strcmp(acts[i].name, wished) == 0) {
            acts[i].act(fake);
            return;
        }
    require(false);
}

/* A drawing is the kind's name and the field's bytes; "do" says what happens instead. */
static void draw(struct fake *fake, struct frame_reader *reader)
{
    struct frame field;
    char drawing[256];
    require(frame_receive(reader, fake->fd, &field, NULL) == ISCHIA_OK);
    require(field.kind == FRAME_BLOB && field.size < 200);
    const int size = snprintf(drawing, sizeof drawing, "%s-%s:%.*s", fake->order.as,
                              fake->order.language, (int)field.size, field.bytes);
    if (json_member(fake->given, "do") != NULL) {
        act(fake);
        return;
    }
    sleep_ms(number_of(fake, "ms", 0.0));
    say(fake, (struct message){.kind = MESSAGE_RENDERED, .job = fake->order.job});
    require(frame_put_blob(&fake->writer, drawing, (size_t)size, NULL) == ISCHIA_OK);
    flush_writer(fake);
}

static void serve(struct fake *fake, struct frame_reader *reader)
{
    for (;;) {
        struct frame frame;
        struct doc_faults faults;
        doc_faults_init(&faults);
        require(frame_receive(reader, fake->fd, &frame, NULL) == ISCHIA_OK);
        if (frame.kind == FRAME_NONE) return;
        require(message_read(frame.bytes, frame.size, &fake->order, NULL) == ISCHIA_OK);
        require(json_parse(&fake->given, fake->order.case_json, strlen(fake->order.case_json),
                           &json_limits_stored, &faults, NULL) == ISCHIA_OK);
        if (fake->order.kind == MESSAGE_RENDER)
            draw(fake, reader);
        else
            act(fake);
        json_destroy(fake->given);
        free(fake->order.case_json);
    }
}

int main(int argc, char **argv)
{
    const char *mode = argc >= 4 ? argv[1] : "";
    require(argc >= 3 && strcmp(argv[argc - 2], "--fd") == 0);
    struct fake fake = {.fd = (int)strtol(argv[argc - 1], NULL, 10)};
    if (strcmp(mode, "exit_first") == 0) return 5;
    if (strcmp(mode, "no_hello") == 0) do_hang(&fake);
    struct message hello = {.kind = MESSAGE_HELLO,
                            .protocol = FRAME_PROTOCOL_VERSION,
                            .model_version = ISCHIA_MODEL_VERSION,
                            .program = ISCHIA_VERSION,
                            .model = ISCHIA_MODEL_NAME};
    if (strcmp(mode, "wrong_version") == 0) hello.model_version++;
    say(&fake, hello);
    if (strcmp(mode, "die_after_hello") == 0) return 6;
    struct frame_reader reader;
    frame_reader_init(&reader, &frame_limits_default);
    serve(&fake, &reader);
    frame_reader_finish(&reader);
    frame_writer_finish(&fake.writer);
    return 0;
}
