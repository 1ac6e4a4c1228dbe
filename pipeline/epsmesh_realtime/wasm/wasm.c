/* The evaluator for a web page: one model, one query at a time, numbers in memory that the page sees.
 *
 *     clang --target=wasm32 -O2 -std=c99 -nostdlib -I pipeline/epsmesh_realtime/wasm/include -I realtime -Wl,--no-entry -Wl,--gc-sections
 *
 * `make wasm` builds it. There is no libc: functions of math.h are the page's.
 */
#include <string.h>

#include "epsmesh.h"
#include "epsmesh_surface.h"
#include "epsmesh_values.h"

#define PAGE __attribute__((visibility("default")))

enum { PAGE_SIZE = 65536 };

static epsmesh_model model;
static epsmesh_query query;
static epsmesh_touch touch;
static struct {
    epsmesh_spot spot;
    double turn[3][3];
} place;

/* ---- what a compiler expects of a libc ---- */

void *memcpy(void *to, const void *from, size_t size) {
    unsigned char *a = (unsigned char *)to;
    const unsigned char *b = (const unsigned char *)from;
    while (size--) *a++ = *b++;
    return to;
}

void *memset(void *to, int byte, size_t size) {
    unsigned char *a = (unsigned char *)to;
    while (size--) *a++ = (unsigned char)byte;
    return to;
}

int memcmp(const void *a, const void *b, size_t size) {
    const unsigned char *p = (const unsigned char *)a, *q = (const unsigned char *)b;
    for (; size && *p == *q; size--) p++, q++;
    return size ? *p - *q : 0;
}

size_t strlen(const char *text) {
    size_t n = 0;
    while (text[n]) n++;
    return n;
}

/* ---- for the page ---- */

/* Return room for `size` bytes, or NULL. It is never freed. */
PAGE void *page_room(size_t size) {
    extern unsigned char __heap_base;
    static size_t end;
    size_t begin = (end ? end : (size_t)&__heap_base) + 15 & ~(size_t)15, most = __builtin_wasm_memory_size(0) * PAGE_SIZE;
    if (begin + size > most && __builtin_wasm_memory_grow(0, (begin + size - most + PAGE_SIZE - 1) / PAGE_SIZE) == (size_t)-1)
        return NULL;
    end = begin + size;
    return (void *)begin;
}

PAGE epsmesh_status page_load(const void *data, size_t size) {
    return epsmesh_load(&model, data, size);
}

/* Answer a query; the numbers of the answer are at page_touch(). Without `along`, a blade's edge is along the face's x. */
PAGE epsmesh_status page_ask(int shape, double radius, double angle, double length, double width, double x, double y,
                             double z, double along_x, double along_y, double along_z, double depth, double young,
                             double poisson) {
    query = epsmesh_ask(&model);
    query.shape = (epsmesh_shape)shape, query.radius = radius, query.angle = angle;
    query.length = length, query.width = width, query.depth = depth, query.young = young, query.poisson = poisson;
    query.at[0] = x, query.at[1] = y, query.at[2] = z;
    query.along[0] = along_x, query.along[1] = along_y, query.along[2] = along_z;
    touch = epsmesh_touch_at(&model, &query);
    return touch.status;
}

/* Return the force (3), its error bar, the stiffness and the contact radius of the last answer. */
PAGE const double *page_touch(void) {
    return touch.force;
}

PAGE const char *page_word(int status) {
    return epsmesh_word((epsmesh_status)status);
}

/* Return 13 numbers of an epsmesh_spot, then its three directions. */
PAGE const double *page_spot(double x, double y) {
    epsmesh_spot_at(&model, x, y, &place.spot, place.turn);
    return &place.spot.height;
}

/* The surface at rest: its points (vertices, 3), and its triangles (triangles, 3). */
PAGE int page_vertices(void) {
    return model.vertices;
}

PAGE int page_triangles(void) {
    return model.triangles;
}

PAGE const float *page_points(void) {
    return model.surface_points;
}

PAGE const int32_t *page_corners(void) {
    return model.surface_triangles;
}

/* The surface of the last answer: epsmesh_surface.h. */
PAGE void page_regular(double *regular) {
    epsmesh_surface_regular(&model, &query, &touch, regular);
}

PAGE epsmesh_status page_move(size_t count, const double *points, const double *regular, double *moved) {
    return epsmesh_surface_move(&model, &query, &touch, count, points, regular, moved);
}
