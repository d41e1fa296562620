/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_ROUTES_H
#define ISCHIA_SERVER_ROUTES_H

#include <stddef.h>

#include "server/http/http.h"
#include "server/http/service.h"

/*
 * One row for each thing that can be asked. Dispatch, 404, 405 with Allow, 406, 413, 415, scopes,
 * metrics, the audit log and the comparison with openapi.json all read this table.
 */
typedef void route_handler(struct call *call, struct http_response *ret);

/* Which document describes a route for programs; the path's beginning says it. */
enum route_contract {
    ROUTE_OPENAPI, /* openapi.json                                                      */
    ROUTE_FHIR,    /* the CapabilityStatement; errors are OperationOutcomes             */
    ROUTE_CDS      /* the discovery document of CDS Hooks                               */
};

struct route {
    enum http_method method; /* GET serves HEAD too */
    const char *path;        /* "/v1/assessments/{id}"; "{file}" takes all that is left */
    const char *name;        /* for metrics: method and path */
    route_handler *handler;
    unsigned scope;             /* bit of enum auth_scope; 0: open to all */
    size_t body_max;            /* 0: takes no body */
    const char *const *takes;   /* media types of the body, NULL-ended; NULL: any or none */
    const char *const *gives;   /* media types of the answer, NULL-ended, the first is usual */
    const char *const *queries; /* parameters of the query, NULL-ended; NULL: none */
    const char *audit;          /* what the audit log calls it; NULL: not recorded */
    bool is_page;               /* for people: not in openapi.json */
};

/* By the beginning of the route's path. */
enum route_contract route_contract_of(const struct route *route);

extern const struct route routes[];
extern const size_t route_count;

/* The route for a method and a decoded path, and what the path's "{…}" stand for. NULL: none;
 * *ret_allowed then has a bit for each method that the path does take. */
const struct route *route_find(enum http_method method, const char *path, char *ret_id,
                               size_t id_size, char *ret_rest, size_t rest_size,
                               unsigned *ret_allowed);

/* `ischiad --print-routes`: method, path, scope, a line each, for tests. */
void routes_print(FILE *out);

/* handle_fhir.c: what a search takes, NULL-ended */
extern const char *const fhir_search_keys[];

/* handle_*.c */
route_handler handle_submit, handle_get, handle_list, handle_cancel, handle_erase;
route_handler handle_events;
route_handler handle_field, handle_section;
route_handler handle_report;
route_handler handle_estimate;
route_handler handle_what_if;
route_handler handle_study_submit, handle_study_get, handle_study_list, handle_study_results,
    handle_study_cancel, handle_study_erase;
route_handler handle_parameters, handle_changes;
route_handler handle_openapi, handle_docs, handle_health, handle_ready, handle_metrics,
    handle_version;
route_handler handle_fhir_metadata, handle_fhir_read, handle_fhir_search, handle_fhir_assess,
    handle_fhir_async, handle_fhir_cancel;
route_handler handle_cds_discovery, handle_cds_hook, handle_cds_feedback;
route_handler handle_home, handle_past, handle_result, handle_form, handle_asset;

#endif
