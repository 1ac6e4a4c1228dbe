/* Any convex tip on a model of epsmesh.h, flat faces only. C99; no allocation, locks, input or output.
 *
 * A patch is plain memory of about 150 kB. Each call starts from the last one's contact, so every tool and thread needs
 * its own patch.
 */
#ifndef EPSMESH_PATCH_H
#define EPSMESH_PATCH_H

#include "epsmesh.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { EPSMESH_SIDE = 11, EPSMESH_CELLS = EPSMESH_SIDE * EPSMESH_SIDE, EPSMESH_DEPTHS = 40, EPSMESH_FILLS = 4 };

/* Return the height (m) of a convex tip above its lowest point, which is at x = y = 0 (m, along the tip's axes). */
typedef double (*epsmesh_height)(double x, double y, void *user);

/* Put the heights at `count` places into `z`. */
typedef void (*epsmesh_heights)(size_t count, const double *x, const double *y, double *z, void *user);

typedef struct {
    epsmesh_height height;
    epsmesh_heights heights; /* one of both */
    void *user;
    double reach, depths[EPSMESH_DEPTHS], outlines[EPSMESH_DEPTHS][2], fills[EPSMESH_FILLS][2];
    double aspect, kernel[2 * EPSMESH_SIDE - 1][2 * EPSMESH_SIDE - 1];
    double matrix[EPSMESH_CELLS][EPSMESH_CELLS];
    unsigned char pressed[EPSMESH_CELLS];
    int is_made;
} epsmesh_patch;

/* Make the patch of a tip up to a `reach` (m). Returns EPSMESH_OK, or EPSMESH_INPUT if the tip is not convex. */
epsmesh_status epsmesh_patch_make(epsmesh_patch *patch, epsmesh_height height, void *user, double reach);

/* The same, of a function for many places. */
epsmesh_status epsmesh_patch_make_of(epsmesh_patch *patch, epsmesh_heights heights, void *user, double reach);

/* Return the depth (m) at which the tip's rim is in the plane of the undeformed face. */
double epsmesh_patch_deepest(const epsmesh_patch *patch);

/* Answer a query for the tip, turned by `turn` (rad) from the face's x to its y; the query's shape and sizes are unused. */
epsmesh_touch epsmesh_patch_touch(epsmesh_patch *patch, const epsmesh_model *model, const epsmesh_query *query,
                                  double turn);

/* Answer `count` queries with their turns one after the other, as so many calls do. */
void epsmesh_patch_touch_each(epsmesh_patch *patch, const epsmesh_model *model, size_t count,
                              const epsmesh_query *queries, const double *turns, epsmesh_touch *touches);

#ifdef __cplusplus
}
#endif
#endif
