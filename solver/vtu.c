/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Inline binary arrays: base64 of an unsigned 64-bit byte count followed by the values. Every array
 * is one row of a table: its name, type and the function that gives its values.
 */
#include "solver/vtu.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "solver/clusters.h"
#include "solver/kinematics.h"
#include "solver/strain.h"

enum { VTK_HEXAHEDRON = 12 };

enum number_type { UINT8, INT32, FLOAT64, NUMBER_TYPE_COUNT };

static const struct {
    const char *name;
    int bytes;
} number_types[NUMBER_TYPE_COUNT] = {
    [UINT8] = {"UInt8", 1},
    [INT32] = {"Int32", 4},
    [FLOAT64] = {"Float64", 8},
};

/* Everything the arrays draw from. */
struct source {
    const struct mesh *mesh;
    const double *displacement_mm;
    struct strain_field strains;
    int *cluster; /* [cell_count] */
};

/* Every value of every type here is a double without loss. */
typedef double array_value(const struct source *source, size_t item, int component);

struct array {
    const char *name;
    enum number_type type;
    int components;
    array_value *value;
};

/* --- base64 ----------------------------------------------------------------------------------- */

struct base64 {
    FILE *out;
    uint32_t bits;
    int bytes; /* waiting in bits: 0, 1 or 2 */
};

static void base64_flush(struct base64 *b)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    if (b->bytes == 0) return;
    const uint32_t bits = b->bits << (8 * (3 - b->bytes));
    for (int i = 0; i < 4; i++) {
        const char digit = digits[bits >> (18 - 6 * i) & 63];
        (void)putc_unlocked(i <= b->bytes ? digit : '=', b->out);
    }
    b->bits = 0;
    b->bytes = 0;
}

static void base64_put(struct base64 *b, uint64_t value, int bytes)
{
    for (int i = 0; i < bytes; i++) {
        b->bits = b->bits << 8 | (uint32_t)(value >> (8 * i) & 0xff);
        if (++b->bytes == 3) base64_flush(b);
    }
}

static uint64_t encode(enum number_type type, double value)
{
    uint64_t bits = 0;
    if (type == FLOAT64)
        memcpy(&bits, &value, sizeof bits);
    else
        bits = (uint64_t)(int64_t)value;
    return bits;
}

/* --- the arrays ------------------------------------------------------------------------------- */

static double deformed_position(const struct source *s, size_t node, int d)
{
    return s->mesh->X_mm[node][d] + s->displacement_mm[3 * node + (size_t)d];
}

static double displacement(const struct source *s, size_t node, int d)
{
    return s->displacement_mm[3 * node + (size_t)d];
}

static double connectivity(const struct source *s, size_t element, int corner)
{
    return s->mesh->hex[element][corner];
}

static double offset(const struct source *s, size_t element, int component)
{
    (void)s, (void)component;
    return (double)((element + 1) * HEX_CORNERS);
}

static double cell_type(const struct source *s, size_t element, int component)
{
    (void)s, (void)element, (void)component;
    return VTK_HEXAHEDRON;
}

static double tissue(const struct source *s, size_t element, int component)
{
    (void)component;
    return s->mesh->tissue[element];
}

typedef double pick_measure(const struct strain_measures *strain);

static double shear(const struct strain_measures *s) { return s->green_lagrange_shear; }
static double compression(const struct strain_measures *s) { return s->green_lagrange_compression; }
static double engineering(const struct strain_measures *s) { return s->engineering_shear; }

static double mean_of(const struct source *s, size_t element, pick_measure *pick)
{
    const struct strain_cell *cell = &s->strains.cell[element * HEX_CELLS];
    double sum = 0, volume = 0;
    for (int q = 0; q < HEX_CELLS; q++) {
        sum += cell[q].volume_mm3 * pick(&cell[q].strain);
        volume += cell[q].volume_mm3;
    }
    return sum / volume;
}

static double max_of(const struct source *s, size_t element, pick_measure *pick)
{
    const struct strain_cell *cell = &s->strains.cell[element * HEX_CELLS];
    double largest = 0;
    for (int q = 0; q < HEX_CELLS; q++) largest = fmax(largest, pick(&cell[q].strain));
    return largest;
}

#define STRAIN_ARRAY(name, reduce, pick)                                                           \
    static double name(const struct source *s, size_t element, int component)                      \
    {                                                                                              \
        (void)component;                                                                           \
        return reduce(s, element, pick);                                                           \
    }
STRAIN_ARRAY(E_shear, mean_of, shear)
STRAIN_ARRAY(E_comp, mean_of, compression)
STRAIN_ARRAY(eps_shear, mean_of, engineering)
STRAIN_ARRAY(E_shear_max, max_of, shear)
STRAIN_ARRAY(E_comp_max, max_of, compression)
STRAIN_ARRAY(eps_shear_max, max_of, engineering)

static double volume_in_cluster(const struct source *s, size_t element, int id)
{
    double volume = 0;
    for (size_t i = element * HEX_CELLS; i < (element + 1) * HEX_CELLS; i++)
        if (s->cluster[i] == id) volume += s->strains.cell[i].volume_mm3;
    return volume;
}

static double cluster(const struct source *s, size_t element, int component)
{
    (void)component;
    int most = NO_CLUSTER;
    double most_volume = 0;
    for (size_t i = element * HEX_CELLS; i < (element + 1) * HEX_CELLS; i++) {
        const int id = s->cluster[i];
        if (id == NO_CLUSTER || id == most) continue;
        const double volume = volume_in_cluster(s, element, id);
        if (volume < most_volume || (volume == most_volume && id > most)) continue;
        most = id;
        most_volume = volume;
    }
    return most;
}

static double cluster_volume(const struct source *s, size_t element, int component)
{
    (void)component;
    double volume = 0;
    for (size_t i = element * HEX_CELLS; i < (element + 1) * HEX_CELLS; i++)
        if (s->cluster[i] != NO_CLUSTER) volume += s->strains.cell[i].volume_mm3;
    return volume;
}

static const struct array positions[] = {{"Points", FLOAT64, 3, deformed_position}};
static const struct array point_arrays[] = {{"displacement", FLOAT64, 3, displacement}};
static const struct array topology[] = {
    {"connectivity", INT32, HEX_CORNERS, connectivity},
    {"offsets", INT32, 1, offset},
    {"types", UINT8, 1, cell_type},
};
static const struct array cell_arrays[] = {
    {"tissue", UINT8, 1, tissue},
    {"E_shear", FLOAT64, 1, E_shear},
    {"E_comp", FLOAT64, 1, E_comp},
    {"eps_shear", FLOAT64, 1, eps_shear},
    {"E_shear_max", FLOAT64, 1, E_shear_max},
    {"E_comp_max", FLOAT64, 1, E_comp_max},
    {"eps_shear_max", FLOAT64, 1, eps_shear_max},
    {"cluster", INT32, 1, cluster},
    {"cluster_volume_mm3", FLOAT64, 1, cluster_volume},
};

/* --- the file --------------------------------------------------------------------------------- */

static void write_array(FILE *out, const struct array *a, const struct source *source, size_t items)
{
    struct base64 b = {.out = out};
    const int bytes = number_types[a->type].bytes;
    (void)fprintf(out, "<DataArray type=\"%s\" Name=\"%s\"", number_types[a->type].name, a->name);
    /* VTK reads a flat list of corners, whatever the cells' sizes. */
    if (a->components > 1 && a->components != HEX_CORNERS)
        (void)fprintf(out, " NumberOfComponents=\"%d\"", a->components);
    (void)fputs(" format=\"binary\">", out);
    base64_put(&b, (uint64_t)items * (uint64_t)(a->components * bytes), 8);
    for (size_t i = 0; i < items; i++)
        for (int k = 0; k < a->components; k++)
            base64_put(&b, encode(a->type, a->value(source, i, k)), bytes);
    base64_flush(&b);
    (void)fputs("</DataArray>\n", out);
}

static void write_group(FILE *out, const char *element, const char *attributes,
                        const struct array *arrays, size_t array_count, const struct source *source,
                        int items)
{
    (void)fprintf(out, "<%s%s>\n", element, attributes);
    for (size_t i = 0; i < array_count; i++) write_array(out, &arrays[i], source, (size_t)items);
    (void)fprintf(out, "</%s>\n", element);
}

static void write_field_data(FILE *out, const struct ischia_case *c)
{
    (void)fputs("<FieldData>\n", out);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        (void)fprintf(out,
                      "<DataArray type=\"Float64\" Name=\"%s (%s)\" NumberOfTuples=\"1\" "
                      "format=\"ascii\">%.17g</DataArray>\n",
                      ischia_params[i].key, ischia_params[i].unit, c->param[i]);
    (void)fputs("</FieldData>\n", out);
}

#define WRITE_GROUP(out, element, attributes, table, source, items)                                \
    write_group((out), (element), (attributes), (table), sizeof(table) / sizeof(table)[0],         \
                (source), (items))

static void write_file(FILE *out, const struct ischia_case *c, const struct source *source)
{
    const struct mesh *mesh = source->mesh;
    (void)fprintf(out,
                  "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
                  "<!-- %s version %d; mm; points are deformed positions; quarter model -->\n"
                  "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" "
                  "header_type=\"UInt64\">\n<UnstructuredGrid>\n",
                  ISCHIA_MODEL_NAME, ISCHIA_MODEL_VERSION);
    write_field_data(out, c);
    (void)fprintf(out, "<Piece NumberOfPoints=\"%d\" NumberOfCells=\"%d\">\n", mesh->node_count,
                  mesh->element_count);
    WRITE_GROUP(out, "PointData", " Vectors=\"displacement\"", point_arrays, source,
                mesh->node_count);
    WRITE_GROUP(out, "CellData", " Scalars=\"E_shear\"", cell_arrays, source, mesh->element_count);
    WRITE_GROUP(out, "Points", "", positions, source, mesh->node_count);
    WRITE_GROUP(out, "Cells", "", topology, source, mesh->element_count);
    (void)fputs("</Piece>\n</UnstructuredGrid>\n</VTKFile>\n", out);
}

static enum ischia_code find_cluster_ids(struct source *source, struct ischia_error *err)
{
    struct faces faces;
    struct ischia_cluster_set set;
    const size_t count = (size_t)source->strains.cell_count;
    int *id = calloc(count, sizeof *id);
    CHECK(id != NULL, err, ISCHIA_E_MEMORY, "out of memory for the clusters of %zu cells", count);
    enum ischia_code code = faces_init(&faces, source->mesh, err);
    if (code == ISCHIA_OK) {
        code =
            clusters_find(source->mesh, &faces, &source->strains, ISCHIA_OVER_BOTH, &set, id, err);
        faces_finish(&faces);
    }
    if (code == ISCHIA_OK)
        source->cluster = id;
    else
        free(id);
    return code;
}

enum ischia_code vtu_write(FILE *out, const struct ischia_case *c, const struct mesh *mesh,
                           const double *displacement_mm, struct ischia_error *err)
{
    struct source source = {.mesh = mesh, .displacement_mm = displacement_mm};
    TRY(strain_field_init(&source.strains, mesh, displacement_mm, err));
    enum ischia_code code = find_cluster_ids(&source, err);
    if (code == ISCHIA_OK) {
        write_file(out, c, &source);
        if (fflush(out) != 0 || ferror(out))
            code = FAIL(err, ISCHIA_E_IO, "cannot write the VTU file: %s", strerror(errno));
    }
    free(source.cluster);
    strain_field_finish(&source.strains);
    return code;
}
