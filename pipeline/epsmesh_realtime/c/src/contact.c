/* Frictionless contact of a tool with a body, from c, h and their gradients at one place: closed forms, E = 1.
 *
 * A force F at t displaces the face at s (both from the tool's axis) by its field on a half-space, plus
 * F (c + g.(s + t) + h (s^2 + t^2)/4), grad c = 2g: the regular part of the body's Green's function up to second order. For
 * a round tool this is exactly the half-space under a tool whose profile has Fh/4 r^2 more (I. N. Sneddon, 1965):
 *
 *     D(a) = a int f'(r) / (a^2 - r^2)^(1/2) dr,    F = 2E* int D_e(a) - D_e(s) ds,    D_e(s) = D(s) + F h s^2/2,
 *     d = D_e(a) + F c + h/4 int p r^2,             int p r^2 = 4E* int s^2 (D_e(a) - D_e(s)) ds.
 *
 * The gradient g tilts the face by Fg. The pressure changes as under a tilted disc of the contact's radius, which adds
 * -2/3 E* a^3 F^2 g^2 to the complementary energy U(F), d = dU/dF. All forces derive from one energy: at a fixed depth the
 * lateral force is dU/dx, so a closed path does no work. On a dome of mean curvature k a tool acts like one whose profile
 * has k r^2/2 more. D(s) is s artanh(s/R) for a ball (by a series without cancellation) and pi/2 m s for a cone whose flank
 * rises by m (A. E. H. Love, 1939); the first radii are H. Hertz's (1882) and Love's. A bonded disc has V. I. Mossakovskii's
 * normal stiffness (1954), and R. D. Mindlin's lateral one (1949).
 *
 * Large displacements of a ball. The body is linear far from the tool, where strains are small. At equal force, the contact
 * of a half-space is deeper than H. Hertz's depth S by S (L/S - 1) and has 1 - A/a of his radius less. Both ratios are
 * functions of nu and x = (F/E* R^2)^(1/3) alone: solved once for a law, and tabulated. That depth is added to d of a
 * paraboloid, the tool of Hertz, so F derives from one energy as before. As the tool comes nearer to the support of the
 * body, at the depth H, d is smaller by b F L/H^2: on layers 2 to 10 radii thick b is constant within a fifth, for one law
 * and nu. It is fitted to full solves. The bar includes what is left, in proportion to d/room.
 */

/* `aside` is the slope of the energy with x and y; or, if the tool `sticks`, a reaction along the face: components along
 * axes that are turned by the least angle from the body's to the normal. */
typedef struct {
    real force, aside[2], stiffness, radius, mean_square;
    real share; /* relative change of F, per such change of the half-space's F at a depth */
    int sticks;
} contact;

typedef struct {
    real depth, slope, force, square, growth, compliance, near_compliance, widened;
} pressed;

static real cube(real x) { return x * x * x; }
static real fifth(real x) { return x * x * x * x * x; }

static real tangent(real a, const place *p) {
    return 0.5 / (p->plane * a) + p->c + a * a / 3 * p->h - 2.0 / 45 * p->plane * p->h * p->h * fifth(a);
}

static contact press_disc(real a, real depth, const place *p) {
    real stiff = p->plane, h = p->h;
    contact k;
    int i;
    k.force = depth / (tangent(a, p) - 4.0 / 3 * stiff * cube(a) * p->tilt);
    for (i = 0; i < 2; i++) {
        real slope = p->slope_c[i] + p->slope_h[i] * (a * a / 3 - 4.0 / 45 * stiff * h * fifth(a));
        k.aside[i] = 0.5 * k.force * k.force * (slope - 4.0 / 3 * stiff * cube(a) * p->slope_tilt[i]);
    }
    k.stiffness = k.force / depth, k.radius = a, k.share = 1, k.sticks = 0;
    k.mean_square = 2.0 / 3 * a * a - 8.0 / 45 * stiff * h * fifth(a);
    return k;
}

/* D(s), D'(s), and the integrals of D and s^2 D from 0 to s */
static void profile(const request *tool, int is_paraboloid, real s, real out[4]) {
    if (is_paraboloid) {
        real bend = 1 / tool->radius;
        out[0] = bend * s * s, out[1] = 2 * bend * s, out[2] = bend * cube(s) / 3, out[3] = bend * fifth(s) / 5;
    } else if (tool->shape == EPSMESH_SPHERE) {
        real big = tool->radius, t = (s / big) * (s / big), power = t, sum[4] = {0, 0, 0, 0};
        int k;
        for (k = 0; k < TERMS; k++) {
            real term = power / (2 * k + 1);
            sum[0] += term, sum[1] += (2 * k + 2) * term;
            sum[2] += term / (2 * k + 3), sum[3] += term / (2 * k + 5);
            if (term <= NEGLIGIBLE * sum[0]) break;
            power *= t;
        }
        out[0] = big * sum[0], out[1] = big / s * sum[1], out[2] = big * s * sum[2], out[3] = big * cube(s) * sum[3];
    } else {
        real steep = 0.5 * PI / tan(tool->angle);
        out[0] = steep * s, out[1] = steep, out[2] = steep * s * s / 2, out[3] = steep * s * s * s * s / 4;
    }
}

/* Add the depth by which a half-space at large displacements differs from Hertz's. */
static void add_near(const request *tool, const place *p, pressed *k) {
    real big = tool->radius, x = cbrt(k->force / (p->plane * big * big)), terms[3][EPSMESH_MOST];
    real ratio[2] = {0, 0}, growth = 0, hertz = pow(0.75, 2.0 / 3) * x * x * big;
    int i, j;
    polynomials(2 * x / p->near_most - 1, p->nears, terms);
    for (i = 0; i < p->nears; i++) {
        for (j = 0; j < 2; j++) ratio[j] += p->near[j][i] * terms[0][i];
        growth += p->near[0][i] * terms[1][i] * 2 / p->near_most;
    }
    k->near_compliance = hertz / (3 * k->force) * (2 * ratio[0] + x * growth), k->widened = ratio[1];
    k->depth += hertz * (ratio[0] - 1) - p->near_support * k->force * hertz * ratio[0];
    k->compliance += hertz / (3 * k->force) * (2 * (ratio[0] - 1) + x * growth) -
                     p->near_support * (hertz * ratio[0] + k->force * k->near_compliance);
}

static pressed press_to(real a, const request *tool, const place *p) {
    real stiff = p->plane, h = p->h, d[4], own = 1 - 2.0 / 3 * stiff * h * cube(a), power, effect;
    pressed k = {-1, 0, 0, 0, 0, 0, 0, 1};
    if (!(own > 0)) return k;
    profile(tool, p->nears > 0, a, d);
    d[0] += p->bend * a * a, d[1] += 2 * p->bend * a, d[2] += p->bend * cube(a) / 3, d[3] += p->bend * fifth(a) / 5;
    k.force = 2 * stiff * (a * d[0] - d[2]) / own;
    k.square = 4 * stiff * (cube(a) / 3 * d[0] - d[3]) + 4.0 / 15 * stiff * h * k.force * fifth(a);
    k.growth = 2 * stiff * a * d[1] + 2 * stiff * h * k.force * a * a;
    if (k.growth <= 0 || k.force <= 0) {
        pressed none = {-1, 0, 0, 0, 0, 0, 0, 1};
        return none;
    }
    power = own / k.growth * k.force / a;
    effect = -2.0 / 3 * stiff * p->tilt * cube(a) * k.force * (2 + 3 * power);
    k.depth = d[0] + 0.5 * h * k.force * a * a + p->c * k.force + 0.25 * h * k.square + effect;
    k.compliance = tangent(a, p) + effect * (1 + 3 * power) / k.force;
    if (p->nears) add_near(tool, p, &k);
    k.slope = k.compliance * k.growth / own;
    return k;
}

/* The largest radius of contact that formulas and tables know. */
static real limit_of(const request *tool, const place *p) {
    real big = tool->radius, stiff;
    if (!p->nears) return tool->shape == EPSMESH_SPHERE ? BALL_LIMIT * tool->radius : tool->radius;
    stiff = 4 / (3 * big) + 2.0 / 3 * p->h * p->plane * big * big * cube(p->near_most);
    return stiff > 0 ? cbrt(big * big * cube(p->near_most) / stiff) : HUGE_VAL; /* no contact reaches that force */
}

static int press_round(const request *tool, const place *p, real most, contact *k) {
    real limit = limit_of(tool, p), depth = tool->depth;
    real low = 0, high = most < limit ? most : limit, a, step, of_h, of_tilt;
    pressed found;
    int i;
    if (!(press_to(high, tool, p).depth >= depth)) return 0;
    a = tool->shape == EPSMESH_SPHERE ? sqrt(tool->radius * depth) : 2 / PI * depth * tan(tool->angle);
    if (!(a < 0.5 * high)) a = 0.5 * high;
    for (i = 0; i < STEPS; i++) {
        found = press_to(a, tool, p);
        if (found.depth < depth) low = a; else high = a;
        step = found.slope > 0 ? a - (found.depth - depth) / found.slope : low;
        if (low <= step && step <= high && fabs(step - a) <= CLOSE * a) {
            a = step; /* Newton's error is the square of this step; rounding may put it onto the bracket's end */
            break;
        }
        if (!(low < step && step < high)) step = 0.5 * (low + high);
        a = step;
    }
    found = press_to(a, tool, p);
    k->force = found.force, k->stiffness = 1 / found.compliance, k->radius = found.widened * a;
    k->mean_square = found.square / found.force, k->share = found.near_compliance / found.compliance, k->sticks = 0;
    of_h = 0.25 * found.force * found.force * k->mean_square +
           4.0 / 3 * p->plane * p->plane * p->tilt * fifth(a) * cube(found.force) / found.growth;
    of_tilt = -2.0 / 3 * p->plane * cube(a) * found.force * found.force;
    for (i = 0; i < 2; i++)
        k->aside[i] = 0.5 * found.force * found.force * p->slope_c[i] + of_h * p->slope_h[i] +
                      of_tilt * p->slope_tilt[i] + 0.5 * found.square * p->slope_bend[i];
    return 1;
}

/* A rectangle's stiffness, second moments and tilting stiffness: half sides l >= w, E* = 1, in Chebyshev
 * polynomials of 1 - 2 log(w/l)/log(1/50): F/d in units of 2 sqrt(l w), <x^2>/l^2 and <y^2>/w^2 of its pressure, and moment
 * per tilt about its short and long axis in l^2.5 w^0.5 and l w^2. Fitted to boundary elements (A. E. H. Love's
 * rectangles, graded to the edges), within 1e-5. */
static const double RECTANGLE[5][8] = {
    {1.5467288, -0.5389724, 0.154788, -0.0121522, 0.0020102, -0.0001257, 6e-06, -1.4e-06},
    {0.4134192, 0.0443058, 0.0039289, -0.0011234, -0.0003526, 1.7e-06, 2.01e-05, 4.2e-06},
    {0.484368, -0.0181444, -0.0053293, -0.0007768, 1.19e-05, 3.22e-05, 7.5e-06, 8e-07},
    {1.8450174, -0.0168921, 0.2328837, 0.0145178, 0.0050319, 0.0002247, -2e-06, -6.7e-06},
    {1.7362244, 0.2238417, 0.0903649, 0.0247386, 0.0048149, 0.0006582, 5.88e-05, 3.6e-06},
};

static int press_blade(const request *q, const real edge[2], const place *p, real most, contact *k) {
    real big = 0.5 * (q->length > q->width ? q->length : q->width), c8[3][EPSMESH_MOST], r[5] = {0, 0, 0, 0, 0};
    real small = 0.5 * (q->length > q->width ? q->width : q->length), e[2][2], lean[2], twice[2], mean, half, soft;
    real of_place[2], along_edge, across;
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
        real slope = p->lean[0] * e[j][0] + p->lean[1] * e[j][1];
        soft -= lean[j] * slope * slope / 4;
        for (i = 0; i < 2; i++)
            of_place[i] -= lean[j] / 2 * slope * (p->hessian[i][0] * e[j][0] + p->hessian[i][1] * e[j][1]);
    }
    k->force = q->depth / soft, k->stiffness = 1 / soft, k->radius = sqrt(big * big + small * small);
    k->mean_square = along_edge + across, k->share = 1, k->sticks = 0;
    for (i = 0; i < 2; i++) k->aside[i] = 0.5 * k->force * k->force * of_place[i];
    return 1;
}

/* The last column of the inverse of compliances, as force per depth. */
static contact press_bonded(real a, real depth, const place *p) {
    real shear = 0.5 / (1 + p->poisson), soft = 1 - 2 * p->poisson, xx, yy, zz, xy, xz, yz, det;
    real down = 4 * shear * a * (soft > SOFT ? log(1 + 2 * soft) / soft : 2 - 2 * soft);
    real aside = 8 * shear * a / (2 - p->poisson);
    contact k;
    xx = p->regular[0][0] + 1 / aside, yy = p->regular[1][1] + 1 / aside, xy = p->regular[0][1];
    xz = p->regular[0][2], yz = p->regular[1][2], zz = p->regular[2][2] + 1 / down + a * a / 3 * p->h;
    det = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
    k.force = depth * (xx * yy - xy * xy) / det, k.stiffness = k.force / depth;
    k.aside[0] = depth * (xy * yz - xz * yy) / det, k.aside[1] = depth * (xy * xz - xx * yz) / det;
    k.radius = a, k.mean_square = 2.0 / 3 * a * a, k.share = 1, k.sticks = 1;
    return k;
}
