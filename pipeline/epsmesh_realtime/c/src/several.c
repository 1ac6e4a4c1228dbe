/* Several tools at once, E = 1, with their interaction.
 *
 *     U(F) = sum U_i(F_i) + sum_{i<j} F_i F_j (G + m_i w_i + m_j w_j)(x_i, x_j),    d_i = dU/dF_i,    aside on i: dU/dx_i
 *
 * Each tool follows its own model (contact.c), at its depth minus the displacement by the others. G is the displacement of
 * one place by a unit force at another:
 *
 *     G(x, y) = (1 - nu^2)/(pi |x - y|) + R(x, y),    R(x, y) = sum phi_k(x) S_kl(nu) phi_l(y).
 *
 * The first term is a half-space's (J. Boussinesq, 1885). The regular part R has low rank: modes phi are polynomials over
 * the region, and links S are symmetric, because R is (E. Betti, 1872). On a curved face forces and displacements are
 * along the normals, |x - y| is the chord, and R includes the effect of the curvature. m is the second moment of a contact on a
 * half-space, which depends on its force only; M is its tensor, and m w = 1/2 M:grad grad G its effect on a half-space's G.
 *
 * Error bars: errors of depths and of the tools' models propagate between tools in the worst case. Neglected in G are the
 * second moments on R, the error of these moments, and the next order on a half-space: FOURTH and FOURTH_BLADE are the
 * largest effects of two contacts' fourth moments, in units of (m_i + m_j)^2/D^4; BENDS_BLADE multiplies second derivatives
 * of R for blades. The complementary energy has -2/3 E* a^3 times the squared slope of the face; the model includes only a
 * tool's own slope. Lateral forces of bonded discs displace other places, and others pull at them.
 */
enum { TOOLS = EPSMESH_MOST_TOOLS };

/* Of places i and j: G, its slope with x_i, the size of the Laplacian of R, a half-space's share of G, the distance and
 * its slope with x_i; seen from above, the distance, and x_i - x_j over it. Of a tool i at the place of j, w and its slope
 * with x_i; and the slope of the w of j at i with x_i. */
typedef struct {
    double sinks[TOOLS][TOOLS], slopes[TOOLS][TOOLS][2], bends[TOOLS][TOOLS], near[TOOLS][TOOLS];
    double apart[TOOLS][TOOLS], grows[TOOLS][TOOLS][2], level[TOOLS][TOOLS], away[TOOLS][TOOLS][2];
    double bent[TOOLS][TOOLS], slope_bent[TOOLS][TOOLS][2], slope_felt[TOOLS][TOOLS][2];
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
        double d = g->apart[i][j], *e = g->away[i][j], along[2], share, near = g->near[i][j] / (d * d), turns;
        g->bent[i][j] = g->slope_bent[i][j][0] = g->slope_bent[i][j][1] = 0;
        g->slope_felt[j][i][0] = g->slope_felt[j][i][1] = 0;
        if (i == j) continue;
        for (k = 0; k < 2; k++) along[k] = t[k][0] * e[0] + t[k][1] * e[1];
        share = along[0] * e[0] + along[1] * e[1];
        g->bent[i][j] = near * (1.5 * share - 0.5);
        for (k = 0; k < 2; k++) {
            turns = 3 * near / g->level[i][j] * (along[k] - share * e[k]);
            g->slope_bent[i][j][k] = turns - 3 * g->bent[i][j] / d * g->grows[i][j][k];
            g->slope_felt[j][i][k] = -turns - 3 * g->bent[i][j] / d * g->grows[j][i][k];
        }
    }
}

/* Put the modes of the displacement by a unit force at each of `n` places, from their own modes, into `linked`. */
static void linked_by(const epsmesh_model *m, double poisson, int n, double f[][4][EPSMESH_MOST_MODES],
                      double linked[][EPSMESH_MOST_MODES]) {
    double nu[3][EPSMESH_MOST], low = m->poisson_range[0], high = m->poisson_range[1];
    int i, j, k, l, rank = m->pair_counts[1];
    polynomials(high == low ? 0 : (2 * poisson - low - high) / (high - low), m->pair_counts[0], nu);
    for (i = 0; i < n; i++)
        for (k = 0; k < rank; k++) linked[i][k] = 0;
    for (l = 0; l < rank; l++)
        for (k = 0; k < rank; k++) {
            double s = 0;
            for (j = 0; j < m->pair_counts[0]; j++) s += nu[0][j] * m->pair_links[(j * rank + l) * rank + k];
            for (i = 0; i < n; i++) linked[i][k] += f[i][0][l] * s;
        }
}

static void influences(const epsmesh_model *m, int n, const epsmesh_query *q, const asked *a, influence *g) {
    double f[TOOLS][4][EPSMESH_MOST_MODES], linked[TOOLS][EPSMESH_MOST_MODES], plane = 1 / (1 - q->poisson * q->poisson);
    int i, j, k, l, rank = m->pair_counts[1];
    for (i = 0; i < n; i++) modes_at(m, a[i].local[0], a[i].local[1], f[i]);
    linked_by(m, q->poisson, n, f, linked);
    for (i = 0; i < n; i++)
        for (j = 0; j < n; j++) {
            double x = a[i].local[0] - a[j].local[0], y = a[i].local[1] - a[j].local[1], d = sqrt(x * x + y * y);
            double z = a[i].f.height - a[j].f.height, r[4] = {0, 0, 0, 0};
            if (d < TOUCHING) d = TOUCHING;
            g->level[i][j] = d, g->away[i][j][0] = x / d, g->away[i][j][1] = y / d, d = sqrt(d * d + z * z);
            g->grows[i][j][0] = (x + z * a[i].f.slope[0]) / d, g->grows[i][j][1] = (y + z * a[i].f.slope[1]) / d;
            for (l = 0; l < 4; l++)
                for (k = 0; k < rank; k++) r[l] += f[i][l][k] * linked[j][k];
            g->apart[i][j] = d;
            g->near[i][j] = i == j ? 0 : 1 / (PI * plane * d);
            g->sinks[i][j] = i == j ? 0 : g->near[i][j] + r[0], g->bends[i][j] = i == j ? 0 : fabs(r[3]);
            for (l = 0; l < 2; l++)
                g->slopes[i][j][l] = i == j ? 0 : r[l + 1] - g->near[i][j] / d * g->grows[i][j][l];
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
                more += fi * s->k[j].force * (g->slopes[i][j][l] + s->mean[i] * g->slope_bent[i][j][l] +
                                              s->mean[j] * g->slope_felt[i][j][l]);
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
        refused |= status[i] != EPSMESH_OK && status[i] != EPSMESH_NO_CONTACT;
    }
    for (i = 0; i < n && refused; i++) {
        found = status[i] == EPSMESH_OK || status[i] == EPSMESH_NO_CONTACT ? EPSMESH_OTHERS : status[i];
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
        if (!(k.force > 0)) t[i] = all(EPSMESH_NO_CONTACT, 0.0);
        k.stiffness *= s.inverse[i][i], k.aside[0] = s.aside[i][0], k.aside[1] = s.aside[i][1];
        if (k.force > 0) t[i] = answer_of(m, q[i].young, q[i].depth, &a[i], &k, errors[i]);
        which[i] = t[i].status == EPSMESH_DAMAGED, refused |= which[i];
    }
    if (refused) refuse(n, t, which, EPSMESH_DAMAGED);
}
