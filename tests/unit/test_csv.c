/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/samples.h"

#include "api/csv.h"
#include "api/result_csv.h"

static struct csv_reader reader;
static struct csv_row row;
static struct ischia_error err;
static FILE *file;

static void open_bytes(const char *bytes, size_t length)
{
    file = tmpfile();
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, length, file), length);
    rewind(file);
    csv_reader_init(&reader, file);
}

static void open_text(const char *text) { open_bytes(text, strlen(text)); }

/* "code@line: a|b|c" for the next row, "end" at the end. */
static const char *next(void)
{
    static char shown[256];
    bool end = false;
    const enum ischia_code code = csv_read(&reader, &row, &end, &err);
    if (code == ISCHIA_OK && end) return "end";
    (void)snprintf(shown, sizeof shown, "%s@%ld: ", ischia_code_name(code), row.line);
    for (int i = 0; i < row.count; i++) {
        const size_t used = strlen(shown);
        (void)snprintf(shown + used, sizeof shown - used, "%s%s", i > 0 ? "|" : "", row.field[i]);
    }
    return shown;
}

static void expect_rows(const char *text, const char *const *rows)
{
    open_text(text);
    for (; *rows != NULL; rows++) assert_string_equal(next(), *rows);
    assert_string_equal(next(), "end");
    assert_string_equal(next(), "end");
    (void)fclose(file);
}

static void rows_and_fields(void **state)
{
    static const char *const plain[] = {"ok@1: a|b|c", "ok@2: 1||3", "ok@3: |", NULL};
    static const char *const windows[] = {"ok@1: a|b", "ok@3: 1|2", NULL};
    static const char *const quoted[] = {"ok@1: a,b|say \"hi\"|two\nlines", "ok@3: |x", NULL};
    (void)state;
    expect_rows("a,b,c\n1,,3\n,\n", plain);
    expect_rows("a,b,c\n1,,3\n,", plain);
    expect_rows("\xEF\xBB\xBF"
                "a,b\r\n\r\n1,2\r\n",
                windows);
    expect_rows("\"a,b\",\"say \"\"hi\"\"\",\"two\nlines\"\n\"\",x\n", quoted);
    expect_rows("\"a,b\",\"say \"\"hi\"\"\",\"two\nlines\"\r\n\"\",\"x\"\r\n", quoted);
}

static void nothing_at_all(void **state)
{
    static const char *const none[] = {NULL};
    (void)state;
    expect_rows("", none);
    expect_rows("\n\r\n\n", none);
    expect_rows("\xEF\xBB\xBF", none);
}

/* A bad line costs itself, not the rows behind it. */
static void bad_rows_do_not_take_others_along(void **state)
{
    static const char *const misplaced[] = {"ok@1: a", "input@2: ", "ok@3: b", NULL};
    static const char *const open[] = {"ok@1: a", "input@2: ", "ok@3: b", "ok@4: c", NULL};
    static const char *const after[] = {"input@1: ", "input@2: ", "ok@3: x|y", NULL};
    (void)state;
    expect_rows("a\n6.9\",5\nb\n", misplaced);
    expect_rows("a\n\"x,5\nb\nc\n", open);
    expect_rows("\"a\nb\"c\nx,y\n", after);
    expect_rows("a\n\xff\nb\n", misplaced);
}

static void a_nul_is_refused(void **state)
{
    (void)state;
    open_bytes("a\nb\0c\nd\n", 8);
    assert_string_equal(next(), "ok@1: a");
    assert_string_equal(next(), "input@2: ");
    assert_string_equal(next(), "ok@3: d");
    (void)fclose(file);
}

static void long_rows_and_many_columns(void **state)
{
    static char text[3 * CSV_ROW_BYTES_MAX];
    (void)state;
    memset(text, 'x', sizeof text);
    text[0] = 'a';
    text[1] = '\n';
    text[2 * CSV_ROW_BYTES_MAX + 100] = '\n';
    text[sizeof text - 3] = text[sizeof text - 1] = '\n';
    text[sizeof text - 2] = 'b';
    open_bytes(text, sizeof text);
    assert_string_equal(next(), "ok@1: a");
    assert_string_equal(next(), "limit@2: ");
    bool end;
    assert_int_equal(csv_read(&reader, &row, &end, &err), ISCHIA_OK);
    assert_int_equal(row.line, 3);
    assert_int_equal(strlen(row.field[0]), CSV_ROW_BYTES_MAX - 104);
    assert_string_equal(next(), "ok@4: b");
    assert_string_equal(next(), "end");
    assert_int_equal(reader.consumed, sizeof text);
    (void)fclose(file);
    memset(text, ',', CSV_COLUMNS_MAX);
    memcpy(text + CSV_COLUMNS_MAX, "\nb\n", 4);
    open_text(text);
    assert_string_equal(next(), "limit@1: ");
    assert_string_equal(next(), "ok@2: b");
    (void)fclose(file);
    open_text(text + 1);
    assert_int_equal(csv_read(&reader, &row, &end, &err), ISCHIA_OK);
    assert_int_equal(row.count, CSV_COLUMNS_MAX);
    (void)fclose(file);
}

static void many_rows_cross_the_buffer(void **state)
{
    bool end;
    (void)state;
    file = tmpfile();
    for (int i = 0; i < 30000; i++)
        assert_true(fprintf(file, "%d,\"row \"\"%d\"\"\"\r\n", i, i) > 0);
    rewind(file);
    csv_reader_init(&reader, file);
    for (int i = 0; i < 30000; i++) {
        char number[16], quoted[32];
        assert_int_equal(csv_read(&reader, &row, &end, &err), ISCHIA_OK);
        (void)snprintf(number, sizeof number, "%d", i);
        (void)snprintf(quoted, sizeof quoted, "row \"%d\"", i);
        assert_int_equal(row.count, 2);
        assert_int_equal(row.line, i + 1);
        assert_string_equal(row.field[0], number);
        assert_string_equal(row.field[1], quoted);
    }
    assert_int_equal(csv_read(&reader, &row, &end, &err), ISCHIA_OK);
    assert_true(end);
    (void)fclose(file);
}

static void fields_are_quoted_when_they_must(void **state)
{
    static const char *const back[] = {"ok@1: a|b,c|say \"hi\"||two\nlines|0.1||-7", NULL};
    struct text_out out;
    (void)state;
    text_out_init(&out);
    csv_put_text(&out, "a", true);
    csv_put_text(&out, "b,c", false);
    csv_put_text(&out, "say \"hi\"", false);
    csv_put_text(&out, "", false);
    csv_put_text(&out, "two\nlines", false);
    csv_put_number(&out, 0.1, false);
    csv_put_number(&out, (double)NAN, false);
    csv_put_integer(&out, -7, false);
    csv_end_row(&out);
    assert_string_equal(out.text, "a,\"b,c\",\"say \"\"hi\"\"\",,\"two\nlines\",0.1,,-7\n");
    expect_rows(out.text, back);
    text_out_finish(&out);
}

static void result_columns(void **state)
{
    const struct ischia_result result = sample_result(), failure = sample_failure();
    struct text_out out;
    (void)state;
    text_out_init(&out);
    result_csv_put_header(&out, true);
    assert_string_equal(
        out.text, "status,reason,eps_max,eps_max_error,E_shear_max,E_comp_max,volume_shear_mm3,"
                  "volume_compression_mm3,volume_both_mm3,largest_both_mm3,seat_displacement_mm,"
                  "contact_area_mm2,mean_pressure_kPa,peak_pressure_kPa,force_shear_N,"
                  "force_compression_N,newton_iterations,wall_s");
    text_out_clear(&out);
    result_csv_put(&out, "succeeded", "", &result, true);
    assert_string_equal(
        out.text, "succeeded,,1.3333333333333333,0.01,1.9,0.49,14400.1,8100.7,0,0,32.5,4400,58.6,"
                  "142.85714285714286,61.25,,140,1.5");
    text_out_clear(&out);
    result_csv_put(&out, "failed", "a, b", &failure, false);
    assert_string_equal(out.text, ",failed,\"a, b\",,,,,,,,,,,,,,,140,1.5");
    text_out_clear(&out);
    result_csv_put(&out, "refused", "x", NULL, false);
    assert_string_equal(out.text, ",refused,x,,,,,,,,,,,,,,,,");
    text_out_finish(&out);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows_and_fields),
        cmocka_unit_test(nothing_at_all),
        cmocka_unit_test(bad_rows_do_not_take_others_along),
        cmocka_unit_test(a_nul_is_refused),
        cmocka_unit_test(long_rows_and_many_columns),
        cmocka_unit_test(many_rows_cross_the_buffer),
        cmocka_unit_test(fields_are_quoted_when_they_must),
        cmocka_unit_test(result_columns),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
