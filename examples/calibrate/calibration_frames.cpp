#include "calibrate/calibration_frames.hpp"

#include <new>

bool CalibrationFrames::read(const struct path *path) {
    frame.reset(new (std::nothrow) CalibrationFrame[(size_t)path->count + 1]);
    if (!frame) return false;
    int run = 0;
    count = 0;
    origin_ns = path->count ? path->points[0].timestamp_ns : 0;
    for (int i = 0; i < path->count; i++) {
        const path_point &point = path->points[i];
        if (point.state != FATHOM_FIRST && point.state != FATHOM_TRACKED) {
            run++;
            continue;
        }
        CalibrationFrame &f = frame[count++];
        const double *q = point.pose.orientation;
        for (int r = 0; r < 3; r++) f.position[r] = point.pose.position[r];
        f.rotation = Eigen::Quaterniond(q[3], q[0], q[1], q[2]).normalized();
        f.t = 1e-9 * (double)(point.timestamp_ns - origin_ns);
        f.run = run;
    }
    return true;
}

int CalibrationFrames::after(int i, double seconds) const {
    const double tolerance = 1e-4; /* stamps in whole microseconds and the like */
    for (int j = i + 1; j < count && frame[j].run == frame[i].run; j++) {
        const double passed = frame[j].t - frame[i].t;
        if (passed > 2 * seconds + tolerance) break;
        if (passed >= seconds - tolerance) return j;
    }
    return -1;
}
