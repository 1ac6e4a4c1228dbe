/* Values of the tables at a place, with derivatives (epsmesh_realtime/table.py defines the tables); the face there. */

typedef struct {
    real c, h, tilt, slope_c[2], slope_h[2], slope_tilt[2], plane, poisson, bend, slope_bend[2];
    real bent[2], bent_slopes[2][2], lean[2], hessian[2][2], regular[3][3]; /* of blades and bonded tools */
    real near[2][EPSMESH_MOST_NEAR], near_most, near_support; /* over x, for nu; 0 terms at small strain */
    int nears;
} place;

typedef struct {
    real f, slope[2], xx, xy, yy;
} value;

typedef struct {
    real nu[3][EPSMESH_MOST], left[3][EPSMESH_MOST], right[3][EPSMESH_MOST];
} terms;

static void polynomials(real at, int n, real p[3][EPSMESH_MOST]) {
    int i;
    p[0][0] = 1, p[1][0] = p[2][0] = 0;
    if (n > 1) p[0][1] = at, p[1][1] = 1, p[2][1] = 0;
    for (i = 2; i < n; i++) {
        p[2][i] = 2 * at * p[2][i - 1] + 4 * p[1][i - 1] - p[2][i - 2];
        p[1][i] = 2 * at * p[1][i - 1] + 2 * p[0][i - 1] - p[1][i - 2];
        p[0][i] = 2 * at * p[0][i - 1] - p[0][i - 2];
    }
}

static void directions(const epsmesh_model *m, real x, real y, int rows, int columns, terms *p) {
    real a = m->reach[0], b = m->reach[1], u, v;
    if (m->is_axial) {
        u = 2 * (x * x + y * y) / (a * a) - 1, v = 0;
    } else {
        u = m->even[0] ? 2 * (x / a) * (x / a) - 1 : x / a;
        v = m->even[1] ? 2 * (y / b) * (y / b) - 1 : y / b;
    }
    polynomials(v, rows, p->left);
    polynomials(u, columns, p->right);
}

static value along(const epsmesh_model *m, const double *table, const terms *p, const int counts[3], real x, real y) {
    int i, j, k, rows = counts[1], columns = counts[2];
    real f = 0, fu = 0, fv = 0, fuu = 0, fuv = 0, fvv = 0, a = m->reach[0], b = m->reach[1], bend = 4 / (a * a);
    value found;
    for (j = 0; j < rows; j++) {
        real sum[3] = {0, 0, 0};
        for (k = 0; k < columns; k++) {
            real flat = 0;
            for (i = 0; i < counts[0]; i++) flat += p->nu[0][i] * table[(i * rows + j) * columns + k];
            sum[0] += flat * p->right[0][k], sum[1] += flat * p->right[1][k], sum[2] += flat * p->right[2][k];
        }
        f += p->left[0][j] * sum[0], fu += p->left[0][j] * sum[1], fuu += p->left[0][j] * sum[2];
        fv += p->left[1][j] * sum[0], fuv += p->left[1][j] * sum[1], fvv += p->left[2][j] * sum[0];
    }
    found.f = f;
    if (m->is_axial) {
        real ux = bend * x, uy = bend * y;
        found.slope[0] = fu * ux, found.slope[1] = fu * uy;
        found.xx = fuu * ux * ux + fu * bend, found.xy = fuu * ux * uy, found.yy = fuu * uy * uy + fu * bend;
    } else {
        real ux = m->even[0] ? bend * x : 1 / a, uxx = m->even[0] ? bend : 0;
        real vy = m->even[1] ? 4 / (b * b) * y : 1 / b, vyy = m->even[1] ? 4 / (b * b) : 0;
        found.slope[0] = fu * ux, found.slope[1] = fv * vy;
        found.xx = fuu * ux * ux + fu * uxx, found.xy = fuv * ux * vy, found.yy = fvv * vy * vy + fv * vyy;
    }
    return found;
}

/* The factor of one of the seven tables, with its gradient (1/m): what symmetry implies, epsmesh_realtime/table.py. */
static real factor(const epsmesh_model *m, int k, real x, real y, real own[2]) {
    real xi = m->even[0] ? x / m->reach[0] : 1, eta = m->even[1] ? y / m->reach[1] : 1;
    real of_x = m->even[0] ? 1 / m->reach[0] : 0, of_y = m->even[1] ? 1 / m->reach[1] : 0;
    own[0] = own[1] = 0;
    if ((k == 0 || k == 5) && m->is_axial) {
        own[0] = 2 * xi * of_x, own[1] = -2 * eta * of_y;
        return xi * xi - eta * eta;
    }
    if (k == 1 || k == 6) {
        own[0] = 2 * eta * of_x, own[1] = 2 * xi * of_y;
        return 2 * xi * eta;
    }
    if (k == 2) own[0] = of_x;
    if (k == 3) own[1] = of_y;
    return k == 2 ? xi : k == 3 ? eta : 1;
}

/* Values for blades and bonded tools. */
static void shape_at(const epsmesh_model *m, const terms *s, real x, real y, real t, const real slope_t[2],
                     place *p) {
    real f[EPSMESH_TENSORS], g, own[2];
    size_t whole = (size_t)m->counts[0] * (size_t)m->counts[1] * (size_t)m->counts[2];
    int i, k;
    for (k = 0; k < EPSMESH_TENSORS; k++) {
        value v = along(m, m->tensors + (size_t)k * whole, s, m->counts, x, y);
        g = factor(m, k, x, y, own), f[k] = g * v.f;
        for (i = 0; i < 2 && k < 2; i++)
            p->bent_slopes[k][i] = ((g * v.slope[i] + v.f * own[i]) - 3 * f[k] * slope_t[i] / t) / (t * t * t);
    }
    p->bent[0] = f[0] / (t * t * t), p->bent[1] = f[1] / (t * t * t);
    p->regular[0][0] = (f[4] + f[5]) / t, p->regular[1][1] = (f[4] - f[5]) / t, p->regular[2][2] = p->c;
    p->regular[0][1] = p->regular[1][0] = f[6] / t;
    p->regular[0][2] = p->regular[2][0] = f[2] / t;
    p->regular[1][2] = p->regular[2][1] = f[3] / t;
}

/* The ratios of a ball on a half-space at large displacements to H. Hertz's, for this nu: src/contact.c. */
static void near_of(const epsmesh_model *m, real ratio, place *p) {
    real nu[3][EPSMESH_MOST], low = m->poisson_range[0], high = m->poisson_range[1];
    const double *c = m->near;
    int i, j, k;
    p->nears = m->is_large ? m->near_counts[1] : 0, p->near_most = m->near_most;
    p->near_support = m->near_support / (m->thickness * m->thickness);
    if (!p->nears) return;
    polynomials(high == low ? 0 : (2 * ratio - low - high) / (high - low), m->near_counts[0], nu);
    for (k = 0; k < 2; k++) {
        for (i = 0; i < p->nears; i++) p->near[k][i] = 0;
        for (j = 0; j < m->near_counts[0]; j++)
            for (i = 0; i < p->nears; i++) p->near[k][i] += nu[0][j] * *c++;
    }
}

static int place_at(const epsmesh_model *m, real x, real y, real ratio, int whole, place *p) {
    real t, q, low = m->poisson_range[0], high = m->poisson_range[1];
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
            real second = i == j ? (i ? of_t.yy : of_t.xx) : of_t.xy;
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
    near_of(m, ratio, p);
    if (whole) shape_at(m, &s, x, y, t, of_t.slope, p);
    return 1;
}

/* ---- the face ---- */

static spot face_at(const epsmesh_model *m, real x, real y) {
    spot f = {0, {0, 0}, {{0, 0}, {0, 0}}, 0, {0, 0}, {0, 0, 1}};
    int counts[3], i;
    real steep;
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
static void force_at(const spot *f, real push, const real aside[2], real depth, real out[3]) {
    real steep = sqrt(1 + f->slope[0] * f->slope[0] + f->slope[1] * f->slope[1]), m[2][2], det, x, y;
    int i, j;
    for (i = 0; i < 2; i++)
        for (j = 0; j < 2; j++) m[i][j] = (i == j) + f->slope[i] * f->slope[j] + depth / steep * f->second[i][j];
    det = m[0][0] * m[1][1] - m[0][1] * m[1][0];
    x = (m[1][1] * aside[0] - m[0][1] * aside[1]) / det, y = (m[0][0] * aside[1] - m[1][0] * aside[0]) / det;
    out[0] = push * f->normal[0] + x, out[1] = push * f->normal[1] + y;
    out[2] = push * f->normal[2] + x * f->slope[0] + y * f->slope[1];
}

/* The force on a tool that sticks, from components along the normal and along axes turned by the least angle to it. */
static void reaction_at(const spot *f, real push, const real aside[2], real out[3]) {
    const real *n = f->normal, share = (aside[0] * n[0] + aside[1] * n[1]) / (1 + n[2]);
    out[0] = push * n[0] + aside[0] - share * n[0], out[1] = push * n[1] + aside[1] - share * n[1];
    out[2] = push * n[2] - share * (1 + n[2]);
}
