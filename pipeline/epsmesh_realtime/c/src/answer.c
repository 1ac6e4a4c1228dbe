/* A query by itself: what is refused, the values at its place, the contact, and the force in the body's coordinates. */

static real smaller(real a, real b) { return a < b ? a : b; }

static real room_at(const epsmesh_model *m, real x, real y) {
    if (m->is_round) return smaller(m->sides[0] - sqrt(x * x + y * y), m->thickness);
    return smaller(smaller(m->sides[0] - fabs(x), m->sides[1] - fabs(y)), m->thickness);
}

static int is_inside(const epsmesh_model *m, real x, real y) {
    if (m->is_round) return x * x + y * y <= m->reach[0] * m->reach[0];
    return fabs(x) <= m->reach[0] && fabs(y) <= m->reach[1];
}

static int is_positive(real x) { return isfinite(x) && x > 0; }

static void into_face(const epsmesh_model *m, const real at[3], real local[3]) {
    int i, j;
    for (i = 0; i < 3; i++)
        for (local[i] = 0, j = 0; j < 3; j++) local[i] += m->axes[i][j] * (at[j] - m->origin[j]);
}

/* Return whether the model has this tool; `edge` is the direction of a blade on the face. */
static epsmesh_status tool_of(const epsmesh_model *m, const request *q, real edge[2]) {
    int i, j, is_blade = q->shape == EPSMESH_BLADE, has_angle = q->shape == EPSMESH_CONE;
    edge[0] = 1, edge[1] = 0;
    if ((int)q->shape < EPSMESH_DISC || (int)q->shape > EPSMESH_BONDED_DISC) return EPSMESH_TOOL;
    if ((is_blade || q->shape == EPSMESH_BONDED_DISC) && !m->has_tensors) return EPSMESH_TOOL;
    if (m->is_large && q->shape != EPSMESH_SPHERE) return EPSMESH_TOOL;
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
        real size;
        for (i = 0; i < 2; i++)
            for (edge[i] = 0, j = 0; j < 3; j++) edge[i] += m->axes[i][j] * q->along[j];
        size = sqrt(edge[0] * edge[0] + edge[1] * edge[1]);
        if (!is_positive(size)) return EPSMESH_INPUT;
        edge[0] /= size, edge[1] /= size;
    }
    return q->width < SLENDER * q->length || q->length < SLENDER * q->width ? EPSMESH_TOOL : EPSMESH_OK;
}

static epsmesh_status misfit(const epsmesh_model *m, const request *q, real local[3], real edge[2], spot *f) {
    real length = 0, inward = 0;
    epsmesh_status status;
    int i, j;
    if (!m->is_loaded) return EPSMESH_NO_MODEL;
    status = tool_of(m, q, edge);
    if (status != EPSMESH_OK) return status;
    if (!isfinite(q->depth) || !isfinite(q->poisson) || !is_positive(q->young)) return EPSMESH_INPUT;
    into_face(m, q->at, local);
    if (!(isfinite(local[0]) && isfinite(local[1]) && isfinite(local[2]))) return EPSMESH_INPUT;
    if (!is_inside(m, local[0], local[1])) return EPSMESH_OUTSIDE;
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
    return q->depth <= TOUCHING ? EPSMESH_NO_CONTACT : EPSMESH_OK;
}

/* A valid query, with the values at its place. */
typedef struct {
    real local[3], edge[2], room;
    spot f;
    place p;
} asked;

static int surveyed(const epsmesh_model *m, const request *q, asked *a) {
    if (!place_at(m, a->local[0], a->local[1], q->poisson, q->shape >= EPSMESH_BLADE, &a->p)) return 0;
    a->p.bend = a->f.bend, a->p.slope_bend[0] = a->f.slope_bend[0], a->p.slope_bend[1] = a->f.slope_bend[1];
    a->room = room_at(m, a->local[0], a->local[1]);
    return 1;
}

/* Return whether the contact of a tool at a depth of its query is small enough. */
static int press(const epsmesh_model *m, const request *q, const asked *a, contact *k) {
    real most = m->largest * a->room;
    if (q->shape == EPSMESH_BLADE) return press_blade(q, a->edge, &a->p, most, k);
    if (q->shape == EPSMESH_SPHERE || q->shape == EPSMESH_CONE) return press_round(q, &a->p, most, k);
    *k = q->shape == EPSMESH_DISC ? press_disc(q->radius, q->depth, &a->p) : press_bonded(q->radius, q->depth, &a->p);
    return q->radius <= most;
}

/* The force of the tissue on the tool in the body's coordinates. */
static void force_of(const epsmesh_model *m, real young, real depth, const asked *a, const contact *k, real found[3]) {
    real force[3];
    int i, j;
    if (k->sticks) reaction_at(&a->f, k->force, k->aside, force);
    else force_at(&a->f, k->force, k->aside, depth, force);
    for (i = 0; i < 3; i++)
        for (found[i] = 0, j = 0; j < 3; j++) found[i] += young * force[j] * m->axes[j][i];
}
