// Depth images and points in, ambient occlusion out. Header-only, on the C interface: any compiler, standard from C++17
// and OpenCV will do. Conventions are those of scanshade/scanshade.h. Every function throws Error.
#pragma once

#include <scanshade/error.h>

#include <cstdint>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <initializer_list>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

namespace scanshade {

/// Names and values as on the program's command line: {{"method", "surfel"}, {"radius", "0.5"}}.
using Settings = std::vector<std::pair<std::string, std::string>>;

/// A pinhole camera in pixels, with its lens. fx = 0 is no camera.
struct Camera {
    double fx = 0, fy = 0, cx = 0, cy = 0;
    cv::Size size = {};   ///< 0x0 = that of the depth image
    bool fisheye = false; ///< distortion is k1, k2, k3, k4, else k1, k2, p1, p2, k3, k4, k5, k6
    double distortion[8] = {0, 0, 0, 0, 0, 0, 0, 0};

    [[nodiscard]] scanshade_camera to_c() const {
        scanshade_camera c = SCANSHADE_CAMERA_INIT;
        c.fx = fx, c.fy = fy, c.cx = cx, c.cy = cy;
        c.width = size.width, c.height = size.height;
        const bool rational = !fisheye && (distortion[5] != 0 || distortion[6] != 0 || distortion[7] != 0);
        c.lens = fisheye ? SCANSHADE_FISHEYE : rational ? SCANSHADE_RATIONAL : SCANSHADE_BROWN;
        for (int i = 0; i < 5; ++i)
            c.distortion[i] = distortion[i];
        for (int i = 0; i < 3 && rational; ++i)
            c.denominator[i] = distortion[5 + i];
        return c;
    }
    [[nodiscard]] static Camera from_c(const scanshade_camera& c) {
        Camera camera{c.fx, c.fy, c.cx, c.cy, {c.width, c.height}, c.lens == SCANSHADE_FISHEYE, {}};
        for (int i = 0; i < 5; ++i)
            camera.distortion[i] = c.distortion[i];
        for (int i = 0; i < 3 && c.lens == SCANSHADE_RATIONAL; ++i)
            camera.distortion[5 + i] = c.denominator[i];
        return camera;
    }
};

/// What to compute besides visibility.
enum Outputs : std::uint32_t {
    visibility_only = SCANSHADE_VISIBILITY,
    with_confidence = SCANSHADE_CONFIDENCE,
    with_normals = SCANSHADE_NORMALS,
    with_all = SCANSHADE_CONFIDENCE | SCANSHADE_NORMALS
};

/// Values of images or points. Returned matrices own their memory. `image` counts from 0.
class Result {
  public:
    explicit Result(scanshade_result* handle) : handle_(handle, scanshade_result_free) {
        detail::check(scanshade_result_arrays(handle, &arrays_));
    }
    [[nodiscard]] int images() const { return static_cast<int>(arrays_.count); }
    /// 1 = open, 0 = closed, NaN = no surface. Points: one row in their order, or an organised cloud's grid.
    [[nodiscard]] cv::Mat1f visibility(int image = 0) const { return of<float>(arrays_.visibility, image); }
    /// How far each value can be believed, 0 .. 1. Empty where not asked for.
    [[nodiscard]] cv::Mat1f confidence(int image = 0) const { return of<float>(arrays_.confidence, image); }
    /// Unit normals, NaN where there is none. Empty where not asked for.
    [[nodiscard]] cv::Mat3f normals(int image = 0) const { return of<cv::Vec3f>(arrays_.normals, image); }
    /// Sentences: why the values may be wrong; empty = no reason known.
    [[nodiscard]] std::vector<std::string> doubts(int image = 0) const {
        std::vector<std::string> all;
        for (std::int64_t i = 0; const char* doubt = scanshade_result_doubt(handle_.get(), image, i); ++i)
            all.emplace_back(doubt);
        return all;
    }
    /// JSON: settings as used, device, noise, notes and times of every image (scanshade_result_info()).
    [[nodiscard]] std::string info() const { return scanshade_result_info(handle_.get()); }

  private:
    template <class Pixel>
    [[nodiscard]] cv::Mat_<Pixel> of(const float* values, int image) const {
        if (image < 0 || image >= arrays_.count)
            throw Error(SCANSHADE_MISUSE, "image: not one of this result");
        if (!values)
            return {};
        const std::int64_t channels = cv::DataType<Pixel>::channels;
        const float* first = values + image * arrays_.height * arrays_.width * channels;
        return cv::Mat_<Pixel>(static_cast<int>(arrays_.height), static_cast<int>(arrays_.width),
                               reinterpret_cast<Pixel*>(const_cast<float*>(first)))
            .clone();
    }
    std::shared_ptr<scanshade_result> handle_;
    scanshade_arrays arrays_ = SCANSHADE_ARRAYS_INIT;
};

namespace detail {
inline std::vector<scanshade_setting> to_c(const Settings& settings) {
    std::vector<scanshade_setting> all;
    for (const auto& [name, value] : settings)
        all.push_back({name.c_str(), value.c_str()});
    return all;
}
} // namespace detail

/// Settings, a device, and a method's pipelines, which are compiled once. Thread-safe.
class Session {
  public:
    /// Throws Error for a setting that is unknown or out of range.
    explicit Session(const Settings& settings = {}) {
        const std::vector<scanshade_setting> all = detail::to_c(settings);
        scanshade_session* handle = nullptr;
        detail::check(scanshade_session_open(all.data(), all.size(), &handle));
        handle_.reset(handle, scanshade_session_close);
    }

    Session(std::initializer_list<Settings::value_type> settings) : Session(Settings(settings)) {}

    /// Ambient occlusion of a depth image: CV_16UC1 (0 and 65535 = hole) or CV_32FC1. `depth_scale`: "mm", "tum", "m"
    /// or units per metre; empty = millimetres of integers, metres of floats.
    [[nodiscard]] Result compute(const cv::Mat& depth, const Camera& camera, const std::string& depth_scale = {},
                                 std::uint32_t outputs = with_confidence) const {
        if (depth.type() != CV_16UC1 && depth.type() != CV_32FC1)
            throw Error(SCANSHADE_MISUSE, "depth: expected CV_16UC1 or CV_32FC1");
        const scanshade_camera c = camera.to_c();
        scanshade_depth in = SCANSHADE_DEPTH_INIT;
        in.values = depth.data;
        in.type = depth.depth() == CV_16U ? SCANSHADE_UINT16 : SCANSHADE_FLOAT32;
        in.width = depth.cols, in.height = depth.rows;
        in.row_bytes = static_cast<std::int64_t>(depth.step);
        in.depth_scale = depth_scale.empty() ? nullptr : depth_scale.c_str();
        in.camera = &c;
        scanshade_result* result = nullptr;
        detail::check(scanshade_compute_depth(get(), &in, outputs, &result));
        return Result(result);
    }

    /// Ambient occlusion of every point, by rays from it. `normals`: unit, one per point; empty = estimated. `z_up`: z
    /// is known to point to the sky.
    [[nodiscard]] Result compute(const std::vector<Eigen::Vector3f>& points,
                                 const std::vector<Eigen::Vector3f>& normals = {}, bool z_up = false,
                                 std::uint32_t outputs = visibility_only) const {
        if (!normals.empty() && normals.size() != points.size())
            throw Error(SCANSHADE_MISUSE, "normals: expected one per point, or none");
        static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float), "packed");
        scanshade_points in = SCANSHADE_POINTS_INIT;
        in.points = points.data();
        in.count = static_cast<std::int64_t>(points.size());
        in.normals = normals.empty() ? nullptr : normals.data();
        in.z_up = z_up;
        scanshade_result* result = nullptr;
        detail::check(scanshade_compute_points(get(), &in, outputs, &result));
        return Result(result);
    }

    /// All settings that shape its results, as used: a JSON object.
    [[nodiscard]] std::string settings() const { return scanshade_session_settings(get()); }
    /// For the C interface; the session keeps it.
    [[nodiscard]] scanshade_session* get() const { return handle_.get(); }

  private:
    std::shared_ptr<scanshade_session> handle_;
};

} // namespace scanshade
