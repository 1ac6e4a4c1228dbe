/* Tolerances, and constants of bars. */
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
