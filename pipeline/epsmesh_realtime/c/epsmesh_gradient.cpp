/* Derivatives of forces: the evaluator's own formulas, compiled with numbers that carry derivatives (R. E. Wengert, 1964).
 * Roots that Newton's method finds carry those of its last step. Compile with -O3: by gcc it is five times as fast. */
#include "epsmesh_gradient.h"

#include <cmath>

namespace {

const size_t SEEDS = 4; /* derivatives in one pass */

/* A number with derivatives. */
struct real {
    double v, d[SEEDS];
    real() = default;
    real(double x) : v(x) {
        for (double &each : d) each = 0;
    }
};

/* f(x), from its value and its slope. */
inline real chained(const real &x, double f, double slope) {
    real y(f);
    for (size_t i = 0; i < SEEDS; i++) y.d[i] = slope * x.d[i];
    return y;
}

inline real sum_of(const real &x, const real &y, double f, double of_x, double of_y) {
    real z(f);
    for (size_t i = 0; i < SEEDS; i++) z.d[i] = of_x * x.d[i] + of_y * y.d[i];
    return z;
}

inline real operator-(const real &x) { return chained(x, -x.v, -1); }
inline real operator+(const real &x, const real &y) { return sum_of(x, y, x.v + y.v, 1, 1); }
inline real operator+(const real &x, double y) { return chained(x, x.v + y, 1); }
inline real operator+(double x, const real &y) { return y + x; }
inline real operator-(const real &x, const real &y) { return sum_of(x, y, x.v - y.v, 1, -1); }
inline real operator-(const real &x, double y) { return chained(x, x.v - y, 1); }
inline real operator-(double x, const real &y) { return chained(y, x - y.v, -1); }
inline real operator*(const real &x, const real &y) { return sum_of(x, y, x.v * y.v, y.v, x.v); }
inline real operator*(const real &x, double y) { return chained(x, x.v * y, y); }
inline real operator*(double x, const real &y) { return chained(y, x * y.v, x); }
inline real operator/(const real &x, const real &y) { return sum_of(x, y, x.v / y.v, 1 / y.v, -x.v / y.v / y.v); }
inline real operator/(const real &x, double y) { return chained(x, x.v / y, 1 / y); }
inline real operator/(double x, const real &y) { return chained(y, x / y.v, -x / y.v / y.v); }
template <class T> inline void operator+=(real &x, const T &y) { x = x + y; }
template <class T> inline void operator-=(real &x, const T &y) { x = x - y; }
template <class T> inline void operator*=(real &x, const T &y) { x = x * y; }
template <class T> inline void operator/=(real &x, const T &y) { x = x / y; }
inline bool operator<(const real &x, const real &y) { return x.v < y.v; }
inline bool operator<=(const real &x, const real &y) { return x.v <= y.v; }
inline bool operator>(const real &x, const real &y) { return x.v > y.v; }
inline bool operator>=(const real &x, const real &y) { return x.v >= y.v; }
inline bool operator==(const real &x, const real &y) { return !(x.v < y.v) && !(x.v > y.v); }
inline bool operator!=(const real &x, const real &y) { return !(x == y); }

inline bool isfinite(const real &x) { return std::isfinite(x.v); }
inline real fabs(const real &x) { return x.v < 0 ? -x : x; }
inline real sqrt(const real &x) { return chained(x, ::sqrt(x.v), 0.5 / ::sqrt(x.v)); }
inline real cbrt(const real &x) { return chained(x, ::cbrt(x.v), ::cbrt(x.v) / (3 * x.v)); }
inline real log(const real &x) { return chained(x, ::log(x.v), 1 / x.v); }
inline real tan(const real &x) { return chained(x, ::tan(x.v), 1 + ::tan(x.v) * ::tan(x.v)); }

/* epsmesh_query and epsmesh_spot. */
struct request {
    epsmesh_shape shape;
    real radius, angle, at[3], axis[3], depth, young, poisson, length, width, along[3];
};

struct spot {
    real height, slope[2], second[2][2], bend, slope_bend[2], normal[3];
};

#include "src/constants.c"
#include "src/table.c"
#include "src/contact.c"
#include "src/answer.c"

/* Put the derivatives of one query with some numbers, a pass, into `slopes` (3, width). */
epsmesh_side pass(const epsmesh_model *m, const epsmesh_query *query, size_t seeds, const int32_t *numbers, size_t width,
                  double *slopes) {
    request q = {query->shape, query->radius, query->angle, {}, {}, query->depth, query->young, query->poisson,
                 query->length, query->width, {}};
    real *const of[EPSMESH_NUMBERS] = {&q.radius, &q.angle, &q.at[0], &q.at[1], &q.at[2], &q.axis[0], &q.axis[1], &q.axis[2],
                                       &q.depth, &q.young, &q.poisson, &q.length, &q.width, &q.along[0], &q.along[1],
                                       &q.along[2]};
    const bool is_round = q.shape == EPSMESH_SPHERE || q.shape == EPSMESH_CONE;
    epsmesh_side side = EPSMESH_SMOOTH;
    real force[3] = {0, 0, 0};
    asked a;
    contact k;
    for (size_t i = 0; i < 3; i++) q.at[i] = query->at[i], q.axis[i] = query->axis[i], q.along[i] = query->along[i];
    for (size_t i = 0; i < seeds; i++)
        if (numbers[i] >= 0 && numbers[i] < EPSMESH_NUMBERS) of[numbers[i]]->d[i] = 1;
    epsmesh_status status = misfit(m, &q, a.local, a.edge, &a.f);
    if (status == EPSMESH_NO_CONTACT && !is_round && fabs(q.depth) <= TOUCHING) {
        side = EPSMESH_LIFTS, status = EPSMESH_OK;
        q.depth.v = 0;
    }
    if (status == EPSMESH_OK && q.shape == EPSMESH_BLADE && q.length == q.width) side = EPSMESH_SQUARE;
    bool has_force = status == EPSMESH_NO_CONTACT;
    if (status == EPSMESH_OK && surveyed(m, &q, &a) && press(m, &q, &a, &k)) {
        force_of(m, q.young, q.depth, &a, &k, force);
        has_force = true;
    }
    for (size_t i = 0; i < 3; i++)
        for (size_t j = 0; j < seeds; j++) slopes[i * width + j] = has_force ? force[i].d[j] : static_cast<double>(NAN);
    return side;
}

} // namespace

void epsmesh_gradient(const epsmesh_model *m, size_t count, const epsmesh_query *queries, const epsmesh_touch *touches,
                      size_t width, const int32_t *numbers, double *slopes, int32_t *sides) {
    for (size_t k = 0; k < count; k++) {
        const bool answers = touches[k].status == EPSMESH_OK || touches[k].status == EPSMESH_NO_CONTACT;
        double *own = &slopes[3 * k * width];
        sides[k] = EPSMESH_SMOOTH;
        for (size_t j = 0; j < 3 * width && !answers; j++) own[j] = static_cast<double>(NAN);
        for (size_t j = 0; j < width && answers; j += SEEDS)
            sides[k] = pass(m, &queries[k], width - j < SEEDS ? width - j : SEEDS, &numbers[j], width, own + j);
    }
}
