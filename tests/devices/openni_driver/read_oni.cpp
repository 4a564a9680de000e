// Plays a recording with OpenNI2's own C++ interface and default settings, as NiViewer and every other program
// written against OpenNI2 does, and prints what comes: one line for each frame with stream, size, time stamp and
// the sum of its bytes.
#include <OpenNI.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>

using namespace openni;

int main(int argc, char** argv) {
    if (argc < 3 || OpenNI::initialize() != STATUS_OK) {
        fprintf(stderr, "usage: read_oni FILE FRAMES; %s\n", OpenNI::getExtendedError());
        return 2;
    }
    Device device;
    if (device.open(argv[1]) != STATUS_OK) {
        fprintf(stderr, "%s\n", OpenNI::getExtendedError());
        return 3;
    }
    device.getPlaybackControl()->setRepeatEnabled(false);
    VideoStream streams[3];
    VideoStream* started[3];
    const SensorType kinds[3] = {SENSOR_DEPTH, SENSOR_COLOR, SENSOR_IR};
    int count = 0;
    for (int i = 0; i < 3; ++i)
        if (device.getSensorInfo(kinds[i]) && streams[i].create(device, kinds[i]) == STATUS_OK &&
            streams[i].start() == STATUS_OK)
            started[count++] = &streams[i];
    for (int left = atoi(argv[2]), ready; left > 0; --left) {
        if (OpenNI::waitForAnyStream(started, count, &ready, 2000) != STATUS_OK) break;
        VideoFrameRef frame;
        started[ready]->readFrame(&frame);
        uint64_t sum = 0;
        for (int i = 0; i < frame.getDataSize(); ++i) sum += static_cast<const uint8_t*>(frame.getData())[i];
        printf("%d %d %d %llu %llu\n", int(frame.getSensorType()), frame.getWidth(), frame.getHeight(),
               static_cast<unsigned long long>(frame.getTimestamp()), static_cast<unsigned long long>(sum));
    }
    fflush(stdout);
    _Exit(0);  // the runtime's own shutdown crashes in some builds
}
