/* Derivatives of forces with the numbers of a query. C++11, callable from C; no allocation, locks, input or output. */
#ifndef EPSMESH_GRADIENT_H
#define EPSMESH_GRADIENT_H

#include "epsmesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The numbers of a query, in the order of its fields. */
typedef enum {
    EPSMESH_BY_RADIUS,
    EPSMESH_BY_ANGLE,
    EPSMESH_BY_AT,              /* x, y, z: at a fixed depth, along the face; the force is constant along its normal */
    EPSMESH_BY_DEPTH = 8,
    EPSMESH_BY_YOUNG,
    EPSMESH_BY_POISSON,
    EPSMESH_BY_LENGTH,
    EPSMESH_BY_WIDTH,
    EPSMESH_BY_ALONG,           /* x, y, z */
    EPSMESH_NUMBERS = 16
} epsmesh_number;

/* Whether a derivative from the other side differs. */
typedef enum {
    EPSMESH_SMOOTH,
    EPSMESH_LIFTS, /* a flat tool at the face: derivatives are those of pressing; those of lifting are 0 */
    EPSMESH_SQUARE /* a blade as wide as long: fits of its stiffness end there */
} epsmesh_side;

/* Put the derivatives of the forces of `count` queries, each by itself, with `width` of their `numbers` into `slopes`
 * (count, 3, width), in N per unit of the number, and how to read them, of epsmesh_side, into `sides`. `touches` are the
 * answers of epsmesh_touch_each: 0 without contact, NaN without an answer. With the axis, 5 to 7, derivatives are 0: a tool
 * presses along the normal. */
void epsmesh_gradient(const epsmesh_model *model, size_t count, const epsmesh_query *queries,
                      const epsmesh_touch *touches, size_t width, const int32_t *numbers, double *slopes, int32_t *sides);

#ifdef __cplusplus
}
#endif
#endif
