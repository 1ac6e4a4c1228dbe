/* epsmesh.h is the interface. Formulas are in pipeline/realtime/, in the same order and under the same names. */
#include "epsmesh.h"

#include <float.h>
#include <math.h>
#include <string.h>

static const double PI = 3.14159265358979323846;
static const double FORMAT = 2.0, TOUCHING = 1e-12, SMALLEST = 1e-6, SLENDER = 0.02, SOFT = 1e-12, STICKS = 0.1;
static const double BALL_LIMIT = 0.6, NEGLIGIBLE = 1e-17, SAME = 4e-16;
static const double FOOT_SAME = 1e-13; /* of the region */
/* Of several tools: NEAR in units of both radii; see pipeline/realtime/doubt.py for the others. */
static const double NEAR = 2.0, SETTLED = 1e-8, FOURTH = 0.5, FOURTH_BLADE = 2.0, BENDS_BLADE = 2.0;
enum { STEPS = 60, TERMS = 40, FOOT_STEPS = 30, SETTLE_STEPS = 40 };

/* ---- the file: netCDF classic with 64-bit offsets ---- */

typedef struct {
    const unsigned char *data;
    size_t size, at;
    int failed;
} reader;

static const unsigned char *take(reader *r, size_t size) {
    if (r->failed || size > r->size - r->at) {
        r->failed = 1;
        return NULL;
    }
    r->at += size;
    return r->data + (r->at - size);
}

static unsigned long number(reader *r) {
    const unsigned char *b = take(r, 4);
    return b ? (unsigned long)b[0] << 24 | (unsigned long)b[1] << 16 | (unsigned long)b[2] << 8 | b[3] : 0;
}

static unsigned long count(reader *r, unsigned long most) {
    unsigned long found = number(r);
    if (found > most) r->failed = 1;
    return r->failed ? 0 : found;
}

static unsigned long listed(reader *r, unsigned long tag) {
    unsigned long found = number(r), length = count(r, 256);
    if (found != tag && (found || length)) r->failed = 1;
    return r->failed ? 0 : length;
}

static int name_is(const char *name, size_t length, const char *known) {
    return strlen(known) == length && memcmp(name, known, length) == 0;
}

static const char *read_name(reader *r, size_t *length) {
    *length = count(r, 256);
    return (const char *)take(r, (*length + 3) / 4 * 4);
}

static void skip_attributes(reader *r) {
    static const size_t bytes[] = {0, 1, 1, 2, 4, 4, 8};
    unsigned long i, n = listed(r, 12);
    for (i = 0; i < n && !r->failed; i++) {
        size_t length, kind, values;
        read_name(r, &length);
        kind = number(r), values = number(r);
        if (kind < 1 || kind > 6 || values > r->size) {
            r->failed = 1;
            return;
        }
        take(r, (values * bytes[kind] + 3) / 4 * 4);
    }
}

static double as_double(const unsigned char *b) {
    unsigned char native[8];
    const unsigned short one = 1;
    double value;
    int i, is_little = *(const unsigned char *)&one;
    for (i = 0; i < 8; i++) native[i] = b[is_little ? 7 - i : i];
    memcpy(&value, native, 8);
    return value;
}

typedef struct {
    const char *name;
    double *into;
    size_t room, length[4];
    int rank; /* -1: not yet found */
} wanted;

enum { WANTED = 27, OPTIONAL = 21, OF_PAIRS = 23 };

/* Return where the `n` doubles of a variable begin, or NULL if they are not all in the file. */
static const unsigned char *found_at(const reader *r, const unsigned char *begin, const size_t *shape, int rank,
                                     size_t *n) {
    size_t whole = 0;
    int i;
    for (*n = 1, i = 0; i < rank; i++) {
        if (shape[i] && *n > r->size / shape[i]) return NULL;
        *n *= shape[i];
    }
    for (i = 0; i < 8; i++) {
        if (whole > (r->size >> 8)) return NULL;
        whole = whole << 8 | begin[i];
    }
    return whole > r->size || *n > (r->size - whole) / 8 ? NULL : r->data + whole;
}

static int fill(wanted *w, const unsigned char *values, size_t n, const size_t *shape, int rank) {
    size_t i;
    if (rank > 4 || n == 0 || n > w->room) return 0;
    for (i = 0; i < (size_t)rank; i++) w->length[i] = shape[i];
    for (i = 0; i < n; i++) {
        w->into[i] = as_double(values + 8 * i);
        if (!isfinite(w->into[i])) return 0;
    }
    w->rank = rank;
    return 1;
}

static int read_variables(reader *r, wanted *w) {
    size_t lengths[256], length, shape[4], size;
    unsigned long i, n, j, rank, kind;
    const unsigned char *magic = take(r, 4), *begin, *values;
    if (!magic || memcmp(magic, "CDF\002", 4)) return 0;
    count(r, 256);
    n = listed(r, 10);
    for (i = 0; i < n; i++) {
        read_name(r, &length);
        lengths[i] = number(r);
    }
    skip_attributes(r);
    for (j = listed(r, 11); j > 0 && !r->failed; j--) {
        const char *name = read_name(r, &length);
        rank = count(r, 4);
        for (i = 0; i < rank; i++) {
            unsigned long dimension = number(r);
            if (dimension >= n) return 0;
            shape[i] = lengths[dimension];
        }
        skip_attributes(r);
        kind = number(r);
        number(r);
        begin = take(r, 8);
        if (!name || !begin) return 0;
        if (kind != 6) continue;
        values = found_at(r, begin, shape, (int)rank, &size);
        if (!values) return 0;
        for (i = 0; i < WANTED; i++)
            if (name_is(name, length, w[i].name) && !fill(&w[i], values, size, shape, (int)rank)) return 0;
    }
    return !r->failed;
}

/* ---- loading ---- */

static int is_sound(const epsmesh_model *m) {
    int i, j, k;
    for (i = 0; i < 3; i++) {
        if (m->bar[i] < 0) return 0;
        for (j = 0; j < 3; j++) {
            double dot = i == j ? -1.0 : 0.0;
            for (k = 0; k < 3; k++) dot += m->axes[i][k] * m->axes[j][k];
            if (!(fabs(dot) < 1e-9)) return 0;
        }
    }
    if (m->bar[3] < 0 || m->bend_error < 0) return 0;
    for (i = 0; i < 2; i++)
        if (!(0 < m->reach[i] && m->reach[i] < m->sides[i])) return 0;
    if (m->is_round && (m->counts[1] != 1 || m->face_counts[0] != 1 || !m->even[0] || !m->even[1])) return 0;
    if (!(m->off > 0 && m->aligned > 0 && m->aligned <= 0.5)) return 0;
    if (!(-1 < m->poisson_range[0] && m->poisson_range[0] <= m->poisson && m->poisson <= m->poisson_range[1])) return 0;
    if (m->poisson_range[1] > 0.5 || (m->counts[0] > 1 && m->poisson_range[0] == m->poisson_range[1])) return 0;
    return m->thickness > 0 && m->young > 0 && m->largest > 0 && m->largest <= 1;
}

/* Return whether a file's interaction of places, if it has one, is valid. */
static int has_pairs(epsmesh_model *m, const wanted *w) {
    int i, j, n, found = 0, rank, nodes;
    for (i = 0; i < WANTED - OF_PAIRS; i++) found += w[i].rank >= 0;
    m->has_pairs = found > 0;
    if (!found) return 1;
    if (found < WANTED - OF_PAIRS || m->pair_error < 0 || m->pair_aside < 0) return 0;
    if (w[0].length[0] > EPSMESH_MOST_MODES || w[1].length[0] > EPSMESH_MOST_LINKS) return 0;
    for (i = 1; i < 3; i++) {
        if (w[0].length[i] > EPSMESH_MOST || w[1].length[i] != w[0].length[0]) return 0;
        m->pair_counts[i + 1] = (int)w[0].length[i];
    }
    rank = m->pair_counts[1] = (int)w[0].length[0], nodes = m->pair_counts[0] = (int)w[1].length[0];
    for (n = 0; n < nodes; n++)
        for (i = 0; i < rank; i++)
            for (j = 0; j < i; j++)
                if (m->pair_links[(n * rank + i) * rank + j] != m->pair_links[(n * rank + j) * rank + i]) return 0;
    return nodes == 1 || m->poisson_range[0] < m->poisson_range[1];
}

epsmesh_status epsmesh_load(epsmesh_model *m, const void *data, size_t size) {
    double format, is_round, even[2], leans;
    reader r;
    int i;
    wanted w[WANTED] = {
        {"reciprocal", m->reciprocal, EPSMESH_MOST_IN_ALL, {0}, -1},
        {"curvature", m->curvature, EPSMESH_MOST_IN_ALL, {0}, -1},
        {"axes", m->axes[0], 9, {0}, -1},
        {"origin", m->origin, 3, {0}, -1},
        {"bar", m->bar, 4, {0}, -1},
        {"reach", m->reach, 2, {0}, -1},
        {"sides", m->sides, 2, {0}, -1},
        {"poisson_range", m->poisson_range, 2, {0}, -1},
        {"format", &format, 1, {0}, -1},
        {"is_round", &is_round, 1, {0}, -1},
        {"c_ref", &m->c_ref, 1, {0}, -1},
        {"thickness", &m->thickness, 1, {0}, -1},
        {"young", &m->young, 1, {0}, -1},
        {"poisson", &m->poisson, 1, {0}, -1},
        {"largest", &m->largest, 1, {0}, -1},
        {"off", &m->off, 1, {0}, -1},
        {"aligned", &m->aligned, 1, {0}, -1},
        {"leans", &leans, 1, {0}, -1},
        {"even", even, 2, {0}, -1},
        {"height", m->height, EPSMESH_MOST_IN_ALL, {0}, -1},
        {"bend", m->bend, EPSMESH_MOST_IN_ALL, {0}, -1},
        {"tensors", m->tensors, EPSMESH_TENSORS * EPSMESH_MOST_IN_ALL, {0}, -1}, /* may be missing, as may */
        {"bend_error", &m->bend_error, 1, {0}, -1},
        {"pair_modes", m->pair_modes, EPSMESH_MOST_TERMS, {0}, -1},
        {"pair_links", m->pair_links, EPSMESH_MOST_LINKS * EPSMESH_MOST_MODES * EPSMESH_MOST_MODES, {0}, -1},
        {"pair_error", &m->pair_error, 1, {0}, -1},
        {"pair_aside", &m->pair_aside, 1, {0}, -1},
    };
    static const int ranks[WANTED] = {3, 3, 2, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 2, 4, 0, 3, 3, 0, 0};
    static const size_t firsts[] = {3, 3, 4, 2, 2, 2};
    m->is_loaded = 0, m->bend_error = 0;
    r.data = (const unsigned char *)data, r.size = size, r.at = 0, r.failed = data == NULL;
    if (!read_variables(&r, w)) return EPSMESH_NO_MODEL;
    for (i = 0; i < WANTED; i++)
        if ((i < OPTIONAL || w[i].rank >= 0) && w[i].rank != ranks[i]) return EPSMESH_NO_MODEL;
    for (i = 0; i < WANTED; i++)
        if ((i >= 2 && i < 8 && w[i].length[0] != firsts[i - 2])) return EPSMESH_NO_MODEL;
    if (w[2].length[1] != 3 || format != FORMAT || (is_round != 0 && is_round != 1)) return EPSMESH_NO_MODEL;
    if ((leans != 0 && leans != 1) || w[18].length[0] != 2) return EPSMESH_NO_MODEL;
    m->is_round = is_round == 1, m->leans = leans == 1, m->has_tensors = w[OPTIONAL].rank == 4;
    for (i = 0; i < 2; i++) {
        if ((even[i] != 0 && even[i] != 1) || w[19].length[i] != w[20].length[i]) return EPSMESH_NO_MODEL;
        if (w[19].length[i] > EPSMESH_MOST) return EPSMESH_NO_MODEL;
        m->even[i] = even[i] == 1, m->face_counts[i] = (int)w[19].length[i];
    }
    if (m->has_tensors && w[OPTIONAL].length[0] != EPSMESH_TENSORS) return EPSMESH_NO_MODEL;
    for (i = 0; i < 3; i++) {
        if (w[0].length[i] != w[1].length[i]) return EPSMESH_NO_MODEL;
        if (m->has_tensors && w[OPTIONAL].length[i + 1] != w[0].length[i]) return EPSMESH_NO_MODEL;
        if (w[0].length[i] > EPSMESH_MOST) return EPSMESH_NO_MODEL;
        m->counts[i] = (int)w[0].length[i];
    }
    m->is_flat = 1;
    for (i = 0; i < m->face_counts[0] * m->face_counts[1]; i++)
        if (m->height[i] != 0 || m->bend[i] != 0) m->is_flat = 0;
    /* Files of earlier versions lack it, and are too inaccurate for a curved face. */
    if (!m->is_flat && w[OPTIONAL + 1].rank < 0) return EPSMESH_NO_MODEL;
    if (!has_pairs(m, w + OF_PAIRS)) return EPSMESH_NO_MODEL;
    m->is_loaded = is_sound(m);
    return m->is_loaded ? EPSMESH_OK : EPSMESH_NO_MODEL;
}

/* ---- the table ---- */

typedef struct {
    double c, h, tilt, slope_c[2], slope_h[2], slope_tilt[2], plane, poisson, bend, slope_bend[2];
    double bent[2], bent_slopes[2][2], lean[2], hessian[2][2], regular[3][3]; /* of blades and bonded tools */
} place;

typedef struct {
    double f, slope[2], xx, xy, yy;
} value;

typedef struct {
    double nu[3][EPSMESH_MOST], left[3][EPSMESH_MOST], right[3][EPSMESH_MOST];
} terms;

static void polynomials(double at, int n, double p[3][EPSMESH_MOST]) {
    int i;
    p[0][0] = 1, p[1][0] = p[2][0] = 0;
    if (n > 1) p[0][1] = at, p[1][1] = 1, p[2][1] = 0;
    for (i = 2; i < n; i++) {
        p[2][i] = 2 * at * p[2][i - 1] + 4 * p[1][i - 1] - p[2][i - 2];
        p[1][i] = 2 * at * p[1][i - 1] + 2 * p[0][i - 1] - p[1][i - 2];
        p[0][i] = 2 * at * p[0][i - 1] - p[0][i - 2];
    }
}

static void directions(const epsmesh_model *m, double x, double y, int rows, int columns, terms *p) {
    double a = m->reach[0], b = m->reach[1], u, v;
    if (m->is_round) {
        u = 2 * (x * x + y * y) / (a * a) - 1, v = 0;
    } else {
        u = m->even[0] ? 2 * (x / a) * (x / a) - 1 : x / a;
        v = m->even[1] ? 2 * (y / b) * (y / b) - 1 : y / b;
    }
    polynomials(v, rows, p->left);
    polynomials(u, columns, p->right);
}

static value along(const epsmesh_model *m, const double *table, const terms *p, const int counts[3], double x, double y) {
    int i, j, k, rows = counts[1], columns = counts[2];
    double f = 0, fu = 0, fv = 0, fuu = 0, fuv = 0, fvv = 0, a = m->reach[0], b = m->reach[1], bend = 4 / (a * a);
    value found;
    for (j = 0; j < rows; j++) {
        double sum[3] = {0, 0, 0};
        for (k = 0; k < columns; k++) {
            double flat = 0;
            for (i = 0; i < counts[0]; i++) flat += p->nu[0][i] * table[(i * rows + j) * columns + k];
            sum[0] += flat * p->right[0][k], sum[1] += flat * p->right[1][k], sum[2] += flat * p->right[2][k];
        }
        f += p->left[0][j] * sum[0], fu += p->left[0][j] * sum[1], fuu += p->left[0][j] * sum[2];
        fv += p->left[1][j] * sum[0], fuv += p->left[1][j] * sum[1], fvv += p->left[2][j] * sum[0];
    }
    found.f = f;
    if (m->is_round) {
        double ux = bend * x, uy = bend * y;
        found.slope[0] = fu * ux, found.slope[1] = fu * uy;
        found.xx = fuu * ux * ux + fu * bend, found.xy = fuu * ux * uy, found.yy = fuu * uy * uy + fu * bend;
    } else {
        double ux = m->even[0] ? bend * x : 1 / a, uxx = m->even[0] ? bend : 0;
        double vy = m->even[1] ? 4 / (b * b) * y : 1 / b, vyy = m->even[1] ? 4 / (b * b) : 0;
        found.slope[0] = fu * ux, found.slope[1] = fv * vy;
        found.xx = fuu * ux * ux + fu * uxx, found.xy = fuv * ux * vy, found.yy = fvv * vy * vy + fv * vyy;
    }
    return found;
}

/* Values for blades and bonded tools; the factors of the seven tables are those of pipeline/realtime/table.py. */
static void shape_at(const epsmesh_model *m, const terms *s, double x, double y, double t, const double slope_t[2],
                     place *p) {
    double xi = m->even[0] ? x / m->reach[0] : 1, eta = m->even[1] ? y / m->reach[1] : 1;
    double of_x = m->even[0] ? 1 / m->reach[0] : 0, of_y = m->even[1] ? 1 / m->reach[1] : 0;
    double f[EPSMESH_TENSORS], g, own[2];
    size_t whole = (size_t)m->counts[0] * (size_t)m->counts[1] * (size_t)m->counts[2];
    int i, k;
    for (k = 0; k < EPSMESH_TENSORS; k++) {
        value v = along(m, m->tensors + (size_t)k * whole, s, m->counts, x, y);
        g = 1, own[0] = own[1] = 0;
        if ((k == 0 || k == 5) && m->is_round) g = xi * xi - eta * eta, own[0] = 2 * xi * of_x, own[1] = -2 * eta * of_y;
        if (k == 1 || k == 6) g = 2 * xi * eta, own[0] = 2 * eta * of_x, own[1] = 2 * xi * of_y;
        if (k == 2) g = xi;
        if (k == 3) g = eta;
        f[k] = g * v.f;
        for (i = 0; i < 2 && k < 2; i++)
            p->bent_slopes[k][i] = ((g * v.slope[i] + v.f * own[i]) - 3 * f[k] * slope_t[i] / t) / (t * t * t);
    }
    p->bent[0] = f[0] / (t * t * t), p->bent[1] = f[1] / (t * t * t);
    p->regular[0][0] = (f[4] + f[5]) / t, p->regular[1][1] = (f[4] - f[5]) / t, p->regular[2][2] = p->c;
    p->regular[0][1] = p->regular[1][0] = f[6] / t;
    p->regular[0][2] = p->regular[2][0] = f[2] / t;
    p->regular[1][2] = p->regular[2][1] = f[3] / t;
}

static int place_at(const epsmesh_model *m, double x, double y, double ratio, int whole, place *p) {
    double t, q, low = m->poisson_range[0], high = m->poisson_range[1];
    value of_t, of_q;
    terms s;
    int i, j;
    polynomials(high == low ? 0 : (2 * ratio - low - high) / (high - low), m->counts[0], s.nu);
    directions(m, x, y, m->counts[1], m->counts[2], &s);
    of_t = along(m, m->reciprocal, &s, m->counts, x, y);
    of_q = along(m, m->curvature, &s, m->counts, x, y);
    t = of_t.f, q = of_q.f;
    if (!(t > 0)) return 0;
    for (i = 0; i < 2; i++) {
        p->slope_c[i] = -of_t.slope[i] / (t * t);
        p->slope_h[i] = of_q.slope[i] / (t * t * t) - 3 * q * of_t.slope[i] / (t * t * t * t);
        for (j = 0; j < 2; j++) {
            double second = i == j ? (i ? of_t.yy : of_t.xx) : of_t.xy;
            p->hessian[i][j] = m->leans ? 2 * of_t.slope[i] * of_t.slope[j] / (t * t * t) - second / (t * t) : 0;
        }
    }
    for (i = 0; i < 2; i++) {
        p->lean[i] = m->leans ? p->slope_c[i] : 0;
        p->slope_tilt[i] = 0.5 * (p->hessian[i][0] * p->slope_c[0] + p->hessian[i][1] * p->slope_c[1]);
    }
    p->tilt = 0.25 * (p->lean[0] * p->lean[0] + p->lean[1] * p->lean[1]);
    p->c = 1 / t - m->c_ref, p->h = q / (t * t * t), p->plane = 1 / (1 - ratio * ratio), p->poisson = ratio;
    p->bend = p->slope_bend[0] = p->slope_bend[1] = p->bent[0] = p->bent[1] = 0;
    if (whole) shape_at(m, &s, x, y, t, of_t.slope, p);
    return 1;
}

/* ---- the face ---- */

typedef struct {
    double height, slope[2], second[2][2], bend, slope_bend[2], normal[3];
} spot;

static spot face_at(const epsmesh_model *m, double x, double y) {
    spot f = {0, {0, 0}, {{0, 0}, {0, 0}}, 0, {0, 0}, {0, 0, 1}};
    int counts[3], i;
    double steep;
    terms s;
    value z, bend;
    if (m->is_flat) return f;
    counts[0] = 1, counts[1] = m->face_counts[0], counts[2] = m->face_counts[1];
    s.nu[0][0] = 1;
    directions(m, x, y, counts[1], counts[2], &s);
    z = along(m, m->height, &s, counts, x, y);
    bend = along(m, m->bend, &s, counts, x, y);
    f.height = z.f, f.bend = bend.f;
    f.second[0][0] = z.xx, f.second[1][1] = z.yy, f.second[0][1] = f.second[1][0] = z.xy;
    steep = sqrt(1 + z.slope[0] * z.slope[0] + z.slope[1] * z.slope[1]);
    for (i = 0; i < 2; i++) {
        f.slope[i] = z.slope[i], f.slope_bend[i] = bend.slope[i];
        f.normal[i] = -z.slope[i] / steep;
    }
    f.normal[2] = 1 / steep;
    return f;
}

/* The force on a tool whose tip is at p - d n: its work is the decrease of the energy. */
static void force_at(const spot *f, double push, const double aside[2], double depth, double out[3]) {
    double steep = sqrt(1 + f->slope[0] * f->slope[0] + f->slope[1] * f->slope[1]), m[2][2], det, x, y;
    int i, j;
    for (i = 0; i < 2; i++)
        for (j = 0; j < 2; j++) m[i][j] = (i == j) + f->slope[i] * f->slope[j] + depth / steep * f->second[i][j];
    det = m[0][0] * m[1][1] - m[0][1] * m[1][0];
    x = (m[1][1] * aside[0] - m[0][1] * aside[1]) / det, y = (m[0][0] * aside[1] - m[1][0] * aside[0]) / det;
    out[0] = push * f->normal[0] + x, out[1] = push * f->normal[1] + y;
    out[2] = push * f->normal[2] + x * f->slope[0] + y * f->slope[1];
}

/* ---- contact ---- */

typedef struct {
    double force, aside[2], stiffness, radius, mean_square;
} contact;

typedef struct {
    double depth, slope, force, square, growth, compliance;
} pressed;

static double cube(double x) { return x * x * x; }
static double fifth(double x) { return x * x * x * x * x; }

static double tangent(double a, const place *p) {
    return 0.5 / (p->plane * a) + p->c + a * a / 3 * p->h - 2.0 / 45 * p->plane * p->h * p->h * fifth(a);
}

static contact press_disc(double a, double depth, const place *p) {
    double stiff = p->plane, h = p->h;
    contact k;
    int i;
    k.force = depth / (tangent(a, p) - 4.0 / 3 * stiff * cube(a) * p->tilt);
    for (i = 0; i < 2; i++) {
        double slope = p->slope_c[i] + p->slope_h[i] * (a * a / 3 - 4.0 / 45 * stiff * h * fifth(a));
        k.aside[i] = 0.5 * k.force * k.force * (slope - 4.0 / 3 * stiff * cube(a) * p->slope_tilt[i]);
    }
    k.stiffness = k.force / depth, k.radius = a;
    k.mean_square = 2.0 / 3 * a * a - 8.0 / 45 * stiff * h * fifth(a);
    return k;
}

/* D(s), D'(s), and the integrals of D and s^2 D from 0 to s */
static void profile(const epsmesh_query *tool, double s, double out[4]) {
    if (tool->shape == EPSMESH_SPHERE) {
        double big = tool->radius, t = (s / big) * (s / big), power = t, sum[4] = {0, 0, 0, 0};
        int k;
        for (k = 0; k < TERMS; k++) {
            double term = power / (2 * k + 1);
            sum[0] += term, sum[1] += (2 * k + 2) * term;
            sum[2] += term / (2 * k + 3), sum[3] += term / (2 * k + 5);
            if (term <= NEGLIGIBLE * sum[0]) break;
            power *= t;
        }
        out[0] = big * sum[0], out[1] = big / s * sum[1], out[2] = big * s * sum[2], out[3] = big * cube(s) * sum[3];
    } else {
        double steep = 0.5 * PI / tan(tool->angle);
        out[0] = steep * s, out[1] = steep, out[2] = steep * s * s / 2, out[3] = steep * s * s * s * s / 4;
    }
}

static pressed press_to(double a, const epsmesh_query *tool, const place *p) {
    double stiff = p->plane, h = p->h, d[4], own = 1 - 2.0 / 3 * stiff * h * cube(a), power, effect;
    pressed k = {-1, 0, 0, 0, 0, 0};
    if (!(own > 0)) return k;
    profile(tool, a, d);
    d[0] += p->bend * a * a, d[1] += 2 * p->bend * a, d[2] += p->bend * cube(a) / 3, d[3] += p->bend * fifth(a) / 5;
    k.force = 2 * stiff * (a * d[0] - d[2]) / own;
    k.square = 4 * stiff * (cube(a) / 3 * d[0] - d[3]) + 4.0 / 15 * stiff * h * k.force * fifth(a);
    k.growth = 2 * stiff * a * d[1] + 2 * stiff * h * k.force * a * a;
    if (k.growth <= 0 || k.force <= 0) {
        pressed none = {-1, 0, 0, 0, 0, 0};
        return none;
    }
    power = own / k.growth * k.force / a;
    effect = -2.0 / 3 * stiff * p->tilt * cube(a) * k.force * (2 + 3 * power);
    k.depth = d[0] + 0.5 * h * k.force * a * a + p->c * k.force + 0.25 * h * k.square + effect;
    k.compliance = tangent(a, p) + effect * (1 + 3 * power) / k.force;
    k.slope = k.compliance * k.growth / own;
    return k;
}

static int press_round(const epsmesh_query *tool, const place *p, double most, contact *k) {
    double limit = tool->shape == EPSMESH_SPHERE ? BALL_LIMIT * tool->radius : tool->radius, depth = tool->depth;
    double low = 0, high = most < limit ? most : limit, a, step, of_h, of_tilt;
    pressed found;
    int i;
    if (!(press_to(high, tool, p).depth >= depth)) return 0;
    a = tool->shape == EPSMESH_SPHERE ? sqrt(tool->radius * depth) : 2 / PI * depth * tan(tool->angle);
    if (!(a < 0.5 * high)) a = 0.5 * high;
    for (i = 0; i < STEPS; i++) {
        found = press_to(a, tool, p);
        if (found.depth < depth) low = a; else high = a;
        step = found.slope > 0 ? a - (found.depth - depth) / found.slope : low;
        if (!(low < step && step < high)) step = 0.5 * (low + high);
        if (fabs(step - a) <= SAME * a) break;
        a = step;
    }
    found = press_to(a, tool, p);
    k->force = found.force, k->stiffness = 1 / found.compliance, k->radius = a;
    k->mean_square = found.square / found.force;
    of_h = 0.25 * found.force * found.force * k->mean_square +
           4.0 / 3 * p->plane * p->plane * p->tilt * fifth(a) * cube(found.force) / found.growth;
    of_tilt = -2.0 / 3 * p->plane * cube(a) * found.force * found.force;
    for (i = 0; i < 2; i++)
        k->aside[i] = 0.5 * found.force * found.force * p->slope_c[i] + of_h * p->slope_h[i] +
                      of_tilt * p->slope_tilt[i] + 0.5 * found.square * p->slope_bend[i];
    return 1;
}

/* A rectangle's stiffness, second moments and tilting stiffness: pipeline/realtime/blade.py */
static const double RECTANGLE[5][8] = {
    {1.5467288, -0.5389724, 0.154788, -0.0121522, 0.0020102, -0.0001257, 6e-06, -1.4e-06},
    {0.4134192, 0.0443058, 0.0039289, -0.0011234, -0.0003526, 1.7e-06, 2.01e-05, 4.2e-06},
    {0.484368, -0.0181444, -0.0053293, -0.0007768, 1.19e-05, 3.22e-05, 7.5e-06, 8e-07},
    {1.8450174, -0.0168921, 0.2328837, 0.0145178, 0.0050319, 0.0002247, -2e-06, -6.7e-06},
    {1.7362244, 0.2238417, 0.0903649, 0.0247386, 0.0048149, 0.0006582, 5.88e-05, 3.6e-06},
};

static int press_blade(const epsmesh_query *q, const double edge[2], const place *p, double most, contact *k) {
    double big = 0.5 * (q->length > q->width ? q->length : q->width), c8[3][EPSMESH_MOST], r[5] = {0, 0, 0, 0, 0};
    double small = 0.5 * (q->length > q->width ? q->width : q->length), e[2][2], lean[2], twice[2], mean, half, soft;
    double of_place[2], along_edge, across;
    int i, j;
    if (sqrt(big * big + small * small) > most) return 0;
    polynomials(1 - 2 * log(small / big) / log(SLENDER), 8, c8);
    for (i = 0; i < 5; i++)
        for (j = 0; j < 8; j++) r[i] += RECTANGLE[i][j] * c8[0][j];
    for (i = 0; i < 2; i++) e[0][i] = edge[i];
    if (q->length < q->width) e[0][0] = -edge[1], e[0][1] = edge[0];
    e[1][0] = -e[0][1], e[1][1] = e[0][0];
    along_edge = r[1] * big * big, across = r[2] * small * small;
    lean[0] = p->plane * r[3] * big * big * sqrt(big * small), lean[1] = p->plane * r[4] * small * small * big;
    twice[0] = e[0][0] * e[0][0] - e[0][1] * e[0][1], twice[1] = 2 * e[0][0] * e[0][1];
    mean = (along_edge + across) / 2, half = along_edge - across;
    soft = 1 / (p->plane * r[0] * 2 * sqrt(big * small)) + p->c + mean * p->h +
           half * (twice[0] * p->bent[0] + twice[1] * p->bent[1]);
    for (i = 0; i < 2; i++)
        of_place[i] = p->slope_c[i] + mean * p->slope_h[i] +
                      half * (twice[0] * p->bent_slopes[0][i] + twice[1] * p->bent_slopes[1][i]);
    for (j = 0; j < 2; j++) {
        double slope = p->lean[0] * e[j][0] + p->lean[1] * e[j][1];
        soft -= lean[j] * slope * slope / 4;
        for (i = 0; i < 2; i++)
            of_place[i] -= lean[j] / 2 * slope * (p->hessian[i][0] * e[j][0] + p->hessian[i][1] * e[j][1]);
    }
    k->force = q->depth / soft, k->stiffness = 1 / soft, k->radius = sqrt(big * big + small * small);
    k->mean_square = along_edge + across;
    for (i = 0; i < 2; i++) k->aside[i] = 0.5 * k->force * k->force * of_place[i];
    return 1;
}

/* The last column of the inverse of compliances, as force per depth. */
static contact press_bonded(double a, double depth, const place *p) {
    double shear = 0.5 / (1 + p->poisson), soft = 1 - 2 * p->poisson, xx, yy, zz, xy, xz, yz, det;
    double down = 4 * shear * a * (soft > SOFT ? log(1 + 2 * soft) / soft : 2);
    double aside = 8 * shear * a / (2 - p->poisson);
    contact k;
    xx = p->regular[0][0] + 1 / aside, yy = p->regular[1][1] + 1 / aside, xy = p->regular[0][1];
    xz = p->regular[0][2], yz = p->regular[1][2], zz = p->regular[2][2] + 1 / down + a * a / 3 * p->h;
    det = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
    k.force = depth * (xx * yy - xy * xy) / det, k.stiffness = k.force / depth;
    k.aside[0] = depth * (xy * yz - xz * yy) / det, k.aside[1] = depth * (xy * xz - xx * yz) / det;
    k.radius = a, k.mean_square = 2.0 / 3 * a * a;
    return k;
}

/* ---- queries ---- */

static double smaller(double a, double b) { return a < b ? a : b; }

static double room_at(const epsmesh_model *m, double x, double y) {
    if (m->is_round) return smaller(m->sides[0] - sqrt(x * x + y * y), m->thickness);
    return smaller(smaller(m->sides[0] - fabs(x), m->sides[1] - fabs(y)), m->thickness);
}

static int is_positive(double x) { return isfinite(x) && x > 0; }

/* Return whether the model has this tool; `edge` is the direction of a blade on the face. */
static epsmesh_status tool_of(const epsmesh_model *m, const epsmesh_query *q, double edge[2]) {
    int i, j, is_blade = q->shape == EPSMESH_BLADE, has_angle = q->shape == EPSMESH_CONE;
    edge[0] = 1, edge[1] = 0;
    if ((int)q->shape < EPSMESH_DISC || (int)q->shape > EPSMESH_BONDED_DISC) return EPSMESH_TOOL;
    if ((is_blade || q->shape == EPSMESH_BONDED_DISC) && !m->has_tensors) return EPSMESH_TOOL;
    if (!is_blade) {
        if (!isfinite(q->radius) || (has_angle && !isfinite(q->angle))) return EPSMESH_TOOL;
        if (q->radius < SMALLEST || (has_angle && !(0.01 <= q->angle && q->angle <= PI / 2 - 0.001)))
            return EPSMESH_INPUT;
        return EPSMESH_OK;
    }
    if (!isfinite(q->length) || !isfinite(q->width)) return EPSMESH_TOOL;
    if (q->length < SMALLEST || q->width < SMALLEST) return EPSMESH_INPUT;
    if (!isfinite(q->along[0]) || !isfinite(q->along[1]) || !isfinite(q->along[2])) return EPSMESH_INPUT;
    if (q->along[0] != 0 || q->along[1] != 0 || q->along[2] != 0) {
        double size;
        for (i = 0; i < 2; i++)
            for (edge[i] = 0, j = 0; j < 3; j++) edge[i] += m->axes[i][j] * q->along[j];
        size = sqrt(edge[0] * edge[0] + edge[1] * edge[1]);
        if (!is_positive(size)) return EPSMESH_INPUT;
        edge[0] /= size, edge[1] /= size;
    }
    return q->width < SLENDER * q->length || q->length < SLENDER * q->width ? EPSMESH_TOOL : EPSMESH_OK;
}

static epsmesh_status misfit(const epsmesh_model *m, const epsmesh_query *q, double local[3], double edge[2], spot *f) {
    double length = 0, inward = 0, shift;
    epsmesh_status status;
    int i, j;
    if (!m->is_loaded) return EPSMESH_NO_MODEL;
    status = tool_of(m, q, edge);
    if (status != EPSMESH_OK) return status;
    if (!isfinite(q->depth) || !isfinite(q->poisson) || !is_positive(q->young)) return EPSMESH_INPUT;
    for (i = 0; i < 3; i++) {
        local[i] = 0;
        for (j = 0; j < 3; j++) {
            shift = q->at[j] - m->origin[j];
            local[i] += m->axes[i][j] * shift;
        }
        if (!isfinite(local[i])) return EPSMESH_INPUT;
    }
    if (m->is_round ? !(local[0] * local[0] + local[1] * local[1] <= m->reach[0] * m->reach[0])
                    : !(fabs(local[0]) <= m->reach[0] && fabs(local[1]) <= m->reach[1]))
        return EPSMESH_OUTSIDE;
    *f = face_at(m, local[0], local[1]);
    for (i = 0; i < 3; i++) {
        if (!isfinite(q->axis[i])) return EPSMESH_INPUT;
        length += q->axis[i] * q->axis[i];
        for (j = 0; j < 3; j++) inward -= f->normal[i] * m->axes[i][j] * q->axis[j];
    }
    if (!isfinite(length)) return EPSMESH_INPUT;
    if (length > 0 && !(inward / sqrt(length) >= 1 - 0.5 * m->aligned * m->aligned)) return EPSMESH_TILTED;
    if (!(fabs(local[2] - f->height) <= m->off)) return EPSMESH_OFF;
    if (!(m->poisson_range[0] <= q->poisson && q->poisson <= m->poisson_range[1])) return EPSMESH_POISSON;
    if (q->depth >= m->thickness) return EPSMESH_DEEP;
    return q->depth <= TOUCHING ? EPSMESH_LOST : EPSMESH_OK;
}

/* Move a place to about the nearest one of the region; return whether it was outside. */
static int into_region(const epsmesh_model *m, double place[2]) {
    double r = sqrt(place[0] * place[0] + place[1] * place[1]);
    int i, was_outside = 0;
    for (i = 0; i < 2; i++) {
        double size = m->is_round ? r : fabs(place[i]);
        if (size > m->reach[i]) place[i] *= m->reach[i] / size * (1 - 1e-15), was_outside = 1;
    }
    return was_outside;
}

/* Newton's method for (tip - p) . dp/dx = (tip - p) . dp/dy = 0, from the place straight above. */
static epsmesh_status curved_foot(const epsmesh_model *m, const double tip[3], double foot[3], double *depth) {
    double place[2] = {tip[0], tip[1]};
    int i, j, steps, cuts = into_region(m, place);
    for (steps = 0; steps < FOOT_STEPS; steps++) {
        spot f = face_at(m, place[0], place[1]);
        double above = tip[2] - f.height, off[2], k[2][2], det, step[2];
        if (steps == 0 && !cuts && above >= 0) return EPSMESH_LOST;
        for (i = 0; i < 2; i++) {
            off[i] = tip[i] - place[i] + above * f.slope[i];
            for (j = 0; j < 2; j++) k[i][j] = (i == j) + f.slope[i] * f.slope[j] - above * f.second[i][j];
        }
        det = k[0][0] * k[1][1] - k[0][1] * k[1][0];
        if (!(det > 0 && k[0][0] > 0)) return EPSMESH_DEEP;
        step[0] = (k[1][1] * off[0] - k[0][1] * off[1]) / det, step[1] = (k[0][0] * off[1] - k[1][0] * off[0]) / det;
        if (fabs(step[0]) <= FOOT_SAME * m->reach[0] && fabs(step[1]) <= FOOT_SAME * m->reach[1]) {
            foot[0] = place[0], foot[1] = place[1], foot[2] = f.height;
            *depth = -above / f.normal[2];
            return above < 0 ? EPSMESH_OK : EPSMESH_LOST;
        }
        for (i = 0; i < 2; i++) place[i] += step[i];
        /* If steps end at the border several times, the place is outside. */
        if (into_region(m, place) && ++cuts > 2) return EPSMESH_OUTSIDE;
    }
    return EPSMESH_DEEP;
}

epsmesh_status epsmesh_foot(const epsmesh_model *m, const double tip[3], double at[3], double *depth) {
    double local[3], foot[3];
    epsmesh_status status;
    int i, j;
    if (!m->is_loaded) return EPSMESH_NO_MODEL;
    for (i = 0; i < 3; i++) {
        for (local[i] = 0, j = 0; j < 3; j++) local[i] += m->axes[i][j] * (tip[j] - m->origin[j]);
        if (!isfinite(local[i])) return EPSMESH_INPUT;
    }
    if (m->is_flat) {
        if (local[2] >= 0) return EPSMESH_LOST;
        foot[0] = local[0], foot[1] = local[1], foot[2] = 0, *depth = -local[2];
    } else {
        status = curved_foot(m, local, foot, depth);
        if (status != EPSMESH_OK) return status;
    }
    for (i = 0; i < 3; i++)
        for (at[i] = m->origin[i], j = 0; j < 3; j++) at[i] += foot[j] * m->axes[j][i];
    return EPSMESH_OK;
}

static epsmesh_touch all(epsmesh_status status, double number) {
    epsmesh_touch t;
    t.status = status;
    t.force[0] = t.force[1] = t.force[2] = t.force_error = t.stiffness = t.contact_radius = number;
    return t;
}

epsmesh_query epsmesh_ask(const epsmesh_model *m) {
    epsmesh_query q;
    memset(&q, 0, sizeof q);
    q.radius = q.angle = q.depth = q.at[0] = q.at[1] = q.at[2] = (double)NAN;
    q.length = q.width = (double)NAN;
    q.young = m->young, q.poisson = m->poisson;
    return q;
}

/* A valid query, with the values at its place. */
typedef struct {
    double local[3], edge[2], room;
    spot f;
    place p;
} asked;

static int surveyed(const epsmesh_model *m, const epsmesh_query *q, asked *a) {
    if (!place_at(m, a->local[0], a->local[1], q->poisson, q->shape >= EPSMESH_BLADE, &a->p)) return 0;
    a->p.bend = a->f.bend, a->p.slope_bend[0] = a->f.slope_bend[0], a->p.slope_bend[1] = a->f.slope_bend[1];
    a->room = room_at(m, a->local[0], a->local[1]);
    return 1;
}

/* Return whether the contact of a tool at a depth of its query is small enough. */
static int press(const epsmesh_model *m, const epsmesh_query *q, const asked *a, contact *k) {
    double most = m->largest * a->room;
    if (q->shape == EPSMESH_BLADE) return press_blade(q, a->edge, &a->p, most, k);
    if (q->shape == EPSMESH_SPHERE || q->shape == EPSMESH_CONE) return press_round(q, &a->p, most, k);
    *k = q->shape == EPSMESH_DISC ? press_disc(q->radius, q->depth, &a->p) : press_bonded(q->radius, q->depth, &a->p);
    return q->radius <= most;
}

static double bar_of(const epsmesh_model *m, const epsmesh_query *q, const asked *a, const contact *k) {
    double share = (k->radius / a->room) * (k->radius / a->room), error;
    double bent = fabs(a->p.h) + 2 * sqrt(a->p.bent[0] * a->p.bent[0] + a->p.bent[1] * a->p.bent[1]);
    double sticks = q->shape == EPSMESH_BONDED_DISC ? STICKS * (1 - 2 * q->poisson) * k->radius / a->room : 0;
    error = m->bar[3] + k->stiffness * ((m->bar[0] + m->bar[2] * share * share + sticks) / a->room +
                                        m->bar[1] * bent * k->mean_square);
    if (q->shape == EPSMESH_SPHERE || q->shape == EPSMESH_CONE) {
        double growth = 3 * k->stiffness / k->force - 2 / q->depth;
        error += m->bend_error / 2 * k->mean_square * (growth > 0 ? growth : 0);
    }
    return error;
}

/* Return a contact in the body's coordinates, of a tool at `depth` by itself. */
static epsmesh_touch told(const epsmesh_model *m, double young, double depth, const asked *a, const contact *k,
                          double error) {
    epsmesh_touch t;
    double force[3];
    int i, j;
    t.status = EPSMESH_OK, t.stiffness = young * k->stiffness, t.contact_radius = k->radius, t.force_error = error;
    force_at(&a->f, k->force, k->aside, depth, force);
    for (i = 0; i < 3; i++)
        for (t.force[i] = 0, j = 0; j < 3; j++) t.force[i] += young * force[j] * m->axes[j][i];
    if (!(k->force > 0 && is_positive(t.stiffness) && t.force_error >= 0 && isfinite(t.force_error) &&
          isfinite(t.force[0]) && isfinite(t.force[1]) && isfinite(t.force[2])))
        return all(EPSMESH_DAMAGED, (double)NAN);
    return t;
}

epsmesh_touch epsmesh_touch_at(const epsmesh_model *m, const epsmesh_query *q) {
    asked a;
    contact k;
    epsmesh_status status = misfit(m, q, a.local, a.edge, &a.f);
    if (status == EPSMESH_LOST) return all(status, 0.0);
    if (status != EPSMESH_OK) return all(status, (double)NAN);
    if (!surveyed(m, q, &a)) return all(EPSMESH_DAMAGED, (double)NAN);
    if (!press(m, q, &a, &k)) return all(EPSMESH_LARGE, (double)NAN);
    return told(m, q->young, q->depth, &a, &k, bar_of(m, q, &a, &k));
}

/* ---- several tools: pipeline/realtime/pairs.py, several.py and doubt.py ---- */

enum { TOOLS = EPSMESH_MOST_TOOLS };

/* Of places i and j: G, its slope with x_i, the size of the Laplacian of R, a half-space's share of G, x_i - x_j over
 * the distance, and that; of a tool i at the place of j, w and its slope with x_i. */
typedef struct {
    double sinks[TOOLS][TOOLS], slopes[TOOLS][TOOLS][2], bends[TOOLS][TOOLS], near[TOOLS][TOOLS], away[TOOLS][TOOLS][2], apart[TOOLS][TOOLS];
    double bent[TOOLS][TOOLS], slope_bent[TOOLS][TOOLS][2];
} influence;

typedef struct {
    double depth[TOOLS], force[TOOLS], mean[TOOLS], aside[TOOLS][2], inverse[TOOLS][TOOLS];
    contact k[TOOLS];
} settled;

/* Modes at a place: values, slopes with x and y, and Laplacian. */
static void modes_at(const epsmesh_model *m, double x, double y, double f[4][EPSMESH_MOST_MODES]) {
    double u[3][EPSMESH_MOST], v[3][EPSMESH_MOST], a = m->reach[0], b = m->reach[1];
    int i, j, k, rows = m->pair_counts[2], columns = m->pair_counts[3];
    const double *c = m->pair_modes;
    polynomials(x / a, columns, u), polynomials(y / b, rows, v);
    for (k = 0; k < m->pair_counts[1]; k++) {
        f[0][k] = f[1][k] = f[2][k] = f[3][k] = 0;
        for (j = 0; j < rows; j++, c += columns) {
            double sum[3] = {0, 0, 0};
            for (i = 0; i < columns; i++) sum[0] += c[i] * u[0][i], sum[1] += c[i] * u[1][i], sum[2] += c[i] * u[2][i];
            f[0][k] += v[0][j] * sum[0], f[1][k] += v[0][j] * sum[1] / a, f[2][k] += v[1][j] * sum[0] / b;
            f[3][k] += v[0][j] * sum[2] / (a * a) + v[2][j] * sum[0] / (b * b);
        }
    }
}

/* Return the second moment (m2) of a contact under a `force` on a half-space, and its exponent `power` in the force. */
static double moment(const epsmesh_query *q, double plane, double force, double *power) {
    double big = 0.5 * (q->length > q->width ? q->length : q->width), c8[3][EPSMESH_MOST], r[2] = {0, 0};
    double small = 0.5 * (q->length > q->width ? q->width : q->length);
    int i, j;
    *power = q->shape == EPSMESH_SPHERE ? 2.0 / 3 : q->shape == EPSMESH_CONE ? 1.0 : 0.0;
    force = force > 0 ? force : 0;
    if (q->shape == EPSMESH_SPHERE) return 0.4 * pow(0.75 * force * q->radius / plane, 2.0 / 3);
    if (q->shape == EPSMESH_CONE) return 2.0 / 3 * force * tan(q->angle) / (PI * plane);
    if (q->shape != EPSMESH_BLADE) return 2.0 / 3 * q->radius * q->radius;
    polynomials(1 - 2 * log(small / big) / log(SLENDER), 8, c8);
    for (i = 0; i < 2; i++)
        for (j = 0; j < 8; j++) r[i] += RECTANGLE[i + 1][j] * c8[0][j];
    return r[0] * big * big + r[1] * small * small;
}

/* The second moment ((xx, xy), (xy, yy)) of a contact, in units of its trace. */
static void tensor(const epsmesh_query *q, const double edge[2], double t[2][2]) {
    double big = 0.5 * (q->length > q->width ? q->length : q->width), c8[3][EPSMESH_MOST], r[2] = {0, 0}, e[2], share;
    double small = 0.5 * (q->length > q->width ? q->width : q->length);
    int i, j;
    t[0][0] = t[1][1] = 0.5, t[0][1] = t[1][0] = 0;
    if (q->shape != EPSMESH_BLADE) return;
    polynomials(1 - 2 * log(small / big) / log(SLENDER), 8, c8);
    for (i = 0; i < 2; i++)
        for (j = 0; j < 8; j++) r[i] += RECTANGLE[i + 1][j] * c8[0][j];
    e[0] = q->length < q->width ? -edge[1] : edge[0], e[1] = q->length < q->width ? edge[0] : edge[1];
    r[0] *= big * big, r[1] *= small * small, share = r[0] / (r[0] + r[1]);
    for (i = 0; i < 2; i++)
        for (j = 0; j < 2; j++) t[i][j] = (1 - share) * (i == j) + (2 * share - 1) * e[i] * e[j];
}

static void bent_at(const epsmesh_query *q, const double edge[2], int n, int i, influence *g) {
    double t[2][2];
    int j, k;
    tensor(q, edge, t);
    for (j = 0; j < n; j++) {
        double d = g->apart[i][j], *e = g->away[i][j], along[2], share, near = g->near[i][j] / (d * d);
        if (i == j) {
            g->bent[i][j] = g->slope_bent[i][j][0] = g->slope_bent[i][j][1] = 0;
            continue;
        }
        for (k = 0; k < 2; k++) along[k] = t[k][0] * e[0] + t[k][1] * e[1];
        share = along[0] * e[0] + along[1] * e[1];
        g->bent[i][j] = near * (1.5 * share - 0.5);
        for (k = 0; k < 2; k++) g->slope_bent[i][j][k] = near / d * (3 * along[k] + (1.5 - 7.5 * share) * e[k]);
    }
}

static void influences(const epsmesh_model *m, int n, const epsmesh_query *q, const asked *a, influence *g) {
    double f[TOOLS][4][EPSMESH_MOST_MODES], linked[TOOLS][EPSMESH_MOST_MODES], nu[3][EPSMESH_MOST];
    double low = m->poisson_range[0], high = m->poisson_range[1], plane = 1 / (1 - q->poisson * q->poisson);
    int i, j, k, l, rank = m->pair_counts[1];
    polynomials(high == low ? 0 : (2 * q->poisson - low - high) / (high - low), m->pair_counts[0], nu);
    for (i = 0; i < n; i++) {
        modes_at(m, a[i].local[0], a[i].local[1], f[i]);
        for (k = 0; k < rank; k++) linked[i][k] = 0;
    }
    for (l = 0; l < rank; l++)
        for (k = 0; k < rank; k++) {
            double s = 0;
            for (j = 0; j < m->pair_counts[0]; j++) s += nu[0][j] * m->pair_links[(j * rank + l) * rank + k];
            for (i = 0; i < n; i++) linked[i][k] += f[i][0][l] * s;
        }
    for (i = 0; i < n; i++)
        for (j = 0; j < n; j++) {
            double x = a[i].local[0] - a[j].local[0], y = a[i].local[1] - a[j].local[1], d = sqrt(x * x + y * y);
            double r[4] = {0, 0, 0, 0};
            if (d < TOUCHING) d = TOUCHING;
            for (l = 0; l < 4; l++)
                for (k = 0; k < rank; k++) r[l] += f[i][l][k] * linked[j][k];
            g->apart[i][j] = d, g->away[i][j][0] = x / d, g->away[i][j][1] = y / d;
            g->near[i][j] = i == j ? 0 : 1 / (PI * plane * d);
            g->sinks[i][j] = i == j ? 0 : g->near[i][j] + r[0], g->bends[i][j] = i == j ? 0 : fabs(r[3]);
            for (l = 0; l < 2; l++)
                g->slopes[i][j][l] = i == j ? 0 : r[l + 1] - g->near[i][j] / d * g->away[i][j][l];
        }
    for (i = 0; i < n; i++) bent_at(&q[i], a[i].edge, n, i, g);
}

/* Put the inverse of `a` into `b`, by Gauss elimination with column pivoting; `a` is overwritten. */
static int inverted(int n, double a[TOOLS][TOOLS], double b[TOOLS][TOOLS]) {
    int i, j, k;
    for (i = 0; i < n; i++)
        for (j = 0; j < n; j++) b[i][j] = i == j;
    for (k = 0; k < n; k++) {
        int best = k;
        double pivot;
        for (i = k + 1; i < n; i++)
            if (fabs(a[i][k]) > fabs(a[best][k])) best = i;
        for (j = 0; j < n; j++) {
            double of_a = a[k][j], of_b = b[k][j];
            a[k][j] = a[best][j], b[k][j] = b[best][j], a[best][j] = of_a, b[best][j] = of_b;
        }
        pivot = a[k][k];
        if (!(fabs(pivot) > 0) || !isfinite(pivot)) return 0;
        for (j = 0; j < n; j++) a[k][j] /= pivot, b[k][j] /= pivot;
        for (i = 0; i < n; i++) {
            double share = a[i][k];
            for (j = 0; j < n && i != k; j++) a[i][j] -= share * a[k][j], b[i][j] -= share * b[k][j];
        }
    }
    return 1;
}

/* Press all tools to depths; return EPSMESH_LARGE with the tool's number, or EPSMESH_DAMAGED. */
static epsmesh_status press_all(const epsmesh_model *m, int n, const epsmesh_query *q, const asked *a,
                                const double depth[TOOLS], contact k[TOOLS], int *whose) {
    int i;
    for (i = 0; i < n; i++) {
        epsmesh_query left = q[i];
        left.depth = depth[i];
        *whose = i;
        memset(&k[i], 0, sizeof k[i]);
        if (!isfinite(depth[i])) return EPSMESH_DAMAGED;
        if (depth[i] > TOUCHING && !press(m, &left, &a[i], &k[i])) return EPSMESH_LARGE;
    }
    return EPSMESH_OK;
}

static void asides(int n, const epsmesh_query *q, const influence *g, settled *s) {
    int i, j, l;
    for (i = 0; i < n; i++)
        for (l = 0; l < 2; l++) {
            double fi = s->k[i].force, more = 0;
            for (j = 0; j < n; j++)
                more += fi * s->k[j].force * (g->slopes[i][j][l] + s->mean[i] * g->slope_bent[i][j][l] -
                                              s->mean[j] * g->slope_bent[j][i][l]);
            s->aside[i][l] = s->k[i].aside[l] + (q[i].shape == EPSMESH_BONDED_DISC ? 0 : more);
        }
}

/* Newton's method, from each tool's contact alone. */
static epsmesh_status settle_all(const epsmesh_model *m, int n, const epsmesh_query *q, const asked *a, const influence *g,
                             settled *s, int *whose) {
    int i, j, steps, is_last = 0;
    for (steps = 0; steps < SETTLE_STEPS; steps++) {
        double grown[TOOLS], felt[TOOLS], power[TOOLS], slope[TOOLS][TOOLS], largest = 0, change = 0;
        epsmesh_status status;
        for (i = 0; i < n; i++) {
            s->mean[i] = moment(&q[i], a[i].p.plane, s->force[i], &power[i]);
            grown[i] = (1 + power[i]) * s->mean[i];
            for (felt[i] = 0, j = 0; j < n; j++) felt[i] += g->bent[i][j] * s->force[j];
        }
        for (i = 0; i < n; i++) {
            s->depth[i] = q[i].depth - grown[i] * felt[i];
            for (j = 0; j < n; j++) s->depth[i] -= (g->sinks[i][j] + g->bent[j][i] * s->mean[j]) * s->force[j];
        }
        status = press_all(m, n, q, a, s->depth, s->k, whose);
        if (status != EPSMESH_OK) return status;
        for (i = 0; i < n; i++) {
            for (j = 0; j < n; j++) {
                double second = g->sinks[i][j] + grown[i] * g->bent[i][j] + grown[j] * g->bent[j][i];
                if (i == j) second = s->force[i] > 0 ? power[i] * grown[i] * felt[i] / s->force[i] : 0;
                slope[i][j] = (i == j) + s->k[i].stiffness * second;
            }
        }
        if (!inverted(n, slope, s->inverse)) return EPSMESH_DAMAGED;
        if (is_last) {
            asides(n, q, g, s);
            return EPSMESH_OK;
        }
        for (i = 0; i < n; i++) {
            double step = 0;
            for (j = 0; j < n; j++) step += s->inverse[i][j] * (s->force[j] - s->k[j].force);
            felt[i] = step;
        }
        for (i = 0; i < n; i++) {
            s->force[i] -= felt[i];
            if (!isfinite(s->force[i])) return EPSMESH_DAMAGED;
            if (fabs(s->force[i]) > largest) largest = fabs(s->force[i]);
            if (fabs(felt[i]) > change) change = fabs(felt[i]);
        }
        is_last = change <= SETTLED * largest;
    }
    return EPSMESH_DAMAGED;
}

/* The relative bars, where the forces are not 0. */
static void doubts(const epsmesh_model *m, int n, const epsmesh_query *q, const asked *a, const influence *g,
                   const settled *s, double errors[TOOLS]) {
    double off[TOOLS], pull[TOOLS], lean[TOOLS], turn[TOOLS], ratio = q->poisson;
    int i, j;
    for (i = 0; i < n; i++) {
        double stiff = 4 * s->k[i].radius / ((1 + ratio) * (2 - ratio));
        for (pull[i] = lean[i] = 0, j = 0; j < n; j++) {
            if (j == i) continue;
            pull[i] += m->pair_aside / g->apart[i][j] * s->k[j].force;
            lean[i] += sqrt(g->slopes[i][j][0] * g->slopes[i][j][0] + g->slopes[i][j][1] * g->slopes[i][j][1]) *
                       s->k[j].force;
        }
        pull[i] *= q[i].shape == EPSMESH_BONDED_DISC ? stiff : 0;
        turn[i] = 4.0 / 3 * a[i].p.plane * cube(s->k[i].radius);
    }
    for (i = 0; i < n; i++) {
        off[i] = turn[i] * sqrt(a[i].p.tilt) * lean[i];
        for (j = 0; j < n; j++) {
            double d = g->apart[i][j], near = g->near[i][j], doubt, both, known = s->k[j].aside[0];
            int of[2], l, blades = 0;
            if (j == i) continue;
            of[0] = i, of[1] = j;
            doubt = (m->pair_error + m->bar[0]) / sqrt(a[i].room * a[j].room);
            for (l = 0; l < 2; l++) {
                double mean = s->k[of[l]].mean_square, other = mean > 0 ? fabs(mean - s->mean[of[l]]) : mean;
                int is_blade = q[of[l]].shape == EPSMESH_BLADE;
                blades += is_blade;
                doubt += (is_blade ? BENDS_BLADE : 1.0) / 4 * (mean * g->bends[of[l]][of[1 - l]] + other * near / (d * d));
            }
            both = (s->k[i].mean_square + s->k[j].mean_square) / (d * d);
            off[i] += (doubt + (blades ? FOURTH_BLADE : FOURTH) * both * both * near) * s->k[j].force;
            off[i] += sqrt(g->slopes[j][i][0] * g->slopes[j][i][0] + g->slopes[j][i][1] * g->slopes[j][i][1]) * turn[j] *
                      (s->k[j].force * sqrt(a[j].p.tilt) + lean[j]);
            known = sqrt(known * known + s->k[j].aside[1] * s->k[j].aside[1]);
            if (q[j].shape == EPSMESH_BONDED_DISC) off[i] += m->pair_aside / d * (known + pull[j]);
        }
    }
    for (i = 0; i < n; i++) {
        errors[i] = pull[i];
        for (j = 0; j < n; j++) {
            epsmesh_query left = q[j];
            left.depth = s->depth[j];
            if (s->k[j].force > 0)
                errors[i] += fabs(s->inverse[i][j]) * (bar_of(m, &left, &a[j], &s->k[j]) * s->k[j].force +
                                                       s->k[j].stiffness * off[j]);
        }
        errors[i] = s->k[i].force > 0 ? errors[i] / s->k[i].force : 0;
    }
}

/* Give the tools marked in `which` a status, and all others EPSMESH_OTHERS. */
static void refuse(int n, epsmesh_touch *t, const int which[TOOLS], epsmesh_status status) {
    int i;
    for (i = 0; i < n; i++) t[i] = all(which[i] ? status : EPSMESH_OTHERS, (double)NAN);
}

static void refuse_all(int n, epsmesh_touch *t, epsmesh_status status) {
    int i;
    for (i = 0; i < n; i++) t[i] = all(status, (double)NAN);
}

static int too_near(int n, const contact k[TOOLS], const influence *g, int near[TOOLS]) {
    int i, j, found = 0;
    for (i = 0; i < n; i++)
        for (near[i] = 0, j = 0; j < n; j++)
            if (i != j && k[i].radius > 0 && k[j].radius > 0 && g->apart[i][j] < NEAR * (k[i].radius + k[j].radius))
                near[i] = found = 1;
    return found;
}

void epsmesh_touch_all(const epsmesh_model *m, int n, const epsmesh_query *q, epsmesh_touch *t) {
    asked a[TOOLS];
    influence g;
    settled s;
    epsmesh_status status[TOOLS], found;
    double errors[TOOLS];
    int i, refused = 0, which[TOOLS], whose = 0;
    if (n == 1) t[0] = epsmesh_touch_at(m, q);
    if (n <= 1) return;
    if (!m->is_loaded || !m->has_pairs) {
        refuse_all(n, t, m->is_loaded ? EPSMESH_ALONE : EPSMESH_NO_MODEL);
        return;
    }
    for (i = 1; i < n; i++) refused |= !(q[i].young == q[0].young && q[i].poisson == q[0].poisson);
    if (n > TOOLS || refused) {
        refuse_all(n, t, EPSMESH_INPUT);
        return;
    }
    for (i = 0; i < n; i++) {
        status[i] = misfit(m, &q[i], a[i].local, a[i].edge, &a[i].f);
        refused |= status[i] != EPSMESH_OK && status[i] != EPSMESH_LOST;
    }
    for (i = 0; i < n && refused; i++) {
        found = status[i] == EPSMESH_OK || status[i] == EPSMESH_LOST ? EPSMESH_OTHERS : status[i];
        t[i] = all(found, (double)NAN);
    }
    if (refused) return;
    for (i = 0; i < n; i++) {
        s.depth[i] = q[i].depth;
        if (surveyed(m, &q[i], &a[i])) continue;
        refuse_all(n, t, EPSMESH_DAMAGED);
        return;
    }
    influences(m, n, q, a, &g);
    found = press_all(m, n, q, a, s.depth, s.k, &whose);
    if (found == EPSMESH_OK && too_near(n, s.k, &g, which)) found = EPSMESH_NEAR;
    for (i = 0; i < n; i++) s.force[i] = s.k[i].force;
    if (found == EPSMESH_OK) found = settle_all(m, n, q, a, &g, &s, &whose);
    if (found == EPSMESH_OK && too_near(n, s.k, &g, which)) found = EPSMESH_NEAR;
    for (i = 0; i < n && found == EPSMESH_LARGE; i++) which[i] = i == whose;
    if (found == EPSMESH_DAMAGED) refuse_all(n, t, found);
    else if (found != EPSMESH_OK) refuse(n, t, which, found);
    if (found != EPSMESH_OK) return;
    doubts(m, n, q, a, &g, &s, errors);
    for (i = 0; i < n; i++) {
        contact k = s.k[i];
        if (!(k.force > 0)) t[i] = all(EPSMESH_LOST, 0.0);
        k.stiffness *= s.inverse[i][i], k.aside[0] = s.aside[i][0], k.aside[1] = s.aside[i][1];
        if (k.force > 0) t[i] = told(m, q[i].young, q[i].depth, &a[i], &k, errors[i]);
        which[i] = t[i].status == EPSMESH_DAMAGED, refused |= which[i];
    }
    if (refused) refuse(n, t, which, EPSMESH_DAMAGED);
}

const char *epsmesh_word(epsmesh_status status) {
    static const char *const words[] = {"ok",      "lost",   "outside", "large", "deep",    "tool",
                                        "input",   "poisson", "tilted", "off",   "damaged", "no model",
                                        "near",    "others", "alone"};
    return (int)status >= 0 && status < EPSMESH_STATUSES ? words[status] : "";
}
