/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The local model of Macron et al. (2020, section 2.2.2), a quarter of it, as five structured
 * blocks.
 *
 * The bone is half a torus: a tube of radius R1 swept along a circle of radius R2 in the x-z plane
 * (by default R2 is the radius of the tube's centre line). Its bowl, seen from below, is the
 * quarter of a lens; with polar coordinates (v along the rim from x to y, q along a meridian from
 * the tip to the rim, both by arc length) it is a quarter disc, divided like a butterfly: a square
 * core at the tip and two patches between core and rim.
 *
 *      y|_______ rim            Straight lines lead from each point of the bowl to the outer
 *       |  y   /\.              faces of the muscle: the core goes to the bottom, the x patch to
 *       |_____/  \.             the side x = L/2, the y patch to the side y = L/2. Fat and skin
 *       |core |   |             continue the core's columns down to the seat.
 *       |_____|_x_|__x
 *
 * Spacings are functions of the fraction along a direction, so that the same fraction is the same
 * place in meshes of any divisions (the studies of convergence rely on it).
 */
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solver/mesh.h"

const struct mesh_divisions mesh_divisions[ISCHIA_RESOLUTION_COUNT] = {
    [ISCHIA_COARSE] = {.across = 4, .around = 2, .radial = 8, .fat = 2, .skin = 1},
    [ISCHIA_STANDARD] = {.across = 8, .around = 2, .radial = 16, .fat = 4, .skin = 1},
    [ISCHIA_FINE] = {.across = 12, .around = 3, .radial = 24, .fat = 6, .skin = 1},
};

/* How far the core patch reaches over the quarter disc: along its axes, and at its corner. */
static const double core_axis_fraction = 0.62;
static const double core_corner_fraction = 0.52;
/* Slope of the spacing at the axis, 1 for even spacing: on the bowl and on the outer faces. */
static const double bowl_axis_slope = 0.8;
static const double outer_axis_slope = 0.12;
/* The same along the lines from the bone outward, at the bone and at their outer ends, and through
 * the fat at the muscle: thin layers of large strain lie there. */
static const double radial_bone_slope = 0.1;
static const double radial_outer_slope = 0.3;
static const double fat_muscle_slope = 0.4;
/* Tissue beyond the bone's exit from the box top, at the least. */
static const double exit_margin_mm = 10;
/* A box wider than this L/h has the cells of one of this width, but for the outer half of them,
 * which stretch: what a wider box does is then not mixed with what a coarser mesh under the bone
 * does. */
static const double unstretched_L_over_h = 2;

enum { MERIDIAN_SAMPLES = 64, RIM_SAMPLES = 256 };

struct local_geometry {
    double R1, R2c;          /* tube radius; radius of its centre line                          */
    double tip_z, top_z;     /* lowest bone point; box top                                      */
    double muscle_z, skin_z; /* muscle/fat and fat/skin interfaces                              */
    double half_width;
    double stretch;                 /* of it, what is beyond the unstretched width */
    double rim[RIM_SAMPLES + 1][2]; /* outline of the bone in the box top, even in arc length   */
};

/* x of the bone's outline in the plane z = top at a given y; like the tube's sides, its ends go
 * straight up from where the bone is widest. */
static double outline_x(const struct local_geometry *g, double y)
{
    const double tube = g->R2c + sqrt(fmax(0, g->R1 * g->R1 - y * y));
    const double depth = fmax(0, g->R2c + g->R1 - (g->top_z - g->tip_z));
    return sqrt(fmax(0, tube * tube - depth * depth));
}

/* z of the lower bone surface above the plan-view point (x, y). */
static double bowl_z(const struct local_geometry *g, double x, double y)
{
    const double tube = g->R2c + sqrt(fmax(0, g->R1 * g->R1 - y * y));
    return g->tip_z + g->R1 + g->R2c - sqrt(fmax(0, tube * tube - x * x));
}

/* Resamples a polyline of count + 1 points of `dim` numbers to even arc length, in place. */
static void resample_evenly(double *points, int count, int dim, double *scratch)
{
    double *length = scratch, *copy = scratch + count + 1;
    memcpy(copy, points, sizeof *points * (size_t)((count + 1) * dim));
    length[0] = 0;
    for (int i = 1; i <= count; i++) {
        double d2 = 0;
        for (int k = 0; k < dim; k++) d2 += pow(copy[i * dim + k] - copy[(i - 1) * dim + k], 2);
        length[i] = length[i - 1] + sqrt(d2);
    }
    for (int i = 1, s = 1; i < count; i++) {
        const double target = length[count] * i / count;
        while (length[s] < target) s++;
        const double t = (target - length[s - 1]) / (length[s] - length[s - 1]);
        for (int k = 0; k < dim; k++)
            points[i * dim + k] = (1 - t) * copy[(s - 1) * dim + k] + t * copy[s * dim + k];
    }
}

static void rim_build(struct local_geometry *g)
{
    double scratch[3 * (RIM_SAMPLES + 1)];
    for (int i = 0; i <= RIM_SAMPLES; i++) {
        /* Crowded towards y = R1, to follow the outline's blunt corner there. */
        const double angle = M_PI_2 * i / RIM_SAMPLES;
        const double y = g->R1 * sin(angle);
        g->rim[i][0] = outline_x(g, y);
        g->rim[i][1] = y;
    }
    g->rim[RIM_SAMPLES][0] = 0;
    resample_evenly(&g->rim[0][0], RIM_SAMPLES, 2, scratch);
}

static struct local_geometry geometry_of(const struct ischia_case *c)
{
    struct local_geometry g;
    const double skin = c->option[ISCHIA_SKIN_THICKNESS];
    const double h = c->param[ISCHIA_EM] + c->param[ISCHIA_EF];
    g.R1 = c->param[ISCHIA_R1];
    g.R2c = c->param[ISCHIA_R2] - c->option[ISCHIA_R2_SURFACE] * g.R1;
    g.R2c = fmax(g.R2c, 1e-3 * g.R1); /* R2 = R1 under the surface reading: a sphere */
    g.skin_z = skin;
    g.muscle_z = skin + c->param[ISCHIA_EF];
    g.tip_z = g.muscle_z + c->param[ISCHIA_EM];
    g.top_z = g.tip_z + g.R1 * c->option[ISCHIA_EMBED_OVER_R1];
    const double least = outline_x(&g, 0) + exit_margin_mm;
    g.half_width = fmax(c->option[ISCHIA_L_OVER_H] * h / 2, least);
    g.stretch = fmax(0, g.half_width - fmax(unstretched_L_over_h * h / 2, least));
    rim_build(&g);
    return g;
}

/* Spacing on [0, 1]: the cubic with the slope `first` at 0 and `last` at 1. */
static double graded(double t, double first, double last)
{
    return t * (first + t * (3 - 2 * first - last + t * (first + last - 2)));
}

/* The share of the stretch that a place at the fraction t has: none in the inner half. */
static double stretched(double t) { return pow(fmax(0, 2 * t - 1), 3); }

static void lerp3(const double a[3], const double b[3], double t, double ret[3])
{
    for (int i = 0; i < 3; i++) ret[i] = (1 - t) * a[i] + t * b[i];
}

/* The meridian from the tip to the rim point at fraction v: the point at fraction q of its arc. */
static void bowl_point(const struct local_geometry *g, double v, double q, double ret[3])
{
    double points[MERIDIAN_SAMPLES + 2][3], scratch[4 * (MERIDIAN_SAMPLES + 2)];
    const double s = fmin(fmax(v, 0), 1) * RIM_SAMPLES;
    const int i = (int)fmin(s, RIM_SAMPLES - 1);
    const double t = s - i;
    const double x = (1 - t) * g->rim[i][0] + t * g->rim[i + 1][0];
    const double y = (1 - t) * g->rim[i][1] + t * g->rim[i + 1][1];
    for (int k = 0; k <= MERIDIAN_SAMPLES; k++) {
        const double r = sin(M_PI_2 * k / MERIDIAN_SAMPLES);
        points[k][0] = r * x;
        points[k][1] = r * y;
        points[k][2] = fmin(bowl_z(g, r * x, r * y), g->top_z);
    }
    /* The last stretch: up the wall where the bone is embedded deeper than R1, else of length 0. */
    memcpy(points[MERIDIAN_SAMPLES + 1], (double[3]){x, y, g->top_z}, sizeof points[0]);
    resample_evenly(&points[0][0], MERIDIAN_SAMPLES + 1, 3, scratch);
    const double f = fmin(fmax(q, 0), 1) * (MERIDIAN_SAMPLES + 1);
    const int k = (int)fmin(f, MERIDIAN_SAMPLES);
    lerp3(points[k], points[k + 1], f - k, ret);
}

/* The three patches of the quarter disc. Coordinates (a, b) in [0, 1]^2: in the core a is along x
 * and b along y; in the others a is along the core's edge from its axis, b outward to the rim. */
enum patch { PATCH_CORE, PATCH_X, PATCH_Y };

static void core_disc_point(double a, double b, double ret[2])
{
    const double s = core_axis_fraction, d = core_corner_fraction;
    const double u = graded(a, bowl_axis_slope, 1), w = graded(b, bowl_axis_slope, 1);
    ret[0] = s * u * (1 - w) + d * u * w;
    ret[1] = s * w * (1 - u) + d * u * w;
}

static void bowl_patch_point(const struct local_geometry *g, enum patch patch, double a, double b,
                             double ret[3])
{
    double p[2];
    if (patch == PATCH_CORE) {
        core_disc_point(a, b, p);
    } else {
        const double angle = M_PI_4 * graded(a, bowl_axis_slope, 1);
        core_disc_point(1, a, p);
        p[0] = (1 - b) * p[0] + b * cos(angle);
        p[1] = (1 - b) * p[1] + b * sin(angle);
        if (patch == PATCH_Y) {
            const double swap = p[0];
            p[0] = p[1];
            p[1] = swap;
        }
    }
    bowl_point(g, atan2(p[1], p[0]) / M_PI_2, hypot(p[0], p[1]), ret);
}

/* Where the fraction t of an outer face's width is, with the share `stretch` of the stretch. */
static double outer_place(const struct local_geometry *g, double t, double stretch)
{
    return (g->half_width - g->stretch) * graded(t, outer_axis_slope, 1) +
           stretch * g->stretch * stretched(t);
}

/* The end of a line from the bone; with stretch = 0 where it would be in the unstretched box. */
static void outer_patch_point(const struct local_geometry *g, enum patch patch, double a, double b,
                              double stretch, double ret[3])
{
    const double w = outer_place(g, 1, stretch), along = outer_place(g, a, stretch);
    ret[2] = g->muscle_z + b * (g->top_z - g->muscle_z);
    switch (patch) {
    case PATCH_CORE:
        ret[0] = along;
        ret[1] = outer_place(g, b, stretch);
        ret[2] = g->muscle_z;
        break;
    case PATCH_X:
        ret[0] = w;
        ret[1] = along;
        break;
    case PATCH_Y:
        ret[0] = along;
        ret[1] = w;
        break;
    }
}

/* --- numbering -------------------------------------------------------------------------------- */

static int core_nodes(const struct mesh_divisions *d) { return (d->across + 1) * (d->across + 1); }

static int surface_nodes(const struct mesh_divisions *d)
{
    return core_nodes(d) + (2 * d->across + 1) * d->around;
}

int mesh_local_node_count(const struct mesh_divisions *d)
{
    return surface_nodes(d) * (d->radial + 1) + core_nodes(d) * (d->fat + d->skin);
}

/* Node (i, j) of a patch on radial layer l. In the patches x and y, i runs along the core's edge
 * and j = 0 ... around outward; j = 0 is the core's edge, and i = across the line they share. */
static int muscle_node(const struct mesh_divisions *d, enum patch patch, int i, int j, int l)
{
    const int n = d->across, base = l * surface_nodes(d);
    if (patch == PATCH_CORE) return base + j * (n + 1) + i;
    if (j == 0)
        return muscle_node(d, PATCH_CORE, patch == PATCH_X ? n : i, patch == PATCH_X ? i : n, l);
    if (patch == PATCH_Y && i < n)
        return base + core_nodes(d) + (n + 1) * d->around + (j - 1) * n + i;
    return base + core_nodes(d) + (j - 1) * (n + 1) + i;
}

/* Node (i, j) of the columns below the muscle; layer 0 is the muscle's bottom. */
static int column_node(const struct mesh_divisions *d, int i, int j, int layer)
{
    if (layer == 0) return muscle_node(d, PATCH_CORE, i, j, d->radial);
    return surface_nodes(d) * (d->radial + 1) + (layer - 1) * core_nodes(d) + j * (d->across + 1) +
           i;
}

static int patch_rows(const struct mesh_divisions *d, enum patch patch)
{
    return patch == PATCH_CORE ? d->across : d->around;
}

/* --- nodes ------------------------------------------------------------------------------------ */

static void place_muscle_line(struct mesh *m, const struct local_geometry *g, enum patch patch,
                              int i, int j)
{
    const struct mesh_divisions *d = &m->divisions;
    const double a = (double)i / d->across, b = (double)j / patch_rows(d, patch);
    double bowl[3], inner[3], outer[3];
    bowl_patch_point(g, patch, a, b, bowl);
    outer_patch_point(g, patch, a, b, 0, inner);
    outer_patch_point(g, patch, a, b, 1, outer);
    for (int l = 0; l <= d->radial; l++) {
        const double t = (double)l / d->radial;
        double *X = m->X_mm[muscle_node(d, patch, i, j, l)];
        lerp3(bowl, inner, graded(t, radial_bone_slope, radial_outer_slope), X);
        for (int k = 0; k < 3; k++) X[k] += stretched(t) * (outer[k] - inner[k]);
    }
}

/* z of a layer of the columns below the muscle; layer 0 is the muscle's bottom. */
static double column_z(const struct mesh_divisions *d, const struct local_geometry *g, int layer)
{
    if (layer > d->fat) return g->skin_z * (d->fat + d->skin - layer) / d->skin;
    return g->muscle_z +
           (g->skin_z - g->muscle_z) * graded((double)layer / d->fat, fat_muscle_slope, 1);
}

static void place_column(struct mesh *m, const struct local_geometry *g, int i, int j)
{
    const struct mesh_divisions *d = &m->divisions;
    const double *top = m->X_mm[column_node(d, i, j, 0)];
    for (int k = 1; k <= d->fat + d->skin; k++) {
        double *X = m->X_mm[column_node(d, i, j, k)];
        X[0] = top[0];
        X[1] = top[1];
        X[2] = column_z(d, g, k);
    }
}

static void place_nodes(struct mesh *m, const struct local_geometry *g)
{
    const struct mesh_divisions *d = &m->divisions;
    for (int patch = PATCH_CORE; patch <= PATCH_Y; patch++)
        for (int j = 0; j <= patch_rows(d, (enum patch)patch); j++)
            for (int i = 0; i <= d->across; i++) place_muscle_line(m, g, (enum patch)patch, i, j);
    for (int j = 0; j <= d->across; j++)
        for (int i = 0; i <= d->across; i++) place_column(m, g, i, j);
}

/* Snaps the symmetry planes to exact coordinates and flags the nodes. */
static void flag_nodes(struct mesh *m, const struct local_geometry *g)
{
    const double eps = 1e-9 * g->half_width;
    for (int n = 0; n < m->node_count; n++) {
        double *X = m->X_mm[n];
        unsigned flags = 0;
        for (int k = 0; k < 2; k++) {
            if (fabs(X[k]) < eps) X[k] = 0;
            if (X[k] == 0) flags |= k == 0 ? NODE_ON_X0 : NODE_ON_Y0;
            if (fabs(X[k] - g->half_width) < eps) flags |= NODE_ON_SEAT;
        }
        if (X[2] < eps) flags |= NODE_ON_SEAT;
        if (n < surface_nodes(&m->divisions)) flags |= NODE_ON_BONE;
        m->node_flags[n] = (unsigned char)flags;
    }
}

/* --- elements --------------------------------------------------------------------------------- */

static void add_hex(struct mesh *m, enum tissue tissue, const int lower[4], const int upper[4])
{
    int *hex = m->hex[m->element_count];
    memcpy(hex, lower, sizeof(int[4]));
    memcpy(hex + 4, upper, sizeof(int[4]));
    m->tissue[m->element_count++] = (unsigned char)tissue;
}

/* The four nodes of cell (i, j), anticlockwise as seen from the bone. */
static void muscle_quad(const struct mesh_divisions *d, enum patch patch, int i, int j, int l,
                        int ret[4])
{
    /* In patch x the outward direction continues the core's x, so (i, j) change places. */
    static const int cell[2][4][2] = {{{0, 0}, {1, 0}, {1, 1}, {0, 1}},
                                      {{0, 0}, {0, 1}, {1, 1}, {1, 0}}};
    const int(*at)[2] = cell[patch == PATCH_X];
    for (int k = 0; k < 4; k++) ret[k] = muscle_node(d, patch, i + at[k][0], j + at[k][1], l);
}

static void column_quad(const struct mesh_divisions *d, int i, int j, int layer, int ret[4])
{
    ret[0] = column_node(d, i, j, layer);
    ret[1] = column_node(d, i + 1, j, layer);
    ret[2] = column_node(d, i + 1, j + 1, layer);
    ret[3] = column_node(d, i, j + 1, layer);
}

static void build_muscle(struct mesh *m)
{
    const struct mesh_divisions *d = &m->divisions;
    int lower[4], upper[4];
    for (int l = 0; l < d->radial; l++)
        for (int p = PATCH_CORE; p <= PATCH_Y; p++)
            for (int j = 0; j < patch_rows(d, (enum patch)p); j++)
                for (int i = 0; i < d->across; i++) {
                    muscle_quad(d, (enum patch)p, i, j, l + 1, lower);
                    muscle_quad(d, (enum patch)p, i, j, l, upper);
                    add_hex(m, TISSUE_MUSCLE, lower, upper);
                }
    m->muscle_count = m->element_count;
}

static void build_columns(struct mesh *m)
{
    const struct mesh_divisions *d = &m->divisions;
    int lower[4], upper[4];
    for (int k = 0; k < d->fat + d->skin; k++)
        for (int j = 0; j < d->across; j++)
            for (int i = 0; i < d->across; i++) {
                column_quad(d, i, j, k + 1, lower);
                column_quad(d, i, j, k, upper);
                add_hex(m, k < d->fat ? TISSUE_FAT : TISSUE_SKIN, lower, upper);
            }
}

static void add_seat_quad(struct mesh *m, int a, int b, int c, int d)
{
    int *quad = m->seat_quad[m->seat_quad_count++];
    quad[0] = a;
    quad[1] = b;
    quad[2] = c;
    quad[3] = d;
}

/* The side of the columns at i = across (facing +x), or mirrored, at j = across (facing +y). */
static void add_column_sides(struct mesh *m, bool facing_y)
{
    const struct mesh_divisions *d = &m->divisions;
    const int n = d->across;
    for (int k = 0; k < d->fat + d->skin; k++)
        for (int i = 0; i < n; i++)
            if (facing_y)
                add_seat_quad(m, column_node(d, i, n, k), column_node(d, i + 1, n, k),
                              column_node(d, i + 1, n, k + 1), column_node(d, i, n, k + 1));
            else
                add_seat_quad(m, column_node(d, n, i, k + 1), column_node(d, n, i + 1, k + 1),
                              column_node(d, n, i + 1, k), column_node(d, n, i, k));
}

static void build_seat_quads(struct mesh *m)
{
    const struct mesh_divisions *d = &m->divisions;
    int q[4];
    for (int j = 0; j < d->across; j++)
        for (int i = 0; i < d->across; i++) {
            column_quad(d, i, j, d->fat + d->skin, q);
            add_seat_quad(m, q[0], q[3], q[2], q[1]); /* faces down */
        }
    m->outer_skin_quad_count = m->seat_quad_count;
    add_column_sides(m, false);
    add_column_sides(m, true);
    for (int p = PATCH_X; p <= PATCH_Y; p++)
        for (int j = 0; j < d->around; j++)
            for (int i = 0; i < d->across; i++) {
                muscle_quad(d, (enum patch)p, i, j, d->radial, q);
                add_seat_quad(m, q[0], q[3], q[2], q[1]);
            }
}

static void build_axis(struct mesh *m)
{
    const struct mesh_divisions *d = &m->divisions;
    for (int l = 0; l <= d->radial; l++) {
        int *row = m->axis[m->axis_count++];
        row[0] = muscle_node(d, PATCH_CORE, 0, 0, l);
        for (int k = 1; k <= 2; k++) {
            row[k] = muscle_node(d, PATCH_CORE, k, 0, l);
            row[2 + k] = muscle_node(d, PATCH_CORE, 0, k, l);
        }
    }
}

static bool allocate(struct mesh *m)
{
    const struct mesh_divisions *d = &m->divisions;
    const size_t nodes = (size_t)mesh_local_node_count(d);
    const size_t n = (size_t)d->across, below = (size_t)d->fat + (size_t)d->skin;
    const size_t muscle = (n * n + 2 * n * (size_t)d->around) * (size_t)d->radial;
    m->X_mm = calloc(nodes, sizeof *m->X_mm);
    m->node_flags = calloc(nodes, sizeof *m->node_flags);
    m->hex = calloc(muscle + n * n * below, sizeof *m->hex);
    m->tissue = calloc(muscle + n * n * below, sizeof *m->tissue);
    m->seat_quad = calloc(n * n + 2 * n * (below + (size_t)d->around), sizeof *m->seat_quad);
    m->axis = calloc((size_t)d->radial + 1, sizeof *m->axis);
    m->node_count = (int)nodes;
    return m->X_mm && m->node_flags && m->hex && m->tissue && m->seat_quad && m->axis;
}

enum ischia_code mesh_local_init(struct mesh *ret, const struct ischia_case *c,
                                 const struct mesh_divisions *divisions, struct ischia_error *err)
{
    struct mesh m = {.divisions = *divisions};
    assert(ischia_case_is_valid(c));
    assert(divisions->across >= 2 && divisions->around >= 1 && divisions->radial >= 1);
    if (!allocate(&m)) {
        mesh_finish(&m);
        return FAIL(err, ISCHIA_E_MEMORY, "not enough memory for the mesh");
    }
    const struct local_geometry g = geometry_of(c);
    m.tip_z_mm = g.tip_z;
    m.top_z_mm = g.top_z;
    m.muscle_z_mm = g.muscle_z;
    m.half_width_mm = g.half_width;
    place_nodes(&m, &g);
    flag_nodes(&m, &g);
    build_muscle(&m);
    build_columns(&m);
    build_seat_quads(&m);
    build_axis(&m);
    *ret = m;
    return ISCHIA_OK;
}
