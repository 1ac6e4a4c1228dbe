/* What all hosts share: a tool in a hand, the force on it, and what is done when the model does not answer. C99 and C++.
 *
 * The tool is a point that moves freely; its depth is how far it is below the undeformed face, along the normal that leads
 * to it. Nothing here blocks or allocates but `hand_load`, which is called once, before the loop.
 */
#ifndef EPSMESH_HAND_H
#define EPSMESH_HAND_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "../epsmesh.h"

/* Of the force, what is left a millisecond after the model began to refuse, and what comes back in one. */
#define HAND_FADES 0.98
#define HAND_RETURNS 0.02

typedef struct {
    epsmesh_model model;
    void *data;            /* the bytes of its file, into which it points */
    epsmesh_query tool;    /* shape and sizes; place and depth are filled in */
    double most;           /* N: no device is asked for more */
    double share;          /* of the force that is rendered: 1, but after a refusal */
    double last[3];        /* N: the last force that the model gave */
    double stiffness;      /* N/m, for whoever watches it */
    double error;          /* N: bar of the model's force */
    epsmesh_status status; /* of the last call */
} hand;

static void hand_free(hand *h) {
    free(h->data);
    h->data = NULL, h->model.is_loaded = 0;
}

/* Read a model: NULL, or what went wrong. The tool is a ball of `radius` (m). */
static const char *hand_load(hand *h, const char *path, double radius, double most) {
    FILE *file = fopen(path, "rb");
    long size = -1;
    void *data = NULL;
    epsmesh_status status = EPSMESH_NO_MODEL;
    if (!file) return "the model cannot be opened";
    if (!fseek(file, 0, SEEK_END)) size = ftell(file);
    rewind(file);
    if (size > 0) data = malloc((size_t)size);
    if (data && fread(data, 1, (size_t)size, file) == (size_t)size) status = epsmesh_load(&h->model, data, (size_t)size);
    fclose(file);
    h->data = data;
    if (status != EPSMESH_OK || !(radius > 0 && most > 0)) {
        hand_free(h);
        if (status == EPSMESH_OK) return "radius and largest force must be positive";
        return "the file is no model that this version reads";
    }
    h->tool = epsmesh_ask(&h->model);
    h->tool.shape = EPSMESH_SPHERE, h->tool.radius = radius;
    h->most = most, h->share = 1, h->stiffness = h->error = 0, h->status = EPSMESH_NO_CONTACT;
    h->last[0] = h->last[1] = h->last[2] = 0;
    return NULL;
}

/* Put the force (N) on a tool whose lowest point is at `tip` (m), both in the body's coordinates, into `force`. */
static void hand_feel(hand *h, const double tip[3], double force[3]) {
    double size = 0;
    epsmesh_touch touch;
    int i;
    touch.status = epsmesh_foot(&h->model, tip, h->tool.at, &h->tool.depth);
    if (touch.status == EPSMESH_NO_CONTACT) {
        /* Nothing touches, inside the region or outside it. */
        h->status = EPSMESH_NO_CONTACT, h->share = 1, h->stiffness = h->error = 0;
        for (i = 0; i < 3; i++) h->last[i] = force[i] = 0;
        return;
    }
    if (touch.status == EPSMESH_OK) touch = epsmesh_touch_at(&h->model, &h->tool);
    h->status = touch.status;
    if (touch.status == EPSMESH_OK || touch.status == EPSMESH_NO_CONTACT) {
        h->share = fmin(1, h->share + HAND_RETURNS);
        h->stiffness = touch.stiffness, h->error = touch.force_error;
        for (i = 0; i < 3; i++) h->last[i] = touch.force[i];
    } else {
        /* No number is made up: what there was fades, so that the hand feels no blow. */
        h->share *= HAND_FADES, h->stiffness = h->error = 0;
    }
    for (i = 0; i < 3; i++) size += h->last[i] * h->last[i];
    size = sqrt(size);
    for (i = 0; i < 3; i++) force[i] = h->share * h->last[i] * (size > h->most ? h->most / size : 1);
}

#endif
