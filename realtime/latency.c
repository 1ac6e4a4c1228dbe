/* What a query takes, in microseconds: `latency MODEL [QUERIES [SECONDS]]`, and how many ticks of a
 * loop at 1 kHz are late, with a query and without, each SECONDS long. POSIX for its clock; epsmesh.c itself needs C99 alone. */
#define _POSIX_C_SOURCE 200112L
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "epsmesh_patch.h"

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

/* Run a loop at 1 kHz for so many ticks, each second one with a query, and count those that end after the next is due. */
static double paced(const epsmesh_model *model, long ticks, long late[2]) {
    struct timespec due;
    double sum = 0;
    long i;
    clock_gettime(CLOCK_MONOTONIC, &due);
    for (i = 0; i < ticks; i++) {
        epsmesh_query query = epsmesh_ask(model);
        double end;
        due.tv_nsec += 1000000;
        if (due.tv_nsec >= 1000000000) due.tv_nsec -= 1000000000, due.tv_sec++;
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
        query.shape = EPSMESH_SPHERE, query.radius = 0.3 * model->thickness, query.depth = 0.002 * model->thickness;
        memcpy(query.at, model->origin, sizeof query.at);
        query.at[2] += model->height[0];
        if (i % 2) sum += epsmesh_touch_at(model, &query).force[2];
        end = now() - (1e6 * (double)due.tv_sec + 1e-3 * (double)due.tv_nsec);
        late[i % 2] += end > 1000;
    }
    return sum;
}

int main(int count, char **words) {
    static epsmesh_model model;
    static epsmesh_patch patch;
    static unsigned char data[1 << 24];
    static const char *const names[] = {"disc", "sphere", "cone", "blade", "bonded", "patch", "nothing"};
    long i, n = count > 2 ? atol(words[2]) : 20000;
    double *took = n > 0 ? (double *)malloc((size_t)n * sizeof *took) : NULL, sum = 0, radius;
    FILE *file = count > 1 ? fopen(words[1], "rb") : NULL;
    int shape, axis;
    if (!file || !took || epsmesh_load(&model, data, fread(data, 1, sizeof data, file)) != EPSMESH_OK) {
        fprintf(stderr, "usage: latency MODEL [QUERIES]\n");
        return 2;
    }
    fclose(file);
    radius = 0.05 * model.thickness;
    if (epsmesh_patch_make(&patch, bowl, &radius, 0.6 * radius) != EPSMESH_OK) return 1;
    for (shape = 0; shape < 7; shape++) {
        for (i = 0; i < n; i++) {
            epsmesh_query query = epsmesh_ask(&model);
            double x = 0.8 * model.reach[0] * ((double)(i % 101) / 50 - 1), begin;
            query.shape = (epsmesh_shape)shape, query.angle = 1.2;
            query.radius = radius, query.depth = 0.002 * model.thickness;
            query.length = 0.1 * model.thickness, query.width = 0.02 * model.thickness;
            for (axis = 0; axis < 3; axis++) query.at[axis] = model.origin[axis] + x * model.axes[0][axis];
            begin = now();
            if (shape < 5) sum += epsmesh_touch_at(&model, &query).force[2];
            else if (shape == 5) sum += epsmesh_patch_touch(&patch, &model, &query, 1e-3 * (double)i).force[2];
            took[i] = now() - begin;
        }
        qsort(took, (size_t)n, sizeof *took, rising);
        printf("%-8s p50 %.2f  p99 %.2f  largest %.1f us\n", names[shape], took[n / 2], took[n - 1 - n / 100], took[n - 1]);
    }
    free(took);
    if (count > 3) {
        long late[2] = {0, 0}, ticks = (long)(2000 * atof(words[3]));
        sum += paced(&model, ticks, late);
        printf("1 kHz    late by a tick: %ld of %ld with a query, %ld without\n", late[1], ticks / 2, late[0]);
    }
    return sum > 0 ? 0 : 1;
}
