/* The displacement of a body's surface for a touch, for display. C99; no allocation, locks, input or output.
 *
 * Points and displacements are x, y, z (m) along the face's axes (model->axes), from model->origin.
 */
#ifndef EPSMESH_SURFACE_H
#define EPSMESH_SURFACE_H

#include "epsmesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Put the regular part of the displacement (m/N, E = 1) of all model->vertices into `regular` (vertices, 3). */
void epsmesh_surface_regular(const epsmesh_model *model, const epsmesh_query *query, const epsmesh_touch *touch,
                             double *regular);

/* Put the displacement (m) of `count` `points` (count, 3) with their `regular` parts into `moved` (count, 3). `touch` is the
 * answer of `query`. Returns its status; EPSMESH_DAMAGED if a displacement is not finite. */
epsmesh_status epsmesh_surface_move(const epsmesh_model *model, const epsmesh_query *query, const epsmesh_touch *touch,
                                    size_t count, const double *points, const double *regular, double *moved);

/* Answer a query, and put the displacement (m) of all vertices into `moved` (vertices, 3): 0 where the tool does not touch,
 * NaN if the model refuses. `room` is memory for 6 * vertices numbers. */
epsmesh_touch epsmesh_surface_press(const epsmesh_model *model, const epsmesh_query *query, double *room, double *moved);

#ifdef __cplusplus
}
#endif
#endif
