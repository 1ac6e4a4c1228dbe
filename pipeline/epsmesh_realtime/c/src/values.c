/* Values within a model: epsmesh_values.h. */

void epsmesh_spot_at(const epsmesh_model *m, double x, double y, epsmesh_spot *s, double turn[3][3]) {
    *s = face_at(m, x, y), turn_of(s, turn);
}

void epsmesh_factors(const epsmesh_model *m, double x, double y, double factors[EPSMESH_TENSORS]) {
    double own[2];
    int k;
    for (k = 0; k < EPSMESH_TENSORS; k++) factors[k] = factor(m, k, x, y, own);
}

double epsmesh_room_at(const epsmesh_model *m, double x, double y) {
    return is_inside(m, x, y) ? room_at(m, x, y) : (double)NAN;
}

epsmesh_status epsmesh_place_at(const epsmesh_model *m, double x, double y, double poisson, epsmesh_place *found) {
    place p;
    memset(&p, 0, sizeof p), memset(found, 0, sizeof *found);
    if (!place_at(m, x, y, poisson, m->has_tensors, &p)) return EPSMESH_DAMAGED;
    found->c = p.c, found->h = p.h;
    memcpy(found->slope_c, p.slope_c, sizeof p.slope_c), memcpy(found->slope_h, p.slope_h, sizeof p.slope_h);
    memcpy(found->bent, p.bent, sizeof p.bent), memcpy(found->regular, p.regular, sizeof p.regular);
    return EPSMESH_OK;
}

void epsmesh_between(const epsmesh_model *m, double poisson, size_t n, const double *at, size_t others, const double *to,
                     double *found) {
    double f[4][EPSMESH_MOST_MODES], linked[EPSMESH_MOST_MODES];
    int k, l, rank = m->pair_counts[1];
    size_t i, j;
    for (j = 0; j < others; j++) {
        modes_at(m, to[2 * j], to[2 * j + 1], f);
        linked_by(m, poisson, 1, &f, &linked);
        for (i = 0; i < n; i++) {
            double sum = 0;
            modes_at(m, at[2 * i], at[2 * i + 1], f);
            for (k = 0, l = rank; k < l; k++) sum += f[0][k] * linked[k];
            found[i * others + j] = sum;
        }
    }
}

void epsmesh_surface_far(const epsmesh_model *m, double x, double y, double poisson, double *regular) {
    static const double none[3] = {0, 0, 0};
    regular_at(m, x, y, poisson, none, regular);
}
