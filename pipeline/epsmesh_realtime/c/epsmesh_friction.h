/* Coulomb's friction of a tool that is dragged over a model of epsmesh.h. C99; no allocation, locks, input or output.
 *
 * The model's own normal force N limits the friction to `friction` times N. Below that the tool sticks: the friction is that
 * of a bristle as stiff as R. D. Mindlin's contact (1949). No motion gains energy, at steps of any size.
 */
#ifndef EPSMESH_FRICTION_H
#define EPSMESH_FRICTION_H

#include "epsmesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What a tool remembers of its way, plain memory: every tool and thread needs its own. All zeros: it has not touched. */
typedef struct {
    double tip[3], stretch[3]; /* m */
    double stiffness, slid;    /* N/m; m since it last stuck */
    int is_touching, padding;
} epsmesh_bristle;

typedef struct {
    epsmesh_touch touch;        /* without friction; its bar has what friction changes of the normal force */
    double friction[3];         /* N: further force on the tool, along the face */
    double friction_error;      /* N */
    double stretch;             /* m: of the bristle */
    int is_sticking, padding;
} epsmesh_rubbing;

/* Answer a query of a tool that has come from the last one on a straight way. A bonded disc has no friction: EPSMESH_TOOL.
 * `friction` is Coulomb's coefficient. After an answer without contact, or a refusal, the tool begins anew. */
epsmesh_rubbing epsmesh_touch_rubbing(const epsmesh_model *model, const epsmesh_query *query, double friction,
                                      epsmesh_bristle *bristle);

/* The same of `count` queries, one after the other. */
void epsmesh_touch_rubbing_each(const epsmesh_model *model, size_t count, const epsmesh_query *queries, double friction,
                                epsmesh_bristle *bristle, epsmesh_rubbing *found);

/* Put the sizes (bytes) of a bristle and a rubbing into `sizes`, for other languages. */
void epsmesh_friction_sizes(size_t sizes[2]);

#ifdef __cplusplus
}
#endif
#endif
