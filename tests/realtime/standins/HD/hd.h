/* Names of OpenHaptics that the example uses, to check its syntax where the toolkit is not installed. */
typedef unsigned int HHD, HDCallbackCode, HDenum;
typedef unsigned long HDSchedulerHandle;
typedef struct { int errorCode, internalErrorCode; HHD hHD; } HDErrorInfo;
typedef HDCallbackCode (*HDSchedulerCallback)(void *);
#define HDCALLBACK
enum { HD_CALLBACK_DONE, HD_CALLBACK_CONTINUE, HD_CURRENT_POSITION, HD_CURRENT_FORCE, HD_FORCE_OUTPUT,
       HD_NOMINAL_MAX_CONTINUOUS_FORCE, HD_NOMINAL_MAX_STIFFNESS, HD_MAX_SCHEDULER_PRIORITY };
#define HD_DEFAULT_DEVICE ((const char *)0)
#define HD_DEVICE_ERROR(problem) ((problem).errorCode != 0)
HHD hdInitDevice(const char *);
HHD hdGetCurrentDevice(void);
HDErrorInfo hdGetError(void);
void hdBeginFrame(HHD), hdEndFrame(HHD), hdDisableDevice(HHD), hdEnable(HDenum);
void hdGetDoublev(HDenum, double *), hdSetDoublev(HDenum, const double *);
void hdStartScheduler(void), hdStopScheduler(void), hdUnschedule(HDSchedulerHandle);
HDSchedulerHandle hdScheduleAsynchronous(HDSchedulerCallback, void *, unsigned short);
