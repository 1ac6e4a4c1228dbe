/* What a file must have to be a model; epsmesh_realtime/file.py defines every array. */

/* Point at finite doubles of a rank; `shape` is given where it is not 0, else returned. */
static const double *doubles(file *f, const char *name, uint32_t rank, uint32_t shape[4]) {
    uint32_t found[4], i;
    const double *values = (const double *)file_find(f, name, FLOAT64, rank, found);
    size_t k, size = 1;
    if (f->flaw) return NULL;
    f->name = name, f->flaw = values ? EPSMESH_SHAPE : EPSMESH_ABSENT;
    if (!values) return NULL;
    for (i = 0; i < rank; i++) {
        if (shape[i] && shape[i] != found[i]) return NULL;
        shape[i] = found[i], size *= found[i];
    }
    f->flaw = EPSMESH_INFINITE;
    for (k = 0; k < size; k++)
        if (!isfinite(values[k])) return NULL;
    f->name = "", f->flaw = EPSMESH_SOUND;
    return values;
}

/* Copy `count` doubles, or one number if it is 0. */
static void numbers(file *f, const char *name, double *into, uint32_t count) {
    uint32_t shape[4] = {0, 0, 0, 0};
    const double *values;
    shape[0] = count, values = doubles(f, name, count > 0, shape);
    if (values) memcpy(into, values, (count ? count : 1) * sizeof *into);
}

static int has(file *f, const char *name) {
    file one = *f;
    uint32_t shape[4];
    return file_find(&one, name, KINDS, 0, shape) != NULL || one.flaw == EPSMESH_SHAPE;
}

static void wrong_if(file *f, int is_wrong, const char *name) {
    if (f->flaw || !is_wrong) return;
    f->flaw = EPSMESH_VALUE, f->name = name;
}

static int is_flag(double x) { return x == 0 || x == 1; }

static void load_table(epsmesh_model *m, file *f) {
    uint32_t shape[4] = {0, 0, 0, 0}, seven[4] = {EPSMESH_TENSORS, 0, 0, 0};
    double is_round = 0, leans = 0, even[2] = {0, 0}, *range = m->poisson_range;
    int i;
    m->reciprocal = doubles(f, "reciprocal", 3, shape);
    m->curvature = doubles(f, "curvature", 3, shape);
    for (i = 0; i < 3; i++) seven[i + 1] = shape[i], m->counts[i] = (int)shape[i];
    for (i = 0; i < 3; i++) wrong_if(f, shape[i] > EPSMESH_MOST, "reciprocal");
    m->has_tensors = has(f, "tensors");
    m->tensors = m->has_tensors ? doubles(f, "tensors", 4, seven) : NULL;
    numbers(f, "c_ref", &m->c_ref, 0), numbers(f, "is_round", &is_round, 0), numbers(f, "leans", &leans, 0);
    numbers(f, "even", even, 2), numbers(f, "reach", m->reach, 2), numbers(f, "poisson_range", range, 2);
    numbers(f, "poisson", &m->poisson, 0);
    wrong_if(f, !is_flag(leans), "leans"), wrong_if(f, !is_flag(even[0]) || !is_flag(even[1]), "even");
    wrong_if(f, !is_flag(is_round), "is_round");
    m->leans = leans == 1, m->is_round = is_round == 1, m->even[0] = even[0] == 1, m->even[1] = even[1] == 1;
    m->is_axial = m->is_round && m->counts[1] == 1;
    wrong_if(f, m->is_axial && !(m->even[0] && m->even[1]), "is_round");
    wrong_if(f, !(-1 < range[0] && range[0] <= m->poisson && m->poisson <= range[1] && range[1] <= 0.5), "poisson_range");
    wrong_if(f, m->counts[0] > 1 && range[0] == range[1], "poisson_range");
}

static void load_body(epsmesh_model *m, file *f) {
    int i, j, k;
    uint32_t shape[4] = {3, 3, 0, 0};
    const double *frame = doubles(f, "axes", 2, shape);
    numbers(f, "origin", m->origin, 3), numbers(f, "sides", m->sides, 2), numbers(f, "thickness", &m->thickness, 0);
    numbers(f, "young", &m->young, 0), numbers(f, "largest", &m->largest, 0), numbers(f, "bar", m->bar, 4);
    numbers(f, "off", &m->off, 0), numbers(f, "aligned", &m->aligned, 0);
    for (i = 0; i < 3 && frame; i++)
        for (j = 0; j < 3; j++) {
            double dot = i == j ? -1.0 : 0.0;
            m->axes[i][j] = frame[3 * i + j];
            for (k = 0; k < 3; k++) dot += frame[3 * i + k] * frame[3 * j + k];
            wrong_if(f, !(fabs(dot) < 1e-9), "axes");
        }
    for (i = 0; i < 4; i++) wrong_if(f, m->bar[i] < 0, "bar");
    for (i = 0; i < 2; i++) wrong_if(f, !(0 < m->reach[i] && m->reach[i] < m->sides[i]), "reach");
    wrong_if(f, !(m->thickness > 0), "thickness"), wrong_if(f, !(m->young > 0), "young");
    wrong_if(f, !(m->largest > 0 && m->largest <= 1), "largest");
    wrong_if(f, !(m->off > 0), "off"), wrong_if(f, !(m->aligned > 0 && m->aligned <= 0.5), "aligned");
}

static void load_face(epsmesh_model *m, file *f) {
    uint32_t shape[4] = {0, 0, 0, 0};
    int i;
    m->height = doubles(f, "height", 2, shape), m->bend = doubles(f, "bend", 2, shape);
    if (f->flaw) return;
    for (i = 0; i < 2; i++) {
        wrong_if(f, shape[i] > EPSMESH_MOST, "height");
        m->face_counts[i] = (int)shape[i];
    }
    wrong_if(f, m->is_axial && shape[0] != 1, "height");
    m->is_flat = 1;
    for (i = 0; i < m->face_counts[0] * m->face_counts[1]; i++)
        if (m->height[i] != 0 || m->bend[i] != 0) m->is_flat = 0;
    m->bend_error = 0;
    if (!m->is_flat || has(f, "bend_error")) numbers(f, "bend_error", &m->bend_error, 0);
    wrong_if(f, m->bend_error < 0, "bend_error");
}

/* The interaction of several tools: all of it, or none. */
static void load_pairs(epsmesh_model *m, file *f) {
    uint32_t modes[4] = {0, 0, 0, 0}, links[4] = {0, 0, 0, 0};
    int i, j, n, rank;
    m->has_pairs = has(f, "pair_modes") || has(f, "pair_links") || has(f, "pair_error") || has(f, "pair_aside");
    if (!m->has_pairs) return;
    m->pair_modes = doubles(f, "pair_modes", 3, modes);
    links[1] = links[2] = modes[0];
    m->pair_links = doubles(f, "pair_links", 3, links);
    numbers(f, "pair_error", &m->pair_error, 0), numbers(f, "pair_aside", &m->pair_aside, 0);
    wrong_if(f, m->pair_error < 0, "pair_error"), wrong_if(f, m->pair_aside < 0, "pair_aside");
    wrong_if(f, modes[0] > EPSMESH_MOST_MODES || modes[1] > EPSMESH_MOST || modes[2] > EPSMESH_MOST, "pair_modes");
    wrong_if(f, links[0] > EPSMESH_MOST_LINKS, "pair_links");
    wrong_if(f, links[0] > 1 && m->poisson_range[0] == m->poisson_range[1], "pair_links");
    if (f->flaw) return;
    rank = (int)modes[0];
    m->pair_counts[0] = (int)links[0], m->pair_counts[1] = rank;
    m->pair_counts[2] = (int)modes[1], m->pair_counts[3] = (int)modes[2];
    for (n = 0; n < (int)links[0]; n++)
        for (i = 0; i < rank; i++)
            for (j = 0; j < i; j++)
                wrong_if(f, m->pair_links[(n * rank + i) * rank + j] != m->pair_links[(n * rank + j) * rank + i],
                         "pair_links");
}

/* The relaxation of all tissue, if it relaxes. */
static void load_relaxation(epsmesh_model *m, file *f) {
    uint32_t shape[4] = {0, 0, 0, 0}, i;
    const double *shares, *times;
    double rest = 1;
    m->relaxing = 0;
    if (f->flaw || !(has(f, "relaxation_share") || has(f, "relaxation_time"))) return;
    shares = doubles(f, "relaxation_share", 1, shape), times = doubles(f, "relaxation_time", 1, shape);
    wrong_if(f, shape[0] > EPSMESH_MOST_RELAXING, "relaxation_share");
    for (i = 0; i < shape[0] && !f->flaw; i++) {
        m->share[i] = shares[i], m->time[i] = times[i], rest -= shares[i];
        wrong_if(f, !(shares[i] > 0), "relaxation_share"), wrong_if(f, !(times[i] > 0), "relaxation_time");
    }
    wrong_if(f, !(rest > 0), "relaxation_share");
    m->relaxing = f->flaw ? 0 : (int)shape[0];
}

/* A ball on a half-space at large displacements: all of it, or none. */
static void load_near(epsmesh_model *m, file *f) {
    uint32_t shape[4] = {2, 0, 0, 0};
    int i;
    m->is_large = has(f, "near") || has(f, "near_most") || has(f, "near_error") || has(f, "near_room") ||
                  has(f, "near_support");
    if (!m->is_large) return;
    m->near = doubles(f, "near", 3, shape);
    numbers(f, "near_most", &m->near_most, 0), numbers(f, "near_error", &m->near_error, 0);
    numbers(f, "near_room", &m->near_room, 0), numbers(f, "near_support", &m->near_support, 0);
    for (i = 0; i < 2; i++) {
        wrong_if(f, shape[i + 1] > EPSMESH_MOST_NEAR, "near");
        m->near_counts[i] = (int)shape[i + 1];
    }
    wrong_if(f, shape[1] > 1 && m->poisson_range[0] == m->poisson_range[1], "near");
    wrong_if(f, !(m->near_most > 0), "near_most"), wrong_if(f, m->near_error < 0, "near_error");
    wrong_if(f, m->near_room < 0, "near_room"), wrong_if(f, m->near_support < 0, "near_support");
    wrong_if(f, !m->is_flat || m->has_pairs || m->relaxing, "near");
}

/* The deforming surface, for display: all of it, or none. */
static void load_surface(epsmesh_model *m, file *f) {
    uint32_t points[4], corners[4], modes[4], amounts[4];
    double most = m->sides[0] > m->sides[1] ? m->sides[0] : m->sides[1];
    size_t i, size;
    most = FAR * (most > m->thickness ? most : m->thickness);
    m->vertices = 0;
    if (f->flaw || !has(f, "surface_points")) return;
    m->surface_points = (const float *)file_find(f, "surface_points", FLOAT32, 2, points);
    m->surface_triangles = (const int32_t *)file_find(f, "surface_triangles", INT32, 2, corners);
    m->surface_modes = (const int16_t *)file_find(f, "surface_modes", INT16, 3, modes);
    m->surface_amounts = (const float *)file_find(f, "surface_amounts", FLOAT32, 4, amounts);
    numbers(f, "surface_error", &m->surface_error, 0);
    if (!m->surface_points || !m->surface_triangles || !m->surface_modes || !m->surface_amounts) {
        if (!f->flaw) f->flaw = EPSMESH_ABSENT, f->name = "whole surface";
        return;
    }
    if (f->flaw) return;
    wrong_if(f, points[1] != 3 || points[0] > INT32_MAX / 3, "surface_points");
    wrong_if(f, corners[1] != 3, "surface_triangles");
    wrong_if(f, modes[0] != points[0] || modes[1] != 3 || modes[2] != amounts[0], "surface_modes");
    wrong_if(f, amounts[0] > EPSMESH_MOST_SEEN || amounts[1] > EPSMESH_MOST, "surface_amounts");
    wrong_if(f, amounts[2] > EPSMESH_MOST || amounts[3] > EPSMESH_MOST, "surface_amounts");
    wrong_if(f, m->surface_error < 0, "surface_error");
    if (f->flaw) return;
    for (i = 0; i < 3 * (size_t)points[0]; i++)
        wrong_if(f, !(fabs((double)m->surface_points[i]) <= most), "surface_points");
    for (i = 0; i < 3 * (size_t)corners[0]; i++)
        wrong_if(f, m->surface_triangles[i] < 0 || (uint32_t)m->surface_triangles[i] >= points[0], "surface_triangles");
    size = (size_t)amounts[0] * amounts[1] * amounts[2] * amounts[3];
    for (i = 0; i < size; i++) wrong_if(f, !isfinite(m->surface_amounts[i]), "surface_amounts");
    if (f->flaw) return;
    m->vertices = (int)points[0], m->triangles = (int)corners[0];
    for (i = 0; i < 4; i++) m->surface_counts[i] = (int)amounts[i];
}

epsmesh_status epsmesh_load(epsmesh_model *m, const void *data, size_t size) {
    file f;
    memset(m, 0, sizeof *m);
    file_open(&f, data, size);
    load_table(m, &f), load_body(m, &f), load_face(m, &f), load_pairs(m, &f);
    load_relaxation(m, &f), load_near(m, &f), load_surface(m, &f);
    m->flaw = f.flaw, m->flawed = f.name, m->is_loaded = f.flaw == EPSMESH_SOUND;
    return m->is_loaded ? EPSMESH_OK : EPSMESH_NO_MODEL;
}
