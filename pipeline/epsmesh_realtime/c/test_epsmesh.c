/* Hold a model file, whole, cut short and damaged, against what epsmesh.h promises: `test_epsmesh MODEL [FILES]`, the number
 * of damaged files. With EPSMESH_GRADIENT defined, derivatives are asked as well: link epsmesh_gradient.cpp. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef EPSMESH_GRADIENT
#include "epsmesh_gradient.h"
#endif
#include "epsmesh_relaxation.h"
#include "epsmesh_surface.h"

enum { VERTICES = 2000, HEADER = 2400 }; /* bytes of a file's header and its table of arrays, about */

static unsigned long state = 1;

static unsigned long draw(void) {
    state = (state * 1103515245UL + 12345UL) & 0x7fffffffUL;
    return state >> 8;
}

static double within(double low, double high) { return low + (high - low) * (double)draw() / (double)(1UL << 23); }

static int failures = 0;

static void expect(int is_right, const char *what) {
    if (is_right) return;
    failures++;
    fprintf(stderr, "failed: %s\n", what);
}

/* Ask for derivatives: without contact they are 0, of a refusal none. */
static void ask_slopes(const epsmesh_model *model, const epsmesh_query *query, const epsmesh_touch *touch) {
#ifdef EPSMESH_GRADIENT
    static const int32_t numbers[] = {0, 1, 2, 3, 4, 8, 9, 10, 11, 12, 13, 14, 15, 5, 16, -1};
    double slopes[3 * 16], sum = 0;
    int32_t side;
    size_t i;
    epsmesh_gradient(model, 1, query, touch, 16, numbers, slopes, &side);
    for (i = 0; i < 3 * 16; i++) sum += slopes[i];
    if (touch->status == EPSMESH_NO_CONTACT) expect(isfinite(sum) != 0, "without contact derivatives are finite");
    else if (touch->status != EPSMESH_OK) expect(isnan(slopes[0]) && isnan(slopes[15]), "a refusal has no derivatives");
#else
    (void)model, (void)query, (void)touch;
#endif
}

/* Ask at random places; a refusal has no numbers, an answer has finite ones. */
static void ask_around(const epsmesh_model *model, int times) {
    static const double sizes[] = {1e-3, 5e-3, 5e-3, 0, 1e-3};
    int i, j;
    for (i = 0; i < times; i++) {
        epsmesh_query query = epsmesh_ask(model);
        epsmesh_touch touch;
        double x = within(-1.1, 1.1) * model->reach[0], y = within(-1.1, 1.1) * model->reach[1];
        query.shape = (epsmesh_shape)(i % 5);
        query.radius = sizes[i % 5], query.angle = 1.2;
        query.length = 3e-3, query.width = within(1e-5, 4e-3), query.along[i % 3] = within(-1, 1);
        for (j = 0; j < 3; j++) query.at[j] = model->origin[j] + x * model->axes[0][j] + y * model->axes[1][j];
        query.depth = within(-1e-5, 5e-4);
        if (i % 17 == 0) query.depth = (double)NAN;
        touch = epsmesh_touch_at(model, &query);
        if (touch.status == EPSMESH_OK || touch.status == EPSMESH_NO_CONTACT) {
            expect(isfinite(touch.force[0] + touch.force[1] + touch.force[2]), "a force is finite");
            expect(isfinite(touch.force_error + touch.stiffness + touch.contact_radius), "an answer is finite");
            expect(touch.force_error >= 0, "a bar is none of less than nothing");
        } else {
            expect(isnan(touch.force[0]) && isnan(touch.stiffness), "a refusal has no numbers");
        }
        expect(strlen(epsmesh_word(touch.status)) > 0, "a status has a word");
        ask_slopes(model, &query, &touch);
    }
}

/* Ask for the surface: it moves, or nothing does. */
static void ask_surface(const epsmesh_model *model, int times) {
    static double room[6 * VERTICES], moved[3 * VERTICES];
    int i, j;
    if (model->vertices > VERTICES) return;
    for (i = 0; i < times; i++) {
        epsmesh_query query = epsmesh_ask(model);
        epsmesh_touch touch;
        double sum = 0;
        query.shape = (epsmesh_shape)(i % 5), query.radius = 1e-3, query.angle = 1.2, query.length = 3e-3, query.width = 5e-4;
        for (j = 0; j < 3; j++) query.at[j] = model->origin[j] + within(-1, 1) * model->reach[0] * model->axes[0][j];
        query.depth = within(-1e-5, 2e-4);
        touch = epsmesh_surface_press(model, &query, room, moved);
        for (j = 0; j < 3 * model->vertices; j++) sum += moved[j];
        expect((touch.status == EPSMESH_OK || touch.status == EPSMESH_NO_CONTACT) == (isfinite(sum) != 0) || !model->vertices,
               "the surface moves, or nothing is known of it");
    }
}

/* Ask for some tools at once: either all have an answer, or none has numbers. */
static void ask_several(const epsmesh_model *model, int times) {
    epsmesh_query queries[EPSMESH_MOST_TOOLS];
    epsmesh_touch touches[EPSMESH_MOST_TOOLS];
    int i, j, k, n, answers;
    for (i = 0; i < times; i++) {
        n = 2 + i % (EPSMESH_MOST_TOOLS - 1);
        for (j = 0; j < n; j++) {
            double x = within(-1, 1) * model->reach[0], y = within(-1, 1) * model->reach[1];
            queries[j] = epsmesh_ask(model);
            queries[j].shape = (epsmesh_shape)((i + j) % 5), queries[j].radius = within(1e-4, 2e-3), queries[j].angle = 1.2;
            queries[j].length = 2e-3, queries[j].width = 5e-4, queries[j].depth = within(-1e-5, 3e-4);
            for (k = 0; k < 3; k++)
                queries[j].at[k] = model->origin[k] + x * model->axes[0][k] + y * model->axes[1][k];
        }
        epsmesh_touch_all(model, n, queries, touches);
        for (answers = 0, j = 0; j < n; j++) {
            int has = touches[j].status == EPSMESH_OK || touches[j].status == EPSMESH_NO_CONTACT;
            answers += has;
            expect(has == (isfinite(touches[j].force[0] + touches[j].force_error + touches[j].stiffness) != 0),
                   "an answer of several is finite, a refusal is not");
            expect(!has || touches[j].force_error >= 0, "a bar of several is none of less than nothing");
        }
        expect(answers == 0 || answers == n, "all tools have an answer, or none has");
    }
}

/* Press at random into relaxing tissue: an answer is finite, a refusal is not, and no force pulls. */
static void ask_after(const epsmesh_model *model, int times) {
    static epsmesh_moment moments[8];
    epsmesh_model relaxing = *model;
    epsmesh_memory memory;
    epsmesh_touch touch;
    int i, j, k;
    relaxing.relaxing = 2;
    for (i = 0; i < 2; i++) relaxing.share[i] = within(0, 0.5), relaxing.time[i] = within(1e-3, 1);
    for (i = 0; i < times; i++) {
        epsmesh_query query = epsmesh_ask(model);
        query.shape = (epsmesh_shape)(i % 5), query.radius = 1e-3, query.angle = 1.2, query.length = 3e-3, query.width = 5e-4;
        for (j = 0; j < 3; j++) query.at[j] = model->origin[j];
        epsmesh_memory_begin(&memory, moments, 8);
        for (k = 0; k < 12; k++) {
            query.depth = within(-1e-5, 2e-4);
            touch = epsmesh_touch_after(&relaxing, &query, k % 4 ? within(0, 0.1) : 0, &memory);
            expect((touch.status == EPSMESH_OK || touch.status == EPSMESH_NO_CONTACT) == (isfinite(touch.force[2]) != 0),
                   "an answer after others is finite, a refusal is not");
            expect(touch.status != EPSMESH_OK || touch.force_error >= 0, "a bar after others is none of less than nothing");
        }
    }
}

/* Put numbers in the place of counts: those that products overflow with, or limits are missed by one. */
static void miscount(unsigned char *part, size_t size) {
    static const unsigned long numbers[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 63, 64, 65, 95, 96, 97, 255, 256, 257, 4096, 4097,
                                            16384, 16385, 0x1fffffffUL, 0x20000000UL, 0x40000000UL, 0x7fffffffUL,
                                            0x80000000UL, 0xfffffffeUL, 0xffffffffUL};
    size_t at = 4 * (draw() % (size / 4));
    unsigned long number = numbers[draw() % (sizeof numbers / sizeof *numbers)];
    int i;
    for (i = 0; i < 4; i++) part[at + (size_t)i] = (unsigned char)(number >> 8 * i & 0xff);
}

int main(int count, char **words) {
    static epsmesh_model model, damaged;
    static double data[1 << 17];
    unsigned char *part;
    size_t size, i, files = count > 2 ? (size_t)strtoul(words[2], NULL, 10) : 30000, sound = 0, cut = 0;
    epsmesh_query query;
    FILE *file = count > 1 ? fopen(words[1], "rb") : NULL;
    if (!file) return fprintf(stderr, "usage: test_epsmesh MODEL [FILES]\n"), 2;
    size = fread(data, 1, sizeof data, file);
    fclose(file);
    expect(epsmesh_load(&model, data, size) == EPSMESH_OK, "the model is read");
    ask_around(&model, 3000);
    ask_several(&model, 2000);
    ask_surface(&model, 200);
    ask_after(&model, 2000);
    expect(model.vertices > 0, "the model has a surface");
    expect(epsmesh_load(&damaged, NULL, 0) == EPSMESH_NO_MODEL, "nothing is no model");
    memset(&query, 0, sizeof query);
    expect(epsmesh_touch_at(&damaged, &query).status == EPSMESH_NO_MODEL, "what was not loaded is not asked");
    for (i = 0; i < size; i += 1 + size / 2000) {
        part = (unsigned char *)malloc(i ? i : 1); /* of its own size, so that a sanitizer sees what is read past it */
        if (!part) return 2;
        memcpy(part, data, i);
        expect(epsmesh_load(&damaged, part, i) == EPSMESH_NO_MODEL, "a part is no model");
        free(part), cut++;
    }
    part = (unsigned char *)malloc(size);
    if (!part) return 2;
    for (i = 0; i < files; i++) {
        int flips = 1 + (int)(draw() % 4);
        memcpy(part, data, size);
        while (flips--) {
            if (i % 3 == 2) miscount(part, HEADER);
            else part[draw() % (i % 3 ? size : (size_t)HEADER)] = (unsigned char)draw();
        }
        if (epsmesh_load(&damaged, part, size) == EPSMESH_OK) {
            sound++;
            ask_around(&damaged, 6);
            ask_several(&damaged, 2);
            ask_surface(&damaged, 1);
        }
    }
    for (i = 0; i < *((const uint32_t *)data + 4); i++) { /* each array in turn, of a kind that there is not */
        static const uint32_t unknown[2] = {5, 0};
        memcpy(part, data, size);
        memcpy(part + 32 + 64 * i + 32, unknown, sizeof unknown);
        epsmesh_load(&damaged, part, size);
    }
    free(part);
    printf("%s: %lu files cut short, %lu damaged, of which %lu are models\n", failures ? "failed" : "passed",
           (unsigned long)cut, (unsigned long)files, (unsigned long)sound);
    return failures ? 1 : 0;
}
