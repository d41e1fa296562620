/* SPDX-License-Identifier: GPL-3.0-or-later */
/* ischia hl7: one side as HL7 v2, and over MLLP to a port, as a record system would send it. */
#include <errno.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "api/hl7.h"
#include "server/address.h"
#include "server/cli/files.h"
#include "server/cli/options.h"
#include "server/cli/run.h"
#include "server/hl7/mllp.h"

enum { ANSWER_WITHIN_MS = 60 * 1000, READ_BYTES = 4096 };

/* ---- the message ---- */

static enum ischia_code make_message(const struct ischia_request *request, char **ret,
                                     size_t *ret_size, struct ischia_error *err)
{
    struct text_out out;
    struct tm parts;
    char now[HL7_TIME_BYTES], control_id[24];
    unsigned long long random = 0;
    const time_t seconds = time(NULL);
    CHECK(
        hl7_carries(request), err, ISCHIA_E_INPUT,
        "an HL7 v2 message has no place for single options of skin or model, only for the name of "
        "a set (\"model\": \"as-published\")");
    (void)gmtime_r(&seconds, &parts);
    (void)strftime(now, sizeof now, "%Y%m%d%H%M%S+0000", &parts);
    CHECK(getrandom(&random, sizeof random, 0) == sizeof random, err, ISCHIA_E_IO,
          "the system gives no randomness");
    (void)snprintf(control_id, sizeof control_id, "%016llx", random);
    const struct hl7_sender sender = {.application = "ISCHIA-CLI",
                                      .facility = "",
                                      .peer_application = "ISCHIA",
                                      .peer_facility = "",
                                      .control_id = control_id,
                                      .time = now};
    text_out_init(&out);
    hl7_put_request(&out, &sender, request);
    return text_out_take(&out, ret, ret_size, err);
}

static bool starts_with(const char *text, const char *start)
{
    return strncmp(text, start, strlen(start)) == 0;
}

/* A case in JSON becomes a message; one that is a message already is sent as it is. Returns the
 * exit status; EXIT_DONE: *ret is the caller's to free. */
static int read_message(const char *path, bool sends, char **ret, size_t *ret_size)
{
    struct ischia_request request;
    struct ischia_error err;
    char *text = NULL;
    size_t size = 0;
    if (file_read(path, HL7_MESSAGE_BYTES_MAX, &text, &size, &err) != ISCHIA_OK)
        return report_error("hl7", &err);
    if (sends && starts_with(text, "MSH")) {
        *ret = text;
        *ret_size = size;
        return EXIT_DONE;
    }
    int status = read_request_text("hl7", file_name(path), text, size, NULL, &request);
    free(text);
    if (status == EXIT_DONE && make_message(&request, ret, ret_size, &err) != ISCHIA_OK)
        status = report_error("hl7", &err);
    return status;
}

/* ---- the wire ---- */

static enum ischia_code dial(const char *address, int *ret_fd, struct ischia_error *err)
{
    struct address peer;
    int fd = -1, cause = 0;
    TRY(address_find(address, &peer, err));
    for (const struct addrinfo *a = peer.where; fd < 0 && a != NULL; a = a->ai_next) {
        fd = socket(a->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
        if (fd >= 0 && connect(fd, a->ai_addr, a->ai_addrlen) == 0) break;
        cause = errno;
        if (fd >= 0) (void)close(fd);
        fd = -1;
    }
    address_finish(&peer);
    CHECK(fd >= 0, err, ISCHIA_E_IO, "cannot connect to %.80s: %s", address, strerror(cause));
    *ret_fd = fd;
    return ISCHIA_OK;
}

static enum ischia_code send_all(int fd, const char *bytes, size_t size, struct ischia_error *err)
{
    while (size > 0) {
        const ssize_t n = send(fd, bytes, size, MSG_NOSIGNAL);
        if (n < 0 && errno == EINTR) continue;
        CHECK(n > 0, err, ISCHIA_E_IO, "the connection broke: %s", strerror(errno));
        bytes += n;
        size -= (size_t)n;
    }
    return ISCHIA_OK;
}

/* One framed answer into mllp. */
static enum ischia_code receive(int fd, struct mllp *mllp, struct ischia_error *err)
{
    char bytes[READ_BYTES];
    for (;;) {
        struct pollfd p = {.fd = fd, .events = POLLIN};
        size_t taken = 0;
        CHECK(poll(&p, 1, ANSWER_WITHIN_MS) > 0, err, ISCHIA_E_IO, "no acknowledgement in %d s",
              ANSWER_WITHIN_MS / 1000);
        const ssize_t n = recv(fd, bytes, sizeof bytes, 0);
        CHECK(n > 0, err, ISCHIA_E_IO, "the connection ended without an acknowledgement");
        const enum mllp_event event = mllp_take(mllp, bytes, (size_t)n, &taken);
        if (event == MLLP_MESSAGE) return ISCHIA_OK;
        CHECK(event == MLLP_MORE, err, ISCHIA_E_IO, "the answer is not MLLP");
    }
}

static enum ischia_code exchange(const char *address, const char *message, size_t size,
                                 struct mllp *mllp, struct ischia_error *err)
{
    char *frame = NULL;
    size_t frame_size = 0;
    int fd = -1;
    TRY(dial(address, &fd, err));
    enum ischia_code code = mllp_frame(message, size, &frame, &frame_size, err);
    if (code == ISCHIA_OK) code = send_all(fd, frame, frame_size, err);
    if (code == ISCHIA_OK) code = receive(fd, mllp, err);
    free(frame);
    (void)close(fd);
    return code;
}

/* ---- the command ---- */

/* For people: a segment a line. */
static void print_message(const char *text, size_t size)
{
    for (size_t i = 0; i < size; i++) (void)putchar(text[i] == '\r' ? '\n' : text[i]);
}

static bool is_accepted(const char *text, size_t size)
{
    return memmem(text, size, "\rMSA|AA|", 8) != NULL;
}

static int send_to(const char *address, const char *message, size_t size)
{
    struct mllp mllp;
    struct ischia_error err;
    size_t answer_size = 0;
    mllp_init(&mllp, HL7_MESSAGE_BYTES_MAX);
    const enum ischia_code code = exchange(address, message, size, &mllp, &err);
    const char *answer = mllp_message(&mllp, &answer_size);
    int status = EXIT_DONE;
    if (code != ISCHIA_OK) {
        status = report_error("hl7", &err);
    } else {
        print_message(answer, answer_size);
        if (!is_accepted(answer, answer_size)) status = EXIT_SOLVE_FAILED;
    }
    mllp_finish(&mllp);
    return status;
}

int command_hl7(int argc, char **argv)
{
    const struct cli_option table[] = {{0}};
    const struct cli_usage usage = {
        .command = "hl7",
        .synopsis = "send HOST:PORT [FILE|-] | message [FILE|-]",
        .about = "message prints one side (JSON) as an ORU^R01. send sends that, or a message that "
                 "FILE\n"
                 "holds already, over MLLP without TLS, and prints the acknowledgement; the exit "
                 "status\n"
                 "is 0 for AA and 1 for AE and AR.",
        .options = table,
        .operands_max = 3,
    };
    const char *words[3] = {"", NULL, NULL};
    char *message = NULL;
    size_t size = 0;
    const enum cli_parse parsed = cli_parse_options(&usage, argc, argv, words);
    if (parsed != CLI_RUN) return parsed == CLI_HELP_SHOWN ? EXIT_DONE : EXIT_BAD_INPUT;
    const bool sends = strcmp(words[0], "send") == 0;
    const bool shows = strcmp(words[0], "message") == 0 && words[2] == NULL;
    if (!shows && (!sends || words[1] == NULL)) {
        (void)fprintf(stderr, "ischia hl7: say what to do: %s\n", usage.synopsis);
        return EXIT_BAD_INPUT;
    }
    const char *path = sends ? words[2] : words[1];
    int status = read_message(path == NULL ? "-" : path, sends, &message, &size);
    if (status != EXIT_DONE) return status;
    if (sends)
        status = send_to(words[1], message, size);
    else
        print_message(message, size);
    free(message);
    return status;
}
