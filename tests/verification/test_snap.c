/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A side of Table 1 whose tissue snaps, gone twice: in load steps that are long enough to jump,
 * where the energy that comes free is known only as what the balance misses, and in slow motion,
 * where it is the work of the drag, force times way. The two must be the same energy, and the end
 * the same equilibrium.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "solver/units.h"
#include "tests/unit/near.h"
#include "tests/verification/sides.h"

/* R1 5, R2 63, eM 39, eF 35, muM 1, muF 8, F 192: row 709 of docs/validation/table1_default. */
static const double param[ISCHIA_PARAM_COUNT] = {5, 63, 39, 35, 1, 8, 192};

static struct outcome press(bool slow_motion)
{
    const struct path_effort effort = {
        .pace = 0.4, .factorisations_max = 2500, .slow_motion = slow_motion};
    const struct variant variant = {.corner_share = 0.7, .stick_factor = 1};
    struct ischia_case c = ischia_case_default();
    struct run r = {0};
    struct outcome o = {0};
    struct ischia_error err;
    memcpy(c.param, param, sizeof param);
    if (run_init(&r, &c, &mesh_divisions[ISCHIA_STANDARD], &variant, &err) != ISCHIA_OK ||
        path_follow(&r.body, &r.assembly, &r.seat, quarter_force_N(c.param[ISCHIA_F]), &effort,
                    NULL, &r.state, &o.path, &err) != ISCHIA_OK)
        fail_msg("%s", err.message);
    run_measure(&r, &o);
    run_finish(&r);
    print_message("%s: off %.5f released %.5f eps_max %.5f, %d factorisations\n",
                  slow_motion ? "slow" : "jump", o.path.energy_residual, o.path.released, o.eps_max,
                  o.path.factorisations);
    assert_int_equal(o.path.reason, ISCHIA_CONVERGED);
    return o;
}

static void drag_works_as_much_as_a_jump_loses(void **state)
{
    (void)state;
    const struct outcome jump = press(false), slow = press(true);
    assert_true(jump.path.released == 0 && jump.path.energy_residual > 5e-3);
    assert_true(fabs(slow.path.energy_residual) < 2e-3);
    assert_near(slow.path.released / jump.path.energy_residual, 1, 0.1);
    assert_near(slow.eps_max / jump.eps_max, 1, 1e-3);
    assert_near(slow.d_mm / jump.d_mm, 1, 1e-3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(drag_works_as_much_as_a_jump_loses)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
