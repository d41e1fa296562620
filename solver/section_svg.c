/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * One panel is drawn in mm with z up, layer by layer, each as half a section and its mirror image,
 * which overlap a little on the axis. Each strain level is one path over all that lies above it,
 * painted over the lower ones. So no seams show between halves, bands or elements.
 */
#include "solver/section_svg.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solver/colormap.h"
#include "solver/result.h"
#include "solver/section.h"
#include "solver/strain.h"

/* The colour scale: bands of equal width, the last open to all higher strains. */
enum { BANDS = 16 };
static const double band_width = ISCHIA_SECTION_E_SHEAR_MAX / BANDS;

/* What a half is painted with, from the bottom up. */
enum layer {
    LAYER_FAT,
    LAYER_SKIN,
    LAYER_FIRST_BAND,
    LAYER_BONE = LAYER_FIRST_BAND + BANDS,
    LAYER_OUTLINE,
    LAYER_COUNT
};

/* The page, in px: the panels' row is as high as the tissue. */
static const double page_width = 1000, margin = 30, gap = 44;
static const double head_height = 84, foot_height = 118, seat_height_mm = 3.5;

static const char *const tissue_fill[TISSUE_COUNT] = {
    [TISSUE_MUSCLE] = "none",
    [TISSUE_FAT] = "#dfe3e6",
    [TISSUE_SKIN] = "#a3acb3",
};
static const char bone_fill[] = "#f3f4f5", seat_fill[] = "#5b6670", ink[] = "#1b1b1b";

struct panel {
    struct section section;
    double reach_mm; /* how far the tissue reaches outward */
    double top_mm;   /* how high tissue or bone reach      */
};

struct figure {
    FILE *out;
    const struct ischia_case *c;
    const struct ischia_section_labels *labels;
    const struct mesh *mesh;
    const double *displacement_mm;
    double *shear; /* [node_count] recovered */
    struct panel panel[SECTION_PLANE_COUNT];
    double px_per_mm;
    double seat_y; /* px, of z = 0 */
    double height;
};

/* --- words ------------------------------------------------------------------------------------ */

enum { NUMBER_BYTES = 32 };

/* ">" too: "]]>" may not stand in XML. */
static const char *entity_of(char letter)
{
    switch (letter) {
    case '&':
        return "&amp;";
    case '<':
        return "&lt;";
    case '>':
        return "&gt;";
    default:
        return NULL;
    }
}

static void put_words(const struct figure *f, const char *text)
{
    for (; *text != '\0'; text++) {
        const char *entity = entity_of(*text);
        if (entity != NULL)
            (void)fputs(entity, f->out);
        else
            (void)fputc(*text, f->out);
    }
}

static void put_element(const struct figure *f, const char *opening, const char *text,
                        const char *name)
{
    (void)fprintf(f->out, "<%s>", opening);
    put_words(f, text);
    (void)fprintf(f->out, "</%s>\n", name);
}

/* "E" with its index, below the line: what follows it has to come up again. */
static void put_symbol(const struct figure *f)
{
    (void)fputs(" E<tspan font-size=\"10\" dy=\"3\">", f->out);
    put_words(f, f->labels->index);
    (void)fputs("</tspan>", f->out);
}

/* A number of ours as the reader writes it. */
static const char *with_mark(const struct figure *f, char number[NUMBER_BYTES])
{
    char *point = strchr(number, '.');
    if (point != NULL) *point = f->labels->decimal_mark;
    return number;
}

/* Of UTF-8, without the bytes that continue a character. */
static size_t letters(const char *text)
{
    size_t count = 0;
    for (; *text != '\0'; text++) count += ((unsigned char)*text & 0xC0) != 0x80;
    return count;
}

/* --- geometry --------------------------------------------------------------------------------- */

/* The halves of a panel overlap by twice this, so that no seam shows on the axis. */
static const double axis_overlap_mm = 0.2;

static struct section_vertex vertex_of(const struct figure *f, const struct panel *p, int node)
{
    const unsigned axis = NODE_ON_X0 | NODE_ON_Y0;
    struct section_vertex v = {.value = f->shear[node]};
    section_position(&p->section, f->mesh, f->displacement_mm, node, v.at_mm);
    if ((f->mesh->node_flags[node] & axis) == axis) v.at_mm[0] -= axis_overlap_mm;
    return v;
}

static void measure_panel(const struct figure *f, struct panel *p)
{
    for (int q = 0; q < p->section.quad_count; q++) {
        for (int a = 0; a < 4; a++) {
            const struct section_vertex v = vertex_of(f, p, p->section.quad[q].node[a]);
            p->reach_mm = fmax(p->reach_mm, v.at_mm[0]);
            p->top_mm = fmax(p->top_mm, v.at_mm[1]);
        }
    }
}

static void lay_out(struct figure *f)
{
    double reach_mm = 0, top_mm = 0;
    for (int s = 0; s < SECTION_PLANE_COUNT; s++) {
        measure_panel(f, &f->panel[s]);
        reach_mm += f->panel[s].reach_mm;
        top_mm = fmax(top_mm, f->panel[s].top_mm);
    }
    f->px_per_mm = (page_width - 2 * margin - gap) / (2 * reach_mm);
    f->seat_y = head_height + top_mm * f->px_per_mm;
    f->height = f->seat_y + seat_height_mm * f->px_per_mm + foot_height;
}

/* --- paths ------------------------------------------------------------------------------------ */

/* Without the sign of a rounded zero. */
static double tidy(double mm) { return fabs(mm) < 0.005 ? 0 : mm; }

static void put_polygon(FILE *out, const struct section_vertex *v, int count)
{
    for (int i = 0; i < count; i++)
        (void)fprintf(out, "%c%.2f %.2f", i == 0 ? 'M' : 'L', tidy(v[i].at_mm[0]),
                      tidy(v[i].at_mm[1]));
    if (count > 0) (void)fputc('Z', out);
}

static void put_line(FILE *out, const struct section_vertex *a, const struct section_vertex *b)
{
    (void)fprintf(out, "M%.2f %.2fL%.2f %.2f", tidy(a->at_mm[0]), tidy(a->at_mm[1]),
                  tidy(b->at_mm[0]), tidy(b->at_mm[1]));
}

static void quad_vertices(const struct figure *f, const struct panel *p, int quad,
                          struct section_vertex ret[4])
{
    for (int a = 0; a < 4; a++) ret[a] = vertex_of(f, p, p->section.quad[quad].node[a]);
}

static void put_tissue(const struct figure *f, const struct panel *p, enum tissue tissue)
{
    struct section_vertex v[4];
    (void)fprintf(f->out, "<path fill=\"%s\" stroke=\"%s\" d=\"", tissue_fill[tissue],
                  tissue_fill[tissue]);
    for (int q = 0; q < p->section.quad_count; q++) {
        if (p->section.quad[q].tissue != tissue) continue;
        quad_vertices(f, p, q, v);
        put_polygon(f->out, v, 4);
    }
    (void)fputs("\"/>\n", f->out);
}

/* What of a quad lies over the level: itself when all of it does, else clipped triangles. */
static void put_quad_above(FILE *out, const struct section_vertex quad[4], double level)
{
    struct section_vertex triangle[SECTION_TRIANGLES][3], clipped[SECTION_CLIPPED_MAX];
    int above = 0;
    for (int a = 0; a < 4; a++) above += quad[a].value >= level;
    if (above == 4) put_polygon(out, quad, 4);
    if (above == 4 || above == 0) return;
    section_divide(quad, triangle);
    for (int t = 0; t < SECTION_TRIANGLES; t++)
        put_polygon(out, clipped, section_clip(triangle[t], level, clipped));
}

static void put_band(const struct figure *f, const struct panel *p, int band)
{
    struct section_vertex v[4];
    unsigned char rgb[3];
    colormap((double)band / (BANDS - 1), rgb);
    (void)fprintf(f->out, "<path fill=\"#%02x%02x%02x\" stroke=\"#%02x%02x%02x\" d=\"", rgb[0],
                  rgb[1], rgb[2], rgb[0], rgb[1], rgb[2]);
    for (int q = 0; q < p->section.quad_count; q++) {
        if (p->section.quad[q].tissue != TISSUE_MUSCLE) continue;
        quad_vertices(f, p, q, v);
        put_quad_above(f->out, v, band * band_width);
    }
    (void)fputs("\"/>\n", f->out);
}

static void put_threshold_path(const struct figure *f, const struct panel *p)
{
    struct section_vertex v[4], triangle[SECTION_TRIANGLES][3], end[2];
    for (int q = 0; q < p->section.quad_count; q++) {
        if (p->section.quad[q].tissue != TISSUE_MUSCLE) continue;
        quad_vertices(f, p, q, v);
        section_divide(v, triangle);
        for (int t = 0; t < SECTION_TRIANGLES; t++)
            if (section_contour(triangle[t], ISCHIA_E_SHEAR_THRESHOLD, end))
                put_line(f->out, &end[0], &end[1]);
    }
}

/* True when another quad of the section shares the edge; *ret_tissue is then its tissue. */
static bool edge_is_shared(const struct section *s, int quad, int a, int b, enum tissue *ret_tissue)
{
    for (int q = 0; q < s->quad_count; q++) {
        int found = 0;
        for (int k = 0; k < 4; k++) found += s->quad[q].node[k] == a || s->quad[q].node[k] == b;
        if (found < 2 || q == quad) continue;
        *ret_tissue = s->quad[q].tissue;
        return true;
    }
    return false;
}

/* Outlines of the tissues: edges at the outside (not on the symmetry axis) and between tissues. */
static void put_outline_path(const struct figure *f, const struct panel *p)
{
    const unsigned axis = NODE_ON_X0 | NODE_ON_Y0;
    for (int q = 0; q < p->section.quad_count; q++) {
        const struct section_quad *quad = &p->section.quad[q];
        for (int k = 0; k < 4; k++) {
            const int a = quad->node[k], b = quad->node[(k + 1) % 4];
            enum tissue other = TISSUE_COUNT;
            if ((f->mesh->node_flags[a] & f->mesh->node_flags[b] & axis) == axis) continue;
            if (edge_is_shared(&p->section, q, a, b, &other) && other <= quad->tissue) continue;
            struct section_vertex from = vertex_of(f, p, a), to = vertex_of(f, p, b);
            from.at_mm[0] = fmax(from.at_mm[0], 0);
            to.at_mm[0] = fmax(to.at_mm[0], 0);
            put_line(f->out, &from, &to);
        }
    }
}

/* The bone as the model has it: up to the plane of its rim, which is dashed. */
static void put_bone(const struct figure *f, const struct panel *p)
{
    const struct section *s = &p->section;
    if (s->bone_node_count == 0) return;
    struct section_vertex rim = vertex_of(f, p, s->bone_node[s->bone_node_count - 1]);
    (void)fprintf(f->out, "<path fill=\"%s\" stroke=\"none\" d=\"M%.2f %.2f", bone_fill,
                  -axis_overlap_mm, tidy(rim.at_mm[1]));
    for (int i = 0; i < s->bone_node_count; i++) {
        const struct section_vertex v = vertex_of(f, p, s->bone_node[i]);
        (void)fprintf(f->out, "L%.2f %.2f", tidy(v.at_mm[0]), tidy(v.at_mm[1]));
    }
    (void)fprintf(f->out,
                  "Z\"/>\n<path fill=\"none\" stroke=\"%s\" stroke-width=\"0.2\" "
                  "stroke-dasharray=\"0.8 0.8\" d=\"M0 %.2fH%.2f\"/>\n",
                  ink, tidy(rim.at_mm[1]), tidy(rim.at_mm[0]));
}

/* --- the figure ------------------------------------------------------------------------------- */

/* What is put between the two calls appears twice: as it is, and mirrored. */
static void begin_mirrored(const struct figure *f, int s, int layer)
{
    (void)fprintf(f->out, "<g id=\"half%d-%d\">\n", s, layer);
}

static void end_mirrored(const struct figure *f, int s, int layer)
{
    (void)fprintf(f->out, "</g>\n<use href=\"#half%d-%d\" transform=\"scale(-1 1)\"/>\n", s, layer);
}

static void put_outline(const struct figure *f, const struct panel *p)
{
    (void)fprintf(f->out,
                  "<path fill=\"none\" stroke=\"%s\" stroke-width=\"0.2\" stroke-linecap=\"round\" "
                  "d=\"",
                  ink);
    put_outline_path(f, p);
    (void)fputs("\"/>\n", f->out);
}

static void put_layer(const struct figure *f, const struct panel *p, int layer)
{
    if (layer == LAYER_FAT)
        put_tissue(f, p, TISSUE_FAT);
    else if (layer == LAYER_SKIN)
        put_tissue(f, p, TISSUE_SKIN);
    else if (layer == LAYER_BONE)
        put_bone(f, p);
    else if (layer == LAYER_OUTLINE)
        put_outline(f, p);
    else
        put_band(f, p, layer - LAYER_FIRST_BAND);
}

/* The contour over both halves: a white border under a black line. */
static void put_threshold(const struct figure *f, int s)
{
    static const struct {
        const char *colour;
        double width_mm;
    } strokes[] = {{"#ffffff", 1.0}, {ink, 0.45}};
    (void)fprintf(f->out, "<defs><path id=\"threshold%d\" d=\"", s);
    put_threshold_path(f, &f->panel[s]);
    (void)fputs("\"/></defs>\n", f->out);
    for (size_t i = 0; i < sizeof strokes / sizeof strokes[0]; i++)
        (void)fprintf(f->out,
                      "<g fill=\"none\" stroke=\"%s\" stroke-width=\"%.2f\" "
                      "stroke-linecap=\"round\"><use href=\"#threshold%d\"/>"
                      "<use href=\"#threshold%d\" transform=\"scale(-1 1)\"/></g>\n",
                      strokes[i].colour, strokes[i].width_mm, s, s);
}

static void put_panel(const struct figure *f, int s, double left)
{
    const struct panel *p = &f->panel[s];
    const double half = p->reach_mm * f->px_per_mm, centre = left + half;
    (void)fprintf(f->out,
                  "<text x=\"%.1f\" y=\"%.1f\"><tspan font-weight=\"bold\">%c</tspan>"
                  "<tspan dx=\"8\">",
                  left, head_height - 14, 'a' + s);
    put_words(f, f->labels->plane[s]);
    (void)fputs("</tspan></text>\n", f->out);
    (void)fprintf(f->out,
                  "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"%s\"/>\n",
                  left, f->seat_y, 2 * half, seat_height_mm * f->px_per_mm, seat_fill);
    (void)fprintf(f->out,
                  "<g transform=\"translate(%.2f %.2f) scale(%.4f %.4f)\" "
                  "stroke-width=\"0.08\" stroke-linejoin=\"round\">\n",
                  centre, f->seat_y, f->px_per_mm, -f->px_per_mm);
    for (int layer = 0; layer < LAYER_COUNT; layer++) {
        begin_mirrored(f, s, layer);
        put_layer(f, p, layer);
        end_mirrored(f, s, layer);
    }
    put_threshold(f, s);
    (void)fputs("</g>\n", f->out);
}

static void put_opening(const struct figure *f)
{
    (void)fprintf(f->out,
                  "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
                  "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %.0f %.0f\" "
                  "width=\"%.0f\" height=\"%.0f\" role=\"img\" aria-labelledby=\"title desc\" "
                  "xml:lang=\"%s\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"14\" "
                  "fill=\"%s\">\n",
                  page_width, ceil(f->height), page_width, ceil(f->height), f->labels->language,
                  ink);
    put_element(f, "title id=\"title\"", f->labels->title, "title");
    put_element(f, "desc id=\"desc\"", f->labels->description, "desc");
    (void)fputs("<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n", f->out);
}

/* The seven inputs, in one line. */
static void put_head(const struct figure *f)
{
    char value[NUMBER_BYTES];
    (void)fprintf(f->out, "<text x=\"%.1f\" y=\"26\" font-size=\"17\" font-weight=\"bold\">",
                  margin);
    put_words(f, f->labels->heading);
    (void)fprintf(f->out, "</text>\n<text x=\"%.1f\" y=\"46\" fill=\"#4a4a4a\">", margin);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        (void)snprintf(value, sizeof value, "%.4g", f->c->param[i]);
        (void)fprintf(f->out, "%s%s %s %s", i == 0 ? "" : " · ", ischia_params[i].key,
                      with_mark(f, value), ischia_params[i].unit);
    }
    (void)fputs("</text>\n", f->out);
}

enum { BAR_LEFT = 30, BAR_WIDTH = 430, BAR_HEIGHT = 16, LEGEND_LEFT = 520 };

static void put_bar_tick(const struct figure *f, double y, int band)
{
    const double x = BAR_LEFT + (double)BAR_WIDTH * band / BANDS;
    char value[NUMBER_BYTES];
    (void)snprintf(value, sizeof value, "%.2f", band * band_width);
    (void)fprintf(f->out,
                  "<path d=\"M%.1f %.1fv5\" stroke=\"%s\"/><text x=\"%.1f\" y=\"%.1f\" "
                  "text-anchor=\"middle\" font-size=\"12\">%s</text>\n",
                  x, y + BAR_HEIGHT, ink, x, y + BAR_HEIGHT + 18, with_mark(f, value));
}

static void put_colour_bar(const struct figure *f, double y)
{
    const double width = (double)BAR_WIDTH / BANDS;
    const double threshold = BAR_LEFT + width * ISCHIA_E_SHEAR_THRESHOLD / band_width;
    unsigned char rgb[3];
    (void)fprintf(f->out, "<text x=\"%d\" y=\"%.1f\">", BAR_LEFT, y - 12);
    put_words(f, f->labels->strain);
    put_symbol(f);
    (void)fputs("</text>\n", f->out);
    /* Each band reaches to the end of the bar, under the next: no seams. */
    for (int band = 0; band < BANDS; band++) {
        const double rest = BAR_WIDTH - width * band;
        colormap((double)band / (BANDS - 1), rgb);
        (void)fprintf(f->out,
                      "<path fill=\"#%02x%02x%02x\" d=\"M%.2f %.1fh%.2fl10 8l-10 8h-%.2fZ\"/>\n",
                      rgb[0], rgb[1], rgb[2], BAR_LEFT + width * band, y, rest, rest);
    }
    (void)fprintf(f->out, "<path d=\"M%d %.1fh%dl10 8l-10 8h-%dZ\" fill=\"none\" stroke=\"%s\"/>\n",
                  BAR_LEFT, y, BAR_WIDTH, BAR_WIDTH, ink);
    for (int band = 0; band <= BANDS; band += 2) put_bar_tick(f, y, band);
    (void)fprintf(f->out,
                  "<path d=\"M%.1f %.1fv%d\" stroke=\"#ffffff\" stroke-width=\"5\"/>"
                  "<path d=\"M%.1f %.1fv%d\" stroke=\"%s\" stroke-width=\"2\"/>\n",
                  threshold, y - 4, BAR_HEIGHT + 8, threshold, y - 4, BAR_HEIGHT + 8, ink);
}

/* Returns where the next one begins. */
static double put_swatch(const struct figure *f, double x, double y, const char *fill,
                         const char *name)
{
    const double letter_width = 7.5;
    (void)fprintf(f->out,
                  "<rect x=\"%.1f\" y=\"%.1f\" width=\"18\" height=\"14\" fill=\"%s\" "
                  "stroke=\"%s\" stroke-width=\"0.8\"/><text x=\"%.1f\" y=\"%.1f\">",
                  x, y, fill, ink, x + 25, y + 12);
    put_words(f, name);
    (void)fputs("</text>\n", f->out);
    return x + 45 + letter_width * (double)letters(name);
}

static void put_legend(const struct figure *f, double y)
{
    const struct {
        const char *fill, *name;
    } swatches[] = {{bone_fill, f->labels->bone},
                    {tissue_fill[TISSUE_FAT], f->labels->fat},
                    {tissue_fill[TISSUE_SKIN], f->labels->skin},
                    {seat_fill, f->labels->seat}};
    char value[NUMBER_BYTES];
    double x = LEGEND_LEFT;
    for (size_t i = 0; i < sizeof swatches / sizeof swatches[0]; i++)
        x = put_swatch(f, x, y, swatches[i].fill, swatches[i].name);
    (void)snprintf(value, sizeof value, "%.2f", ISCHIA_E_SHEAR_THRESHOLD);
    (void)fprintf(f->out,
                  "<path d=\"M%d %.1fh18\" stroke=\"%s\" stroke-width=\"2\"/>"
                  "<text x=\"%d\" y=\"%.1f\">",
                  LEGEND_LEFT, y + 31, ink, LEGEND_LEFT + 25, y + 36);
    put_words(f, f->labels->threshold);
    put_symbol(f);
    (void)fprintf(f->out, "<tspan dx=\"4\" dy=\"-3\">= %s</tspan></text>\n", with_mark(f, value));
}

static void put_scale_bar(const struct figure *f, double y)
{
    const double length = 10 * f->px_per_mm, right = page_width - margin;
    (void)fprintf(f->out,
                  "<path d=\"M%.1f %.1fv8m0 -4h%.1fm0 -4v8\" fill=\"none\" stroke=\"%s\" "
                  "stroke-width=\"1.5\"/><text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">10 mm"
                  "</text>\n",
                  right - length, y, length, ink, right - length / 2, y + 24);
}

static void put_figure(const struct figure *f)
{
    const double foot = f->seat_y + seat_height_mm * f->px_per_mm;
    double left = margin;
    put_opening(f);
    put_head(f);
    for (int s = 0; s < SECTION_PLANE_COUNT; s++) {
        put_panel(f, s, left);
        left += 2 * f->panel[s].reach_mm * f->px_per_mm + gap;
    }
    put_colour_bar(f, foot + 52);
    put_legend(f, foot + 46);
    put_scale_bar(f, foot + 49);
    (void)fputs("</svg>\n", f->out);
}

static enum ischia_code recover(struct figure *f, struct ischia_error *err)
{
    struct strain_field strains;
    f->shear = calloc((size_t)f->mesh->node_count, sizeof *f->shear);
    CHECK(f->shear != NULL, err, ISCHIA_E_MEMORY, "out of memory for the section's strains");
    TRY(strain_field_init(&strains, f->mesh, f->displacement_mm, err));
    const enum ischia_code code = section_recover_shear(f->mesh, &strains, f->shear, err);
    strain_field_finish(&strains);
    return code;
}

enum ischia_code section_svg_write(FILE *out, const struct ischia_case *c, const struct mesh *mesh,
                                   const double *displacement_mm,
                                   const struct ischia_section_labels *labels,
                                   struct ischia_error *err)
{
    struct figure f = {
        .out = out, .c = c, .labels = labels, .mesh = mesh, .displacement_mm = displacement_mm};
    enum ischia_code code = recover(&f, err);
    for (int s = 0; code == ISCHIA_OK && s < SECTION_PLANE_COUNT; s++)
        code = section_init(&f.panel[s].section, mesh, (enum section_plane)s, err);
    if (code == ISCHIA_OK) {
        lay_out(&f);
        put_figure(&f);
        if (fflush(out) != 0 || ferror(out))
            code = FAIL(err, ISCHIA_E_IO, "cannot write the section: %s", strerror(errno));
    }
    for (int s = 0; s < SECTION_PLANE_COUNT; s++) section_finish(&f.panel[s].section);
    free(f.shear);
    return code;
}
