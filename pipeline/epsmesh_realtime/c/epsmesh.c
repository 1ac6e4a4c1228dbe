/* The evaluator: compile this file alone. It includes its parts, so that no names but those of the headers are public,
 * and the compiler sees all of them at once. */
#include "epsmesh.h"
#include "epsmesh_friction.h"
#include "epsmesh_insertion.h"
#include "epsmesh_patch.h"
#include "epsmesh_relaxation.h"
#include "epsmesh_surface.h"
#include "epsmesh_values.h"

#include <float.h>
#include <math.h>
#include <string.h>

static const double PI = 3.14159265358979323846;
static const double TOUCHING = 1e-12, SMALLEST = 1e-6, SLENDER = 0.02, SOFT = 1e-12;
/* Of a bonded disc, errors of c: by lateral tractions, times room^2/((1 - 2 nu) a); and on a curved face, by mean curvature. */
static const double STICKS = 0.1, STICKS_BENT = 0.02;
static const double BALL_LIMIT = 0.6, NEGLIGIBLE = 1e-17, CLOSE = 1e-10;
static const double FOOT_SAME = 1e-13; /* of the region */
/* Of several tools: NEAR in units of both radii; see src/several.c for the others. */
static const double NEAR = 2.0, SETTLED = 1e-8, FOURTH = 0.5, FOURTH_BLADE = 2.0, BENDS_BLADE = 2.0;
static const double FAR = 1e3; /* no vertex is farther, in units of the face or the thickness */
enum { STEPS = 60, TERMS = 40, FOOT_STEPS = 30, SETTLE_STEPS = 40 };

#include "src/file.c"
#include "src/load.c"
#include "src/table.c"
#include "src/contact.c"
#include "src/query.c"
#include "src/several.c"
#include "src/patch.c"
#include "src/relaxation.c"
#include "src/surface.c"
#include "src/values.c"
#include "src/insertion.c"
#include "src/friction.c"

const char *epsmesh_word(epsmesh_status status) {
    static const char *const words[] = {"ok",      "no contact", "outside", "large", "deep",    "tool",
                                        "input",   "poisson", "tilted", "off",   "damaged", "no model",
                                        "near",    "others", "alone", "history"};
    return (int)status >= 0 && status < EPSMESH_STATUSES ? words[status] : "";
}

epsmesh_flaw epsmesh_flaw_of(const epsmesh_model *m, const char **array) {
    *array = m->flawed;
    return m->flaw;
}

void epsmesh_sizes(size_t sizes[6]) {
    sizes[0] = sizeof(epsmesh_model), sizes[1] = sizeof(epsmesh_query);
    sizes[2] = sizeof(epsmesh_touch), sizes[3] = sizeof(epsmesh_patch);
    sizes[4] = sizeof(epsmesh_memory), sizes[5] = sizeof(epsmesh_moment);
}
