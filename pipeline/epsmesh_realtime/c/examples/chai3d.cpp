/* CHAI3D: the haptic thread of a program, for any device that CHAI3D knows.
 *
 *     c++ -O2 chai3d.cpp ../epsmesh.c -lchai3d   (epsmesh.c as C: `cc -c` first)
 */
#include <atomic>
#include <cstdio>

#include "chai3d.h"
#include "hand.h"

using namespace chai3d;

static hand tool;
static std::atomic<bool> isRunning(false);
static cGenericHapticDevicePtr device;

/* Call from a cThread of CTHREAD_PRIORITY_HAPTICS; CHAI3D's metres and its z upwards are the model's. */
void feel(void) {
    while (isRunning) {
        cVector3d position;
        double tip[3], force[3];
        device->getPosition(position);
        for (unsigned int i = 0; i < 3; i++) tip[i] = position(i);
        hand_feel(&tool, tip, force);
        device->setForce(cVector3d(force[0], force[1], force[2]));
    }
}

int main(int count, char **arguments) {
    cHapticDeviceHandler handler;
    if (!handler.getDevice(device, 0) || !device->open()) return std::fprintf(stderr, "there is no device\n"), 1;
    device->calibrate();
    const cHapticDeviceInfo info = device->getSpecifications();
    const char *problem = count == 2 ? hand_load(&tool, arguments[1], 5e-3, info.m_maxLinearForce) : "name a model";
    if (problem) return std::fprintf(stderr, "%s\n", problem), 1;
    std::printf("the device renders up to %g N/m; Enter ends this\n", info.m_maxLinearStiffness);
    isRunning = true;
    cThread thread;
    thread.start(feel, CTHREAD_PRIORITY_HAPTICS);
    std::getchar();
    isRunning = false;
    cSleepMs(100);
    device->close();
    return 0;
}
