/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_HL7_H
#define ISCHIA_API_HL7_H

#include <stdbool.h>
#include <stddef.h>

#include "api/faults.h"
#include "api/record.h"
#include "api/text.h"

/*
 * HL7 v2.5.1 in its usual ("ER7") encoding: ORU^R01 in and out, and acknowledgements. Pure
 * documents; framing and sockets are in server/hl7/. Numbers are those of api/measure.h, in OBX
 * segments whose OBX-3 has the coding system 99ISCHIA.
 */
#define HL7_SYSTEM  "99ISCHIA"
#define HL7_FILLER  "ISCHIA" /* OBR-3.2 of what we send */
#define HL7_VERSION "2.5.1"

enum { HL7_MESSAGE_BYTES_MAX = 256 * 1024, HL7_SEGMENTS_MAX = 1000, HL7_FIELD_BYTES = 256 };

/* ---- the encoding ---- */

/* A message cut into segments. Delimiters are those of its MSH; the text is UTF-8. */
struct hl7 {
    char *text;
    char field, component, repetition, escape, subcomponent;
    int count;
    struct {
        size_t at, length;
    } segment[HL7_SEGMENTS_MAX];
};

/*
 * Cuts a message; segments end with CR, LF or both. *ret is the caller's: hl7_destroy.
 * ISCHIA_E_INPUT: it does not begin with a usable MSH, or is in a character set that is not ASCII,
 * UTF-8 or ISO 8859-1, or not in the one that it names; ISCHIA_E_LIMIT; ISCHIA_E_MEMORY.
 */
ISCHIA_MUST_CHECK enum ischia_code hl7_parse(struct hl7 **ret, const char *bytes, size_t length,
                                             struct ischia_error *err);
void hl7_destroy(struct hl7 *message); /* NULL allowed */

/* True when this segment has the name, such as "OBX". */
bool hl7_is(const struct hl7 *message, int segment, const char *name);
/* The text of a component (from 1) of the first repetition of a field (numbered as in the standard)
 * with escapes undone. False, and "" in ret: it does not fit, or has an escape that is not text. An
 * absent one is "". */
bool hl7_get(const struct hl7 *message, int segment, int field, int component, char *ret,
             size_t size);
/* The first repetition of a field as it stands, but with the usual delimiters |^~\&. */
bool hl7_raw(const struct hl7 *message, int segment, int field, char *ret, size_t size);
/* True when the field repeats. */
bool hl7_repeats(const struct hl7 *message, int segment, int field);

/* Adds text to a message with the usual delimiters, with whatever has a meaning escaped. */
void hl7_put_text(struct text_out *out, const char *utf8);

/* ---- reading a message ---- */

enum hl7_ack { HL7_ACCEPTED, HL7_ERROR, HL7_REJECTED, HL7_ACK_COUNT };
extern const char *const hl7_ack_codes[HL7_ACK_COUNT]; /* "AA", "AE", "AR" */

/* The sender's MSH, raw, to be answered. */
struct hl7_head {
    char application[HL7_FIELD_BYTES], facility[HL7_FIELD_BYTES]; /* MSH-3, MSH-4 */
    char control_id[HL7_FIELD_BYTES];                             /* MSH-10       */
    char processing_id[8];                                        /* MSH-11.1     */
};

struct hl7_input {
    struct hl7_head head;          /* as far as it could be read, whatever the verdict */
    struct ischia_request request; /* subject stays "": the caller makes it of origin  */
    struct origin origin;
};

/*
 * Reads an ORU^R01 with the seven inputs. HL7_ACCEPTED: no faults. HL7_ERROR: the content is not
 * acceptable, each fault at "OBX^3^5". HL7_REJECTED: not a message for us at all (type, version,
 * processing id, character set, our own: own_application is MSH-3 of what we send). Never fails but
 * for memory, which is HL7_REJECTED with the code "memory".
 */
enum hl7_ack hl7_read(struct hl7_input *ret, const char *bytes, size_t length,
                      const char *own_application, struct doc_faults *faults);

/* ---- writing ---- */

struct hl7_sender {
    const char *application, *facility; /* ours: MSH-3, MSH-4           */
    const char *peer_application, *peer_facility;
    const char *control_id; /* MSH-10                                          */
    const char *time;       /* MSH-7: "20260301093000.123+0000"                */
};

/* The acknowledgement of a message; faults may be NULL. */
void hl7_put_ack(struct text_out *out, const struct hl7_sender *sender, const struct hl7_head *head,
                 enum hl7_ack ack, const struct doc_faults *faults);
/* An assessment that has ended. */
void hl7_put_result(struct text_out *out, const struct hl7_sender *sender,
                    const struct record *record);
/*
 * One side as a record system would send it: for `ischia hl7`. A message has a place for the name
 * of a set of options, not for single ones over it: hl7_carries says whether the whole request
 * fits, and only then may it be written.
 */
bool hl7_carries(const struct ischia_request *request);
void hl7_put_request(struct text_out *out, const struct hl7_sender *sender,
                     const struct ischia_request *request);

/* RFC 3339 -> HL7's TS and back; "" for what is neither. A TS without an offset gives its date. */
enum { HL7_TIME_BYTES = 32 };
void hl7_time(const char *rfc3339, char ret[HL7_TIME_BYTES]);
void hl7_time_read(const char *ts, char ret[ISCHIA_MEASURED_AT_BYTES]);

#endif
