// An OpenNI2 driver that feeds frames from files, so that live code runs on the real runtime without a camera.
//
// A device is a folder, opened as feed://FOLDER; those named in OPENNI_FEED_FOLDERS (separated by ':') are
// connected when the runtime starts. In the folder:
//   device.txt   lines key=value: name, vendor, vid, pid, serial (none: the property is not supported),
//                width and height of the pictures in the files, ir_excludes_color=1, cropping=0 (not known to the
//                streams), stamp=1 (the first four
//                depth pixels become the clock: monotonic nanoseconds when the frame was made)
//   depth.raw (uint16, mm), color.raw (RGB), ir.raw (uint16): frames one after the other, played in a loop;
//                a stream without a file does not exist. Other modes are sampled from the same files.
// Commands are files that appear and go while it runs:
//   stall        no frames            unplug   disconnected; connected again when the file goes
//   hang         every call blocks    crash    abort() (the file is removed first)
// Like PS1080 it mirrors until it is told not to.
#include <cstdint>
#include <new>
#define XN_NEW(type, argument) new type(argument)
#define XN_DELETE(pointer) delete pointer
#include "Driver/OniDriverAPI.h"

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <time.h>
#include <unistd.h>
#include <vector>

using namespace oni::driver;

static uint64_t now_ns() {
    timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return uint64_t(t.tv_sec) * 1000000000ull + uint64_t(t.tv_nsec);
}

static void sleep_ns(uint64_t ns) {
    timespec t{time_t(ns / 1000000000ull), long(ns % 1000000000ull)};
    nanosleep(&t, nullptr);
}

// What the folder says.
struct Feed {
    std::string folder;
    std::map<std::string, std::string> facts;

    explicit Feed(const std::string& where) : folder(where) {
        std::ifstream file(folder + "/device.txt");
        for (std::string line; std::getline(file, line);) {
            auto at = line.find('=');
            if (at != std::string::npos) facts[line.substr(0, at)] = line.substr(at + 1);
        }
    }
    std::string text(const std::string& key, const std::string& otherwise = "") const {
        auto found = facts.find(key);
        return found == facts.end() ? otherwise : found->second;
    }
    int number(const std::string& key, int otherwise) const {
        auto found = facts.find(key);
        return found == facts.end() ? otherwise : int(strtol(found->second.c_str(), nullptr, 0));
    }
    bool has(const std::string& name) const { return access((folder + "/" + name).c_str(), F_OK) == 0; }
    void obey() const {  // crash and hang, whoever calls
        if (has("crash")) {
            unlink((folder + "/crash").c_str());
            abort();
        }
        while (has("hang")) sleep_ns(20000000);
    }
};

template <class T> static OniStatus put(const T& value, void* data, int* size) {
    if (*size != int(sizeof(T))) return ONI_STATUS_BAD_PARAMETER;
    memcpy(data, &value, sizeof(T));
    return ONI_STATUS_OK;
}

template <class T> static OniStatus take(T& value, const void* data, int size) {
    if (size != int(sizeof(T))) return ONI_STATUS_BAD_PARAMETER;
    memcpy(&value, data, sizeof(T));
    return ONI_STATUS_OK;
}

struct Device;

class Stream : public StreamBase {
public:
    Stream(Device* device, const Feed& feed, OniSensorType kind, const char* file, OniVideoMode mode)
        : m_device(device), m_feed(feed), m_kind(kind), m_mode(mode) {
        m_width = feed.number("width", 640);
        m_height = feed.number("height", 480);
        std::ifstream stream(feed.folder + "/" + file, std::ios::binary);
        std::ostringstream all;
        all << stream.rdbuf();
        m_data = all.str();
        m_bytes = kind == ONI_SENSOR_COLOR ? 3 : 2;
    }
    ~Stream() override { stop(); }

    OniStatus start() override;
    void stop() override {
        m_feed.obey();
        if (m_running.exchange(false) && m_thread.joinable()) m_thread.join();
        switched(false);
    }

    int getRequiredFrameSize() override { return m_mode.resolutionX * m_mode.resolutionY * pixel_bytes(); }

    OniBool isPropertySupported(int id) override {
        if (m_kind == ONI_SENSOR_COLOR && id >= ONI_STREAM_PROPERTY_AUTO_WHITE_BALANCE && id <= ONI_STREAM_PROPERTY_GAIN)
            return TRUE;
        if (id == ONI_STREAM_PROPERTY_CROPPING) return m_feed.number("cropping", 1) != 0;
        return id == ONI_STREAM_PROPERTY_VIDEO_MODE || id == ONI_STREAM_PROPERTY_HORIZONTAL_FOV ||
               id == ONI_STREAM_PROPERTY_VERTICAL_FOV || id == ONI_STREAM_PROPERTY_MIRRORING ||
               (id == ONI_STREAM_PROPERTY_MAX_VALUE && m_kind == ONI_SENSOR_DEPTH);
    }

    OniStatus getProperty(int id, void* data, int* size) override {
        m_feed.obey();
        if (!isPropertySupported(id)) return ONI_STATUS_NOT_SUPPORTED;
        switch (id) {
        case ONI_STREAM_PROPERTY_VIDEO_MODE: return put(m_mode, data, size);
        case ONI_STREAM_PROPERTY_CROPPING: return put(OniCropping{FALSE, 0, 0, m_mode.resolutionX, m_mode.resolutionY}, data, size);
        case ONI_STREAM_PROPERTY_HORIZONTAL_FOV: return put(1.0145f, data, size);
        case ONI_STREAM_PROPERTY_VERTICAL_FOV: return put(0.7898f, data, size);
        case ONI_STREAM_PROPERTY_MIRRORING: return put(OniBool(m_mirror), data, size);
        case ONI_STREAM_PROPERTY_MAX_VALUE: return put(10000, data, size);
        default: return put(m_settings[id - ONI_STREAM_PROPERTY_AUTO_WHITE_BALANCE].load(), data, size);
        }
    }

    OniStatus setProperty(int id, const void* data, int size) override;

private:
    int pixel_bytes() const {
        return m_mode.pixelFormat == ONI_PIXEL_FORMAT_RGB888 ? 3 : m_mode.pixelFormat == ONI_PIXEL_FORMAT_GRAY8 ? 1 : 2;
    }
    void switched(bool on);
    void run();
    void deliver(uint64_t made_ns, int index);

    Device* m_device;
    const Feed& m_feed;
    OniSensorType m_kind;
    OniVideoMode m_mode;
    int m_width, m_height, m_bytes;
    std::string m_data;
    std::atomic<bool> m_mirror{true}, m_running{false};
    std::atomic<int> m_settings[4] = {{1}, {1}, {33}, {100}};  // auto white balance, auto exposure, exposure, gain
    std::thread m_thread;
};

struct Device : DeviceBase {
    explicit Device(const std::string& folder) : feed(folder) {
        add(ONI_SENSOR_DEPTH, "depth.raw", {{ONI_PIXEL_FORMAT_DEPTH_1_MM, 640, 480, 30}, {ONI_PIXEL_FORMAT_DEPTH_1_MM, 320, 240, 30},
                                            {ONI_PIXEL_FORMAT_DEPTH_100_UM, 640, 480, 30}});
        add(ONI_SENSOR_COLOR, "color.raw", {{ONI_PIXEL_FORMAT_RGB888, 640, 480, 30}, {ONI_PIXEL_FORMAT_RGB888, 320, 240, 30},
                                            {ONI_PIXEL_FORMAT_RGB888, 1280, 960, 15}});
        add(ONI_SENSOR_IR, "ir.raw", {{ONI_PIXEL_FORMAT_GRAY16, 640, 480, 30}, {ONI_PIXEL_FORMAT_GRAY8, 640, 480, 30}});
        for (auto& sensor : sensors) sensor.pSupportedVideoModes = modes[sensor.sensorType].data();
    }
    void add(OniSensorType kind, const char* file, std::vector<OniVideoMode> list) {
        if (!feed.has(file)) return;
        files[kind] = file;
        modes[kind] = list;
        sensors.push_back(OniSensorInfo{kind, int(list.size()), nullptr});
    }

    OniStatus getSensorInfoList(OniSensorInfo** list, int* count) override {
        *list = sensors.data();
        *count = int(sensors.size());
        return ONI_STATUS_OK;
    }
    StreamBase* createStream(OniSensorType kind) override {
        feed.obey();
        if (!files.count(kind)) return nullptr;
        return new Stream(this, feed, kind, files[kind], modes[kind][0]);
    }
    void destroyStream(StreamBase* stream) override { delete stream; }

    OniBool isPropertySupported(int id) override {
        return id == ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION ||
               (id == ONI_DEVICE_PROPERTY_SERIAL_NUMBER && !feed.text("serial").empty());
    }
    OniStatus getProperty(int id, void* data, int* size) override {
        feed.obey();
        if (!isPropertySupported(id)) return ONI_STATUS_NOT_SUPPORTED;
        if (id == ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION) return put(OniImageRegistrationMode(registration.load()), data, size);
        std::string serial = feed.text("serial");
        if (*size < int(serial.size()) + 1) return ONI_STATUS_BAD_PARAMETER;
        memcpy(data, serial.c_str(), serial.size() + 1);
        *size = int(serial.size()) + 1;
        return ONI_STATUS_OK;
    }
    OniStatus setProperty(int id, const void* data, int size) override {
        feed.obey();
        OniImageRegistrationMode mode;
        if (id != ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION) return ONI_STATUS_NOT_SUPPORTED;
        OniStatus done = take(mode, data, size);
        if (done == ONI_STATUS_OK) registration = int(mode);
        return done;
    }
    OniBool isImageRegistrationModeSupported(OniImageRegistrationMode) override { return TRUE; }

    Feed feed;
    std::map<OniSensorType, const char*> files;
    std::map<OniSensorType, std::vector<OniVideoMode>> modes;
    std::vector<OniSensorInfo> sensors;
    std::atomic<int> registration{ONI_IMAGE_REGISTRATION_OFF};
    std::atomic<bool> color_on{false}, ir_on{false};
};

OniStatus Stream::start() {
    m_feed.obey();
    bool exclusive = m_feed.number("ir_excludes_color", 0);
    if (exclusive && ((m_kind == ONI_SENSOR_IR && m_device->color_on) || (m_kind == ONI_SENSOR_COLOR && m_device->ir_on)))
        return ONI_STATUS_ERROR;
    if (m_running.exchange(true)) return ONI_STATUS_OK;
    switched(true);
    m_thread = std::thread([this] { run(); });
    return ONI_STATUS_OK;
}

OniStatus Stream::setProperty(int id, const void* data, int size) {
    m_feed.obey();
    if (!isPropertySupported(id)) return ONI_STATUS_NOT_SUPPORTED;
    if (id == ONI_STREAM_PROPERTY_VIDEO_MODE) {
        OniVideoMode wanted;
        OniStatus done = take(wanted, data, size);
        if (done != ONI_STATUS_OK) return done;
        for (const auto& mode : m_device->modes[m_kind])
            if (memcmp(&mode, &wanted, sizeof mode) == 0) {
                m_mode = wanted;
                return ONI_STATUS_OK;
            }
        return ONI_STATUS_NOT_SUPPORTED;
    }
    OniBool value;
    OniStatus done = take(value, data, size);
    if (done != ONI_STATUS_OK) return done;
    if (id == ONI_STREAM_PROPERTY_MIRRORING) m_mirror = value != FALSE;
    else if (id >= ONI_STREAM_PROPERTY_AUTO_WHITE_BALANCE && id <= ONI_STREAM_PROPERTY_GAIN)
        m_settings[id - ONI_STREAM_PROPERTY_AUTO_WHITE_BALANCE] = value;
    else return ONI_STATUS_NOT_SUPPORTED;
    return ONI_STATUS_OK;
}

void Stream::switched(bool on) {
    if (m_kind == ONI_SENSOR_IR) m_device->ir_on = on;
    if (m_kind == ONI_SENSOR_COLOR) m_device->color_on = on;
}

void Stream::run() {
    const uint64_t period = 1000000000ull / uint64_t(m_mode.fps);
    uint64_t next = now_ns() + period;
    for (int index = 1; m_running; next += period) {
        while (m_running && now_ns() < next) sleep_ns(std::min<uint64_t>(next - now_ns(), 5000000));
        if (m_feed.has("crash")) m_feed.obey();
        if (!m_running || m_feed.has("stall") || m_feed.has("unplug") || m_feed.has("hang")) continue;
        deliver(next, index++);
        if (now_ns() > next + 10 * period) next = now_ns();  // the machine was busy: do not catch up in a rush
    }
}

void Stream::deliver(uint64_t made_ns, int index) {
    OniFrame* frame = getServices().acquireFrame();
    if (frame == nullptr) return;
    const int w = m_mode.resolutionX, h = m_mode.resolutionY, out = pixel_bytes();
    const size_t one = size_t(m_width) * m_height * m_bytes, count = m_data.size() / one;
    const char* source = m_data.data() + (count ? size_t(index - 1) % count : 0) * one;
    const bool mirror = m_mirror, tenth = m_mode.pixelFormat == ONI_PIXEL_FORMAT_DEPTH_100_UM;
    const int shift = m_kind == ONI_SENSOR_DEPTH && m_device->registration == ONI_IMAGE_REGISTRATION_DEPTH_TO_COLOR ? 8 : 0;
    const bool plain = w == m_width && h == m_height && out == m_bytes && !mirror && !tenth && !shift;
    char* target = static_cast<char*>(frame->data);
    if (!count) memset(target, 0, size_t(w) * h * out);
    else if (plain) memcpy(target, source, one);
    else
        for (int v = 0; v < h; ++v)
            for (int u = 0; u < w; ++u) {
                int su = ((mirror ? w - 1 - u : u) * m_width) / w - shift, sv = v * m_height / h;
                char* pixel = target + (size_t(v) * w + u) * out;
                if (su < 0) { memset(pixel, 0, out); continue; }
                const char* from = source + (size_t(sv) * m_width + su) * m_bytes;
                if (tenth) {
                    uint16_t mm;
                    memcpy(&mm, from, 2);
                    mm = uint16_t(mm < 6553 ? mm * 10 : 65535);
                    memcpy(pixel, &mm, 2);
                } else memcpy(pixel, from + (out < m_bytes ? 1 : 0), out);  // 8 bits of infrared: the upper ones
            }
    if (m_kind == ONI_SENSOR_COLOR && !m_settings[1] && m_settings[3] != 100)  // gain, without automatic exposure
        for (size_t i = 0; i < size_t(w) * h * 3; ++i)
            target[i] = char(std::min(255, int(uint8_t(target[i])) * m_settings[3] / 100));
    if (m_kind == ONI_SENSOR_DEPTH && m_feed.number("stamp", 0)) {
        uint64_t made = now_ns();
        memcpy(target, &made, sizeof made);
    }
    frame->dataSize = w * h * out;
    frame->width = w;
    frame->height = h;
    frame->stride = w * out;
    frame->videoMode = m_mode;
    frame->sensorType = m_kind;
    frame->croppingEnabled = FALSE;
    frame->cropOriginX = frame->cropOriginY = 0;
    frame->frameIndex = index;
    frame->timestamp = made_ns / 1000;
    raiseNewFrame(frame);
    getServices().releaseFrame(frame);
}

class FeedDriver : public DriverBase {
public:
    explicit FeedDriver(OniDriverServices* services) : DriverBase(services) {}

    OniStatus initialize(DeviceConnectedCallback connected, DeviceDisconnectedCallback disconnected,
                         DeviceStateChangedCallback changed, void* cookie) override {
        DriverBase::initialize(connected, disconnected, changed, cookie);
        const char* named = getenv("OPENNI_FEED_FOLDERS");
        std::stringstream list(named ? named : "");
        for (std::string folder; std::getline(list, folder, ':');) meet("feed://" + folder);
        m_watch = std::thread([this] { watch(); });
        return ONI_STATUS_OK;
    }
    OniStatus tryDevice(const char* uri) override { return meet(uri) ? ONI_STATUS_OK : ONI_STATUS_ERROR; }
    DeviceBase* deviceOpen(const char* uri, const char*) override {
        auto device = new Device(std::string(uri).substr(7));
        device->feed.obey();
        return device;
    }
    void deviceClose(DeviceBase* device) override { delete device; }
    void shutdown() override {
        m_running = false;
        if (m_watch.joinable()) m_watch.join();
    }

private:
    OniDeviceInfo info(const std::string& uri) const {
        Feed feed(uri.substr(7));
        OniDeviceInfo about{};
        snprintf(about.uri, ONI_MAX_STR, "%s", uri.c_str());
        snprintf(about.name, ONI_MAX_STR, "%s", feed.text("name", "Feed").c_str());
        snprintf(about.vendor, ONI_MAX_STR, "%s", feed.text("vendor", "GeoDerm tests").c_str());
        about.usbVendorId = uint16_t(feed.number("vid", 0));
        about.usbProductId = uint16_t(feed.number("pid", 0));
        return about;
    }
    bool meet(const std::string& uri) {
        if (uri.rfind("feed://", 0) != 0) return false;
        Feed feed(uri.substr(7));
        if (!feed.has("device.txt") || feed.has("unplug")) return false;
        {
            std::lock_guard<std::mutex> lock(m_mutex);
            if (!m_present.insert(uri).second) return true;
            m_known.insert(uri);
        }
        OniDeviceInfo about = info(uri);
        deviceConnected(&about);
        return true;
    }
    void watch() {
        for (; m_running; sleep_ns(20000000)) {
            std::set<std::string> known, gone;
            {
                std::lock_guard<std::mutex> lock(m_mutex);
                known = m_known;
                for (const auto& uri : known)
                    if (m_present.count(uri) && Feed(uri.substr(7)).has("unplug")) {
                        m_present.erase(uri);
                        gone.insert(uri);
                    }
            }
            for (const auto& uri : gone) {
                OniDeviceInfo about = info(uri);
                deviceDisconnected(&about);
            }
            for (const auto& uri : known)
                if (!gone.count(uri)) meet(uri);
        }
    }

    std::mutex m_mutex;
    std::set<std::string> m_known, m_present;
    std::thread m_watch;
    std::atomic<bool> m_running{true};
};

ONI_EXPORT_DRIVER(FeedDriver)
