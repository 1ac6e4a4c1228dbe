/* The force on a needle or a blade over its depth: indentation, puncture, cutting, withdrawal, from an insertion's model
 * (`epsmesh export` of a study with [probe.insertion]). C99; no allocation, locks, input or output. SI units.
 *
 * Forces are those of the tissue against the advance. The channel that was cut stays: a tool that is pulled back and pushed
 * in again cuts from the largest depth on. Friction reverses over a `slip`, as the force of cutting begins and ends.
 */
#ifndef EPSMESH_INSERTION_H
#define EPSMESH_INSERTION_H

#include "epsmesh.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { EPSMESH_ADVANCE = 8, EPSMESH_BACK = 5, EPSMESH_PUNCTURE = 5 };

/* What the tool does at its depth. */
typedef enum {
    EPSMESH_ABOVE,    /* it does not touch */
    EPSMESH_INDENTS,  /* it presses on tissue that it has not cut */
    EPSMESH_CUTS,     /* its crack is as deep as ever */
    EPSMESH_CHANNEL   /* it is in the channel that it has cut, or has left a depth of cutting */
} epsmesh_stage;

/* The tables, plain memory that points into the bytes of a file; any number of threads may use it. */
typedef struct {
    const double *advance;   /* depth, elastic, cutting, friction, error, crack's depth, is cutting, error between knots */
    const double *back;      /* depth, elastic, friction, error, error between knots; NULL: without withdrawal */
    const double *punctures; /* depth, its error, force before, its error, force after */
    int advances, backs, pierced, is_loaded;
    double slip;
    epsmesh_flaw flaw;
    const char *flawed;
} epsmesh_path;

/* A tool's state, plain memory: every tool and thread needs its own. */
typedef struct {
    double depth, deepest; /* m */
    double lag, slip;      /* m: how far the tool has slid since the friction was 0, within the slip */
    int way, is_lost;      /* 1 inwards, -1 outwards; the tool was deeper than the model is */
} epsmesh_insertion;

typedef struct {
    epsmesh_status status;
    epsmesh_stage stage;
    int punctures;                     /* number of layers that are pierced */
    int padding;
    double force, force_error;         /* N: sum of the next three, and its bar */
    double elastic, cutting, friction; /* N */
    double stiffness;                  /* N/m: dF/dd of a motion as the last one */
    double crack_depth;                /* m */
} epsmesh_resistance;

/* Point at the `size` bytes of a file at `data`, a multiple of 8: EPSMESH_OK, or EPSMESH_NO_MODEL with its flaw. */
epsmesh_status epsmesh_path_load(epsmesh_path *path, const void *data, size_t size);

/* Return why epsmesh_path_load failed, and the name of the array in question, "" if it is none. */
epsmesh_flaw epsmesh_path_flaw(const epsmesh_path *path, const char **array);

/* Begin above intact tissue. A `slip` (m) of 0 is the model's. */
void epsmesh_insertion_begin(epsmesh_insertion *insertion, const epsmesh_path *path, double slip);

/* Move the tip to a depth (m) below the undeformed face, on a straight way, and return the force there.
 *
 * EPSMESH_DEEP: it is deeper than the model. EPSMESH_HISTORY: the depth of the crack is not known, since the tool was
 * deeper than the model; or the tool is pulled back in a channel, and the model has no withdrawal. */
epsmesh_resistance epsmesh_insertion_to(epsmesh_insertion *insertion, const epsmesh_path *path, double depth);

/* Move the tip through `count` depths, one after the other. */
void epsmesh_insertion_each(epsmesh_insertion *insertion, const epsmesh_path *path, size_t count, const double *depths,
                            epsmesh_resistance *found);

/* Put the sizes (bytes) of a path, an insertion and a resistance into `sizes`, for other languages. */
void epsmesh_insertion_sizes(size_t sizes[3]);

#ifdef __cplusplus
}
#endif
#endif
