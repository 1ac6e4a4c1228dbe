/* A real-time model as a co-simulation unit of FMI 3.0, the Functional Mock-up Interface (fmi-standard.org). C99.
 *
 * `epsmesh export --fmu` compiles it with the evaluator. The types are those of the standard, declared here under its names.
 * References of variables are in the order of VARIABLES in pipeline/epsmesh_realtime/export/fmu.py, which writes modelDescription.xml.
 */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "epsmesh.h"
#include "epsmesh_relaxation.h"

#ifdef _WIN32
#define EXPORTED __declspec(dllexport)
#else
#define EXPORTED __attribute__((visibility("default")))
#endif

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef void *fmi3Instance;
typedef uint32_t fmi3ValueReference;
typedef const char *fmi3String;
typedef void (*fmi3LogMessageCallback)(void *environment, fmi3Status status, fmi3String category, fmi3String message);

static const char *const TOKEN = "{epsmesh-realtime-fmi3-1}";
static const char *const FILE_NAME = "model.epsm";

/* Doubles come first, then integers. */
enum { TIME, TIP, AXIS = TIP + 3, ALONG = AXIS + 3, YOUNG = ALONG + 3, POISSON, RADIUS, ANGLE, LENGTH, WIDTH };
enum { FORCE = WIDTH + 1, FORCE_ERROR = FORCE + 3, STIFFNESS, CONTACT_RADIUS, DEPTH, SHAPE, STATUS };
enum { FIRST_OUTPUT = FORCE, DOUBLES = SHAPE };

typedef enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED } mode;

/* The tool to start with: sizes in units of the way to the nearest side or the bottom; rad. */
static const double OF_ROOM[] = {0.12, 0.3, 0.03}, START_ANGLE = 1.0;

/* Steps in which the contact of a round tool in relaxing tissue may grow. */
enum { ROOM = 8192 };

/* All that a step changes: what a host saves and restores. */
typedef struct {
    double values[DOUBLES], evaluated; /* s: time of the inputs that were evaluated last */
    int64_t shape, status;
    mode in;
    epsmesh_memory memory;
    epsmesh_moment moments[ROOM];
} state;

typedef struct {
    epsmesh_model model;
    void *data; /* the bytes of its file, into which it points */
    state now;
    fmi3LogMessageCallback log;
    void *environment;
    bool tells;
} unit;

static void say(const unit *u, fmi3Status status, const char *category, const char *text) {
    if (u->log && (u->tells || status >= fmi3Error)) u->log(u->environment, status, category, text);
}

/* Load the model into the unit; its bytes are kept as long as the unit. */
static epsmesh_status loaded(unit *u, const char *folder) {
    size_t room = strlen(folder) + strlen(FILE_NAME) + 2;
    char *path = (char *)malloc(room);
    FILE *file;
    long size = -1;
    epsmesh_status status = EPSMESH_NO_MODEL;
    if (!path) return status;
    /* FMI 3.0: the path of the resources ends in a separator; older hosts omit it. */
    snprintf(path, room, "%s%s%s", folder, strchr("/\\", folder[0] ? folder[strlen(folder) - 1] : '/') ? "" : "/", FILE_NAME);
    file = fopen(path, "rb");
    free(path);
    if (!file) return status;
    if (!fseek(file, 0, SEEK_END)) size = ftell(file);
    rewind(file);
    if (size > 0) u->data = malloc((size_t)size);
    if (u->data && fread(u->data, 1, (size_t)size, file) == (size_t)size)
        status = epsmesh_load(&u->model, u->data, (size_t)size);
    fclose(file);
    return status;
}

/* Compute all outputs from the inputs at a `time` (s). */
static fmi3Status evaluate(unit *u, double time) {
    double *v = u->now.values;
    epsmesh_query query = epsmesh_ask(&u->model);
    epsmesh_touch touch;
    epsmesh_status before = (epsmesh_status)u->now.status;
    int i;
    query.shape = (epsmesh_shape)u->now.shape, query.radius = v[RADIUS], query.angle = v[ANGLE];
    query.length = v[LENGTH], query.width = v[WIDTH], query.young = v[YOUNG], query.poisson = v[POISSON];
    for (i = 0; i < 3; i++) query.axis[i] = v[AXIS + i], query.along[i] = v[ALONG + i];
    touch.status = epsmesh_foot(&u->model, v + TIP, query.at, &query.depth);
    if (touch.status == EPSMESH_NO_CONTACT && u->now.memory.phase != EPSMESH_RESTED) {
        /* Below a tool in the air, relaxing tissue recovers. */
        memcpy(query.at, u->now.memory.query.at, sizeof query.at);
        query.depth = 0, touch.status = EPSMESH_OK;
    }
    if (touch.status == EPSMESH_OK) {
        touch = epsmesh_touch_after(&u->model, &query, time - u->now.evaluated, &u->now.memory);
    } else {
        double none = touch.status == EPSMESH_NO_CONTACT ? 0 : (double)NAN;
        /* After a place that is not known, earlier contact is not known; a tool beside the region of a face at rest is no touch. */
        if (touch.status != EPSMESH_NO_CONTACT && (touch.status != EPSMESH_OUTSIDE || u->now.memory.phase != EPSMESH_RESTED)) {
            query.depth = (double)NAN;
            epsmesh_touch_after(&u->model, &query, time - u->now.evaluated, &u->now.memory);
        }
        touch.force[0] = touch.force[1] = touch.force[2] = none;
        touch.force_error = touch.stiffness = touch.contact_radius = query.depth = none;
    }
    for (i = 0; i < 3; i++) v[FORCE + i] = touch.force[i];
    v[FORCE_ERROR] = touch.force_error, v[STIFFNESS] = touch.stiffness;
    v[CONTACT_RADIUS] = touch.contact_radius, v[DEPTH] = query.depth, u->now.status = touch.status;
    u->now.evaluated = time;
    if (touch.status == EPSMESH_OK || touch.status == EPSMESH_NO_CONTACT) return fmi3OK;
    if (before != touch.status) say(u, fmi3Warning, "logStatusWarning", epsmesh_word(touch.status));
    return fmi3Warning;
}

/* Show the outputs before the first step; the tissue does not remember it. */
static fmi3Status peek(unit *u) {
    fmi3Status status = evaluate(u, u->now.evaluated);
    epsmesh_memory_begin(&u->now.memory, u->now.moments, ROOM);
    return status;
}

/* Set the values of modelDescription.xml. */
static void begin(unit *u) {
    double *v = u->now.values, room = fmin(fmin(u->model.sides[0], u->model.sides[1]), u->model.thickness);
    memset(&u->now, 0, sizeof u->now);
    epsmesh_memory_begin(&u->now.memory, u->now.moments, ROOM);
    memcpy(v + TIP, u->model.origin, sizeof u->model.origin);
    v[YOUNG] = u->model.young, v[POISSON] = u->model.poisson, v[ANGLE] = START_ANGLE;
    v[RADIUS] = OF_ROOM[0] * room, v[LENGTH] = OF_ROOM[1] * room, v[WIDTH] = OF_ROOM[2] * room;
    u->now.shape = EPSMESH_SPHERE, u->now.status = EPSMESH_NO_CONTACT;
}

/* ---- common functions ---- */

EXPORTED const char *fmi3GetVersion(void) {
    return "3.0";
}

EXPORTED fmi3Status fmi3SetDebugLogging(fmi3Instance instance, bool on, size_t count, const fmi3String categories[]) {
    (void)count, (void)categories;
    ((unit *)instance)->tells = on;
    return fmi3OK;
}

EXPORTED fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, bool visible,
                                                  bool tells, bool events, bool early, const fmi3ValueReference needed[],
                                                  size_t count, void *environment, fmi3LogMessageCallback log,
                                                  void (*intermediate)(void)) {
    unit *u = (unit *)calloc(1, sizeof(unit));
    (void)name, (void)visible, (void)events, (void)early, (void)needed, (void)count, (void)intermediate;
    if (!u) return NULL;
    u->log = log, u->environment = environment, u->tells = tells;
    if (!token || strcmp(token, TOKEN)) {
        say(u, fmi3Error, "logStatusError", "the instantiation token is another one: description and library differ");
    } else if (!resources || loaded(u, resources) != EPSMESH_OK) {
        say(u, fmi3Error, "logStatusError", "resources/ has no model that this version reads");
    } else {
        begin(u);
        return u;
    }
    free(u->data), free(u);
    return NULL;
}

EXPORTED fmi3Instance fmi3InstantiateModelExchange(void) {
    return NULL;
}

EXPORTED fmi3Instance fmi3InstantiateScheduledExecution(void) {
    return NULL;
}

EXPORTED void fmi3FreeInstance(fmi3Instance instance) {
    if (instance) free(((unit *)instance)->data);
    free(instance);
}

EXPORTED fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, bool has_tolerance, double tolerance, double start,
                                                bool has_stop, double stop) {
    unit *u = (unit *)instance;
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    if (u->now.in != INSTANTIATED) return fmi3Error;
    u->now.in = INITIALIZING, u->now.values[TIME] = u->now.evaluated = start;
    return fmi3OK;
}

EXPORTED fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    unit *u = (unit *)instance;
    if (u->now.in != INITIALIZING) return fmi3Error;
    u->now.in = STEPPING;
    return peek(u);
}

EXPORTED fmi3Status fmi3Terminate(fmi3Instance instance) {
    ((unit *)instance)->now.in = TERMINATED;
    return fmi3OK;
}

EXPORTED fmi3Status fmi3Reset(fmi3Instance instance) {
    begin((unit *)instance);
    return fmi3OK;
}

EXPORTED fmi3Status fmi3DoStep(fmi3Instance instance, double time, double step, bool never_back, bool *event, bool *ends,
                               bool *early, double *reached) {
    unit *u = (unit *)instance;
    fmi3Status status;
    (void)never_back;
    *event = *ends = *early = false, *reached = time;
    if (u->now.in != STEPPING || !(step > 0)) return fmi3Error;
    status = evaluate(u, time);
    u->now.values[TIME] = *reached = time + step;
    return status;
}

/* ---- variables ---- */

EXPORTED fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference of[], size_t count, double values[],
                                   size_t room) {
    unit *u = (unit *)instance;
    size_t i;
    if (room < count) return fmi3Error;
    if (u->now.in == INITIALIZING) peek(u);
    for (i = 0; i < count; i++) {
        if (of[i] >= DOUBLES) return fmi3Error;
        values[i] = u->now.values[of[i]];
    }
    return fmi3OK;
}

EXPORTED fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference of[], size_t count, const double values[],
                                   size_t room) {
    unit *u = (unit *)instance;
    size_t i;
    if (room < count) return fmi3Error;
    for (i = 0; i < count; i++) {
        if (of[i] == TIME || of[i] >= FIRST_OUTPUT) return fmi3Error;
        u->now.values[of[i]] = values[i];
    }
    return fmi3OK;
}

EXPORTED fmi3Status fmi3GetInt64(fmi3Instance instance, const fmi3ValueReference of[], size_t count, int64_t values[],
                                 size_t room) {
    unit *u = (unit *)instance;
    size_t i;
    if (room < count) return fmi3Error;
    if (u->now.in == INITIALIZING) peek(u);
    for (i = 0; i < count; i++) {
        if (of[i] != SHAPE && of[i] != STATUS) return fmi3Error;
        values[i] = of[i] == SHAPE ? u->now.shape : u->now.status;
    }
    return fmi3OK;
}

EXPORTED fmi3Status fmi3SetInt64(fmi3Instance instance, const fmi3ValueReference of[], size_t count, const int64_t values[],
                                 size_t room) {
    unit *u = (unit *)instance;
    size_t i;
    if (room < count) return fmi3Error;
    for (i = 0; i < count; i++) {
        if (of[i] != SHAPE || values[i] < EPSMESH_DISC || values[i] > EPSMESH_BONDED_DISC) return fmi3Error;
        u->now.shape = values[i];
    }
    return fmi3OK;
}

/* ---- the state, which a host saves to repeat a step ---- */

EXPORTED fmi3Status fmi3GetFMUState(fmi3Instance instance, void **saved) {
    if (!*saved) *saved = malloc(sizeof(state));
    if (!*saved) return fmi3Error;
    *(state *)*saved = ((unit *)instance)->now;
    return fmi3OK;
}

EXPORTED fmi3Status fmi3SetFMUState(fmi3Instance instance, void *saved) {
    unit *u = (unit *)instance;
    u->now = *(const state *)saved;
    u->now.memory.moments = u->now.moments;
    return fmi3OK;
}

EXPORTED fmi3Status fmi3FreeFMUState(fmi3Instance instance, void **saved) {
    (void)instance;
    free(*saved);
    *saved = NULL;
    return fmi3OK;
}

/* ---- functions that the standard demands of every library, of abilities that the description does not claim ---- */

#define ABSENT(name) \
    EXPORTED fmi3Status name(void) { return fmi3Error; }
#define NO_TYPE(type) ABSENT(fmi3Get##type) ABSENT(fmi3Set##type)

NO_TYPE(Float32) NO_TYPE(Int8) NO_TYPE(UInt8) NO_TYPE(Int16) NO_TYPE(UInt16) NO_TYPE(Int32) NO_TYPE(UInt32) NO_TYPE(UInt64)
NO_TYPE(Boolean) NO_TYPE(String) NO_TYPE(Binary) NO_TYPE(Clock) NO_TYPE(IntervalDecimal) NO_TYPE(IntervalFraction)
NO_TYPE(ShiftDecimal) NO_TYPE(ShiftFraction) NO_TYPE(ContinuousStates)
ABSENT(fmi3EnterEventMode) ABSENT(fmi3EnterStepMode) ABSENT(fmi3EnterConfigurationMode) ABSENT(fmi3ExitConfigurationMode)
ABSENT(fmi3GetNumberOfVariableDependencies) ABSENT(fmi3GetVariableDependencies) ABSENT(fmi3SerializedFMUStateSize)
ABSENT(fmi3SerializeFMUState) ABSENT(fmi3DeserializeFMUState) ABSENT(fmi3GetDirectionalDerivative)
ABSENT(fmi3GetAdjointDerivative) ABSENT(fmi3EvaluateDiscreteStates) ABSENT(fmi3UpdateDiscreteStates)
ABSENT(fmi3EnterContinuousTimeMode) ABSENT(fmi3CompletedIntegratorStep) ABSENT(fmi3SetTime)
ABSENT(fmi3GetContinuousStateDerivatives) ABSENT(fmi3GetEventIndicators) ABSENT(fmi3GetNominalsOfContinuousStates)
ABSENT(fmi3GetNumberOfEventIndicators) ABSENT(fmi3GetNumberOfContinuousStates) ABSENT(fmi3GetOutputDerivatives)
ABSENT(fmi3ActivateModelPartition)
