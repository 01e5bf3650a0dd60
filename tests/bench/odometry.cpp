// Times OpenCV's FastICPOdometry (rgbd module) on the first frames of a recording: each frame with the one before.
// Usage: odometry FOLDER WIDTHxHEIGHT THREADS FRAMES. Frames are decoded, and for a smaller size thinned to every Nth
// pixel, before anything is timed. Stdout: one JSON object: milliseconds frame by frame (of the frame's maps and of the
// alignment), heap calls a frame where a counter is loaded, the path's error where there is a true one.
#include <dlfcn.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/rgbd.hpp>

namespace {

double now_ms() {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

// The lines that aren't comments.
std::vector<std::string> lines(const std::string &path) {
    std::vector<std::string> kept;
    std::ifstream file(path);
    for (std::string line; std::getline(file, line);)
        if (!line.empty() && line[0] != '#') kept.push_back(line);
    return kept;
}

// Millimetres or the like; metres here. TUM's scale unless rig.txt has another.
double depth_scale(const std::string &folder) {
    for (const std::string &line : lines(folder + "/rig.txt")) {
        std::istringstream in(line);
        std::string key;
        double value;
        if (in >> key >> value && key == "depth_scale") return value;
    }
    return 5000;
}

// Root mean square distance from groundtruth.txt after the best rigid alignment (Horn), NaN without it.
double ate(const std::string &folder, const std::vector<double> &stamps, const std::vector<cv::Vec3d> &path) {
    std::vector<double> times;
    std::vector<cv::Vec3d> truth;
    for (const std::string &line : lines(folder + "/groundtruth.txt")) {
        std::istringstream in(line);
        double t;
        cv::Vec3d p;
        if (!(in >> t >> p[0] >> p[1] >> p[2])) continue;
        times.push_back(t);
        truth.push_back(p);
    }
    std::vector<cv::Vec3d> a, b; // the true and the found place at each stamp
    cv::Vec3d mean_a(0, 0, 0), mean_b(0, 0, 0);
    for (size_t i = 0; i < stamps.size(); i++) {
        const double t = stamps[i];
        const size_t k =
            static_cast<size_t>(std::lower_bound(times.begin(), times.end(), t - 1e-6) - times.begin());
        if (k == times.size()) continue;
        const double part = k > 0 ? std::min((t - times[k - 1]) / (times[k] - times[k - 1]), 1.0) : 1;
        a.push_back(k > 0 ? truth[k - 1] * (1 - part) + truth[k] * part : truth[k]);
        b.push_back(path[i]);
        mean_a += a.back();
        mean_b += b.back();
    }
    if (a.size() < 3) return NAN;
    mean_a /= static_cast<double>(a.size());
    mean_b /= static_cast<double>(b.size());
    cv::Matx33d cross = cv::Matx33d::zeros();
    for (size_t i = 0; i < a.size(); i++) cross += (a[i] - mean_a) * (b[i] - mean_b).t();
    cv::Matx31d w;
    cv::Matx33d u, vt;
    cv::SVD::compute(cross, w, u, vt);
    const cv::Matx33d turn = u * cv::Matx33d::diag(cv::Vec3d(1, 1, cv::determinant(u * vt))) * vt;
    double sum = 0;
    for (size_t i = 0; i < a.size(); i++) {
        const cv::Vec3d off = (a[i] - mean_a) - turn * (b[i] - mean_b);
        sum += off.dot(off);
    }
    return std::sqrt(sum / static_cast<double>(a.size()));
}

void print(const char *name, const std::vector<double> &values) {
    std::printf("\"%s\": [", name);
    for (size_t i = 0; i < values.size(); i++) std::printf("%s%.6g", i ? ", " : "", values[i]);
    std::printf("], ");
}

} // namespace

int main(int argc, char **argv) {
    int width = 0, height = 0, step = 1;
    if (argc != 5 || std::sscanf(argv[2], "%dx%d", &width, &height) != 2) {
        std::fprintf(stderr, "usage: odometry FOLDER WIDTHxHEIGHT THREADS FRAMES\n");
        return 2;
    }
    const std::string folder = argv[1];
    const size_t most = std::strtoul(argv[4], nullptr, 10);
    const double scale = depth_scale(folder);
    std::vector<cv::Mat> images;
    std::vector<double> stamps;
    for (const std::string &line : lines(folder + "/depth.txt")) {
        if (images.size() == most) break;
        std::istringstream in(line);
        double stamp;
        std::string name;
        in >> stamp >> name;
        cv::Mat raw = cv::imread(folder + "/" + name, cv::IMREAD_UNCHANGED), thinned(height, width, CV_32F);
        step = raw.cols / width;
        if (raw.type() != CV_16U || step < 1 || raw.cols != step * width || raw.rows != step * height) {
            std::fprintf(stderr, "odometry: %s isn't a whole number times %s\n", name.c_str(), argv[2]);
            return 1;
        }
        for (int y = 0; y < height; y++)
            for (int x = 0; x < width; x++) {
                const unsigned d = raw.at<unsigned short>(y * step, x * step);
                const double z = d == 65535 ? 0 : d / scale;
                thinned.at<float>(y, x) = z > 0 ? static_cast<float>(z) : 0.0f;
            }
        images.push_back(thinned);
        stamps.push_back(stamp);
    }
    double fx = 525, fy = 525, cx = 319.5, cy = 239.5;
    const std::vector<std::string> calibration = lines(folder + "/calibration.txt");
    if (!calibration.empty()) std::istringstream(calibration[0]) >> fx >> fy >> cx >> cy;
    const cv::Matx33f camera(static_cast<float>(fx / step), 0, static_cast<float>(cx / step), 0,
                             static_cast<float>(fy / step), static_cast<float>(cy / step), 0, 0, 1);
    cv::setNumThreads(std::atoi(argv[3]));
    long (*heap_calls)() = reinterpret_cast<long (*)()>(dlsym(RTLD_DEFAULT, "heap_count_all"));

    cv::Ptr<cv::rgbd::FastICPOdometry> odometry = cv::rgbd::FastICPOdometry::create(cv::Mat(camera));
    cv::Ptr<cv::rgbd::OdometryFrame> before;
    cv::Matx44d pose = cv::Matx44d::eye();
    std::vector<double> maps, track, heap;
    std::vector<cv::Vec3d> path;
    int lost = 0;
    for (size_t i = 0; i < images.size(); i++) {
        const long calls = heap_calls ? heap_calls() : 0;
        const double start = now_ms();
        cv::Ptr<cv::rgbd::OdometryFrame> frame = cv::rgbd::OdometryFrame::create(cv::Mat(), images[i]);
        odometry->prepareFrameCache(frame, cv::rgbd::OdometryFrame::CACHE_ALL);
        const double prepared = now_ms();
        cv::Mat motion;
        const bool found = i == 0 || odometry->compute(frame, before, motion); // scan to the frame before
        const double end = now_ms();
        if (heap_calls) heap.push_back(static_cast<double>(heap_calls() - calls));
        if (i > 0 && found) pose = pose * cv::Matx44d(motion);
        lost += !found;
        maps.push_back(prepared - start);
        track.push_back(end - prepared);
        path.push_back(cv::Vec3d(pose(0, 3), pose(1, 3), pose(2, 3)));
        before = frame;
    }
    std::printf("{");
    print("maps", maps);
    print("track", track);
    print("heap", heap);
    const double error = ate(folder, stamps, path);
    if (std::isfinite(error)) std::printf("\"ate_rmse_m\": %.6f, ", error);
    std::printf("\"frames\": %zu, \"lost\": %d, \"version\": \"%s\"}\n", images.size(), lost, CV_VERSION);
    return 0;
}
