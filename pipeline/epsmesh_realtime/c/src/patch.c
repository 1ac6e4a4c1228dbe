/* Any convex tip: pressures on a patch of rectangles, with a half-space's kernel plus the regular part.
 *
 * Inside the contact the face has the tip's shape and pressures are not negative; outside, the face is below the tip:
 *
 *     sum_j (K_ij/E* + c + g.(s_i + t_j) + (s_i.A s_i + t_j.A t_j)/2) p_j >= d - f(s_i),    p >= 0,    one of both equal,
 *
 * K is the displacement of a half-space by uniform pressure on a rectangle (A. E. H. Love, Phil. Trans. R. Soc. A 228,
 * 1929). The other terms, those of contact.c, are multiplied by its area. The patch depends on the depth only, so that
 * forces derive from one energy. The active set of the last call is the initial guess.
 */

/* Rays for a tip's outlines, bisections, chords of the test of convexity, active sets, growths of the patch. */
enum { ROUND = 48, HALVINGS = 50, CHORDS = 500, SETS = 40, GROWTHS = 8, N = EPSMESH_SIDE, ALL = EPSMESH_CELLS };
/* Shallowest outline in units of the deepest; the contact's share of the patch; relative error of the force: the largest for
 * balls and cones with any size of patch, times 1.3. In units of a depth: penetration of the tip by the face, and concavity
 * of the tip; least height of the rim in units of its largest. */
static const double SHALLOWEST = 1e-5, FILLED = 0.82, GOOD = 0.007, THROUGH = 1e-10, BENT = 1e-6, FLAT = 1e-3;

/* ---- the tip ---- */

static void heights_of(const epsmesh_patch *t, int count, const double *x, const double *y, double *z) {
    int i;
    if (t->heights) t->heights((size_t)count, x, y, z, t->user);
    for (i = 0; i < count && !t->heights; i++) z[i] = t->height(x[i], y[i], t->user);
}

static int is_convex(const epsmesh_patch *t, double size) {
    unsigned long state = 1;
    int i, k;
    for (i = 0; i < CHORDS; i++) {
        double at[4], x[3], y[3], z[3];
        for (k = 0; k < 4; k++) { /* two places, by radius and angle */
            state = (state * 1664525UL + 1013904223UL) & 0xffffffffUL;
            at[k] = (double)state / 4294967296.0;
        }
        for (k = 0; k < 2; k++) {
            double r = t->reach * sqrt(at[2 * k]), angle = 2 * PI * at[2 * k + 1];
            x[k] = r * cos(angle), y[k] = r * sin(angle);
        }
        x[2] = (x[0] + x[1]) / 2, y[2] = (y[0] + y[1]) / 2;
        heights_of(t, 3, x, y, z);
        if (!(z[2] <= (z[0] + z[1]) / 2 + BENT * size)) return 0;
    }
    return 1;
}

static void outline_to(const epsmesh_patch *t, double depth, double out[2]) {
    double ray[2][ROUND], low[ROUND], high[ROUND], at[2][ROUND], z[ROUND];
    int i, k, halved;
    out[0] = out[1] = SMALLEST * t->reach;
    for (i = 0; i < ROUND; i++) {
        ray[0][i] = cos(2 * PI * i / (double)ROUND), ray[1][i] = sin(2 * PI * i / (double)ROUND);
        low[i] = 0, high[i] = t->reach;
    }
    for (halved = 0; halved < HALVINGS; halved++) {
        for (i = 0; i < ROUND; i++)
            for (k = 0; k < 2; k++) at[k][i] = (low[i] + high[i]) / 2 * ray[k][i];
        heights_of(t, ROUND, at[0], at[1], z);
        for (i = 0; i < ROUND; i++) {
            double middle = (low[i] + high[i]) / 2;
            if (z[i] < depth) low[i] = middle;
            else high[i] = middle;
        }
    }
    for (i = 0; i < ROUND; i++)
        for (k = 0; k < 2; k++)
            if (fabs(ray[k][i]) * high[i] > out[k]) out[k] = fabs(ray[k][i]) * high[i];
}

static void outline_at(const epsmesh_patch *t, double depth, double out[2]) {
    double at = log(depth), step = -log(SHALLOWEST) / (EPSMESH_DEPTHS - 1), share;
    int i, k;
    if (depth < t->depths[0]) {
        for (k = 0; k < 2; k++) out[k] = t->outlines[0][k] * sqrt(depth / t->depths[0]);
        return;
    }
    share = (at - log(t->depths[0])) / step;
    i = share < EPSMESH_DEPTHS - 2 ? (int)share : EPSMESH_DEPTHS - 2;
    share -= i;
    for (k = 0; k < 2; k++) out[k] = exp((1 - share) * log(t->outlines[i][k]) + share * log(t->outlines[i + 1][k]));
}

/* ---- the patch ---- */

static double love_part(double p, double top, double bottom) {
    return p * log((top + sqrt(top * top + p * p)) / (bottom + sqrt(bottom * bottom + p * p)));
}

static void share_kernel(epsmesh_patch *t, double aspect) {
    int i, j;
    if (fabs(aspect - t->aspect) <= 1e-12 * aspect) return;
    for (i = 0; i < 2 * N - 1; i++)
        for (j = 0; j < 2 * N - 1; j++) {
            double x = i - (N - 1), y = aspect * (j - (N - 1)), a = 0.5, b = aspect / 2;
            t->kernel[i][j] = (love_part(x + a, y + b, y - b) + love_part(y + b, x + a, x - a) +
                               love_part(x - a, y - b, y + b) + love_part(y - b, x - a, x + a)) / PI;
        }
    t->aspect = aspect;
}

/* Subtract products of four pivot rows from a row, from `first` on. Each number waits for none of the others, so that
 * compilers use wide registers; four pivots read and write the row once. */
static void subtract(double *row, double p[][EPSMESH_CELLS], const double f[4], int first, int m) {
    const double *a = p[0], *b = p[1], *c = p[2], *d = p[3];
    int i;
    for (i = first; i + 4 <= m; i += 4) {
        double w = f[0] * a[i] + f[1] * b[i] + f[2] * c[i] + f[3] * d[i];
        double x = f[0] * a[i + 1] + f[1] * b[i + 1] + f[2] * c[i + 1] + f[3] * d[i + 1];
        double y = f[0] * a[i + 2] + f[1] * b[i + 2] + f[2] * c[i + 2] + f[3] * d[i + 2];
        double z = f[0] * a[i + 3] + f[1] * b[i + 3] + f[2] * c[i + 3] + f[3] * d[i + 3];
        w = row[i] - w, x = row[i + 1] - x, y = row[i + 2] - y, z = row[i + 3] - z;
        row[i] = w, row[i + 1] = x, row[i + 2] = y, row[i + 3] = z;
    }
    for (; i < m; i++) row[i] -= f[0] * a[i] + f[1] * b[i] + f[2] * c[i] + f[3] * d[i];
}

/* Overwrite the upper half of the leading rows with its Cholesky factor, and solve for two right-hand sides. */
static int solve_two(double a[][EPSMESH_CELLS], int m, double *one, double *two) {
    int i, j, k, block, end;
    for (block = 0; block < m; block = end) {
        end = block + 4 < m ? block + 4 : m;
        for (k = block; k < end; k++) {
            double d = a[k][k];
            if (!(d > 0)) return 0;
            d = 1 / sqrt(d);
            for (i = k; i < m; i++) a[k][i] *= d;
            for (j = k + 1; j < end; j++) {
                double f = a[k][j], *row = a[j];
                for (i = j; i < m; i++) row[i] -= f * a[k][i];
            }
        }
        for (j = end; j < m; j++) { /* none is left if the last block is shorter */
            double f[4];
            for (k = 0; k < 4; k++) f[k] = a[block + k][j];
            subtract(a[j], &a[block], f, j, m);
        }
    }
    for (k = 0; k < m; k++) {
        one[k] /= a[k][k], two[k] /= a[k][k];
        for (i = k + 1; i < m; i++) one[i] -= a[k][i] * one[k], two[i] -= a[k][i] * two[k];
    }
    for (k = m - 1; k >= 0; k--) {
        for (i = k + 1; i < m; i++) one[k] -= a[k][i] * one[i], two[k] -= a[k][i] * two[i];
        one[k] /= a[k][k], two[k] /= a[k][k];
    }
    return 1;
}

typedef struct {
    double own[2][EPSMESH_CELLS], at[2][EPSMESH_CELLS], gap[EPSMESH_CELLS], bent[EPSMESH_CELLS], step[2], area;
} cells;

static void lay(const epsmesh_patch *t, const place *p, double depth, double turn, const double size[2], cells *c) {
    double along = cos(turn), aside = sin(turn), at[2][ALL], z[ALL];
    int i, k, inside = 0;
    for (k = 0; k < 2; k++) c->step[k] = 2 * size[k] / (double)N;
    c->area = c->step[0] * c->step[1];
    for (i = 0; i < ALL; i++) {
        double x = size[0] * (2 * (i / N + 0.5) / (double)N - 1), y = size[1] * (2 * (i % N + 0.5) / (double)N - 1), u, v;
        c->own[0][i] = x, c->own[1][i] = y;
        u = c->at[0][i] = along * x - aside * y, v = c->at[1][i] = aside * x + along * y;
        c->gap[i] = -HUGE_VAL;
        if (x * x + y * y <= t->reach * t->reach) c->gap[i] = 0, at[0][inside] = x, at[1][inside++] = y;
        c->bent[i] = p->h / 4 * (u * u + v * v) + (p->bent[0] * (u * u - v * v) + p->bent[1] * 2 * u * v) / 2 +
                     (p->lean[0] * u + p->lean[1] * v) / 2;
    }
    heights_of(t, inside, at[0], at[1], z);
    for (i = 0, k = 0; i < ALL; i++)
        if (c->gap[i] == 0) c->gap[i] = depth - z[k++];
}

typedef struct {
    contact k;
    double extent[2];
} spread;

static void sum_up(const place *p, const cells *c, const double *pressure, const int *chosen, int m, double stiffness,
                   spread *s) {
    double force = 0, moment[2] = {0, 0}, square = 0, apart = 0, twist = 0, most = 0;
    int i, j;
    s->extent[0] = s->extent[1] = 0;
    for (j = 0; j < m; j++) {
        double load = c->area * pressure[j], u = c->at[0][chosen[j]], v = c->at[1][chosen[j]];
        force += load, moment[0] += u * load, moment[1] += v * load;
        square += (u * u + v * v) * load, apart += (u * u - v * v) * load, twist += 2 * u * v * load;
        if (u * u + v * v > most) most = u * u + v * v;
        for (i = 0; i < 2; i++)
            if (fabs(c->own[i][chosen[j]]) > s->extent[i]) s->extent[i] = fabs(c->own[i][chosen[j]]);
    }
    for (i = 0; i < 2; i++)
        s->k.aside[i] = 0.5 * force * (force * p->slope_c[i] + square / 2 * p->slope_h[i] + p->hessian[i][0] * moment[0] +
                                       p->hessian[i][1] * moment[1] + apart * p->bent_slopes[0][i] +
                                       twist * p->bent_slopes[1][i]);
    s->k.force = force, s->k.stiffness = stiffness, s->k.radius = sqrt(most), s->k.mean_square = square / force;
}

/* Find which cells press, beginning with those that did: 0 where no set of them is it. */
static int settle(epsmesh_patch *t, const place *p, double depth, double turn, const double size[2], spread *s) {
    cells c;
    double pressure[EPSMESH_CELLS], unit[EPSMESH_CELLS], bends[EPSMESH_CELLS], soft, sum, bent;
    const double *middle = &t->kernel[N - 1][N - 1]; /* of two cells it depends on their difference alone: see `at` */
    int chosen[EPSMESH_CELLS], at[EPSMESH_CELLS], of_chosen[EPSMESH_CELLS], i, j, m, set, changed;
    lay(t, p, depth, turn, size, &c);
    share_kernel(t, c.step[1] / c.step[0]);
    for (i = 0; i < ALL; i++) at[i] = (i / N) * (2 * N - 1) + i % N;
    soft = c.step[0] / p->plane;
    for (m = 0, i = 0; i < ALL; i++) m += t->pressed[i] = t->pressed[i] && c.gap[i] > 0;
    for (i = 0; i < ALL && !m; i++) t->pressed[i] = c.gap[i] > 0;
    for (set = 0; set < SETS; set++) {
        for (m = 0, i = 0; i < ALL; i++)
            if (t->pressed[i]) of_chosen[m] = at[i], bends[m] = c.area * c.bent[i], chosen[m++] = i;
        if (!m) return 0;
        for (i = 0; i < m; i++) {
            const double *kernel = middle + of_chosen[i], rest = c.area * p->c + bends[i];
            for (j = i; j < m; j++) t->matrix[i][j] = soft * kernel[-of_chosen[j]] + rest + bends[j];
            pressure[i] = c.gap[chosen[i]], unit[i] = 1;
        }
        if (!solve_two(t->matrix, m, pressure, unit)) return 0;
        for (sum = bent = 0, j = 0; j < m; j++) sum += pressure[j], bent += c.bent[chosen[j]] * pressure[j];
        for (changed = 0, j = 0, i = 0; i < ALL; i++) {
            int presses;
            if (t->pressed[i]) {
                presses = pressure[j++] > 0;
            } else {
                const double *kernel = middle + at[i];
                double sunk = 0;
                int k;
                if (!(c.gap[i] > -HUGE_VAL)) continue;
                for (k = 0; k < m; k++) sunk += pressure[k] * kernel[-of_chosen[k]];
                presses = c.gap[i] - soft * sunk - c.area * ((p->c + c.bent[i]) * sum + bent) > THROUGH * depth;
            }
            changed |= presses != t->pressed[i];
            t->pressed[i] = (unsigned char)presses;
        }
        if (!changed) {
            for (soft = 0, j = 0; j < m; j++) soft += c.area * unit[j];
            sum_up(p, &c, pressure, chosen, m, soft, s);
            return 1;
        }
    }
    return 0;
}

static double fill_depth(const epsmesh_patch *t, int number) {
    double deepest = t->depths[EPSMESH_DEPTHS - 1];
    return deepest * exp(log(SHALLOWEST) + number * (log(0.9) - log(SHALLOWEST)) / (EPSMESH_FILLS - 1));
}

/* Fill the contact on a patch that holds it: 0 if the tip does not. */
static int within(epsmesh_patch *t, const place *p, double depth, double turn, spread *s) {
    double first = log(fill_depth(t, 0)), step = (log(0.9) - log(SHALLOWEST)) / (EPSMESH_FILLS - 1), size[2], share;
    int i, k, grown;
    share = (log(depth) - first) / step;
    share = share < 0 ? 0 : share > EPSMESH_FILLS - 1 ? EPSMESH_FILLS - 1 : share;
    i = share < EPSMESH_FILLS - 2 ? (int)share : EPSMESH_FILLS - 2;
    share -= i;
    outline_at(t, depth, size);
    for (k = 0; k < 2; k++) size[k] *= ((1 - share) * t->fills[i][k] + share * t->fills[i + 1][k]) / FILLED;
    for (grown = 0; grown < GROWTHS; grown++) {
        double free_row = 1 - 1.5 / (double)N;
        if (!settle(t, p, depth, turn, size, s)) return 0;
        if (s->extent[0] * s->extent[0] + s->extent[1] * s->extent[1] > t->reach * t->reach) return 0;
        if (s->extent[0] < size[0] * free_row && s->extent[1] < size[1] * free_row) return 1;
        size[0] *= 1.2, size[1] *= 1.2;
    }
    return 0;
}

static epsmesh_status patch_make(epsmesh_patch *t, double reach) {
    double rim = HUGE_VAL, top = 0, x = 0, y = 0, z;
    place none;
    spread s;
    int i, k, again;
    memset(&none, 0, sizeof none);
    none.plane = 1, t->reach = reach;
    if (!(t->height || t->heights) || !(reach >= SMALLEST && isfinite(reach))) return EPSMESH_INPUT;
    heights_of(t, 1, &x, &y, &z);
    if (z != 0) return EPSMESH_INPUT;
    for (i = 0; i < ROUND; i++) {
        x = reach * cos(2 * PI * i / (double)ROUND), y = reach * sin(2 * PI * i / (double)ROUND);
        heights_of(t, 1, &x, &y, &z);
        if (!isfinite(z)) return EPSMESH_INPUT;
        rim = smaller(rim, z), top = z > top ? z : top;
    }
    if (!(rim > FLAT * top) || !is_convex(t, top)) return EPSMESH_INPUT;
    for (i = 0; i < EPSMESH_DEPTHS; i++) {
        t->depths[i] = rim * exp(log(SHALLOWEST) * (1 - (double)i / (EPSMESH_DEPTHS - 1)));
        outline_to(t, t->depths[i], t->outlines[i]);
    }
    memset(t->pressed, 1, sizeof t->pressed);
    for (i = 0; i < EPSMESH_FILLS; i++) {
        double outline[2], size[2], depth = fill_depth(t, i);
        outline_at(t, depth, outline);
        t->fills[i][0] = t->fills[i][1] = 1;
        for (again = 0; again < 2; again++) {
            for (k = 0; k < 2; k++) size[k] = t->fills[i][k] * outline[k] / FILLED;
            if (!settle(t, &none, depth, 0, size, &s)) continue;
            for (k = 0; k < 2; k++) {
                double fill = (s.extent[k] + size[k] / (double)N) / outline[k];
                t->fills[i][k] = fill < 0.2 ? 0.2 : fill > 1 ? 1 : fill;
            }
        }
    }
    t->is_made = 1;
    return EPSMESH_OK;
}

epsmesh_status epsmesh_patch_make(epsmesh_patch *t, epsmesh_height height, void *user, double reach) {
    memset(t, 0, sizeof *t);
    t->height = height, t->user = user;
    return patch_make(t, reach);
}

epsmesh_status epsmesh_patch_make_of(epsmesh_patch *t, epsmesh_heights heights, void *user, double reach) {
    memset(t, 0, sizeof *t);
    t->heights = heights, t->user = user;
    return patch_make(t, reach);
}

double epsmesh_patch_deepest(const epsmesh_patch *t) { return t->depths[EPSMESH_DEPTHS - 1]; }

epsmesh_touch epsmesh_patch_touch(epsmesh_patch *t, const epsmesh_model *m, const epsmesh_query *query, double turn) {
    double local[3], edge[2], room, share, bent, error, force[3];
    epsmesh_query q = *query;
    epsmesh_status status;
    epsmesh_touch found;
    spread s;
    place p;
    spot f;
    int i, j;
    q.shape = EPSMESH_DISC, q.radius = SMALLEST;
    status = t->is_made ? misfit(m, &q, local, edge, &f) : EPSMESH_TOOL;
    if (status == EPSMESH_NO_CONTACT) return all(status, 0.0);
    if (status != EPSMESH_OK) return all(status, (double)NAN);
    if (!isfinite(turn)) return all(EPSMESH_INPUT, (double)NAN);
    if (!m->is_flat) return all(EPSMESH_TOOL, (double)NAN);
    if (q.depth >= t->depths[EPSMESH_DEPTHS - 1]) return all(EPSMESH_LARGE, (double)NAN);
    memset(&p, 0, sizeof p);
    if (!place_at(m, local[0], local[1], q.poisson, m->has_tensors, &p)) return all(EPSMESH_DAMAGED, (double)NAN);
    room = room_at(m, local[0], local[1]);
    if (!within(t, &p, q.depth, turn, &s) || !(s.k.radius <= m->largest * room)) return all(EPSMESH_LARGE, (double)NAN);
    share = (s.k.radius / room) * (s.k.radius / room);
    bent = fabs(p.h) + 2 * sqrt(p.bent[0] * p.bent[0] + p.bent[1] * p.bent[1]);
    found.status = EPSMESH_OK, found.stiffness = q.young * s.k.stiffness, found.contact_radius = s.k.radius;
    error = GOOD + m->bar[3] + s.k.stiffness * ((m->bar[0] + m->bar[2] * share * share) / room +
                                                m->bar[1] * bent * s.k.mean_square);
    found.force_error = error * q.young * s.k.force;
    force[0] = s.k.aside[0], force[1] = s.k.aside[1], force[2] = s.k.force;
    for (i = 0; i < 3; i++)
        for (found.force[i] = 0, j = 0; j < 3; j++) found.force[i] += q.young * force[j] * m->axes[j][i];
    if (!(s.k.force > 0 && is_positive(found.stiffness) && found.force_error >= 0 && isfinite(found.force_error) &&
          isfinite(found.force[0]) && isfinite(found.force[1]) && isfinite(found.force[2])))
        return all(EPSMESH_DAMAGED, (double)NAN);
    return found;
}

void epsmesh_patch_touch_each(epsmesh_patch *t, const epsmesh_model *m, size_t count, const epsmesh_query *q,
                              const double *turns, epsmesh_touch *touches) {
    size_t i;
    for (i = 0; i < count; i++) touches[i] = epsmesh_patch_touch(t, m, &q[i], turns[i]);
}
