// One cloud of a whole recording: points that several frames saw at the same position become one.
#pragma once

#include "projection/found_frames.h"
#include "projection/length_unit.h"
#include "projection/maps.h"

#include <array>
#include <cstdint>
#include <Eigen/Geometry>
#include <filesystem>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

namespace scanshade {

/// One frame's part of the cloud. All images have the depth's size. `colour` may be empty, and so may `colour_known` if
/// colour is known everywhere.
struct CloudFrame {
    const DepthImage& depth;
    const cv::Mat1f& visibility;
    const cv::Mat1f& confidence;
    const cv::Mat3b& colour;
    const cv::Mat1b& colour_known;
    Eigen::Isometry3d world_from_camera;
};

/// A cloud with a value per point, NaN where a point has none. `colours` and `confidence` may be empty.
struct CloudSweep {
    std::span<const Eigen::Vector3d> points;
    std::span<const cv::Vec3b> colours;
    std::span<const float> visibility, confidence;
    Eigen::Isometry3d world_from_scanner;
    double spacing_m = 0; ///< between neighbours; 0 = not known
};

/// Its memory grows with the recorded surface, not with the number of frames. Equal results need equal order of frames.
class RecordingCloud {
  public:
    /// Points are merged within cubes of this side; 0 = one and a half times what a pixel covers at the first frame's
    /// median depth, or the spacing of the first sweep's points.
    /// `unit`: of the recording, in which the points are written.
    explicit RecordingCloud(double resolution_m, LengthUnit unit = {}) : resolution_m_(resolution_m), unit_(unit) {}

    /// Nearer and more confident views of a point have more weight. Pixels without visibility add nothing.
    void add(const CloudFrame& frame);
    /// More confident points have more weight. Throws Error where no side of the cubes was given and the sweep's
    /// spacing is not known.
    void add(const CloudSweep& sweep);
    [[nodiscard]] std::size_t points() const { return cells_.size(); }
    [[nodiscard]] double resolution_m() const { return resolution_m_; }
    /// "0.0043 m": the side of the cubes.
    [[nodiscard]] std::string merged_within() const;
    /// Binary PLY in world coordinates: ambient_occlusion, ao_confidence, ao_views, and the frames as comments
    /// (io/clouds/recorded_frames.h); binary glTF where the name ends in .glb, with grey visibility where no frame had
    /// colours. Atomic.
    void write(const std::filesystem::path& file) const;
    /// The same for a page: FOLDER/STEM.000.js and on, at most so many points.
    void write_for_page(const std::filesystem::path& folder, const std::string& stem, std::size_t most) const;

  private:
    /// What both kinds of files hold. `colours` is empty where no frame had any.
    struct Columns {
        std::vector<Eigen::Vector3d> points;
        std::vector<cv::Vec3b> colours;
        std::vector<float> visibility, confidence, views;
    };
    [[nodiscard]] Columns columns() const;
    [[nodiscard]] std::vector<std::string> comments(std::span<const Eigen::Vector3d> points) const;

    struct Cell {
        Eigen::Vector3d point = Eigen::Vector3d::Zero();
        Eigen::Vector3f colour = Eigen::Vector3f::Zero();
        double weight = 0;
        float colour_weight = 0, visibility = 0, confidence = 0;
        int last_frame = -1, views = 0;
    };
    using Key = std::array<std::int32_t, 3>;
    struct KeyHash {
        std::size_t operator()(const Key& key) const;
    };
    /// One point as it is seen in the current frame; `bgr` null = without colour.
    void add_point(const Eigen::Vector3d& point, float weight, float visibility, float confidence,
                   const cv::Vec3b* bgr);
    double resolution_m_;
    LengthUnit unit_;
    int frames_ = 0;
    std::vector<Cell> cells_;        ///< in the order they were added
    std::vector<FoundFrame> images_; ///< those that were added, and the cells that each made first
    bool has_sweeps_ = false;
    std::unordered_map<Key, std::size_t, KeyHash> index_;
};

} // namespace scanshade
