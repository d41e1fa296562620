/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A search under /fhir with its 1st, 2nd, ... allocation failing, until one gets through: each
 * answer before is that of the search that was asked for, or a failure; never that of a search that
 * lost a condition. The store is not asked: the id that the query names can be no row's.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "server/http/routes.h"
#include "tests/double/failing_malloc.h"

/* No connection is behind the request: the program is linked with -Wl,--wrap. */
const char *__wrap_http_request_header(const struct http_request *request, const char *name);
const char *__wrap_http_request_header(const struct http_request *request, const char *name)
{
    (void)request, (void)name;
    return NULL;
}

enum { BODY_BYTES = 4096 };

static struct service service;

/* Returns the status; ret is the body. nth: which allocation fails; 0: none. */
static int search(const char *form, size_t size, long nth, char ret[BODY_BYTES])
{
    static char id[64], rest[64];
    static struct http_response response;
    unsigned allowed = 0;
    struct http_request request = {.method = HTTP_POST,
                                   .target = "/fhir/RiskAssessment/_search?_id=x",
                                   .query = "_id=x",
                                   .body = form,
                                   .body_size = size};
    struct call call = {
        .service = &service,
        .request = &request,
        .route = route_find(HTTP_POST, "/fhir/RiskAssessment/_search", id, sizeof id, rest,
                            sizeof rest, &allowed),
    };
    assert_non_null(call.route);
    http_response_init(&response, 200);
    failing_malloc_arm(nth, false);
    call.route->handler(&call, &response);
    failing_malloc_disarm();
    assert_true(response.size < BODY_BYTES);
    memcpy(ret, response.bytes, response.size);
    ret[response.size] = '\0';
    http_response_finish(&response);
    return response.status;
}

static void test_no_condition_is_lost_without_memory(void **state)
{
    static char form[400], whole[BODY_BYTES], body[BODY_BYTES];
    int failures = 0;
    (void)state;
    /* longer than a text's first allocation: the links have to grow */
    (void)snprintf(form, sizeof form, "patient=%0300d", 7);
    assert_int_equal(search(form, strlen(form), 0, whole), 200);
    assert_non_null(strstr(whole, form));
    /* also makes what the log's time zone keeps for good, so that it does not count as a leak */
    assert_int_equal(search(form, strlen(form), 1, body), 503);
    const long live = failing_malloc_live();
    for (long nth = 1;; nth++) {
        const int status = search(form, strlen(form), nth, body);
        if (!failing_malloc_happened()) break;
        assert_int_equal(failing_malloc_live(), live);
        failures += status == 503;
        if (status != 503) assert_int_equal(status, 200);
        if (status == 200) assert_string_equal(body, whole);
    }
    assert_true(failures >= 6); /* form, conditions twice, record, link twice */
}

static void test_a_form_is_read_to_its_end(void **state)
{
    static const char form[] = "_count=7\0&patient=7";
    static char body[BODY_BYTES];
    (void)state;
    assert_int_equal(search(form, sizeof form - 1, 0, body), 400);
    assert_int_equal(search(form, strlen(form), 0, body), 200);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_no_condition_is_lost_without_memory),
        cmocka_unit_test(test_a_form_is_read_to_its_end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
