/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Any bytes on the HL7 v2 port: framing gives the same messages whatever the pieces they come in;
 * reading one does not crash; an acknowledgement can always be written, and can be read; what is
 * taken is a valid case.
 */
#include "tests/fuzz/fuzz.h"

#include <string.h>

#include "api/hl7.h"
#include "server/hl7/mllp.h"

static const struct hl7_sender sender = {.application = "ISCHIA",
                                         .facility = "",
                                         .peer_application = "",
                                         .peer_facility = "",
                                         .control_id = "1",
                                         .time = "20260301"};

static void acknowledge(const struct hl7_head *head, enum hl7_ack ack,
                        const struct doc_faults *faults)
{
    struct text_out out;
    struct hl7 *back = NULL;
    char *text = NULL, code[4];
    size_t size = 0;
    text_out_init(&out);
    hl7_put_ack(&out, &sender, head, ack, faults);
    MUST(text_out_take(&out, &text, &size, NULL) == ISCHIA_OK);
    MUST(hl7_parse(&back, text, size, NULL) == ISCHIA_OK);
    MUST(hl7_is(back, 1, "MSA") && hl7_get(back, 1, 1, 1, code, sizeof code));
    MUST(strcmp(code, hl7_ack_codes[ack]) == 0);
    MUST(back->count == 2 + (int)faults->count);
    hl7_destroy(back);
    free(text);
}

static void answer(const char *message, size_t size)
{
    static struct hl7_input input;
    struct doc_faults faults;
    doc_faults_init(&faults);
    const enum hl7_ack ack = hl7_read(&input, message, size, "ISCHIA", &faults);
    MUST((ack == HL7_ACCEPTED) == (faults.count == 0));
    for (size_t i = 0; i < faults.count; i++) {
        MUST(text_is_utf8(faults.item[i].detail, strlen(faults.item[i].detail)));
        MUST(strpbrk(faults.item[i].detail, "\r\n") == NULL);
    }
    if (ack == HL7_ACCEPTED) MUST(ischia_case_is_valid(&input.request.values));
    acknowledge(&input.head, ack, &faults);
}

/* How many messages there are when the bytes come in pieces of `step`; each is answered. */
static int converse(const char *bytes, size_t size, size_t step, int answers)
{
    struct mllp mllp;
    int count = 0;
    mllp_init(&mllp, 16384);
    for (size_t at = 0; at < size;) {
        size_t taken = 0, length = 0;
        const size_t piece = size - at < step ? size - at : step;
        const enum mllp_event event = mllp_take(&mllp, bytes + at, piece, &taken);
        MUST(taken <= piece);
        at += taken;
        if (event == MLLP_MORE) {
            MUST(taken == piece);
            continue;
        }
        if (event != MLLP_MESSAGE && event != MLLP_BROKEN) break;
        const char *message = mllp_message(&mllp, &length);
        count++;
        if (answers) answer(message, length);
    }
    mllp_finish(&mllp);
    return count;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const char *bytes = (const char *)data;
    const int whole = converse(bytes, size, size + 1, 1);
    MUST(converse(bytes, size, 1, 0) == whole);
    MUST(converse(bytes, size, 7, 0) == whole);
    answer(bytes, size); /* also without a frame, which a fuzzer seldom finds */
    return 0;
}
