/* Virtual depth cameras: a driver plug-in for OpenNI2 that serves the frames of a recording folder, for tests.
 *
 *   VIRTUAL_DEPTH_FOLDER    the recording
 *   VIRTUAL_DEPTH_RATE      frames a second (100)
 *   VIRTUAL_DEPTH_MIRRORED  1: pictures are mirrored, and that can't be changed
 *   VIRTUAL_DEPTH_CONTROL   a file with one word, looked at all the time: good, unplugged, stalled, short,
 *                           wrong-size, wrong-format, cropped, no-data, bad-stamp, losing (every third frame),
 *                           moved (to another address, as by another socket), busy (none can be opened)
 *
 * There are two cameras, VIRTUAL-1 and VIRTUAL-2; only the first one is ever unplugged or moved, and streams that were
 * open then give no frames any more. Frame number i (from 1) shows the recording's frame (i - 1) modulo their number.
 * Their clocks start at zero with the stream and run 1000 parts a million fast. Colour is (i, x, y) modulo 256. */
#include <new>

#define XN_NEW(type, ...) new type(__VA_ARGS__)
#define XN_DELETE(object) delete (object)
#include <Driver/OniDriverAPI.h>

#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>
#include <vector>

#include "fathom_drivers.h"
#include "monotonic.h"

namespace {

using namespace oni::driver;

const int control_period_ms = 5;

std::string variable(const char *name, const char *otherwise) {
    const char *value = getenv(name);
    return value && *value ? value : otherwise;
}

/* What the cameras see; read once. */
struct Recording {
    int width = 0, height = 0;
    std::vector<std::vector<uint16_t>> frames;

    Recording() {
        fathom_recording *recording = nullptr;
        if (fathom_recording_open(&recording, variable("VIRTUAL_DEPTH_FOLDER", ".").c_str(), nullptr)) return;
        width = recording->camera.width;
        height = recording->camera.height;
        for (int i = 0; i < recording->frame_count; i++) {
            frames.emplace_back(size_t(width) * height);
            fathom_recording_read_depth(recording, i, frames.back().data());
        }
        fathom_recording_close(recording);
    }
};

/* The control file's word, followed by a thread. */
class Control {
  public:
    enum Mode {
        good,
        unplugged,
        stalled,
        is_short,
        wrong_size,
        wrong_format,
        cropped,
        no_data,
        bad_stamp,
        losing,
        moved,
        busy,
        modes
    };

    Mode mode() const {
        return now;
    }

    void look() {
        static const char *const words[modes] = {"good",       "unplugged",    "stalled", "short",
                                                 "wrong-size", "wrong-format", "cropped", "no-data",
                                                 "bad-stamp",  "losing",       "moved",   "busy"};
        char word[32] = "";
        FILE *file = fopen(path.c_str(), "r");
        if (!file) return;
        if (fscanf(file, "%31s", word) != 1) *word = 0; /* being written */
        fclose(file);
        for (int i = 0; i < modes; i++)
            if (strcmp(words[i], word) == 0) now = Mode(i);
    }

  private:
    const std::string path = variable("VIRTUAL_DEPTH_CONTROL", "");
    std::atomic<Mode> now{good};
};

/* Whether a camera has been plugged in ever since it was opened. */
struct Plug {
    const std::atomic<int> &changes;
    const int changes_then;

    explicit Plug(const std::atomic<int> &count) : changes(count), changes_then(count) {}

    bool holds() const {
        return changes == changes_then;
    }
};

template <class T> OniStatus give(void *data, int *size, T value) {
    if (*size != int(sizeof value)) return ONI_STATUS_BAD_PARAMETER;
    memcpy(data, &value, sizeof value);
    return ONI_STATUS_OK;
}

class Stream : public StreamBase {
  public:
    Stream(const Recording &what, const Control &how, OniSensorType kind, const Plug &in)
        : recording(what), control(how), type(kind), plug(in) {
        mode = {type == ONI_SENSOR_COLOR ? ONI_PIXEL_FORMAT_RGB888 : ONI_PIXEL_FORMAT_DEPTH_1_MM,
                recording.width, recording.height, 30};
        mirrored = always_mirrored = variable("VIRTUAL_DEPTH_MIRRORED", "0") == "1";
    }

    ~Stream() override {
        stop();
    }

    OniStatus start() override {
        if (recording.frames.empty() || running.exchange(true)) return ONI_STATUS_ERROR;
        thread = std::thread(&Stream::run, this);
        return ONI_STATUS_OK;
    }

    void stop() override {
        running = false;
        if (thread.joinable()) thread.join();
    }

    OniBool isPropertySupported(int id) override {
        for (int known : properties)
            if (known == id) return TRUE;
        return FALSE;
    }

    /* OniFile plays nothing that was recorded without stride and cropping. */
    void notifyAllProperties() override {
        for (int id : properties)
            for (int size : {int(sizeof(int)), int(sizeof(OniVideoMode)), int(sizeof(OniCropping))}) {
                char data[64];
                int got = size;
                if (getProperty(id, data, &got) == ONI_STATUS_OK) {
                    raisePropertyChanged(id, data, got);
                    break;
                }
            }
    }

    OniStatus getProperty(int id, void *data, int *size) override {
        switch (id) {
        case ONI_STREAM_PROPERTY_VIDEO_MODE: return give(data, size, mode);
        case ONI_STREAM_PROPERTY_HORIZONTAL_FOV: return give(data, size, 1.0226f);
        case ONI_STREAM_PROPERTY_VERTICAL_FOV: return give(data, size, 0.7966f);
        case ONI_STREAM_PROPERTY_MAX_VALUE: return give(data, size, 65534);
        case ONI_STREAM_PROPERTY_MIN_VALUE: return give(data, size, 0);
        case ONI_STREAM_PROPERTY_STRIDE: return give(data, size, row_bytes());
        case ONI_STREAM_PROPERTY_CROPPING: return give(data, size, OniCropping{});
        case ONI_STREAM_PROPERTY_MIRRORING: return give(data, size, OniBool(mirrored));
        }
        return ONI_STATUS_NOT_IMPLEMENTED;
    }

    OniStatus setProperty(int id, const void *data, int size) override {
        if (id == ONI_STREAM_PROPERTY_VIDEO_MODE && size == int(sizeof mode)) {
            const OniVideoMode *wanted = static_cast<const OniVideoMode *>(data);
            if (wanted->resolutionX != recording.width || wanted->resolutionY != recording.height)
                return ONI_STATUS_NOT_SUPPORTED;
            mode = *wanted;
            return ONI_STATUS_OK;
        }
        if (id == ONI_STREAM_PROPERTY_MIRRORING && size == int(sizeof(OniBool)) && !always_mirrored) {
            mirrored = *static_cast<const OniBool *>(data) != FALSE;
            return ONI_STATUS_OK;
        }
        return ONI_STATUS_NOT_SUPPORTED;
    }

  private:
    const Recording &recording;
    const Control &control;
    const OniSensorType type;
    const Plug plug;
    OniVideoMode mode;
    bool mirrored, always_mirrored;
    std::atomic<bool> running{false};
    std::thread thread;
    static constexpr int properties[] = {ONI_STREAM_PROPERTY_VIDEO_MODE,   ONI_STREAM_PROPERTY_HORIZONTAL_FOV,
                                         ONI_STREAM_PROPERTY_VERTICAL_FOV, ONI_STREAM_PROPERTY_MAX_VALUE,
                                         ONI_STREAM_PROPERTY_MIN_VALUE,    ONI_STREAM_PROPERTY_STRIDE,
                                         ONI_STREAM_PROPERTY_CROPPING,     ONI_STREAM_PROPERTY_MIRRORING};

    int row_bytes() const {
        return recording.width * (type == ONI_SENSOR_COLOR ? 3 : 2);
    }

    void draw(int index, void *data) const {
        const int width = recording.width, height = recording.height;
        const std::vector<uint16_t> &source = recording.frames[size_t(index - 1) % recording.frames.size()];
        const int factor = mode.pixelFormat == ONI_PIXEL_FORMAT_DEPTH_100_UM ? 10 : 1;
        for (int y = 0; y < height; y++)
            for (int x = 0; x < width; x++) {
                const int to = y * width + (mirrored ? width - 1 - x : x);
                const unsigned char rgb[3] = {(unsigned char)index, (unsigned char)x, (unsigned char)y};
                if (type == ONI_SENSOR_COLOR)
                    memcpy(static_cast<unsigned char *>(data) + 3 * to, rgb, 3);
                else
                    static_cast<uint16_t *>(data)[to] = uint16_t(factor * source[size_t(y) * width + x]);
            }
    }

    void fill(OniFrame *frame, int index, int64_t passed_ns) const {
        frame->frameIndex = index;
        frame->videoMode = mode;
        frame->width = recording.width;
        frame->height = recording.height;
        frame->cropOriginX = frame->cropOriginY = 0;
        frame->croppingEnabled = FALSE;
        frame->sensorType = type;
        frame->stride = row_bytes();
        frame->dataSize = row_bytes() * recording.height;
        frame->timestamp = uint64_t(double(passed_ns) * 1.001 / 1000);
        draw(index, frame->data);
    }

    void spoil(OniFrame *frame) const {
        const uint64_t not_a_number = 0x7ff8000000000000; /* its bits */
        switch (control.mode()) {
        case Control::is_short: frame->dataSize /= 2; break;
        case Control::wrong_size: frame->width /= 2; break;
        case Control::wrong_format: frame->videoMode.pixelFormat = ONI_PIXEL_FORMAT_GRAY16; break;
        case Control::cropped: frame->croppingEnabled = TRUE; break;
        case Control::no_data: frame->dataSize = 0; break;
        case Control::bad_stamp: frame->timestamp = not_a_number; break;
        default: break;
        }
    }

    void run() {
        const double rate = atof(variable("VIRTUAL_DEPTH_RATE", "100").c_str());
        const int64_t start_ns = monotonic_now_ns();
        for (int index = 1; running; index++) {
            const int64_t passed_ns = int64_t(1e9 * index / rate);
            const timespec then = monotonic_timespec(start_ns + passed_ns);
            clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &then, nullptr);
            const Control::Mode now = control.mode();
            if (now == Control::stalled || !plug.holds()) continue;
            if (now == Control::losing && index % 3 == 0) continue;
            OniFrame *frame = getServices().acquireFrame();
            if (!frame) continue;
            fill(frame, index, passed_ns);
            spoil(frame);
            raiseNewFrame(frame);
            getServices().releaseFrame(frame);
        }
    }
};

constexpr int Stream::properties[];

class Device : public DeviceBase {
  public:
    Device(const Recording &what, const Control &how, const char *name, const std::atomic<int> &changes)
        : recording(what), control(how), serial(name), plug(changes) {
        for (int fps : {30, 60})
            modes.push_back({ONI_PIXEL_FORMAT_DEPTH_1_MM, recording.width, recording.height, fps});
        modes.push_back({ONI_PIXEL_FORMAT_DEPTH_100_UM, recording.width, recording.height, 30});
        color_mode = {ONI_PIXEL_FORMAT_RGB888, recording.width, recording.height, 30};
        sensors[0] = {ONI_SENSOR_DEPTH, int(modes.size()), modes.data()};
        sensors[1] = {ONI_SENSOR_COLOR, 1, &color_mode};
    }

    OniStatus getSensorInfoList(OniSensorInfo **list, int *count) override {
        *list = sensors;
        *count = 2;
        return ONI_STATUS_OK;
    }

    StreamBase *createStream(OniSensorType type) override {
        return new Stream(recording, control, type, plug);
    }

    void destroyStream(StreamBase *stream) override {
        delete stream;
    }

    OniStatus getProperty(int id, void *data, int *size) override {
        if (id != ONI_DEVICE_PROPERTY_SERIAL_NUMBER) return ONI_STATUS_NOT_IMPLEMENTED;
        snprintf(static_cast<char *>(data), size_t(*size), "%s", serial.c_str());
        return ONI_STATUS_OK;
    }

    OniStatus setProperty(int id, const void *, int) override {
        return id == ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION ? ONI_STATUS_OK : ONI_STATUS_NOT_IMPLEMENTED;
    }

    OniBool isPropertySupported(int id) override {
        return id == ONI_DEVICE_PROPERTY_SERIAL_NUMBER || id == ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION;
    }

    OniBool isImageRegistrationModeSupported(OniImageRegistrationMode) override {
        return TRUE;
    }

  private:
    const Recording &recording;
    const Control &control;
    const std::string serial;
    const Plug plug;
    std::vector<OniVideoMode> modes;
    OniVideoMode color_mode;
    OniSensorInfo sensors[2];
};

class Driver : public DriverBase {
  public:
    explicit Driver(OniDriverServices *services) : DriverBase(services) {
        for (int i = 0; i < 3; i++) {
            memset(&info[i], 0, sizeof info[i]);
            snprintf(info[i].uri, sizeof info[i].uri, "virtual/depth@9/%d", i + 1);
            snprintf(info[i].vendor, sizeof info[i].vendor, "Virtual");
            snprintf(info[i].name, sizeof info[i].name, "Depth %d", i == 1 ? 2 : 1);
        }
    }

    OniStatus initialize(DeviceConnectedCallback connected, DeviceDisconnectedCallback disconnected,
                         DeviceStateChangedCallback changed, void *cookie) override {
        DriverBase::initialize(connected, disconnected, changed, cookie);
        follow();
        deviceConnected(&info[1]);
        thread = std::thread(&Driver::run, this);
        return ONI_STATUS_OK;
    }

    DeviceBase *deviceOpen(const char *uri, const char *) override {
        if (control.mode() == Control::busy) return nullptr;
        for (int i : {int(first), 1})
            if (i >= 0 && strcmp(uri, info[i].uri) == 0)
                return i == 1 ? new Device(recording, control, "VIRTUAL-2", none)
                              : new Device(recording, control, "VIRTUAL-1", changes);
        return nullptr;
    }

    void deviceClose(DeviceBase *device) override {
        delete device;
    }

    void shutdown() override {
        ending = true;
        if (thread.joinable()) thread.join();
    }

    OniStatus tryDevice(const char *) override {
        return ONI_STATUS_ERROR;
    }

  private:
    Recording recording;
    Control control;
    OniDeviceInfo info[3];       /* the two cameras, then the first one moved */
    std::atomic<int> first{-1};  /* the first camera's place in info; -1: unplugged */
    std::atomic<int> changes{0}; /* of that place */
    const std::atomic<int> none{0};
    std::atomic<bool> ending{false};
    std::thread thread;

    void follow() {
        control.look();
        const Control::Mode mode = control.mode();
        const int now = mode == Control::unplugged ? -1 : mode == Control::moved ? 2 : 0;
        const int before = first;
        if (before == now) return;
        changes++;
        first = now;
        if (before >= 0) deviceDisconnected(&info[before]);
        if (now >= 0) deviceConnected(&info[now]);
    }

    void run() {
        while (!ending) {
            follow();
            const timespec period = {0, control_period_ms * 1000000};
            nanosleep(&period, nullptr);
        }
    }
};

} // namespace

ONI_EXPORT_DRIVER(Driver)
