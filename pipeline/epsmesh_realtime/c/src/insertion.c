/* The path of an insertion: epsmesh_insertion.h. Tables are linear between their knots.
 *
 * F = E + C + f z. Before the first puncture, E is the elastic force of the intact tissue, at any depth. After it, E in the
 * channel is that of the tool at rest in its crack, and no function of the largest depth D: the section of a needle is that
 * of an endless one. C is what cutting takes: all of it at D, nothing a slip s above. Friction is a bristle: z = x/s, where
 * x follows the tool and stays within s. No motion gains energy: at a fixed D, E derives from a potential. At a fixed anchor
 * of the bristle, so does f x/s; where the bristle slides, it takes the mean of f over s per advance, as f >= 0.
 *
 * The study's law is that of Coulomb, without a slip: what this force differs from it by is part of the bar.
 */

enum { ADVANCE_DEPTH, ADVANCE_ELASTIC, ADVANCE_CUTTING, ADVANCE_FRICTION, ADVANCE_ERROR, ADVANCE_CRACK, ADVANCE_CUTS,
       ADVANCE_BETWEEN };
enum { BACK_DEPTH, BACK_ELASTIC, BACK_FRICTION, BACK_ERROR, BACK_BETWEEN };
enum { PIERCED_DEPTH, PIERCED_DEPTH_ERROR, PIERCED_FORCE, PIERCED_FORCE_ERROR, PIERCED_AFTER };
enum { MOST_KNOTS = 65536 };

/* A place between two rows of a table. */
typedef struct {
    const double *low, *high;
    double share, width;
} knots;

/* At a depth with two rows, which is a puncture, it is behind the second one. */
static knots knots_at(const double *rows, int count, int columns, double depth) {
    int low = 0, high = count - 1;
    knots k;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (rows[(size_t)middle * (size_t)columns] <= depth) low = middle;
        else high = middle;
    }
    k.low = rows + (size_t)low * (size_t)columns, k.high = k.low + columns;
    k.width = k.high[0] - k.low[0];
    k.share = k.width > 0 ? (depth - k.low[0]) / k.width : 1;
    if (!(k.share > 0)) k.share = 0;
    if (k.share > 1) k.share = 1;
    return k;
}

static double between(const knots *k, int column) {
    return (1 - k->share) * k->low[column] + k->share * k->high[column];
}

static double slope(const knots *k, int column) {
    return k->width > 0 ? (k->high[column] - k->low[column]) / k->width : 0;
}

static double bar_between(const knots *k, int error, int column) {
    return between(k, error) + 4 * k->share * (1 - k->share) * k->high[column];
}

/* Depths grow from 0; equal ones, which are a puncture, only where `jumps`; columns from the first one on are positive. */
static void check_rows(file *f, const char *name, const double *rows, uint32_t count, uint32_t columns, uint32_t first,
                       int jumps) {
    uint32_t i, j;
    if (!rows || f->flaw) return;
    wrong_if(f, count < 2 || count > MOST_KNOTS || rows[0] != 0, name);
    for (i = 0; i < count && !f->flaw; i++) {
        const double *row = rows + (size_t)i * columns;
        for (j = first; j < columns; j++) wrong_if(f, row[j] < 0, name);
        if (i) wrong_if(f, row[0] < row[-(int)columns] || (!jumps && row[0] == row[-(int)columns]), name);
        if (i > 1) wrong_if(f, row[0] == row[-2 * (int)columns], name);
    }
}

epsmesh_status epsmesh_path_load(epsmesh_path *p, const void *data, size_t size) {
    uint32_t shape[4] = {0, EPSMESH_ADVANCE, 0, 0}, back[4] = {0, EPSMESH_BACK, 0, 0};
    uint32_t punctures[4] = {0, EPSMESH_PUNCTURE, 0, 0};
    file f;
    memset(p, 0, sizeof *p);
    file_open(&f, data, size);
    p->advance = doubles(&f, "path_advance", 2, shape);
    check_rows(&f, "path_advance", p->advance, shape[0], EPSMESH_ADVANCE, ADVANCE_CUTTING, 1);
    numbers(&f, "path_slip", &p->slip, 0), wrong_if(&f, !(p->slip > 0), "path_slip");
    if (has(&f, "path_back")) {
        p->back = doubles(&f, "path_back", 2, back);
        check_rows(&f, "path_back", p->back, back[0], EPSMESH_BACK, BACK_FRICTION, 0);
    }
    if (has(&f, "path_punctures")) {
        p->punctures = doubles(&f, "path_punctures", 2, punctures);
        wrong_if(&f, punctures[0] > shape[0], "path_punctures");
    }
    p->flaw = f.flaw, p->flawed = f.name, p->is_loaded = f.flaw == EPSMESH_SOUND;
    if (!p->is_loaded) return EPSMESH_NO_MODEL;
    p->advances = (int)shape[0], p->backs = p->back ? (int)back[0] : 0, p->pierced = p->punctures ? (int)punctures[0] : 0;
    return EPSMESH_OK;
}

epsmesh_flaw epsmesh_path_flaw(const epsmesh_path *p, const char **array) {
    *array = p->flawed;
    return p->flaw;
}

void epsmesh_insertion_begin(epsmesh_insertion *s, const epsmesh_path *p, double slip) {
    memset(s, 0, sizeof *s);
    s->slip = is_positive(slip) ? slip : p->slip;
    s->way = 1;
}

static epsmesh_resistance resists(epsmesh_status status, epsmesh_stage stage, double number) {
    epsmesh_resistance r;
    memset(&r, 0, sizeof r);
    r.status = status, r.stage = stage;
    r.force = r.force_error = r.elastic = r.cutting = r.friction = r.stiffness = r.crack_depth = number;
    return r;
}

/* Add to the bar what is not known where the tissue is just about to be pierced, or has just been; count the punctures. */
static void pierce(const epsmesh_path *p, double deepest, epsmesh_resistance *r) {
    int i;
    for (i = 0; i < p->pierced; i++) {
        const double *one = p->punctures + (size_t)i * EPSMESH_PUNCTURE;
        double jump = one[PIERCED_FORCE] + one[PIERCED_FORCE_ERROR] - one[PIERCED_AFTER];
        if (deepest >= one[PIERCED_DEPTH]) r->punctures++;
        if (fabs(deepest - one[PIERCED_DEPTH]) <= one[PIERCED_DEPTH_ERROR] && jump > 0) r->force_error += jump;
    }
}

epsmesh_resistance epsmesh_insertion_to(epsmesh_insertion *s, const epsmesh_path *p, double depth) {
    epsmesh_resistance r;
    knots at, front;
    double end, share, rubs, rub_slope;
    int is_front, is_intact;
    if (!p->is_loaded) return resists(EPSMESH_NO_MODEL, EPSMESH_ABOVE, (double)NAN);
    if (!isfinite(depth) || !is_positive(s->slip)) return resists(EPSMESH_INPUT, EPSMESH_ABOVE, (double)NAN);
    end = p->advance[(size_t)(p->advances - 1) * EPSMESH_ADVANCE];
    if (depth > end) s->is_lost = 1;
    if (depth != s->depth) s->way = depth > s->depth ? 1 : -1;
    s->lag += depth - s->depth, s->depth = depth;
    if (s->lag > s->slip) s->lag = s->slip;
    if (s->lag < -s->slip) s->lag = -s->slip;
    if (depth > end) return resists(EPSMESH_DEEP, EPSMESH_ABOVE, (double)NAN);
    if (s->is_lost) return resists(EPSMESH_HISTORY, EPSMESH_ABOVE, (double)NAN);
    if (depth > s->deepest) s->deepest = depth;
    front = knots_at(p->advance, p->advances, EPSMESH_ADVANCE, s->deepest);
    if (depth <= 0) {
        s->lag = 0;
        r = resists(EPSMESH_NO_CONTACT, EPSMESH_ABOVE, 0.0);
        r.crack_depth = between(&front, ADVANCE_CRACK);
        pierce(p, s->deepest, &r);
        r.force_error = 0;
        return r;
    }
    is_front = depth == s->deepest;
    r = resists(EPSMESH_OK, EPSMESH_CHANNEL, 0.0);
    r.crack_depth = between(&front, ADVANCE_CRACK);
    is_intact = depth > r.crack_depth; /* of the layer at this depth */
    share = s->lag / s->slip;
    if (is_front || is_intact) {
        at = knots_at(p->advance, p->advances, EPSMESH_ADVANCE, depth);
        r.stage = (at.share > 0 ? at.high : at.low)[ADVANCE_CUTS] > 0 ? EPSMESH_CUTS : EPSMESH_INDENTS;
        r.elastic = between(&at, ADVANCE_ELASTIC), r.stiffness = slope(&at, ADVANCE_ELASTIC);
        r.force_error = bar_between(&at, ADVANCE_ERROR, ADVANCE_BETWEEN);
        rubs = between(&at, ADVANCE_FRICTION), rub_slope = slope(&at, ADVANCE_FRICTION);
    } else {
        if (!p->back) return resists(EPSMESH_HISTORY, EPSMESH_CHANNEL, (double)NAN);
        at = knots_at(p->back, p->backs, EPSMESH_BACK, depth);
        r.elastic = between(&at, BACK_ELASTIC), r.stiffness = slope(&at, BACK_ELASTIC);
        r.force_error = bar_between(&at, BACK_ERROR, BACK_BETWEEN);
        rubs = between(&at, BACK_FRICTION), rub_slope = slope(&at, BACK_FRICTION);
    }
    r.friction = rubs * share, r.stiffness += rub_slope * share;
    if (fabs(share) < 1) r.stiffness += rubs / s->slip;
    r.force_error += rubs * fabs(s->way - share);
    r.cutting = between(&front, ADVANCE_CUTTING);
    if (is_front) r.stiffness += slope(&front, ADVANCE_CUTTING);
    else {
        double left = 1 - (s->deepest - depth) / s->slip;
        if (left > 0) r.stiffness += r.cutting / s->slip;
        r.cutting *= left > 0 ? left : 0;
        r.force_error += r.cutting;
    }
    r.force = r.elastic + r.cutting + r.friction;
    pierce(p, s->deepest, &r);
    return r;
}

void epsmesh_insertion_each(epsmesh_insertion *s, const epsmesh_path *p, size_t count, const double *depths,
                            epsmesh_resistance *found) {
    size_t i;
    for (i = 0; i < count; i++) found[i] = epsmesh_insertion_to(s, p, depths[i]);
}

void epsmesh_insertion_sizes(size_t sizes[3]) {
    sizes[0] = sizeof(epsmesh_path), sizes[1] = sizeof(epsmesh_insertion), sizes[2] = sizeof(epsmesh_resistance);
}
