/* Relaxing tissue. A term keeps q of a quantity x: q' = x' - q / time; E(t - s) dx(s), integrated, is g x + sum share q
 * (R. M. Christensen 1982, chapters 1 and 2). Where x is linear in time over a step, the recursion is exact.
 *
 * Contact that stays the same (disc, blade): displacements are in proportion to the depth, so forces are elastic ones times
 * R(d)/d, R the integral of the depth. Contact ends where R would be negative, at once below the whole tool, as its
 * pressure has one shape; the surface then recovers with R = 0.
 *
 * Contact that grows (E. H. Lee, J. R. M. Radok 1960): the force is the integral of the elastic force. Where it shrinks
 * (T. C. T. Ting 1966), contact is what it was at an earlier time t1, and only what was before t1 counts: the integral of
 * E(t - s) d'(s) from t1 to t is zero. Both hold for nested contacts on any body that relaxes alike, once up and down. */

/* In steps of growing contact below this share of the depth, the elastic force is linear. In longer ones it is quadratic;
 * the error was at most a ninth of what its curvature changes (balls and cones, 4 to 100 steps), and this share is the bar. */
static const double SHORT = 1e-4, OF_CURVED = 0.25;
/* Tissue is at rest after so many of its longest times, or if so little of the deepest dent is left. Rounding of Q. */
static const double RESTS = 40.0, REST = 1e-12, REGROWN = 1e-12, SAME_PLACE = 1e-6;
enum { ROOT_STEPS = 40 };

static int grows(const epsmesh_query *q) { return q->shape == EPSMESH_SPHERE || q->shape == EPSMESH_CONE; }

/* What is left of a rise at a constant rate, in units of the rise; exp(-x) of what was before. */
static double risen(double x) { return x > 0 ? -expm1(-x) / x : 1; }

/* The same of a rise that is quadratic in time, less that of one at a constant rate. */
static double bent_more(double x) {
    if (x < 1e-3) return x * (1.0 / 6 - x / 12 + x * x / 40);
    return 2 * (1 - risen(x)) / x - risen(x);
}

static double stays(const epsmesh_model *m) {
    double rest = 1;
    int i;
    for (i = 0; i < m->relaxing; i++) rest -= m->share[i];
    return rest;
}

/* The integral of E(t - s)/E over the depth, or over another quantity with its terms. */
static double felt(const epsmesh_model *m, double whole, const double *of, size_t stride) {
    double sum = stays(m) * whole;
    int i;
    for (i = 0; i < m->relaxing; i++) sum += m->share[i] * of[(size_t)i * stride];
    return sum;
}

static double felt_depth(const epsmesh_model *m, const epsmesh_moment *at) { return felt(m, at->depth, at->of_depth, 1); }

static double length_of(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

/* Go on for a step to a depth and an elastic touch there. */
static void go_on(const epsmesh_model *m, epsmesh_moment *at, double step, double depth, const epsmesh_touch *elastic) {
    double size = length_of(elastic->force);
    int i, k;
    for (i = 0; i < m->relaxing; i++) {
        double x = step / m->time[i], left = exp(-x), rise = risen(x);
        at->of_depth[i] = left * at->of_depth[i] + rise * (depth - at->depth);
        for (k = 0; k < 3; k++) at->of_force[i][k] = left * at->of_force[i][k] + rise * (elastic->force[k] - at->force[k]);
    }
    for (k = 0; k < 3; k++) at->force[k] = elastic->force[k];
    at->time += step, at->depth = depth;
    if (elastic->force_error > at->error * size) at->error = elastic->force_error / size;
}

/* The same, if contact grows: the force is quadratic in the step, and through that at half of it. */
static void grow_on(const epsmesh_model *m, const epsmesh_query *q, epsmesh_moment *at, double step,
                    const epsmesh_touch *elastic) {
    epsmesh_query half = *q;
    epsmesh_touch middle;
    double bend[3] = {0, 0, 0}, size;
    int i, k;
    half.depth = 0.5 * (at->depth + q->depth);
    if (q->depth - at->depth > SHORT * q->depth) {
        middle = epsmesh_touch_at(m, &half);
        for (k = 0; k < 3; k++)
            bend[k] = 2 * (at->force[k] + elastic->force[k] - 2 * (middle.status == EPSMESH_OK ? middle.force[k] : 0));
    }
    size = length_of(bend);
    go_on(m, at, step, q->depth, elastic);
    for (i = 0; i < m->relaxing; i++) {
        double x = step / m->time[i], more = bent_more(x);
        for (k = 0; k < 3; k++) at->of_force[i][k] += more * bend[k];
        at->doubt[i] = exp(-x) * at->doubt[i] + OF_CURVED * fabs(more) * size;
    }
}

/* The force at a moment, and its bar, some time (s) `since`. */
static void feel(const epsmesh_model *m, epsmesh_moment *at, double since, epsmesh_touch *touch) {
    double doubt = 0;
    int i, k;
    for (i = 0; i < m->relaxing; i++) {
        double left = exp(-since / m->time[i]);
        for (k = 0; k < 3; k++) at->of_force[i][k] *= left;
        doubt += m->share[i] * left * at->doubt[i];
    }
    for (k = 0; k < 3; k++) touch->force[k] = felt(m, at->force[k], at->of_force[0] + k, 3);
    touch->force_error = at->error * length_of(touch->force) + doubt;
}

void epsmesh_memory_begin(epsmesh_memory *memory, epsmesh_moment *moments, size_t room) {
    memset(memory, 0, sizeof *memory);
    memory->moments = moments, memory->room = moments ? room : 0;
}

static int is_same(const epsmesh_model *m, const epsmesh_query *a, const epsmesh_query *b) {
    double apart = 0;
    int i;
    for (i = 0; i < 3; i++) {
        apart += (a->at[i] - b->at[i]) * (a->at[i] - b->at[i]);
        if (a->shape == EPSMESH_BLADE && a->along[i] != b->along[i]) return 0;
    }
    if (a->shape != b->shape || a->young != b->young || a->poisson != b->poisson) return 0;
    if (!(sqrt(apart) <= SAME_PLACE * m->thickness)) return 0;
    if (a->shape == EPSMESH_BLADE) return a->length == b->length && a->width == b->width;
    return a->radius == b->radius && (a->shape != EPSMESH_CONE || a->angle == b->angle);
}

static epsmesh_touch forgotten(epsmesh_memory *memory, epsmesh_status status) {
    memory->phase = EPSMESH_UNKNOWN;
    return all(status, (double)NAN);
}

static epsmesh_touch in_the_air(const epsmesh_model *m, epsmesh_memory *memory, double step) {
    double longest = 0, left = fabs(memory->now.depth);
    int i;
    for (i = 0; i < m->relaxing; i++) {
        if (m->time[i] > longest) longest = m->time[i];
        left += fabs(memory->now.of_depth[i]);
    }
    memory->away = memory->phase == EPSMESH_FREE ? memory->away + step : 0;
    memory->phase = EPSMESH_FREE;
    if (memory->away > RESTS * longest || left <= REST * memory->deepest)
        epsmesh_memory_begin(memory, memory->moments, memory->room);
    return all(EPSMESH_NO_CONTACT, 0.0);
}

/* A disc or a blade: in contact if its depth is not less than that of the free surface. */
static epsmesh_touch after_same(const epsmesh_model *m, const epsmesh_query *q, double step, epsmesh_memory *memory) {
    epsmesh_touch touch = epsmesh_touch_at(m, q), none = all(EPSMESH_NO_CONTACT, 0.0);
    epsmesh_moment next = memory->now;
    double share, soft = stays(m);
    int i;
    if (touch.status != EPSMESH_OK && touch.status != EPSMESH_NO_CONTACT) return forgotten(memory, touch.status);
    go_on(m, &next, step, q->depth, &touch);
    share = felt_depth(m, &next) / q->depth;
    if (touch.status == EPSMESH_OK && share > 0) {
        memory->now = next, memory->phase = EPSMESH_GROWING;
        if (q->depth > memory->deepest) memory->deepest = q->depth;
        for (i = 0; i < 3; i++) touch.force[i] *= share;
        touch.force_error *= share;
        return touch;
    }
    next = memory->now;
    go_on(m, &next, step, next.depth, &none);
    share = felt_depth(m, &next);
    for (i = 0; i < m->relaxing; i++) soft += m->share[i] * risen(step / m->time[i]);
    next = memory->now;
    go_on(m, &next, step, next.depth - share / soft, &none);
    memory->now = next;
    return in_the_air(m, memory, step);
}

/* Q: what the loading until a share of the way from one moment to the next gives at a `time`, felt at that time. */
static double until(const epsmesh_model *m, const epsmesh_moment *from, const epsmesh_moment *to, double share, double time,
                    double *slope) {
    double rise = to->depth - from->depth, step = to->time - from->time, rest = stays(m);
    double sum = rest * (from->depth + share * rise);
    int i;
    *slope = rest * rise;
    for (i = 0; i < m->relaxing; i++) {
        double then = exp(-(time - from->time - share * step) / m->time[i]), x = share * step / m->time[i];
        sum += m->share[i] * then * (from->of_depth[i] * exp(-x) + share * rise * risen(x));
        *slope += m->share[i] * then * rise;
    }
    return sum;
}

/* Find the moment t1; returns 0 if contact is lost. */
static int shrunk(const epsmesh_model *m, epsmesh_memory *memory, double whole, epsmesh_moment *from, double *share) {
    double time = memory->now.time, low = 0, high = 1, slope, at = 1;
    size_t first = 0, last = memory->used;
    int i;
    if (whole <= 0) return 0;
    /* The last of the moments that gives no more than is felt. Q grows with t1. */
    while (first < last) {
        size_t middle = first + (last - first) / 2;
        if (until(m, &memory->moments[middle], &memory->moments[middle], 0, time, &slope) <= whole) first = middle + 1;
        else last = middle;
    }
    if (first < memory->used) memory->contact = memory->moments[first];
    memory->used = first;
    if (first) *from = memory->moments[first - 1];
    else memset(from, 0, sizeof *from);
    for (i = 0; i < ROOT_STEPS; i++) {
        double off = until(m, from, &memory->contact, at, time, &slope) - whole, next;
        if (off > 0) high = at;
        else low = at;
        next = slope > 0 ? at - off / slope : low;
        if (fabs(next - at) <= CLOSE) {
            at = next;
            break;
        }
        if (!(low <= next && next <= high)) next = 0.5 * (low + high);
        at = next;
    }
    *share = at < 0 ? 0 : at > 1 ? 1 : at;
    return 1;
}

static epsmesh_touch after_growing(const epsmesh_model *m, const epsmesh_query *q, double step, epsmesh_memory *memory) {
    epsmesh_moment *now = &memory->now, from, *top;
    epsmesh_query then = *q;
    epsmesh_touch touch = all(EPSMESH_NO_CONTACT, 0.0);
    double whole, share, slope;
    if (memory->phase <= EPSMESH_GROWING && q->depth >= now->depth) {
        touch = epsmesh_touch_at(m, q);
        if (touch.status == EPSMESH_NO_CONTACT && memory->phase == EPSMESH_RESTED) return touch;
        if (touch.status != EPSMESH_OK) return forgotten(memory, touch.status);
        if (memory->used + 2 > memory->room) return forgotten(memory, EPSMESH_HISTORY);
        top = memory->used > 1 ? &memory->moments[memory->used - 1] : NULL;
        grow_on(m, q, now, step, &touch);
        if (top && top->depth == now->depth && top[-1].depth == now->depth) *top = *now; /* it is held */
        else memory->moments[memory->used++] = *now;
        memory->phase = EPSMESH_GROWING, memory->contact = *now, memory->deepest = now->depth;
        from = *now;
        feel(m, &from, 0, &touch);
        return touch;
    }
    if (memory->phase == EPSMESH_RESTED) return epsmesh_touch_at(m, q);
    /* A tool above the face at rest is above the surface, which never rises beyond it. */
    go_on(m, now, step, q->depth > 0 ? q->depth : 0, &touch);
    whole = felt_depth(m, now);
    if (memory->phase == EPSMESH_FREE) return whole > 0 ? forgotten(memory, EPSMESH_HISTORY) : in_the_air(m, memory, step);
    memory->phase = EPSMESH_SHRINKING;
    if (until(m, &memory->contact, &memory->contact, 0, now->time, &slope) < whole - REGROWN * memory->deepest)
        return forgotten(memory, EPSMESH_HISTORY);
    if (!shrunk(m, memory, whole, &from, &share)) return in_the_air(m, memory, step);
    then.depth = from.depth + share * (memory->contact.depth - from.depth);
    touch = epsmesh_touch_at(m, &then);
    if (touch.status == EPSMESH_NO_CONTACT) return in_the_air(m, memory, step);
    if (touch.status != EPSMESH_OK) return forgotten(memory, touch.status);
    grow_on(m, &then, &from, share * (memory->contact.time - from.time), &touch);
    memory->contact = from;
    feel(m, &from, now->time - from.time, &touch);
    return touch;
}

epsmesh_touch epsmesh_touch_after(const epsmesh_model *m, const epsmesh_query *q, double step, epsmesh_memory *memory) {
    epsmesh_query asked;
    if (!m->is_loaded) return all(EPSMESH_NO_MODEL, (double)NAN);
    if (!m->relaxing) return epsmesh_touch_at(m, q);
    if (!(isfinite(step) && step >= 0)) return forgotten(memory, EPSMESH_INPUT);
    if (!isfinite(q->depth)) return forgotten(memory, EPSMESH_INPUT);
    if (memory->phase == EPSMESH_RESTED) memory->query = *q;
    else if (memory->phase == EPSMESH_UNKNOWN || !is_same(m, q, &memory->query)) return forgotten(memory, EPSMESH_HISTORY);
    asked = memory->query, asked.depth = q->depth;
    memcpy(asked.axis, q->axis, sizeof asked.axis);
    if (memory->phase == EPSMESH_RESTED && q->depth <= TOUCHING) return epsmesh_touch_at(m, &asked);
    return grows(q) ? after_growing(m, &asked, step, memory) : after_same(m, &asked, step, memory);
}

void epsmesh_touch_each_after(const epsmesh_model *m, size_t count, const epsmesh_query *q, const double *steps,
                              epsmesh_memory *memory, epsmesh_touch *touches) {
    size_t i;
    for (i = 0; i < count; i++) touches[i] = epsmesh_touch_after(m, &q[i], steps[i], memory);
}
