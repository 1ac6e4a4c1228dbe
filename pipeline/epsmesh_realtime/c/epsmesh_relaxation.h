/* Forces on tools in relaxing tissue, from step to step. C99; no allocation, locks, input or output.
 *
 * All tissue of the body relaxes alike: E(t) = E (g + sum of share_i exp(-t / time_i)), g = 1 - sum of share_i, at constant
 * Poisson's ratio. E of a query is the modulus at once. The depth is linear in time from call to call; a tool that was above
 * tissue at rest touches it from the call before on.
 */
#ifndef EPSMESH_RELAXATION_H
#define EPSMESH_RELAXATION_H

#include "epsmesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A moment of growing contact: what each term of the relaxation has kept of the depth and of the elastic force until then. */
typedef struct {
    double time, depth, force[3], error; /* s, m, N, share of the force */
    double of_depth[EPSMESH_MOST_RELAXING], of_force[EPSMESH_MOST_RELAXING][3];
    double doubt[EPSMESH_MOST_RELAXING]; /* N: error of of_force, where steps are long */
} epsmesh_moment;

typedef enum { EPSMESH_RESTED, EPSMESH_GROWING, EPSMESH_SHRINKING, EPSMESH_FREE, EPSMESH_UNKNOWN } epsmesh_phase;

/* What the tissue below one tool remembers. Plain memory: every tool and thread needs its own. */
typedef struct {
    epsmesh_query query; /* tool, place and tissue, which stay the same while tissue remembers */
    epsmesh_phase phase;
    epsmesh_moment now, contact; /* of the depth; and when shrinking contact was as large as it is now */
    double deepest, away;        /* m; s without contact */
    epsmesh_moment *moments;     /* of growing contact, by the caller */
    size_t room, used;
} epsmesh_memory;

/* Begin with tissue at rest. Round tools need `room` for one moment in each call in which contact grows, and for two more;
 * discs and blades need none. */
void epsmesh_memory_begin(epsmesh_memory *memory, epsmesh_moment *moments, size_t room);

/* Answer a query, `step` (s) after the last one. Without relaxation this is epsmesh_touch_at.
 *
 * EPSMESH_HISTORY: the force depends on an earlier contact that is not known. Place, tool or tissue have changed during contact, or before
 * the tissue was at rest again; the contact of a round tool has grown again after it had shrunk, or has used up its room;
 * or an earlier query in contact was refused. Begin again. */
epsmesh_touch epsmesh_touch_after(const epsmesh_model *model, const epsmesh_query *query, double step,
                                  epsmesh_memory *memory);

/* Answer `count` queries, each so many `steps` (s) after the one before, as so many calls do. */
void epsmesh_touch_each_after(const epsmesh_model *model, size_t count, const epsmesh_query *queries, const double *steps,
                              epsmesh_memory *memory, epsmesh_touch *touches);

#ifdef __cplusplus
}
#endif
#endif
