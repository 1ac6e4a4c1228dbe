/* A tool dragged over a model: `drag MODEL SHAPE RADIUS DEPTH SECONDS SEED PACED`, SI units.
 *
 * A hand follows a random smooth path over the region, in and out of contact, at most DEPTH deep. A mass is coupled to it
 * by a spring and a damper, as haptic programs do, and feels the force of `examples/hand.h` a thousand times a second. For
 * each tick one line goes to standard output: status; the tip (3), the force of the tissue (3), the depth of the last
 * query; the size of the force's gradient, N/m; the work of the hand, and the energy in mass and spring, J; the time that
 * the force took, us, elapsed and of the processor. PACED is 1 for a loop in real time, 0 for one as fast as it goes.
 * SHAPE: 0 disc, 1 ball, 2 cone of 70 degrees. */
#define _POSIX_C_SOURCE 200112L
#include <time.h>

#include "examples/hand.h"
#include "epsmesh_values.h"

enum { WAVES = 12, LONGEST = 10 };
static const double TICK = 1e-3, PI_ = 3.14159265358979323846;
/* The tool: its mass (kg), and the spring (N/m) and damper (N s/m) between it and the hand. Share of the region. */
static const double MASS = 0.05, SPRING = 400, DAMPER = 4, WITHIN = 0.85;
/* Lowest point of the path's depth, in units of the deepest one, below zero: out of contact. */
static const double LIFTED = 0.5;
/* Half the step (m) of a difference for the gradient. */
static const double APART = 1e-7;

typedef struct {
    double size[WAVES], phase[WAVES], most;
} wave;

static double drawn(unsigned long *state) {
    *state = (*state * 1664525UL + 1013904223UL) & 0xffffffffUL;
    return (double)*state / 4294967296.0;
}

/* At most 1 by magnitude: periods from a second to LONGEST seconds. */
static double wave_at(const wave *w, double t) {
    double sum = 0;
    int i;
    for (i = 0; i < WAVES; i++) sum += w->size[i] * sin(2 * PI_ * (i + 1) * t / (double)LONGEST + w->phase[i]);
    return sum / w->most;
}

static void wave_make(wave *w, unsigned long *state) {
    int i;
    double t, most = 0;
    for (i = 0; i < WAVES; i++) w->size[i] = 2 * drawn(state) - 1, w->phase[i] = 2 * PI_ * drawn(state);
    for (w->most = 1, t = 0; t < (double)LONGEST; t += 0.01) most = fmax(most, fabs(wave_at(w, t)));
    w->most = 1.01 * most;
}

static void path_at(const hand *h, const wave w[3], double deepest, double t, double tip[3]) {
    const epsmesh_model *m = &h->model;
    double x = WITHIN * m->reach[0] * wave_at(&w[0], t), y = WITHIN * m->reach[1] * wave_at(&w[1], t), turn[3][3], at[3];
    double level = 0.5 * (1 - LIFTED) + 0.5 * (1 + LIFTED) * wave_at(&w[2], t), corner = m->is_round ? sqrt(0.5) : 1;
    epsmesh_spot spot;
    int i, j;
    x *= corner, y *= corner;
    epsmesh_spot_at(m, x, y, &spot, turn);
    at[0] = x, at[1] = y, at[2] = spot.height;
    for (i = 0; i < 3; i++) at[i] -= deepest * level * spot.normal[i];
    for (i = 0; i < 3; i++)
        for (tip[i] = m->origin[i], j = 0; j < 3; j++) tip[i] += at[j] * m->axes[j][i];
}

static double now(clockid_t clock) {
    struct timespec t;
    clock_gettime(clock, &t);
    return 1e6 * (double)t.tv_sec + 1e-3 * (double)t.tv_nsec;
}

/* The size (N/m, Frobenius) of the force's gradient at a tip, by central differences. */
static double gradient(const hand *h, const double tip[3]) {
    hand probe = *h;
    double ends[3], force[2][3], sum = 0;
    int axis, i, k;
    for (axis = 0; axis < 3; axis++) {
        for (k = 0; k < 2; k++) {
            for (i = 0; i < 3; i++) ends[i] = tip[i] + (i != axis ? 0 : k ? APART : -APART);
            hand_feel(&probe, ends, force[k]);
        }
        for (i = 0; i < 3; i++) sum += (force[1][i] - force[0][i]) * (force[1][i] - force[0][i]);
    }
    return sqrt(sum) / (2 * APART);
}

int main(int count, char **words) {
    static hand h;
    wave waves[3];
    double path[3], next[3], tip[3], speed[3] = {0, 0, 0}, force[3], work = 0, deepest;
    unsigned long state;
    struct timespec due;
    long tick, ticks;
    int i, is_paced;
    const char *problem = count == 8 ? hand_load(&h, words[1], atof(words[3]), 1e9) : "drag MODEL SHAPE RADIUS DEPTH "
                                                                                      "SECONDS SEED PACED";
    if (problem) {
        fprintf(stderr, "%s\n", problem);
        return 2;
    }
    h.tool.shape = (epsmesh_shape)atoi(words[2]), h.tool.angle = 70 * PI_ / 180;
    deepest = atof(words[4]), ticks = (long)(atof(words[5]) / TICK), state = (unsigned long)atol(words[6]);
    is_paced = atoi(words[7]);
    for (i = 0; i < 3; i++) wave_make(&waves[i], &state);
    path_at(&h, waves, deepest, 0, path);
    for (i = 0; i < 3; i++) tip[i] = path[i];
    clock_gettime(CLOCK_MONOTONIC, &due);
    for (tick = 0; tick < ticks; tick++) {
        double began, own, took, stored = 0, steep;
        if (is_paced) {
            due.tv_nsec += 1000000;
            if (due.tv_nsec >= 1000000000) due.tv_nsec -= 1000000000, due.tv_sec++;
            clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
        }
        began = now(CLOCK_MONOTONIC), own = now(CLOCK_THREAD_CPUTIME_ID);
        hand_feel(&h, tip, force);
        own = now(CLOCK_THREAD_CPUTIME_ID) - own, took = now(CLOCK_MONOTONIC) - began;
        steep = gradient(&h, tip);
        path_at(&h, waves, deepest, (double)(tick + 1) * TICK, next);
        for (i = 0; i < 3; i++) {
            const double pull = SPRING * (path[i] - tip[i]) + DAMPER * ((next[i] - path[i]) / TICK - speed[i]);
            work += pull * (next[i] - path[i]);
            stored += 0.5 * MASS * speed[i] * speed[i] + 0.5 * SPRING * (path[i] - tip[i]) * (path[i] - tip[i]);
            speed[i] += TICK / MASS * (pull + force[i]);
        }
        printf("%d %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.9g %.9g %.9g %.3f %.3f\n", (int)h.status, tip[0], tip[1], tip[2],
               force[0], force[1], force[2], h.status == EPSMESH_OK ? h.tool.depth : 0.0, steep, work, stored, took, own);
        for (i = 0; i < 3; i++) tip[i] += TICK * speed[i], path[i] = next[i];
    }
    hand_free(&h);
    return 0;
}
