/* What a query takes, tool by tool, in microseconds: `latency MODEL [QUERIES [SECONDS]]`.
 *
 * First QUERIES of each tool, and of two discs at once, one after the other. Then a loop at 1 kHz of SECONDS, whose ticks take the tools in turn,
 * and nothing in turn with them: what a query takes there, and how many ticks ended after the next one was due, beside
 * those that asked nothing. POSIX for its clock; epsmesh.c itself needs C99 alone. */
#define _POSIX_C_SOURCE 200112L
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "epsmesh_patch.h"
#include "epsmesh_relaxation.h"

enum { PATCH = 5, BOTH = 6, AFTER_DISC = 7, AFTER_BALL = 8, NOTHING = 9, KINDS = 10, PLACES = 101 };
static const char *const NAMES[] = {"disc", "sphere", "cone", "blade", "bonded", "patch", "two", "disc, relaxing",
                                    "sphere, relaxing", "nothing"};
/* Relaxing tissue: so many steps of a millisecond in, held, and out; and its terms, if the model has none. */
enum { STROKE = 1000 };
static const double SHARES[] = {0.1, 0.2, 0.2, 0.1}, TIMES[] = {0.01, 0.1, 1, 10};
static const long TICK = 1000000; /* ns */

static epsmesh_model model;
static epsmesh_patch patch;
static epsmesh_query queries[NOTHING][PLACES];
static epsmesh_memory memories[2];
static epsmesh_moment moments[2][STROKE + 8];

static int rising(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e6 * (double)t.tv_sec + 1e-3 * (double)t.tv_nsec;
}

/* A bowl that touches about as a ball of `user` (m) does. */
static double bowl(double x, double y, void *user) {
    double radius = *(const double *)user;
    return (x * x + 2 * y * y) / (2 * radius);
}

/* Go on by a millisecond of a stroke at one place. */
static double ask_after(int kind) {
    static epsmesh_model relaxing;
    static long asked[2];
    long which = kind - AFTER_DISC, number = asked[which]++ % (3 * STROKE);
    epsmesh_query query = queries[kind][PLACES / 2];
    int i;
    if (!relaxing.relaxing) {
        relaxing = model, relaxing.relaxing = model.relaxing ? model.relaxing : 4;
        for (i = 0; i < 4 && !model.relaxing; i++) relaxing.share[i] = SHARES[i], relaxing.time[i] = TIMES[i];
    }
    if (number == 0) epsmesh_memory_begin(&memories[which], moments[which], STROKE + 8);
    if (number < STROKE) query.depth *= (double)(number + 1) / (double)STROKE;
    if (number >= 2 * STROKE) query.depth *= (double)(3 * STROKE - number) / (double)STROKE;
    return epsmesh_touch_after(&relaxing, &query, 1e-3, &memories[which]).force[2];
}

/* Ask, and return the force, which is NaN where there is none. */
static double ask(int kind, long number) {
    const epsmesh_query *query = &queries[kind % NOTHING][number % PLACES];
    if (kind == NOTHING) return 0;
    if (kind == AFTER_DISC || kind == AFTER_BALL) return ask_after(kind);
    if (kind == BOTH) {
        epsmesh_query both[2];
        epsmesh_touch touches[2];
        both[0] = *query, both[1] = queries[BOTH][(number + PLACES / 2) % PLACES];
        epsmesh_touch_all(&model, 2, both, touches);
        return touches[0].force[2];
    }
    if (kind == PATCH) return epsmesh_patch_touch(&patch, &model, query, 1e-3 * (double)number).force[2];
    return epsmesh_touch_at(&model, query).force[2];
}

/* Find the face at x (m) of the region's middle: the highest tip that a foot is not lost for. */
static void on_face(double x, double at[3]) {
    double low = -100 * model.thickness, high = 100 * model.thickness, foot[3], depth;
    int i, axis;
    for (i = 0; i < 80; i++) {
        double z = 0.5 * (low + high);
        for (axis = 0; axis < 3; axis++) at[axis] = model.origin[axis] + x * model.axes[0][axis] + z * model.axes[2][axis];
        if (epsmesh_foot(&model, at, foot, &depth) == EPSMESH_NO_CONTACT) high = z;
        else low = z;
    }
}

/* Put queries of one tool along the middle of the region; return whether the model answers all of them. */
static int made(int kind, double size) {
    double force;
    int i;
    for (i = 0; i < PLACES; i++) {
        epsmesh_query *query = &queries[kind][i];
        double x = 0.8 * model.reach[0] * ((double)i / (PLACES / 2) - 1);
        *query = epsmesh_ask(&model);
        query->shape = (epsmesh_shape)(kind == AFTER_BALL ? EPSMESH_SPHERE : kind >= PATCH ? EPSMESH_DISC : kind), query->angle = 1.2;
        query->radius = size, query->length = 2 * size, query->width = 0.4 * size;
        on_face(x, query->at);
        query->depth = 0.04 * size;
    }
    for (i = 0; i < PLACES; i++) {
        force = ask(kind, i);
        if (!(force == force)) return 0;
    }
    return 1;
}

static void print_times(const char *name, double *took, long count) {
    qsort(took, (size_t)count, sizeof *took, rising);
    printf("%-16s p50 %7.2f  p99 %7.2f  largest %9.1f us", name, took[count / 2], took[count - 1 - count / 100],
           took[count - 1]);
}

/* Run a loop at 1 kHz whose ticks take the `kinds` in turn: what each took, and how many ended after the next was due. */
static double paced(const int *kinds, int count, long ticks, double *took, long *late) {
    struct timespec due;
    double sum = 0;
    long i;
    clock_gettime(CLOCK_MONOTONIC, &due);
    for (i = 0; i < ticks; i++) {
        long turn = i % count;
        double begin;
        due.tv_nsec += TICK;
        if (due.tv_nsec >= 1000000000) due.tv_nsec -= 1000000000, due.tv_sec++;
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
        begin = now();
        sum += ask(kinds[turn], i);
        took[turn * (ticks / count) + i / count] = now() - begin;
        late[turn] += now() - (1e6 * (double)due.tv_sec + 1e-3 * (double)due.tv_nsec) > 1e-3 * (double)TICK;
    }
    return sum;
}

int main(int count, char **words) {
    static double data[1 << 23]; /* of which a model is a part */
    long i, n = count > 2 ? atol(words[2]) : 20000, ticks = count > 3 ? (long)(1000 * atof(words[3])) : 0;
    FILE *file = count > 1 ? fopen(words[1], "rb") : NULL;
    int kinds[KINDS], known = 0, kind;
    double *took, sum = 0, radius;
    if (!file || n < 1 || ticks < 0 || epsmesh_load(&model, data, fread(data, 1, sizeof data, file)) != EPSMESH_OK) {
        fprintf(stderr, "usage: latency MODEL [QUERIES [SECONDS]]\n");
        return 2;
    }
    fclose(file);
    took = (double *)malloc((size_t)(n > ticks ? n : ticks + 1) * sizeof *took);
    if (!took) return 1;
    radius = 0.05 * model.thickness;
    if (epsmesh_patch_make(&patch, bowl, &radius, 0.6 * radius) != EPSMESH_OK) return 1;
    for (kind = 0; kind < KINDS; kind++) {
        if (kind == NOTHING || made(kind, radius)) kinds[known++] = kind;
        else printf("%-16s is none of this model's\n", NAMES[kind]);
    }
    for (kind = 0; kind < known; kind++) {
        for (i = 0; i < n; i++) {
            double begin = now();
            sum += ask(kinds[kind], i);
            took[i] = now() - begin;
        }
        print_times(NAMES[kinds[kind]], took, n), printf("\n");
    }
    ticks -= ticks % known;
    if (ticks) {
        long late[KINDS] = {0}, each = ticks / known;
        sum += paced(kinds, known, ticks, took, late);
        printf("at 1 kHz, %ld ticks of each in turn\n", each);
        for (kind = 0; kind < known; kind++) {
            print_times(NAMES[kinds[kind]], took + kind * each, each);
            printf("  late %ld\n", late[kind]);
        }
    }
    free(took);
    return sum > 0 ? 0 : 1;
}
