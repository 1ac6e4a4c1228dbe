/* Unity: a native plug-in, called from the thread that serves the device, never from Update(), which is a frame apart.
 *
 *     cc -O2 -shared -fPIC unity.c ../epsmesh.c -lm -o libepsmesh_unity.so   (Plugins/x86_64; .dll, .bundle alike)
 *
 * EpsmeshTool.cs beside this file declares it. Unity is left handed, y up: its x, y, z are the model's x, z, y.
 */
#include "hand.h"

#ifdef _WIN32
#define EXPORTED __declspec(dllexport)
#else
#define EXPORTED __attribute__((visibility("default")))
#endif

/* Return a tool, or NULL if the model at `path` cannot be used; `radius` (m), `most` (N). */
EXPORTED void *epsmesh_unity_open(const char *path, double radius, double most) {
    hand *made = (hand *)malloc(sizeof(hand));
    if (made && hand_load(made, path, radius, most)) {
        free(made);
        made = NULL;
    }
    return made;
}

EXPORTED void epsmesh_unity_close(void *tool) {
    if (tool) hand_free((hand *)tool);
    free(tool);
}

/* Put the force (N) on a tool at `tip` (m) into `force`, both in Unity's axes; return the status, 0 is ok. */
EXPORTED int epsmesh_unity_feel(void *tool, const double tip[3], double force[3], double *error) {
    hand *h = (hand *)tool;
    const double there[3] = {tip[0], tip[2], tip[1]};
    double found[3];
    hand_feel(h, there, found);
    force[0] = found[0], force[1] = found[2], force[2] = found[1];
    *error = h->error;
    return h->status;
}
