// Recordings in any of the program's formats, frame by frame; and the refined camera of one. Header-only.
#pragma once

#include <scanshade/session.h>

#include <optional>

namespace scanshade {

/// One frame of a capture, decoded. Its matrices are views of its memory and live as long as it or a copy of it.
class Frame {
  public:
    explicit Frame(scanshade_frame* handle) : handle_(handle, scanshade_frame_free) {
        detail::check(scanshade_frame_get(handle, &data_));
    }
    [[nodiscard]] std::string name() const { return data_.name; }
    /// Metres, 0 = hole; empty for clouds. Not to be written.
    [[nodiscard]] cv::Mat1f depth_m() const {
        return data_.depth_m ? cv::Mat1f(data_.height, data_.width, const_cast<float*>(data_.depth_m)) : cv::Mat1f();
    }
    /// 8-bit blue, green, red; empty where there is none. Not to be written.
    [[nodiscard]] cv::Mat3b colour() const {
        using Pixel = cv::Vec3b;
        return data_.colour ? cv::Mat3b(data_.colour_height, data_.colour_width,
                                        reinterpret_cast<Pixel*>(const_cast<std::uint8_t*>(data_.colour)))
                            : cv::Mat3b();
    }
    /// x, y, z of each point, one column each; NaN = invalid; no columns for depth images.
    [[nodiscard]] Eigen::Map<const Eigen::Matrix3Xd> points() const {
        const Eigen::Index count = data_.points ? Eigen::Index(data_.width) * data_.height : 0;
        return {data_.points, 3, count};
    }
    [[nodiscard]] std::optional<Camera> camera() const {
        return data_.camera ? std::optional(Camera::from_c(*data_.camera)) : std::nullopt;
    }
    [[nodiscard]] std::optional<Eigen::Isometry3d> world_from_camera() const {
        using Matrix = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
        if (!data_.world_from_camera)
            return std::nullopt;
        return Eigen::Isometry3d(Eigen::Matrix4d(Eigen::Map<const Matrix>(data_.world_from_camera)));
    }
    /// Ambient occlusion as the program's `run` computes it, of pixels or points as recorded.
    [[nodiscard]] Result compute(const Session& session, std::uint32_t outputs = with_confidence) const {
        scanshade_result* result = nullptr;
        detail::check(scanshade_compute_frame(session.get(), handle_.get(), outputs, &result));
        return Result(result);
    }

  private:
    std::shared_ptr<scanshade_frame> handle_;
    scanshade_frame_data data_ = SCANSHADE_FRAME_DATA_INIT;
};

/// A folder, a depth image or a cloud file. Opening lists the frames and decodes none.
class Capture {
  public:
    /// Settings: camera, depth-scale, poses, colour, registered, association-limit, topic, confidence-min.
    explicit Capture(const std::string& path, const Settings& settings = {}) {
        const std::vector<scanshade_setting> all = detail::to_c(settings);
        scanshade_capture* handle = nullptr;
        detail::check(scanshade_capture_open(path.c_str(), all.data(), all.size(), &handle));
        handle_.reset(handle, scanshade_capture_close);
    }
    [[nodiscard]] std::int64_t size() const { return scanshade_capture_count(handle_.get()); }
    /// Decodes frame `index`.
    [[nodiscard]] Frame operator[](std::int64_t index) const {
        scanshade_frame* frame = nullptr;
        detail::check(scanshade_capture_load(handle_.get(), index, &frame));
        return Frame(frame);
    }
    /// JSON: kind, camera, names of the frames, warnings (scanshade_capture_info()).
    [[nodiscard]] std::string info() const { return scanshade_capture_info(handle_.get()); }

  private:
    std::shared_ptr<scanshade_capture> handle_;
};

struct Refinement {
    Camera camera;
    std::string report;     ///< JSON as `refine` writes it, with sigmas, errors and the verdict
    std::string summary;    ///< the same for people
    std::string trajectory; ///< refined poses, TUM's format
};

/// What the program's `refine` does, with its settings.
[[nodiscard]] inline Refinement refine(const std::string& path, const Settings& settings = {}) {
    const std::vector<scanshade_setting> all = detail::to_c(settings);
    scanshade_refinement* handle = nullptr;
    detail::check(scanshade_refine(path.c_str(), all.data(), all.size(), &handle));
    const std::unique_ptr<scanshade_refinement, void (*)(scanshade_refinement*)> owner(handle,
                                                                                       scanshade_refinement_free);
    scanshade_camera camera = SCANSHADE_CAMERA_INIT;
    detail::check(scanshade_refinement_camera(handle, &camera));
    return {Camera::from_c(camera), scanshade_refinement_report(handle), scanshade_refinement_summary(handle),
            scanshade_refinement_trajectory(handle)};
}

} // namespace scanshade
