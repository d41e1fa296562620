/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Frames however they are cut up, broken frames, and the messages in them. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmocka.h>

#include "server/frame.h"
#include "server/message.h"

static const struct frame_limits small = {.json_max = 32, .blob_max = 1000};

static void feed(struct frame_reader *reader, const char *bytes, size_t size)
{
    while (size > 0) {
        char *space;
        size_t room;
        assert_int_equal(frame_reader_space(reader, &space, &room, NULL), ISCHIA_OK);
        const size_t part = size < room ? size : room;
        memcpy(space, bytes, part);
        frame_reader_filled(reader, part);
        bytes += part;
        size -= part;
    }
}

static struct frame next(struct frame_reader *reader)
{
    struct frame frame;
    struct ischia_error err = {0};
    if (frame_reader_next(reader, &frame, &err) != ISCHIA_OK) fail_msg("%s", err.message);
    return frame;
}

static const char stream[] = "{\"a\":1}\n#5\nab\ncd{}\n#0\n{\"b\":\"}#9\"}\n";

static void expect_stream(struct frame *frames)
{
    static const enum frame_kind kinds[] = {FRAME_JSON, FRAME_BLOB, FRAME_JSON, FRAME_BLOB,
                                            FRAME_JSON};
    static const size_t sizes[] = {7, 5, 2, 0, 11};
    for (int i = 0; i < 5; i++) {
        assert_int_equal(frames[i].kind, kinds[i]);
        assert_int_equal(frames[i].size, sizes[i]);
    }
}

static void test_frames_in_pieces_of_any_size(void **state)
{
    (void)state;
    for (size_t piece = 1; piece <= sizeof stream; piece++) {
        struct frame_reader reader;
        struct frame frames[8] = {{0}};
        int count = 0;
        frame_reader_init(&reader, &small);
        for (size_t at = 0; at < sizeof stream - 1; at += piece) {
            const size_t rest = sizeof stream - 1 - at;
            feed(&reader, stream + at, rest < piece ? rest : piece);
            for (struct frame f; (f = next(&reader)).kind != FRAME_NONE;) {
                if (f.kind == FRAME_JSON) assert_int_equal(strlen(f.bytes), f.size);
                if (count == 1) assert_memory_equal(f.bytes, "ab\ncd", 5);
                frames[count++] = f;
            }
        }
        assert_int_equal(count, 5);
        expect_stream(frames);
        frame_reader_finish(&reader);
    }
}

static void test_broken_streams_are_refused_for_good(void **state)
{
    (void)state;
    static const struct {
        const char *bytes;
        size_t size;
    } bad[] = {
        {"hello\n", 6},
        {"\n", 1},
        {"#-1\n", 4},
        {"#\n", 2},
        {"#01\n", 4},
        {"#1x\n", 4},
        {"#1001\n", 6},
        {"#99999999999999999999\n", 22},
        {"#99999999999999", 15},
        {"{\0}\n", 4},
        {"{012345678901234567890123456789012", 34},
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        struct frame_reader reader;
        struct frame frame;
        struct ischia_error err;
        frame_reader_init(&reader, &small);
        feed(&reader, bad[i].bytes, bad[i].size);
        assert_int_equal(frame_reader_next(&reader, &frame, &err), ISCHIA_E_INPUT);
        feed(&reader, "{}\n", 3);
        assert_int_equal(frame_reader_next(&reader, &frame, &err), ISCHIA_E_INPUT);
        frame_reader_finish(&reader);
    }
}

static void test_limits_are_exact(void **state)
{
    (void)state;
    struct frame_reader reader;
    frame_reader_init(&reader, &small);
    feed(&reader, "{\"23456789012345678901234567890}\n", 33); /* 32 and the newline */
    assert_int_equal(next(&reader).size, 32);
    feed(&reader, "#1000\n", 6);
    char bytes[1000] = {0};
    feed(&reader, bytes, 999);
    assert_int_equal(next(&reader).kind, FRAME_NONE);
    feed(&reader, bytes, 1);
    assert_int_equal(next(&reader).size, 1000);
    frame_reader_finish(&reader);
}

static void test_memory_follows_what_arrived(void **state)
{
    (void)state;
    struct frame_reader reader;
    frame_reader_init(&reader, &frame_limits_default);
    feed(&reader, "#268435456\n", 11); /* promises 256 MiB */
    assert_int_equal(next(&reader).kind, FRAME_NONE);
    assert_true(reader.capacity <= 128 * 1024);
    frame_reader_finish(&reader);
}

static void test_written_and_read_over_a_socket(void **state)
{
    (void)state;
    int pair[2];
    struct frame_writer writer = {0};
    struct frame_reader reader;
    struct frame frame;
    bool empty = false;
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, pair), 0);
    frame_reader_init(&reader, &small);
    assert_int_equal(frame_put_json(&writer, "{}", 2, NULL), ISCHIA_OK);
    assert_int_equal(frame_put_blob(&writer, "xyz", 3, NULL), ISCHIA_OK);
    assert_int_equal(frame_put_json(&writer, "{\n}", 3, NULL), ISCHIA_E_INPUT);
    assert_int_equal(frame_put_json(&writer, "[]", 2, NULL), ISCHIA_E_INPUT);
    assert_int_equal(frame_writer_flush(&writer, pair[0], &empty, NULL), ISCHIA_OK);
    assert_true(empty);
    assert_int_equal(frame_receive(&reader, pair[1], &frame, NULL), ISCHIA_OK);
    assert_int_equal(frame.kind, FRAME_JSON);
    assert_int_equal(frame_receive(&reader, pair[1], &frame, NULL), ISCHIA_OK);
    assert_int_equal(frame.kind, FRAME_BLOB);
    assert_memory_equal(frame.bytes, "xyz", 3);
    assert_int_equal(write(pair[0], "{\"half", 6), 6);
    (void)close(pair[0]);
    assert_int_equal(frame_receive(&reader, pair[1], &frame, NULL), ISCHIA_E_IO);
    assert_int_equal(frame_put_json(&writer, "{}", 2, NULL), ISCHIA_OK);
    assert_int_equal(frame_writer_flush(&writer, pair[0], &empty, NULL), ISCHIA_E_IO);
    (void)close(pair[1]);
    frame_writer_finish(&writer);
    frame_reader_finish(&reader);
}

static void expect_round_trip(struct message message)
{
    char *json = NULL;
    size_t size = 0;
    struct message back = {0};
    struct ischia_error err = {0};
    assert_int_equal(message_write(&message, &json, &size, &err), ISCHIA_OK);
    assert_null(memchr(json, '\n', size));
    if (message_read(json, size, &back, &err) != ISCHIA_OK) fail_msg("%s", err.message);
    assert_int_equal(back.kind, message.kind);
    assert_int_equal(back.job, message.job);
    assert_true(back.fraction <= message.fraction && back.fraction >= message.fraction);
    assert_string_equal(back.text, message.text);
    assert_string_equal(back.as, message.as);
    assert_string_equal(back.language, message.language);
    assert_string_equal(back.model, message.model);
    if (message.case_json != NULL) assert_string_equal(back.case_json, message.case_json);
    free(back.case_json);
    free(json);
}

static void test_messages_come_back_as_they_were(void **state)
{
    (void)state;
    static char case_json[] = "{\"R1\":7.1,\"skin\":{\"mu\":1e-05},\"x\":[true,null,\"\\\"\"]}";
    expect_round_trip((struct message){.kind = MESSAGE_HELLO, .protocol = 1, .model = "m"});
    expect_round_trip((struct message){
        .kind = MESSAGE_PROGRESS, .job = 3, .fraction = 1.0 / 3, .text = "pressing \"on\""});
    expect_round_trip((struct message){.kind = MESSAGE_RESULT, .job = MESSAGE_JOB_MAX});
    expect_round_trip((struct message){.kind = MESSAGE_PROBLEM, .job = 1});
    expect_round_trip((struct message){.kind = MESSAGE_RENDERED, .job = 1});
    expect_round_trip((struct message){.kind = MESSAGE_SOLVE, .job = 1, .case_json = case_json});
    expect_round_trip((struct message){
        .kind = MESSAGE_RENDER, .job = 1, .as = "svg", .language = "fr", .case_json = case_json});
}

static void test_bad_messages_are_refused(void **state)
{
    (void)state;
    static const char *const bad[] = {
        "{}",
        "{\"say\":\"result\"}",
        "{\"say\":\"result\",\"job\":0}",
        "{\"say\":\"result\",\"job\":1.5}",
        "{\"say\":\"result\",\"job\":\"1\"}",
        "{\"say\":\"result\",\"job\":1,\"job\":2}",
        "{\"say\":\"hello\",\"job\":1}",
        "{\"op\":\"result\",\"job\":1}",
        "{\"op\":\"solve\",\"job\":1}",
        "{\"op\":\"solve\",\"job\":1,\"case\":[]}",
        ("{\"say\":\"progress\",\"job\":1,\"fraction\":1.01,\"load_step\":1,"
         "\"newton_iteration\":1,\"F_N\":1,\"message\":\"\"}"),
        "{\"say\":1}",
        "[1]",
        "{\"say\":\"result\",\"job\":1}x",
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        struct message message;
        struct ischia_error err;
        assert_int_equal(message_read(bad[i], strlen(bad[i]), &message, &err), ISCHIA_E_INPUT);
    }
    assert_true(message_is_object("{\"a\":1}", 7));
    assert_false(message_is_object("{\"a\":1,\"a\":1}", 13));
    assert_false(message_is_object("[]", 2));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_frames_in_pieces_of_any_size),
        cmocka_unit_test(test_broken_streams_are_refused_for_good),
        cmocka_unit_test(test_limits_are_exact),
        cmocka_unit_test(test_memory_follows_what_arrived),
        cmocka_unit_test(test_written_and_read_over_a_socket),
        cmocka_unit_test(test_messages_come_back_as_they_were),
        cmocka_unit_test(test_bad_messages_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
