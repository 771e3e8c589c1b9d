// The light that a capture's photographs were taken in: ambient light, and one direction. Estimated once over frames of
// the whole capture, then used for the pictures of every frame.
#pragma once

#include "projection/maps.h"
#include "shaders/shared/light.h"

#include <cstddef>
#include <cstdint>
#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// I = gain albedo (visibility^power (1 + gradient . n) + shadow max(0, direct . n)), in linear light. Ambient light is
/// 1, since only products of albedo and light can be known (ao/light/README.md).
struct Light {
    Eigen::Vector3d direct = {0, 0, 0};   ///< towards the light; its length is direct / ambient light; 0 = none
    Eigen::Vector3d tint = {1, 1, 1};     ///< of direct over ambient light: red, green, blue
    Eigen::Vector3d gradient = {0, 0, 0}; ///< of ambient light over normals
    double power = 1;                     ///< of visibility in the photographs; 0 = they show none
    bool shadows = false;                 ///< shadows of the depth image explain the photographs better
    bool in_world = false;                ///< directions are in the recording's world, else in camera space
    std::string doubt = {};               ///< a sentence: why the direction may be wrong; empty = no reason known

    [[nodiscard]] bool has_direct() const { return direct.norm() > 0; }
    /// For the shaders, in the space of a camera.
    [[nodiscard]] shared::LightConstants on_gpu(const Eigen::Matrix3d& world_from_camera) const;
};

/// One frame with everything that is known of it, all on one pixel grid.
struct LightFrame {
    const DepthImage& depth;
    const NormalImage& normals;
    const cv::Mat1f& visibility;
    const cv::Mat3b& colour;
    cv::Mat1b colour_known = {}; ///< empty = everywhere
    Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
};

/// A pixel of a surface.
struct LightSample {
    Eigen::Vector3d normal; ///< in the light's space
    Eigen::Vector3d colour; ///< red, green, blue in linear light
    double visibility;
    int frame, u, v;
    int albedo = -1; ///< samples of one number share an albedo; -1 = with too few
};

/// Samples of all frames, and what shadows need of them. Memory is bounded by the number of frames and samples.
class LightSamples {
  public:
    /// Of frames that share a world, or else not.
    explicit LightSamples(bool in_world, std::size_t per_frame = 1500) : in_world_(in_world), per_frame_(per_frame) {}
    /// Takes samples spread over normals and visibilities. Pixels that are clipped, dark, beside an edge or seen at a
    /// grazing angle are left out.
    void add(const LightFrame& frame);
    /// Gives samples of like colour and place one albedo. Call it once, after the last add().
    void group();

    [[nodiscard]] const std::vector<LightSample>& all() const { return samples_; }
    [[nodiscard]] std::size_t frames() const { return frames_.size(); }
    [[nodiscard]] int albedos() const { return albedos_; }
    [[nodiscard]] bool in_world() const { return in_world_; }
    /// The mean direction that cameras look in.
    [[nodiscard]] Eigen::Vector3d forward() const;
    /// 0 where a depth image, of any frame in a world, has something in the way towards the light, else 1.
    [[nodiscard]] double lit(const LightSample& sample, const Eigen::Vector3d& towards) const;

  private:
    struct Kept {
        Pinhole camera;
        cv::Mat1f z_m;
        Eigen::Isometry3d world_from_camera;
    };
    [[nodiscard]] Eigen::Vector3d place(const LightSample& sample) const;
    /// Of a point and a direction in the light's space.
    [[nodiscard]] bool sees_light(const Kept& frame, const Eigen::Vector3d& from, const Eigen::Vector3d& ray) const;
    bool in_world_;
    std::size_t per_frame_;
    int albedos_ = 0;
    std::vector<Kept> frames_;
    std::vector<LightSample> samples_;
};

/// How a term of the model did on albedos that it was not fitted to.
struct LightModel {
    std::string name;    ///< "albedo alone", "ambient", ...
    double held_out = 0; ///< mean of min(|log residual|, 0.35)
};

struct LightEstimate {
    Light light;
    std::vector<LightModel> models; ///< as tried
    std::string chosen;             ///< the name of one of them; empty = there was too little to go by
    std::string sentence;           ///< what was found, or why no direct light was
    std::size_t samples = 0, frames = 0;
    int albedos = 0;
    double spread_deg = 0; ///< between the directions that halves of the samples give
};

struct LightRequest {
    bool direct = true;                       ///< false: all light is ambient
    std::optional<Eigen::Vector3d> towards{}; ///< a direct light's direction, in the light's space, where it is known
};

/// The same samples give the same bytes.
[[nodiscard]] LightEstimate estimate_light(const LightSamples& samples, const LightRequest& request = {});

} // namespace scanshade
