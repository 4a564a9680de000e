/* A stand-in for the NiTE2 runtime, for tests: it tracks nobody real.
 *
 * It has the C interface that the Python binding loads. A person stands 2.5 m before the camera: new in the first
 * frame, calibrating (first out of pose, then in it) once skeleton tracking was asked for, then tracked in the psi
 * stance and moving right by a millimetre a frame. The file "mood" beside the library says what goes wrong: "crash"
 * and "hang" happen in the fourth frame.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct { float x, y, z; } Point;
typedef struct { float x, y, z, w; } Quaternion;
typedef struct { int type; Point position; float confidence; Quaternion turn; float turn_confidence; } Joint;
typedef struct { int type; int state; } Pose;
typedef struct { Joint joints[15]; int state; int internal; } Skeleton;
typedef struct { short id; Point low, high, center; int state; Skeleton skeleton; Pose poses[2]; } User;
typedef struct { short *pixels; int width, height, stride; } UserMap;
typedef struct { Point point, normal; } Plane;
typedef struct {
    int count; User *users; UserMap map; void *depth; unsigned long long timestamp; int index;
    float floor_confidence; Plane floor;
} Frame;
typedef struct { int major, minor, maintenance, build; } Version;

static const float PSI[15][3] = {
    {0, 600, 2500}, {0, 400, 2500}, {180, 380, 2500}, {-180, 380, 2500}, {450, 380, 2490}, {-450, 380, 2490},
    {460, 680, 2450}, {-460, 680, 2450}, {0, 150, 2500}, {100, -100, 2500}, {-100, -100, 2500},
    {110, -500, 2500}, {-110, -500, 2500}, {120, -880, 2510}, {-120, -880, 2510}};

static int reads = 0, asked = 0;
static Frame frame;
static User user;

static int mood(const char *what) {
    char said[32] = "";
    FILE *file;
    const char *folder = getenv("NITE2_REDIST64");
    char path[1024];
    snprintf(path, sizeof path, "%s/mood", folder ? folder : ".");
    file = fopen(path, "r");
    if (!file) return 0;
    if (!fgets(said, sizeof said, file)) said[0] = 0;
    fclose(file);
    return strncmp(said, what, strlen(what)) == 0;
}

int niteInitialize(void) { return 0; }
void niteShutdown(void) {}
Version niteGetVersion(void) { Version v = {2, 2, 0, 0}; return v; }
int niteInitializeUserTracker(void **handle) { *handle = &frame; return 0; }
int niteInitializeUserTrackerByDevice(void *device, void **handle) { *handle = &frame; return device ? 0 : 1; }
int niteShutdownUserTracker(void *handle) { return handle ? 0 : 1; }
int niteStartSkeletonTracking(void *handle, short id) { asked++; return handle && id == 1 ? 0 : 2; }

int niteReadUserTrackerFrame(void *handle, Frame **out) {
    int k;
    reads++;
    if (reads == 4 && mood("crash")) abort();
    if (reads == 4 && mood("hang")) sleep(600);
    memset(&user, 0, sizeof user);
    user.id = 1;
    user.state = reads == 1 ? 3 : 1;
    user.center.z = 2500;
    user.skeleton.state = !asked ? 0 : reads == 2 ? 3 : reads == 3 ? 1 : 2;
    for (k = 0; k < 15; k++) {
        user.skeleton.joints[k].type = k;
        user.skeleton.joints[k].position.x = PSI[k][0] + reads;
        user.skeleton.joints[k].position.y = PSI[k][1];
        user.skeleton.joints[k].position.z = PSI[k][2];
        user.skeleton.joints[k].confidence = 1.0f;
    }
    frame.count = 1;
    frame.users = &user;
    frame.timestamp = 33000ull * reads;
    frame.index = reads;
    *out = &frame;
    return handle ? 0 : 1;
}
int niteUserTrackerFrameAddRef(void *handle, Frame *f) { return handle && f ? 0 : 1; }
int niteUserTrackerFrameRelease(void *handle, Frame *f) { return handle && f ? 0 : 1; }

#define UNUSED(name) int name(void) { return 1; }
UNUSED(niteStopSkeletonTracking) UNUSED(niteIsSkeletonTracking) UNUSED(niteSetSkeletonSmoothing)
UNUSED(niteGetSkeletonSmoothing) UNUSED(niteStartPoseDetection) UNUSED(niteStopPoseDetection)
UNUSED(niteStopAllPoseDetection) UNUSED(niteRegisterUserTrackerCallbacks)
UNUSED(niteUnregisterUserTrackerCallbacks) UNUSED(niteDumpUserTrackerCalibrationDataToFile)
UNUSED(niteShutdownHandTracker) UNUSED(niteStartHandTracking) UNUSED(niteStopHandTracking)
UNUSED(niteStopAllHandTracking) UNUSED(niteSetHandSmoothingFactor) UNUSED(niteGetHandSmoothingFactor)
UNUSED(niteRegisterHandTrackerCallbacks) UNUSED(niteUnregisterHandTrackerCallbacks)
UNUSED(niteReadHandTrackerFrame) UNUSED(niteHandTrackerFrameAddRef) UNUSED(niteHandTrackerFrameRelease)
UNUSED(niteStartGestureDetection) UNUSED(niteStopGestureDetection) UNUSED(niteStopAllGestureDetection)
UNUSED(niteConvertJointCoordinatesToDepth) UNUSED(niteConvertDepthCoordinatesToJoint)
UNUSED(niteConvertHandCoordinatesToDepth) UNUSED(niteConvertDepthCoordinatesToHand)
UNUSED(niteInitializeHandTracker) UNUSED(niteInitializeHandTrackerByDevice)
