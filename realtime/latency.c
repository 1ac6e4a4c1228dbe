/* What a query takes, in microseconds: `latency MODEL [QUERIES]`. POSIX for its clock; epsmesh.c itself needs C99 alone. */
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <stdlib.h>
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
    return sum > 0 ? 0 : 1;
}
