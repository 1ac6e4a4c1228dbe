/* What is seen of a touch: a half-space under the tool, plus the regular part R of the body's Green's function, which the
 * file has as a few modes of the surface: the effect of sides, support and curvature.
 *
 * On the face, rho from the axis of a contact of radius a under a force F, E = 1 (K. L. Johnson, Contact Mechanics, ch. 3
 * and 5; I. N. Sneddon, 1965), outside the contact:
 *
 *     disc  w = F/(pi E* a) asin(a/rho),                                             P = F (1 - (1 - rho^2/a^2)^(1/2))
 *     ball  w = 3F/(4 pi E* a^3) ((2a^2 - rho^2) asin(a/rho) + a (rho^2 - a^2)^(1/2)),  P = F (1 - (1 - rho^2/a^2)^(3/2))
 *     cone  w = 2F/(pi E* a^2) (a asin(a/rho) + (rho^2 - a^2)^(1/2) - rho),
 *           P = F (1 - (1 - rho^2/a^2)^(1/2) + rho^2/a^2 arcosh(a/rho))
 *
 * Inside, the face has the tool's shape. The lateral displacement is (1 - 2 nu)(1 + nu) P/(2 pi rho) towards the axis; P is
 * the force within rho. Below the face, a contact is represented by its force and second moment. Near the tool, a curved
 * face uses the closed form of its tangent plane, corrected by a point force for the distance to that plane. A blade is
 * represented by discs along its edge with the same second moments. At the edge of a bonded disc there is no displacement
 * towards the axis.
 */

/* A point is on the face, in units of the thickness; distance from the axis that counts as 0, in contact radii. */
static const double ON_FACE = 1e-6, AXIS = 1e-6;
/* A curved face is near a tool up to so many contact radii, and up to this slope below the tangent plane. */
static const double NEXT_TO = 4.0, STEEP = 1.0;
/* Largest height above the force's plane, in units of the distance to the force, for the half-space's field; largest
 * distance of a contact's points from its plane, in units of its radius. */
static const double OVER = 0.95, BOWED = 0.7;
/* Discs of a blade: their distance in half widths, and their least and largest number. */
static const double APART = 1.2;
enum { FEWEST = 4, MOST_DISCS = 24 };

/* Equal contacts of radius `a` at `centres`, with the second moments `spread` of the whole pressure for a unit force. */
typedef struct {
    const epsmesh_query *tool;
    double a, reach, square, spread[3], centres[MOST_DISCS][2], half[2], edge[2], poisson, plane;
    int count;
} footprint;

static void footprint_of(const epsmesh_query *q, const double edge[2], double radius, footprint *f) {
    const double share = q->shape == EPSMESH_SPHERE ? 2.0 / 5 : q->shape == EPSMESH_CONE ? 1.0 / 3 : 2.0 / 3;
    double spread[2], second[2][2];
    int i;
    f->tool = q, f->poisson = q->poisson, f->plane = 1 / (1 - q->poisson * q->poisson), f->count = 1;
    f->a = f->reach = radius, f->centres[0][0] = f->centres[0][1] = 0;
    f->spread[0] = f->spread[2] = 0.5 * share * radius * radius, f->spread[1] = 0;
    f->half[0] = f->half[1] = HUGE_VAL, f->edge[0] = 1, f->edge[1] = 0;
    if (q->shape == EPSMESH_BLADE) {
        double power, most = moment(q, f->plane, 0, &power), along;
        tensor(q, edge, second);
        f->spread[0] = most * second[0][0], f->spread[1] = most * second[0][1], f->spread[2] = most * second[1][1];
        f->half[0] = 0.5 * (q->length > q->width ? q->length : q->width);
        f->half[1] = 0.5 * (q->length > q->width ? q->width : q->length);
        f->edge[0] = q->length < q->width ? -edge[1] : edge[0], f->edge[1] = q->length < q->width ? edge[0] : edge[1];
        f->a = f->half[1], f->reach = sqrt(f->half[0] * f->half[0] + f->half[1] * f->half[1]);
        f->count = (int)ceil(2 * f->half[0] / (APART * f->half[1]));
        f->count = f->count < FEWEST ? FEWEST : f->count > MOST_DISCS ? MOST_DISCS : f->count;
        spread[0] = f->spread[0] * f->edge[0] + f->spread[1] * f->edge[1];
        spread[1] = f->spread[1] * f->edge[0] + f->spread[2] * f->edge[1];
        /* A disc's second moment in one direction is a third of its squared radius. Chebyshev points: the pressure is
         * singular (1/sqrt) at both ends. */
        along = spread[0] * f->edge[0] + spread[1] * f->edge[1] - f->a * f->a / 3;
        along = sqrt(along > 0 ? 2 * along : 0);
        for (i = 0; i < f->count; i++) {
            const double at = along * cos(PI * (i + 0.5) / f->count);
            f->centres[i][0] = at * f->edge[0], f->centres[i][1] = at * f->edge[1];
        }
    }
    f->square = f->spread[0] + f->spread[2];
}

/* Return w/F of a half-space outside the contact, and P/F; inside, w is that of the edge. */
static double on_face(const footprint *f, double rho, double *share) {
    const double a = f->a, far = rho > a ? rho : a, near = rho < a ? rho / a : 1;
    const double angle = asin(a / far), beside = sqrt(far * far - a * a), left = sqrt(1 - near * near);
    if (f->tool->shape == EPSMESH_SPHERE) {
        *share = 1 - left * left * left;
        return 0.75 / (PI * f->plane * a * a * a) * ((2 * a * a - far * far) * angle + a * beside);
    }
    if (f->tool->shape == EPSMESH_CONE) {
        *share = 1 - left + near * near * acosh(1 / near);
        return 2 / (PI * f->plane * a * a) * (a * angle - a * a / (far + beside));
    }
    *share = 1 - left;
    return angle / (PI * f->plane * a);
}

/* Add `weight` times the displacement of a half-space's face, from the middle of one contact. */
static void add_on_face(const footprint *f, double x, double y, double weight, double moved[3]) {
    double rho = sqrt(x * x + y * y), share, sunk, aside;
    rho = rho > AXIS * f->a ? rho : AXIS * f->a;
    sunk = on_face(f, rho, &share);
    if (f->tool->shape == EPSMESH_BONDED_DISC) {
        const double free = 1 - (f->a / rho) * (f->a / rho);
        share *= free > 0 ? free : 0;
    }
    aside = -(1 - 2 * f->poisson) * (1 + f->poisson) / (2 * PI) * share / (rho * rho);
    moved[0] += weight * aside * x, moved[1] += weight * aside * y, moved[2] -= weight * sunk;
}

/* The displacement of a half-space under a newton, E = 1 (J. Boussinesq, 1885); the second moment adds its Laplacian along
 * the face times a quarter of the mean of rho^2. */
static void boussinesq(double poisson, double square, const double at[3], double moved[3]) {
    const double across = at[0] * at[0] + at[1] * at[1], all_of = across + at[2] * at[2], soft = 1 - 2 * poisson;
    const double one = 1 / sqrt(all_of > square ? all_of : square), third = one * one * one, fifth_of = third * one * one;
    const double depth = -at[2] > -OVER / one ? -at[2] : -OVER / one, quarter = square / 4, bend = 15 * across * one * one;
    const double scale = (1 + poisson) / (2 * PI);
    double aside = depth * third - soft * one / (1 / one + depth), down = depth * depth * third + (1 + soft) * one;
    aside += quarter * fifth_of * depth * (bend - 12 + 3 * soft);
    down += quarter * (depth * depth * fifth_of * (bend - 6) + (1 + soft) * third * (1 - 3 * depth * depth * one * one));
    moved[0] = scale * aside * at[0], moved[1] = scale * aside * at[1], moved[2] = -scale * down;
}

static void on_plane(const footprint *f, const double at[3], double moved[3]) {
    int i;
    if (f->count > 1 && at[0] * at[0] + at[1] * at[1] > (NEXT_TO * f->reach) * (NEXT_TO * f->reach)) {
        boussinesq(f->poisson, f->square, at, moved);
        return;
    }
    moved[0] = moved[1] = moved[2] = 0;
    for (i = 0; i < f->count; i++)
        add_on_face(f, at[0] - f->centres[i][0], at[1] - f->centres[i][1], 1.0 / f->count, moved);
}

/* The displacement at a place from the axis and the plane of contact; below the tool it is that of the contact's edge. */
static void field(const footprint *f, const double at[3], double flat, double moved[3]) {
    const double across = at[0] * at[0] + at[1] * at[1], height = at[2] * at[2];
    double level[3], plane[3], less[3];
    int i;
    if (fabs(at[2]) <= flat) {
        on_plane(f, at, moved);
        return;
    }
    boussinesq(f->poisson, f->square, at, moved);
    if (!(across + height <= (NEXT_TO * f->reach) * (NEXT_TO * f->reach) && height <= STEEP * STEEP * across)) return;
    level[0] = at[0], level[1] = at[1], level[2] = 0;
    boussinesq(f->poisson, f->square, level, less), on_plane(f, level, plane);
    for (i = 0; i < 3; i++) moved[i] += plane[i] - less[i];
}

static int is_below(const footprint *f, const double at[3]) {
    double along, aside;
    if (!(at[0] * at[0] + at[1] * at[1] <= f->reach * f->reach && fabs(at[2]) <= BOWED * f->reach)) return 0;
    along = f->edge[0] * at[0] + f->edge[1] * at[1], aside = f->edge[0] * at[1] - f->edge[1] * at[0];
    return f->count == 1 || (fabs(along) <= f->half[0] && fabs(aside) <= f->half[1]);
}

/* The height of the tool's surface above its lowest point, less that of a point below it. */
static double lifted(const epsmesh_query *q, const double at[3]) {
    const double square = at[0] * at[0] + at[1] * at[1], left = q->radius * q->radius - square;
    if (q->shape == EPSMESH_SPHERE) return q->radius - sqrt(left > 0 ? left : 0) - at[2];
    return q->shape == EPSMESH_CONE ? sqrt(square) / tan(q->angle) - at[2] : 0;
}

/* Eight sums at a time: one alone waits for itself, and a compiler does not reorder it. */
static double weighted(const int16_t *modes, const float *amounts, int count) {
    float sum[8] = {0, 0, 0, 0, 0, 0, 0, 0};
    int i, k;
    for (k = 0; k + 8 <= count; k += 8)
        for (i = 0; i < 8; i++) sum[i] += (float)modes[k + i] * amounts[k + i];
    for (; k < count; k++) sum[0] += (float)modes[k] * amounts[k];
    return ((double)sum[0] + sum[1] + sum[2] + sum[3]) + ((double)sum[4] + sum[5] + sum[6] + sum[7]);
}

/* R of all vertices for a force at x, y (m) with second moments xx, xy, yy (m^2). */
static void regular_at(const epsmesh_model *m, double x, double y, double ratio, const double spread[3], double *regular) {
    const int *n = m->surface_counts;
    double u[3][EPSMESH_MOST], v[3][EPSMESH_MOST], nu[3][EPSMESH_MOST], a = m->reach[0], b = m->reach[1];
    double low = m->poisson_range[0], high = m->poisson_range[1];
    const float *amount = m->surface_amounts;
    float amounts[EPSMESH_MOST_SEEN];
    size_t row, rows = 3 * (size_t)m->vertices;
    int i, j, k, p;
    polynomials(x / a, n[3], u), polynomials(y / b, n[2], v);
    polynomials(high == low ? 0 : (2 * ratio - low - high) / (high - low), n[1], nu);
    for (k = 0; k < n[0]; k++) {
        double sum = 0;
        for (p = 0; p < n[1]; p++)
            for (j = 0; j < n[2]; j++)
                for (i = 0; i < n[3]; i++)
                    sum += *amount++ * nu[0][p] *
                           (v[0][j] * u[0][i] + spread[1] / (a * b) * v[1][j] * u[1][i] +
                            spread[0] / (2 * a * a) * v[0][j] * u[2][i] + spread[2] / (2 * b * b) * v[2][j] * u[0][i]);
        amounts[k] = (float)sum;
    }
    for (row = 0; row < rows; row++) regular[row] = weighted(m->surface_modes + row * (size_t)n[0], amounts, n[0]);
}

/* The footprint of a touch, and its place (m) along the face's axes. */
static void foot_of(const epsmesh_model *m, const epsmesh_query *q, const epsmesh_touch *t, double local[3], footprint *f) {
    double edge[2];
    tool_of(m, q, edge), into_face(m, q->at, local), footprint_of(q, edge, t->contact_radius, f);
}

void epsmesh_surface_regular(const epsmesh_model *m, const epsmesh_query *q, const epsmesh_touch *t, double *regular) {
    double at[3];
    footprint f;
    if (t->status != EPSMESH_OK) return;
    foot_of(m, q, t, at, &f);
    regular_at(m, at[0], at[1], q->poisson, f.spread, regular);
}

epsmesh_status epsmesh_surface_move(const epsmesh_model *m, const epsmesh_query *q, const epsmesh_touch *t, size_t count,
                                    const double *points, const double *regular, double *moved) {
    double at[3], turn[3][3], force = 0, sum = 0, flat = ON_FACE * m->thickness;
    footprint f;
    spot s;
    size_t n;
    int i, j;
    for (n = 0; n < 3 * count && t->status != EPSMESH_OK; n++) moved[n] = t->status == EPSMESH_NO_CONTACT ? 0 : (double)NAN;
    if (t->status != EPSMESH_OK) return t->status;
    foot_of(m, q, t, at, &f);
    s = face_at(m, at[0], at[1]);
    turn_of(&s, turn);
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) force += s.normal[i] * m->axes[i][j] * t->force[j] / q->young;
    for (n = 0; n < count; n++, points += 3, regular += 3, moved += 3) {
        double away[3], own[3], more;
        for (i = 0; i < 3; i++)
            for (away[i] = 0, j = 0; j < 3; j++) away[i] += turn[i][j] * (points[j] - at[j]);
        field(&f, away, flat, own);
        for (i = 0; i < 3; i++)
            moved[i] = force * (own[0] * turn[0][i] + own[1] * turn[1][i] + own[2] * turn[2][i] + regular[i]);
        if (is_below(&f, away)) { /* the surface below the tool follows it */
            more = lifted(q, away) - q->depth - (moved[0] * turn[2][0] + moved[1] * turn[2][1] + moved[2] * turn[2][2]);
            for (i = 0; i < 3; i++) moved[i] += more * turn[2][i];
        }
        sum += fabs(moved[0]) + fabs(moved[1]) + fabs(moved[2]);
    }
    return isfinite(sum) ? EPSMESH_OK : EPSMESH_DAMAGED;
}

epsmesh_touch epsmesh_surface_press(const epsmesh_model *m, const epsmesh_query *q, double *room, double *moved) {
    epsmesh_touch t = epsmesh_touch_at(m, q);
    size_t i, count = 3 * (size_t)m->vertices;
    for (i = 0; i < count; i++) room[i] = m->surface_points[i];
    epsmesh_surface_regular(m, q, &t, room + count);
    if (epsmesh_surface_move(m, q, &t, count / 3, room, room + count, moved) != EPSMESH_DAMAGED) return t;
    for (i = 0; i < count; i++) moved[i] = (double)NAN;
    return all(EPSMESH_DAMAGED, (double)NAN);
}
