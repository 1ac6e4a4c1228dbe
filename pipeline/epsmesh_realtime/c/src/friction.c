/* Coulomb's friction on the normal force of the model: epsmesh_friction.h.
 *
 * The tip moves by m; the bristle s follows it along the face, s1 = P (s0 + m), and slides where it would be longer than
 * f N/k: s = l s1, 0 <= l <= 1. The friction is -k s. The work of the tool, k s.m = k s.(s1 - P s0), is at least
 * k (s^2 - s0^2)/2, as s.s1 = s^2/l: it is never less than the energy that the bristle gains. If k grows, s0 is shortened at
 * equal force, which loses energy, as does a smaller k at equal length.
 *
 * k is K 2 (1 - nu)/(2 - nu), where K is the stiffness of the touch. A round contact slides from its rim inwards before all
 * of it does (C. Cattaneo, 1938): its friction differs from the bristle's by at most SLIPS f N, until it has slid by half of
 * f N/k. Tissue that sticks presses harder on a flat tool by the factor of V. I. Mossakovskii (1954). */
static const double SLIPS = 0.2, PRESSES = 1.5;

static void let_go(epsmesh_bristle *b) { memset(b, 0, sizeof *b); }

epsmesh_rubbing epsmesh_touch_rubbing(const epsmesh_model *m, const epsmesh_query *q, double friction, epsmesh_bristle *b) {
    epsmesh_rubbing r;
    double tip[3], local[3], normal[3], push = 0, stiff, along = 0, length = 0, most, kept, before = 0, ratio;
    spot f;
    int i, j;
    memset(&r, 0, sizeof r);
    if (!isfinite(friction) || friction < 0) r.touch = all(EPSMESH_INPUT, (double)NAN);
    else if (m->is_loaded && q->shape == EPSMESH_BONDED_DISC) r.touch = all(EPSMESH_TOOL, (double)NAN);
    else r.touch = epsmesh_touch_at(m, q);
    if (r.touch.status != EPSMESH_OK) {
        let_go(b);
        r.friction_error = r.stretch = r.touch.force_error;
        for (i = 0; i < 3; i++) r.friction[i] = r.touch.force[i];
        return r;
    }
    into_face(m, q->at, local);
    f = face_at(m, local[0], local[1]);
    for (i = 0; i < 3; i++)
        for (normal[i] = 0, j = 0; j < 3; j++) normal[i] += f.normal[j] * m->axes[j][i];
    for (i = 0; i < 3; i++) tip[i] = q->at[i] - q->depth * normal[i], push += r.touch.force[i] * normal[i];
    stiff = r.touch.stiffness * 2 * (1 - q->poisson) / (2 - q->poisson);
    kept = b->is_touching && b->stiffness < stiff ? b->stiffness / stiff : 1;
    for (i = 0; i < 3; i++) {
        b->stretch[i] = b->is_touching ? kept * b->stretch[i] + tip[i] - b->tip[i] : 0;
        along += b->stretch[i] * normal[i];
    }
    for (i = 0; i < 3; i++) b->stretch[i] -= along * normal[i], length += b->stretch[i] * b->stretch[i];
    length = sqrt(length), most = friction * push / stiff, before = length;
    r.is_sticking = !(length > most);
    if (!r.is_sticking) {
        for (i = 0; i < 3; i++) b->stretch[i] *= most / length;
        length = most, b->slid += before - most;
    } else b->slid = 0;
    for (i = 0; i < 3; i++) b->tip[i] = tip[i], r.friction[i] = -stiff * b->stretch[i];
    b->stiffness = stiff, b->is_touching = 1, r.stretch = length;
    r.friction_error = friction * r.touch.force_error + (b->slid < most / 2 ? SLIPS * friction * push : 0);
    ratio = q->poisson < 0.499 ? (1 - q->poisson) * log(3 - 4 * q->poisson) / (1 - 2 * q->poisson) - 1 : 0;
    if (friction > 0) r.touch.force_error += PRESSES * ratio * push;
    return r;
}

void epsmesh_touch_rubbing_each(const epsmesh_model *m, size_t count, const epsmesh_query *q, double friction,
                                epsmesh_bristle *b, epsmesh_rubbing *found) {
    size_t i;
    for (i = 0; i < count; i++) found[i] = epsmesh_touch_rubbing(m, &q[i], friction, b);
}

void epsmesh_friction_sizes(size_t sizes[2]) { sizes[0] = sizeof(epsmesh_bristle), sizes[1] = sizeof(epsmesh_rubbing); }
