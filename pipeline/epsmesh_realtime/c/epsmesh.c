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

/* What tables, contacts and answers compute with; epsmesh_gradient.cpp compiles them with derivatives. */
typedef double real;
typedef epsmesh_spot spot;
typedef epsmesh_query request;

#include "src/constants.c"
#include "src/file.c"
#include "src/load.c"
#include "src/table.c"
#include "src/contact.c"
#include "src/answer.c"
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
