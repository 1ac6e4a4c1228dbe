/* The model file into a model. */
/* ---- the file: netCDF classic with 64-bit offsets ---- */

typedef struct {
    const unsigned char *data;
    size_t size, at;
    int failed;
} reader;

static const unsigned char *take(reader *r, size_t size) {
    if (r->failed || size > r->size - r->at) {
        r->failed = 1;
        return NULL;
    }
    r->at += size;
    return r->data + (r->at - size);
}

static unsigned long number(reader *r) {
    const unsigned char *b = take(r, 4);
    return b ? (unsigned long)b[0] << 24 | (unsigned long)b[1] << 16 | (unsigned long)b[2] << 8 | b[3] : 0;
}

static unsigned long count(reader *r, unsigned long most) {
    unsigned long found = number(r);
    if (found > most) r->failed = 1;
    return r->failed ? 0 : found;
}

static unsigned long listed(reader *r, unsigned long tag) {
    unsigned long found = number(r), length = count(r, 256);
    if (found != tag && (found || length)) r->failed = 1;
    return r->failed ? 0 : length;
}

static int name_is(const char *name, size_t length, const char *known) {
    return strlen(known) == length && memcmp(name, known, length) == 0;
}

static const char *read_name(reader *r, size_t *length) {
    *length = count(r, 256);
    return (const char *)take(r, (*length + 3) / 4 * 4);
}

static void skip_attributes(reader *r) {
    static const size_t bytes[] = {0, 1, 1, 2, 4, 4, 8};
    unsigned long i, n = listed(r, 12);
    for (i = 0; i < n && !r->failed; i++) {
        size_t length, kind, values;
        read_name(r, &length);
        kind = number(r), values = number(r);
        if (kind < 1 || kind > 6 || values > r->size) {
            r->failed = 1;
            return;
        }
        take(r, (values * bytes[kind] + 3) / 4 * 4);
    }
}

static double as_double(const unsigned char *b) {
    unsigned char native[8];
    const unsigned short one = 1;
    double value;
    int i, is_little = *(const unsigned char *)&one;
    for (i = 0; i < 8; i++) native[i] = b[is_little ? 7 - i : i];
    memcpy(&value, native, 8);
    return value;
}

typedef struct {
    const char *name;
    double *into;
    size_t room, length[4];
    int rank; /* -1: not yet found */
} wanted;

enum { WANTED = 27, OPTIONAL = 21, OF_PAIRS = 23 };

/* Return where the `n` doubles of a variable begin, or NULL if they are not all in the file. */
static const unsigned char *found_at(const reader *r, const unsigned char *begin, const size_t *shape, int rank,
                                     size_t *n) {
    size_t whole = 0;
    int i;
    for (*n = 1, i = 0; i < rank; i++) {
        if (shape[i] && *n > r->size / shape[i]) return NULL;
        *n *= shape[i];
    }
    for (i = 0; i < 8; i++) {
        if (whole > (r->size >> 8)) return NULL;
        whole = whole << 8 | begin[i];
    }
    return whole > r->size || *n > (r->size - whole) / 8 ? NULL : r->data + whole;
}

static int fill(wanted *w, const unsigned char *values, size_t n, const size_t *shape, int rank) {
    size_t i;
    if (rank > 4 || n == 0 || n > w->room) return 0;
    for (i = 0; i < (size_t)rank; i++) w->length[i] = shape[i];
    for (i = 0; i < n; i++) {
        w->into[i] = as_double(values + 8 * i);
        if (!isfinite(w->into[i])) return 0;
    }
    w->rank = rank;
    return 1;
}

static int read_variables(reader *r, wanted *w) {
    size_t lengths[256], length, shape[4], size;
    unsigned long i, n, j, rank, kind;
    const unsigned char *magic = take(r, 4), *begin, *values;
    if (!magic || memcmp(magic, "CDF\002", 4)) return 0;
    count(r, 256);
    n = listed(r, 10);
    for (i = 0; i < n; i++) {
        read_name(r, &length);
        lengths[i] = number(r);
    }
    skip_attributes(r);
    for (j = listed(r, 11); j > 0 && !r->failed; j--) {
        const char *name = read_name(r, &length);
        rank = count(r, 4);
        for (i = 0; i < rank; i++) {
            unsigned long dimension = number(r);
            if (dimension >= n) return 0;
            shape[i] = lengths[dimension];
        }
        skip_attributes(r);
        kind = number(r);
        number(r);
        begin = take(r, 8);
        if (!name || !begin) return 0;
        if (kind != 6) continue;
        values = found_at(r, begin, shape, (int)rank, &size);
        if (!values) return 0;
        for (i = 0; i < WANTED; i++)
            if (name_is(name, length, w[i].name) && !fill(&w[i], values, size, shape, (int)rank)) return 0;
    }
    return !r->failed;
}

/* ---- loading ---- */

static int is_sound(const epsmesh_model *m) {
    int i, j, k;
    for (i = 0; i < 3; i++) {
        if (m->bar[i] < 0) return 0;
        for (j = 0; j < 3; j++) {
            double dot = i == j ? -1.0 : 0.0;
            for (k = 0; k < 3; k++) dot += m->axes[i][k] * m->axes[j][k];
            if (!(fabs(dot) < 1e-9)) return 0;
        }
    }
    if (m->bar[3] < 0 || m->bend_error < 0) return 0;
    for (i = 0; i < 2; i++)
        if (!(0 < m->reach[i] && m->reach[i] < m->sides[i])) return 0;
    if (m->is_round && (m->counts[1] != 1 || m->face_counts[0] != 1 || !m->even[0] || !m->even[1])) return 0;
    if (!(m->off > 0 && m->aligned > 0 && m->aligned <= 0.5)) return 0;
    if (!(-1 < m->poisson_range[0] && m->poisson_range[0] <= m->poisson && m->poisson <= m->poisson_range[1])) return 0;
    if (m->poisson_range[1] > 0.5 || (m->counts[0] > 1 && m->poisson_range[0] == m->poisson_range[1])) return 0;
    return m->thickness > 0 && m->young > 0 && m->largest > 0 && m->largest <= 1;
}

/* Return whether a file's interaction of places, if it has one, is valid. */
static int has_pairs(epsmesh_model *m, const wanted *w) {
    int i, j, n, found = 0, rank, nodes;
    for (i = 0; i < WANTED - OF_PAIRS; i++) found += w[i].rank >= 0;
    m->has_pairs = found > 0;
    if (!found) return 1;
    if (found < WANTED - OF_PAIRS || m->pair_error < 0 || m->pair_aside < 0) return 0;
    if (w[0].length[0] > EPSMESH_MOST_MODES || w[1].length[0] > EPSMESH_MOST_LINKS) return 0;
    for (i = 1; i < 3; i++) {
        if (w[0].length[i] > EPSMESH_MOST || w[1].length[i] != w[0].length[0]) return 0;
        m->pair_counts[i + 1] = (int)w[0].length[i];
    }
    rank = m->pair_counts[1] = (int)w[0].length[0], nodes = m->pair_counts[0] = (int)w[1].length[0];
    for (n = 0; n < nodes; n++)
        for (i = 0; i < rank; i++)
            for (j = 0; j < i; j++)
                if (m->pair_links[(n * rank + i) * rank + j] != m->pair_links[(n * rank + j) * rank + i]) return 0;
    return nodes == 1 || m->poisson_range[0] < m->poisson_range[1];
}

epsmesh_status epsmesh_load(epsmesh_model *m, const void *data, size_t size) {
    double format, is_round, even[2], leans;
    reader r;
    int i;
    wanted w[WANTED] = {
        {"reciprocal", m->reciprocal, EPSMESH_MOST_IN_ALL, {0}, -1},
        {"curvature", m->curvature, EPSMESH_MOST_IN_ALL, {0}, -1},
        {"axes", m->axes[0], 9, {0}, -1},
        {"origin", m->origin, 3, {0}, -1},
        {"bar", m->bar, 4, {0}, -1},
        {"reach", m->reach, 2, {0}, -1},
        {"sides", m->sides, 2, {0}, -1},
        {"poisson_range", m->poisson_range, 2, {0}, -1},
        {"format", &format, 1, {0}, -1},
        {"is_round", &is_round, 1, {0}, -1},
        {"c_ref", &m->c_ref, 1, {0}, -1},
        {"thickness", &m->thickness, 1, {0}, -1},
        {"young", &m->young, 1, {0}, -1},
        {"poisson", &m->poisson, 1, {0}, -1},
        {"largest", &m->largest, 1, {0}, -1},
        {"off", &m->off, 1, {0}, -1},
        {"aligned", &m->aligned, 1, {0}, -1},
        {"leans", &leans, 1, {0}, -1},
        {"even", even, 2, {0}, -1},
        {"height", m->height, EPSMESH_MOST_IN_ALL, {0}, -1},
        {"bend", m->bend, EPSMESH_MOST_IN_ALL, {0}, -1},
        {"tensors", m->tensors, EPSMESH_TENSORS * EPSMESH_MOST_IN_ALL, {0}, -1}, /* may be missing, as may */
        {"bend_error", &m->bend_error, 1, {0}, -1},
        {"pair_modes", m->pair_modes, EPSMESH_MOST_TERMS, {0}, -1},
        {"pair_links", m->pair_links, EPSMESH_MOST_LINKS * EPSMESH_MOST_MODES * EPSMESH_MOST_MODES, {0}, -1},
        {"pair_error", &m->pair_error, 1, {0}, -1},
        {"pair_aside", &m->pair_aside, 1, {0}, -1},
    };
    static const int ranks[WANTED] = {3, 3, 2, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 2, 4, 0, 3, 3, 0, 0};
    static const size_t firsts[] = {3, 3, 4, 2, 2, 2};
    m->is_loaded = 0, m->bend_error = 0;
    r.data = (const unsigned char *)data, r.size = size, r.at = 0, r.failed = data == NULL;
    if (!read_variables(&r, w)) return EPSMESH_NO_MODEL;
    for (i = 0; i < WANTED; i++)
        if ((i < OPTIONAL || w[i].rank >= 0) && w[i].rank != ranks[i]) return EPSMESH_NO_MODEL;
    for (i = 0; i < WANTED; i++)
        if ((i >= 2 && i < 8 && w[i].length[0] != firsts[i - 2])) return EPSMESH_NO_MODEL;
    if (w[2].length[1] != 3 || format != FORMAT || (is_round != 0 && is_round != 1)) return EPSMESH_NO_MODEL;
    if ((leans != 0 && leans != 1) || w[18].length[0] != 2) return EPSMESH_NO_MODEL;
    m->is_round = is_round == 1, m->leans = leans == 1, m->has_tensors = w[OPTIONAL].rank == 4;
    for (i = 0; i < 2; i++) {
        if ((even[i] != 0 && even[i] != 1) || w[19].length[i] != w[20].length[i]) return EPSMESH_NO_MODEL;
        if (w[19].length[i] > EPSMESH_MOST) return EPSMESH_NO_MODEL;
        m->even[i] = even[i] == 1, m->face_counts[i] = (int)w[19].length[i];
    }
    if (m->has_tensors && w[OPTIONAL].length[0] != EPSMESH_TENSORS) return EPSMESH_NO_MODEL;
    for (i = 0; i < 3; i++) {
        if (w[0].length[i] != w[1].length[i]) return EPSMESH_NO_MODEL;
        if (m->has_tensors && w[OPTIONAL].length[i + 1] != w[0].length[i]) return EPSMESH_NO_MODEL;
        if (w[0].length[i] > EPSMESH_MOST) return EPSMESH_NO_MODEL;
        m->counts[i] = (int)w[0].length[i];
    }
    m->is_flat = 1;
    for (i = 0; i < m->face_counts[0] * m->face_counts[1]; i++)
        if (m->height[i] != 0 || m->bend[i] != 0) m->is_flat = 0;
    /* Files of earlier versions lack it, and are too inaccurate for a curved face. */
    if (!m->is_flat && w[OPTIONAL + 1].rank < 0) return EPSMESH_NO_MODEL;
    if (!has_pairs(m, w + OF_PAIRS)) return EPSMESH_NO_MODEL;
    m->is_loaded = is_sound(m);
    return m->is_loaded ? EPSMESH_OK : EPSMESH_NO_MODEL;
}
