/* Names of CHAI3D 3 that the example uses, to check its syntax where the library is not installed. */
#include <memory>
namespace chai3d {
struct cVector3d {
    cVector3d(double = 0, double = 0, double = 0) {}
    double operator()(unsigned int) const { return 0; }
};
struct cHapticDeviceInfo { double m_maxLinearForce, m_maxLinearStiffness; };
struct cGenericHapticDevice {
    bool open(), close(), calibrate(bool = false), getPosition(cVector3d &), setForce(const cVector3d &);
    cHapticDeviceInfo getSpecifications();
};
typedef std::shared_ptr<cGenericHapticDevice> cGenericHapticDevicePtr;
struct cHapticDeviceHandler { bool getDevice(cGenericHapticDevicePtr &, unsigned int = 0); };
enum CThreadPriority { CTHREAD_PRIORITY_GRAPHICS, CTHREAD_PRIORITY_HAPTICS };
struct cThread { void start(void (*)(void), const CThreadPriority); };
void cSleepMs(unsigned int);
}
