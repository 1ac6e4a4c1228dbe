/* Queries of one tool: the place below a tip, force and error bar. */

/* Rows: two unit tangents, the first one above x, and the outward normal. */
static void turn_of(const spot *f, double turn[3][3]) {
    const double *n = f->normal, size = sqrt(n[2] * n[2] + n[0] * n[0]);
    int i;
    turn[0][0] = n[2] / size, turn[0][1] = 0, turn[0][2] = -n[0] / size;
    for (i = 0; i < 3; i++) turn[2][i] = n[i];
    for (i = 0; i < 3; i++) turn[1][i] = n[(i + 1) % 3] * turn[0][(i + 2) % 3] - n[(i + 2) % 3] * turn[0][(i + 1) % 3];
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
        if (steps == 0 && !cuts && above >= 0) return EPSMESH_NO_CONTACT;
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
            return above < 0 ? EPSMESH_OK : EPSMESH_NO_CONTACT;
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
    into_face(m, tip, local);
    if (!(isfinite(local[0]) && isfinite(local[1]) && isfinite(local[2]))) return EPSMESH_INPUT;
    if (m->is_flat) {
        if (local[2] >= 0) return EPSMESH_NO_CONTACT;
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

/* The error bar of a force, as a share of it. */
static double bar_of(const epsmesh_model *m, const epsmesh_query *q, const asked *a, const contact *k) {
    double share = (k->radius / a->room) * (k->radius / a->room), error;
    double bent = fabs(a->p.h) + 2 * sqrt(a->p.bent[0] * a->p.bent[0] + a->p.bent[1] * a->p.bent[1]);
    double sticks = 0;
    if (k->sticks)
        sticks = STICKS * (1 - 2 * q->poisson) * k->radius / (a->room * a->room) +
                 STICKS_BENT * (fabs(a->p.bend) + m->bend_error);
    error = m->bar[3] + k->stiffness * ((m->bar[0] + m->bar[2] * share * share) / a->room +
                                        m->bar[1] * bent * k->mean_square + sticks);
    if (q->shape == EPSMESH_SPHERE || q->shape == EPSMESH_CONE) {
        double growth = 3 * k->stiffness / k->force - 2 / q->depth;
        error += m->bend_error / 2 * k->mean_square * (growth > 0 ? growth : 0);
    }
    if (m->is_large)
        error += m->near_error * k->share + m->near_room * k->stiffness * q->depth / (a->room * a->room);
    return error;
}

/* Return a contact in the body's coordinates, of a tool at `depth` by itself. */
static epsmesh_touch answer_of(const epsmesh_model *m, double young, double depth, const asked *a, const contact *k,
                          double error) {
    epsmesh_touch t;
    t.status = EPSMESH_OK, t.stiffness = young * k->stiffness, t.contact_radius = k->radius;
    t.force_error = error * young * k->force;
    force_of(m, young, depth, a, k, t.force);
    if (!(k->force > 0 && is_positive(t.stiffness) && t.force_error >= 0 && isfinite(t.force_error) &&
          isfinite(t.force[0]) && isfinite(t.force[1]) && isfinite(t.force[2])))
        return all(EPSMESH_DAMAGED, (double)NAN);
    return t;
}

epsmesh_touch epsmesh_touch_at(const epsmesh_model *m, const epsmesh_query *q) {
    asked a;
    contact k;
    epsmesh_status status = misfit(m, q, a.local, a.edge, &a.f);
    if (status == EPSMESH_NO_CONTACT) return all(status, 0.0);
    if (status != EPSMESH_OK) return all(status, (double)NAN);
    if (!surveyed(m, q, &a)) return all(EPSMESH_DAMAGED, (double)NAN);
    if (!press(m, q, &a, &k)) return all(EPSMESH_LARGE, (double)NAN);
    return answer_of(m, q->young, q->depth, &a, &k, bar_of(m, q, &a, &k));
}

void epsmesh_touch_each(const epsmesh_model *m, size_t count, const epsmesh_query *q, epsmesh_touch *t) {
    size_t i;
    for (i = 0; i < count; i++) t[i] = epsmesh_touch_at(m, &q[i]);
}
