/* Values within a model, for programs that make or test one. Places are x, y (m) along the face's axes. E = 1. */
#ifndef EPSMESH_VALUES_H
#define EPSMESH_VALUES_H

#include "epsmesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A place of the face: its height (m) above the plane of the axes, with derivatives; its mean curvature (1/m), positive on a
 * dome, with its gradient; the outward unit normal. */
typedef struct {
    double height, slope[2], second[2][2], bend, slope_bend[2], normal[3];
} epsmesh_spot;

/* Fill `spot`, and `turn`, whose rows are two unit tangents, the first one above x, and the outward normal. */
void epsmesh_spot_at(const epsmesh_model *model, double x, double y, epsmesh_spot *spot, double turn[3][3]);

/* Return the distance (m) from a place to the nearest side or to the bottom; NaN outside the region. */
double epsmesh_room_at(const epsmesh_model *model, double x, double y);

/* The regular part of the Green's function at a place: c (1/m), h (1/m^3), their gradients, and, if the model has tensors,
 * A1 and Axy (1/m^3) and R (1/m). */
typedef struct {
    double c, h, slope_c[2], slope_h[2], bent[2], regular[3][3];
} epsmesh_place;

/* Returns EPSMESH_OK, or EPSMESH_DAMAGED if the table is inconsistent there. */
epsmesh_status epsmesh_place_at(const epsmesh_model *model, double x, double y, double poisson, epsmesh_place *found);

/* Put the factors by which the tables of blades and bonded tools were divided at a place into `factors`. */
void epsmesh_factors(const epsmesh_model *model, double x, double y, double factors[EPSMESH_TENSORS]);

/* Put R (1/m) at `n` places `at` (n, 2) for unit forces at `m` places `to` (m, 2) into `found` (n, m). */
void epsmesh_between(const epsmesh_model *model, double poisson, size_t n, const double *at, size_t m, const double *to,
                     double *found);

/* Put R (m/N) of all vertices for a force at x, y into `regular` (vertices, 3). */
void epsmesh_surface_far(const epsmesh_model *model, double x, double y, double poisson, double *regular);

#ifdef __cplusplus
}
#endif
#endif
