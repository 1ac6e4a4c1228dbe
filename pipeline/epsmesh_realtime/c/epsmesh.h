/* Forces of tools on a body, from a model file of `epsmesh export`. C99; no allocation, no locks, no input or output.
 *
 * SI units. A model is plain memory that points into the bytes of its file, which epsmesh_load checks once and which must
 * stay where they are. Any number of threads may query a model.
 */
#ifndef EPSMESH_H
#define EPSMESH_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Largest numbers: of polynomials along a direction, of tools at once, of modes of the interaction and of the surface. */
enum { EPSMESH_MOST = 64, EPSMESH_TENSORS = 7, EPSMESH_MOST_RELAXING = 6, EPSMESH_MOST_TOOLS = 16 };
enum { EPSMESH_MOST_MODES = 96, EPSMESH_MOST_LINKS = 3, EPSMESH_MOST_SEEN = 512, EPSMESH_MOST_NEAR = 16 };

typedef enum {
    EPSMESH_OK,
    EPSMESH_NO_CONTACT, /* the tool does not touch: all numbers are 0 */
    EPSMESH_OUTSIDE,    /* the place is outside the model's region */
    EPSMESH_LARGE,      /* tool or contact too large here: a side, the bottom or other tissue is too near */
    EPSMESH_DEEP,       /* the depth exceeds the model's range */
    EPSMESH_TOOL,       /* unknown tool, or a size is missing, or the model has no tables for it */
    EPSMESH_INPUT,      /* a number is not finite, or must be positive */
    EPSMESH_POISSON,    /* Poisson's ratio is outside the model's range */
    EPSMESH_TILTED,     /* the tool must press along the face's inward normal */
    EPSMESH_OFF,        /* the place is not on the face */
    EPSMESH_DAMAGED,    /* the model's numbers are inconsistent here */
    EPSMESH_NO_MODEL,   /* the file is of another kind or version, cut short, or inconsistent */
    EPSMESH_NEAR,       /* two contacts' middles are closer than twice the sum of their radii */
    EPSMESH_OTHERS,     /* another tool, on whose force this one depends, has no answer */
    EPSMESH_ALONE,      /* one tool at a time: the file has no pair_modes */
    EPSMESH_HISTORY,    /* the force depends on an earlier contact that is not known: epsmesh_relaxation.h */
    EPSMESH_STATUSES
} epsmesh_status;

typedef enum { EPSMESH_DISC, EPSMESH_SPHERE, EPSMESH_CONE, EPSMESH_BLADE, EPSMESH_BONDED_DISC } epsmesh_shape;

/* Why a file is no model. */
typedef enum {
    EPSMESH_SOUND,
    EPSMESH_FOREIGN,   /* it is of another kind */
    EPSMESH_VERSION,   /* of another version */
    EPSMESH_UNALIGNED, /* its bytes do not begin at a multiple of 8 */
    EPSMESH_CUT,       /* it has not the length that its header tells */
    EPSMESH_HEADER,    /* its header is damaged, or the machine is not little-endian */
    EPSMESH_ABSENT,    /* an array is absent, */
    EPSMESH_SHAPE,     /* has another type, rank or shape, or ends beyond the file, */
    EPSMESH_INFINITE,  /* is not finite, */
    EPSMESH_VALUE      /* or has an invalid value */
} epsmesh_flaw;

typedef struct {
    const double *reciprocal, *curvature, *tensors, *height, *bend; /* Chebyshev, over (nu, v, u) */
    int counts[3], face_counts[2], is_round, is_axial, even[2], leans, has_tensors, is_flat, is_loaded;
    double c_ref, reach[2], sides[2], thickness, origin[3], axes[3][3], poisson_range[2];
    double young, poisson, largest, off, aligned, bar[4], bend_error;
    const double *pair_modes, *pair_links;
    double pair_error, pair_aside;
    int pair_counts[4], has_pairs; /* nu, modes, and polynomials of y and x */
    const float *surface_points, *surface_amounts;
    const int32_t *surface_triangles;
    const int16_t *surface_modes;
    double surface_error;
    int vertices, triangles, surface_counts[4]; /* modes, and polynomials of nu, y and x */
    double share[EPSMESH_MOST_RELAXING], time[EPSMESH_MOST_RELAXING]; /* of all tissue: epsmesh_relaxation.h */
    int relaxing;                                                     /* number of terms */
    const double *near; /* Chebyshev, over (ratio, nu, x); balls at large displacements: src/contact.c */
    double near_most, near_error, near_room, near_support;
    int near_counts[2], is_large; /* nu, x */
    epsmesh_flaw flaw;
    const char *flawed; /* the array with the flaw */
} epsmesh_model;

typedef struct {
    epsmesh_shape shape;
    double radius;         /* m: of a disc, a ball, or the end of a cone */
    double angle;          /* rad: a cone's half angle to its axis; else unused */
    double at[3];          /* m: where the tool's axis meets the face */
    double axis[3];        /* direction of pressing; 0, 0, 0 is the inward normal */
    double depth;          /* m */
    double young, poisson; /* Pa, 1; by default model->young and model->poisson */
    double length, width;  /* m: of a blade's edge; else unused */
    double along[3];       /* direction of a blade's length; 0, 0, 0 is the face's x */
} epsmesh_query;

typedef struct {
    epsmesh_status status;
    double force[3];       /* N: force of the tissue on the tool, in the body's coordinates */
    double force_error;    /* N: 95 % error bar of the force along the normal */
    double stiffness;      /* N/m: dF/dd at a fixed place */
    double contact_radius; /* m */
} epsmesh_touch;

/* Point `model` at the `size` bytes of a file at `data`, a multiple of 8: EPSMESH_OK, or EPSMESH_NO_MODEL with its flaw. */
epsmesh_status epsmesh_load(epsmesh_model *model, const void *data, size_t size);

/* Find the place `at` of the face for a tool whose lowest point is at `tip` (m), and its `depth` (m) along the inward
 * normal there. Returns EPSMESH_OK; EPSMESH_NO_CONTACT if the tool is above the face; EPSMESH_OUTSIDE beside the region of a
 * curved face; EPSMESH_DEEP if the normals of several places meet at the tip, so that the place is not unique. */
epsmesh_status epsmesh_foot(const epsmesh_model *model, const double tip[3], double at[3], double *depth);

/* Return a query with the model's E and nu, along the inward normal; all else is unset. */
epsmesh_query epsmesh_ask(const epsmesh_model *model);

/* Answer a query; all numbers are NaN unless the status is EPSMESH_OK or EPSMESH_NO_CONTACT. */
epsmesh_touch epsmesh_touch_at(const epsmesh_model *model, const epsmesh_query *query);

/* Answer `count` queries, each by itself. */
void epsmesh_touch_each(const epsmesh_model *model, size_t count, const epsmesh_query *queries, epsmesh_touch *touches);

/* Answer `count` queries of tools that press at the same time, with equal E and nu. The stiffness of each tool is at fixed
 * depths of the others. If one has no answer, the others get EPSMESH_OTHERS. More than EPSMESH_MOST_TOOLS, or different E
 * or nu, give EPSMESH_INPUT. The call takes 120 kB of stack. */
void epsmesh_touch_all(const epsmesh_model *model, int count, const epsmesh_query *queries, epsmesh_touch *touches);

/* Return the name of a status in Python. */
const char *epsmesh_word(epsmesh_status status);

/* Return why epsmesh_load failed, and the name of the array in question, "" if it is none. */
epsmesh_flaw epsmesh_flaw_of(const epsmesh_model *model, const char **array);

/* Put the sizes (bytes) of a model, a query, a touch, a patch (epsmesh_patch.h), a memory and a moment
 * (epsmesh_relaxation.h) into `sizes`, for other languages. */
void epsmesh_sizes(size_t sizes[6]);

#ifdef __cplusplus
}
#endif
#endif
