/* See epsmesh.h for what is offered, pipeline/realtime/ for the formulas, in the same order and under the same names. */
#include "epsmesh.h"

#include <float.h>
#include <math.h>
#include <string.h>

static const double PI = 3.14159265358979323846;
static const double FORMAT = 1.0, TOUCHING = 1e-12, SMALLEST = 1e-6, OFF = 1e-6, ALIGNED = 1e-6;
static const double BALL_LIMIT = 0.6, NEGLIGIBLE = 1e-17, SAME = 4e-16;
enum { STEPS = 60, TERMS = 40 };

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
    size_t room, length[3];
    int rank; /* -1: not yet found */
} wanted;

enum { WANTED = 15 };

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
    if (rank > 3 || n == 0 || n > w->room) return 0;
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
        if (m->counts[i] > EPSMESH_MOST || m->bar[i] < 0) return 0;
        for (j = 0; j < 3; j++) {
            double dot = i == j ? -1.0 : 0.0;
            for (k = 0; k < 3; k++) dot += m->axes[i][k] * m->axes[j][k];
            if (!(fabs(dot) < 1e-9)) return 0;
        }
    }
    if (m->bar[3] < 0) return 0;
    for (i = 0; i < 2; i++)
        if (!(0 < m->reach[i] && m->reach[i] < m->sides[i])) return 0;
    if (m->is_round && m->counts[1] != 1) return 0;
    if (!(-1 < m->poisson_range[0] && m->poisson_range[0] <= m->poisson && m->poisson <= m->poisson_range[1])) return 0;
    if (m->poisson_range[1] > 0.5 || (m->counts[0] > 1 && m->poisson_range[0] == m->poisson_range[1])) return 0;
    return m->thickness > 0 && m->young > 0 && m->largest > 0 && m->largest <= 1;
}

epsmesh_status epsmesh_load(epsmesh_model *m, const void *data, size_t size) {
    double format, is_round;
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
    };
    static const int ranks[WANTED] = {3, 3, 2, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0};
    static const size_t firsts[] = {3, 3, 4, 2, 2, 2};
    m->is_loaded = 0;
    r.data = (const unsigned char *)data, r.size = size, r.at = 0, r.failed = data == NULL;
    if (!read_variables(&r, w)) return EPSMESH_NO_MODEL;
    for (i = 0; i < WANTED; i++)
        if (w[i].rank != ranks[i] || (i >= 2 && i < 8 && w[i].length[0] != firsts[i - 2])) return EPSMESH_NO_MODEL;
    if (w[2].length[1] != 3 || format != FORMAT || (is_round != 0 && is_round != 1)) return EPSMESH_NO_MODEL;
    m->is_round = is_round == 1;
    for (i = 0; i < 3; i++) {
        if (w[0].length[i] != w[1].length[i]) return EPSMESH_NO_MODEL;
        m->counts[i] = (int)w[0].length[i];
    }
    m->is_loaded = is_sound(m);
    return m->is_loaded ? EPSMESH_OK : EPSMESH_NO_MODEL;
}

/* ---- the table ---- */

typedef struct {
    double c, h, tilt, slope_c[2], slope_h[2], slope_tilt[2], plane;
} place;

typedef struct {
    double f, slope[2], xx, xy, yy;
} value;

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

static value along(const epsmesh_model *m, const double *table, const double nu[3][EPSMESH_MOST],
                   const double left[3][EPSMESH_MOST], const double right[3][EPSMESH_MOST], double x, double y) {
    int i, j, k, rows = m->counts[1], columns = m->counts[2];
    double f = 0, fu = 0, fv = 0, fuu = 0, fuv = 0, fvv = 0, bend = 4 / (m->reach[0] * m->reach[0]);
    value found;
    for (j = 0; j < rows; j++) {
        double sum[3] = {0, 0, 0};
        for (k = 0; k < columns; k++) {
            double flat = 0;
            for (i = 0; i < m->counts[0]; i++) flat += nu[0][i] * table[(i * rows + j) * columns + k];
            sum[0] += flat * right[0][k], sum[1] += flat * right[1][k], sum[2] += flat * right[2][k];
        }
        f += left[0][j] * sum[0], fu += left[0][j] * sum[1], fuu += left[0][j] * sum[2];
        fv += left[1][j] * sum[0], fuv += left[1][j] * sum[1], fvv += left[2][j] * sum[0];
    }
    found.f = f;
    if (m->is_round) {
        double ux = bend * x, uy = bend * y;
        found.slope[0] = fu * ux, found.slope[1] = fu * uy;
        found.xx = fuu * ux * ux + fu * bend, found.xy = fuu * ux * uy, found.yy = fuu * uy * uy + fu * bend;
    } else {
        double other = 4 / (m->reach[1] * m->reach[1]), ux = bend * x, vy = other * y;
        found.slope[0] = fu * ux, found.slope[1] = fv * vy;
        found.xx = fuu * ux * ux + fu * bend, found.xy = fuv * ux * vy, found.yy = fvv * vy * vy + fv * other;
    }
    return found;
}

static int place_at(const epsmesh_model *m, double x, double y, double ratio, place *p) {
    double nu[3][EPSMESH_MOST], left[3][EPSMESH_MOST], right[3][EPSMESH_MOST], u, v, t, q, xx, xy, yy;
    double low = m->poisson_range[0], high = m->poisson_range[1], a = m->reach[0], b = m->reach[1];
    value of_t, of_q;
    int i;
    u = m->is_round ? 2 * (x * x + y * y) / (a * a) - 1 : 2 * (x / a) * (x / a) - 1;
    v = m->is_round ? 0 : 2 * (y / b) * (y / b) - 1;
    polynomials(high == low ? 0 : (2 * ratio - low - high) / (high - low), m->counts[0], nu);
    polynomials(v, m->counts[1], left);
    polynomials(u, m->counts[2], right);
    of_t = along(m, m->reciprocal, (const double(*)[EPSMESH_MOST])nu, (const double(*)[EPSMESH_MOST])left,
                 (const double(*)[EPSMESH_MOST])right, x, y);
    of_q = along(m, m->curvature, (const double(*)[EPSMESH_MOST])nu, (const double(*)[EPSMESH_MOST])left,
                 (const double(*)[EPSMESH_MOST])right, x, y);
    t = of_t.f, q = of_q.f;
    if (!(t > 0)) return 0;
    for (i = 0; i < 2; i++) {
        p->slope_c[i] = -of_t.slope[i] / (t * t);
        p->slope_h[i] = of_q.slope[i] / (t * t * t) - 3 * q * of_t.slope[i] / (t * t * t * t);
    }
    xx = 2 * of_t.slope[0] * of_t.slope[0] / (t * t * t) - of_t.xx / (t * t);
    xy = 2 * of_t.slope[0] * of_t.slope[1] / (t * t * t) - of_t.xy / (t * t);
    yy = 2 * of_t.slope[1] * of_t.slope[1] / (t * t * t) - of_t.yy / (t * t);
    p->slope_tilt[0] = 0.5 * (xx * p->slope_c[0] + xy * p->slope_c[1]);
    p->slope_tilt[1] = 0.5 * (xy * p->slope_c[0] + yy * p->slope_c[1]);
    p->tilt = 0.25 * (p->slope_c[0] * p->slope_c[0] + p->slope_c[1] * p->slope_c[1]);
    p->c = 1 / t - m->c_ref, p->h = q / (t * t * t), p->plane = 1 / (1 - ratio * ratio);
    return 1;
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
    k.force = 2 * stiff * (a * d[0] - d[2]) / own;
    k.square = 4 * stiff * (cube(a) / 3 * d[0] - d[3]) + 4.0 / 15 * stiff * h * k.force * fifth(a);
    k.growth = 2 * stiff * a * d[1] + 2 * stiff * h * k.force * a * a;
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
        k->aside[i] = 0.5 * found.force * found.force * p->slope_c[i] + of_h * p->slope_h[i] + of_tilt * p->slope_tilt[i];
    return 1;
}

/* ---- queries ---- */

static double smaller(double a, double b) { return a < b ? a : b; }

static double room_at(const epsmesh_model *m, double x, double y) {
    if (m->is_round) return smaller(m->sides[0] - sqrt(x * x + y * y), m->thickness);
    return smaller(smaller(m->sides[0] - fabs(x), m->sides[1] - fabs(y)), m->thickness);
}

static int is_positive(double x) { return isfinite(x) && x > 0; }

static epsmesh_status misfit(const epsmesh_model *m, const epsmesh_query *q, double local[3]) {
    double length = 0, inward = 0, shift;
    int i, j, has_angle = q->shape == EPSMESH_CONE;
    if (!m->is_loaded) return EPSMESH_NO_MODEL;
    if (q->shape != EPSMESH_DISC && q->shape != EPSMESH_SPHERE && !has_angle) return EPSMESH_TOOL;
    if (!isfinite(q->radius) || (has_angle && !isfinite(q->angle))) return EPSMESH_TOOL;
    if (q->radius < SMALLEST || (has_angle && !(0.01 <= q->angle && q->angle <= PI / 2 - 0.001))) return EPSMESH_INPUT;
    if (!isfinite(q->depth) || !isfinite(q->poisson) || !is_positive(q->young)) return EPSMESH_INPUT;
    for (i = 0; i < 3; i++) {
        local[i] = 0;
        for (j = 0; j < 3; j++) {
            shift = q->at[j] - m->origin[j];
            local[i] += m->axes[i][j] * shift;
        }
        if (!isfinite(local[i]) || !isfinite(q->axis[i])) return EPSMESH_INPUT;
        length += q->axis[i] * q->axis[i];
        inward -= m->axes[2][i] * q->axis[i];
    }
    if (!isfinite(length)) return EPSMESH_INPUT;
    if (length > 0 && !(inward / sqrt(length) >= 1 - 0.5 * ALIGNED * ALIGNED)) return EPSMESH_TILTED;
    if (fabs(local[2]) > OFF * m->thickness) return EPSMESH_OFF;
    if (m->is_round ? !(local[0] * local[0] + local[1] * local[1] <= m->reach[0] * m->reach[0])
                    : !(fabs(local[0]) <= m->reach[0] && fabs(local[1]) <= m->reach[1]))
        return EPSMESH_OUTSIDE;
    if (!(m->poisson_range[0] <= q->poisson && q->poisson <= m->poisson_range[1])) return EPSMESH_POISSON;
    if (q->depth >= m->thickness) return EPSMESH_DEEP;
    return q->depth <= TOUCHING ? EPSMESH_LOST : EPSMESH_OK;
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
    q.young = m->young, q.poisson = m->poisson;
    return q;
}

epsmesh_touch epsmesh_touch_at(const epsmesh_model *m, const epsmesh_query *q) {
    double local[3], room, share;
    epsmesh_status status = misfit(m, q, local);
    epsmesh_touch t;
    place p;
    contact k;
    int i;
    if (status == EPSMESH_LOST) return all(status, 0.0);
    if (status != EPSMESH_OK) return all(status, (double)NAN);
    if (!place_at(m, local[0], local[1], q->poisson, &p)) return all(EPSMESH_DAMAGED, (double)NAN);
    room = room_at(m, local[0], local[1]);
    if (q->shape == EPSMESH_DISC) {
        if (q->radius > m->largest * room) return all(EPSMESH_LARGE, (double)NAN);
        k = press_disc(q->radius, q->depth, &p);
    } else if (!press_round(q, &p, m->largest * room, &k)) {
        return all(EPSMESH_LARGE, (double)NAN);
    }
    share = (k.radius / room) * (k.radius / room);
    t.status = EPSMESH_OK, t.stiffness = q->young * k.stiffness, t.contact_radius = k.radius;
    t.force_error = m->bar[3] + k.stiffness * ((m->bar[0] + m->bar[2] * share * share) / room +
                                               m->bar[1] * fabs(p.h) * k.mean_square);
    for (i = 0; i < 3; i++)
        t.force[i] = q->young * (k.aside[0] * m->axes[0][i] + k.aside[1] * m->axes[1][i] + k.force * m->axes[2][i]);
    if (!(k.force > 0 && is_positive(t.stiffness) && isfinite(t.force_error) && isfinite(t.force[0]) &&
          isfinite(t.force[1]) && isfinite(t.force[2])))
        return all(EPSMESH_DAMAGED, (double)NAN);
    return t;
}

const char *epsmesh_word(epsmesh_status status) {
    static const char *const words[] = {"ok",      "lost",   "outside", "large", "deep",    "tool",
                                        "input",   "poisson", "tilted", "off",   "damaged", "no model"};
    return (int)status >= 0 && status < EPSMESH_STATUSES ? words[status] : "";
}
