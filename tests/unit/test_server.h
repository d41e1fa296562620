/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_TESTS_UNIT_TEST_SERVER_H
#define ISCHIA_TESTS_UNIT_TEST_SERVER_H

/* A PostgreSQL server to test on. Included after cmocka.h. */
#include <libpq-fe.h>
#include <stdlib.h>

/* The address of a server to test on (tests/postgresql/cluster.py), or NULL: a file. */
static inline const char *test_server(void) { return getenv("ISCHIA_TEST_POSTGRESQL"); }

/* Runs SQL there, not as a daemon would. */
static inline void tell_server(const char *sql)
{
    PGconn *connection = PQconnectdb(test_server());
    PQclear(PQexec(connection, "SET client_min_messages = warning"));
    PGresult *result = PQexec(connection, sql);
    const ExecStatusType status = PQresultStatus(result);
    if (status != PGRES_COMMAND_OK && status != PGRES_TUPLES_OK)
        fail_msg("%s", PQerrorMessage(connection));
    PQclear(result);
    PQfinish(connection);
}

/* An empty database: one store a database. */
static inline void empty_server(void) { tell_server("DROP SCHEMA IF EXISTS ischia CASCADE"); }

#endif
