/* OpenHaptics (3D Systems Touch): the servo callback, 1,000 times a second.
 *
 *     cc -O2 openhaptics.c ../epsmesh.c -lHD -lHDU -lm && ./a.out pad.epsm
 *
 * The device speaks of millimetres, y up; the model of metres, along its own axes.
 */
#include <HD/hd.h>
#include <HDU/hduError.h>
#include <stdio.h>

#include "hand.h"

static hand tool;

/* The body's x, y, z are the device's x, -z, y, and its face is where the device has its zero. */
static void to_body(const double device[3], double body[3]) {
    body[0] = 1e-3 * device[0], body[1] = -1e-3 * device[2], body[2] = 1e-3 * device[1];
}

static void to_device(const double body[3], double device[3]) {
    device[0] = body[0], device[1] = body[2], device[2] = -body[1];
}

static HDCallbackCode HDCALLBACK servo(void *data) {
    double device[3], tip[3], force[3], rendered[3];
    HDErrorInfo problem;
    (void)data;
    hdBeginFrame(hdGetCurrentDevice());
    hdGetDoublev(HD_CURRENT_POSITION, device);
    to_body(device, tip);
    hand_feel(&tool, tip, force);
    to_device(force, rendered);
    hdSetDoublev(HD_CURRENT_FORCE, rendered);
    hdEndFrame(hdGetCurrentDevice());
    problem = hdGetError();
    return HD_DEVICE_ERROR(problem) && hduIsSchedulerError(&problem) ? HD_CALLBACK_DONE : HD_CALLBACK_CONTINUE;
}

int main(int count, char **arguments) {
    double most = 0, stiffest = 0;
    const char *problem;
    HDErrorInfo wrong;
    HDSchedulerHandle running;
    HHD device = hdInitDevice(HD_DEFAULT_DEVICE);
    wrong = hdGetError();
    if (HD_DEVICE_ERROR(wrong)) return fprintf(stderr, "there is no device\n"), 1;
    hdGetDoublev(HD_NOMINAL_MAX_CONTINUOUS_FORCE, &most);
    hdGetDoublev(HD_NOMINAL_MAX_STIFFNESS, &stiffest); /* N/mm */
    problem = count == 2 ? hand_load(&tool, arguments[1], 5e-3, most) : "name a model";
    if (problem) return fprintf(stderr, "%s\n", problem), 1;
    hdEnable(HD_FORCE_OUTPUT);
    running = hdScheduleAsynchronous(servo, NULL, HD_MAX_SCHEDULER_PRIORITY);
    hdStartScheduler();
    printf("the device renders up to %g N/m; Enter ends this\n", 1e3 * stiffest);
    getchar();
    hdStopScheduler();
    hdUnschedule(running);
    hdDisableDevice(device);
    return 0;
}
