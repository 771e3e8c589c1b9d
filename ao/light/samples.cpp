#include "ao/light/light.h"
#include "projection/base/error.h"
#include "projection/base/hash.h"
#include "projection/base/statistics.h"
#include "projection/srgb.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>

namespace scanshade {
namespace {

/// The number of a normal's bin: six faces of a cube, each in seven parts by where on the face it is.
int bin_of(const Eigen::Vector3d& normal) {
    Eigen::Index axis = 0;
    normal.cwiseAbs().maxCoeff(&axis);
    const double scale = 1 / std::abs(normal[axis]);
    const double x = normal[(axis + 1) % 3] * scale, y = normal[(axis + 2) % 3] * scale;
    const int face = 2 * static_cast<int>(axis) + (normal[axis] > 0 ? 1 : 0);
    const double aside = std::hypot(x, y);
    const int part =
        aside < 0.3 ? 0 : 1 + std::min(5, static_cast<int>((std::atan2(y, x) / (2 * std::numbers::pi) + 0.5) * 6));
    return 7 * face + part;
}

/// Planes through squares of pixels. A plane's inverse depth is linear in u and v; sums from the image's corner on make
/// each fit a few subtractions, however large the square.
class PlaneFits {
  public:
    struct Plane {
        Eigen::Vector3d normal; ///< in camera space, towards the camera
        double rms;             ///< of inverse depth, of the plane's own
        double tilt;            ///< standard error of the normal, radians
    };

    PlaneFits(const cv::Mat1f& z_m, const Pinhole& camera)
        : camera_(camera), width_(z_m.cols + 1), sums_(static_cast<std::size_t>(width_) * (z_m.rows + 1)) {
        for (int v = 0; v < z_m.rows; ++v) {
            Sums row{};
            for (int u = 0; u < z_m.cols; ++u) {
                if (const double z = static_cast<double>(z_m(v, u)); z > 0 && std::isfinite(z)) {
                    const double x = u - camera.cx, y = v - camera.cy, w = 1 / z;
                    const std::array<double, 10> terms{1, x, y, x * x, x * y, y * y, w, w * x, w * y, w * w};
                    for (std::size_t k = 0; k < terms.size(); ++k)
                        row[k] += terms[k];
                }
                for (std::size_t k = 0; k < row.size(); ++k)
                    at(u + 1, v + 1)[k] = at(u + 1, v)[k] + row[k];
            }
        }
    }

    /// Of the pixels at most `reach` away; nothing at the image's border and where depth has holes.
    [[nodiscard]] std::optional<Plane> around(int u, int v, int reach) const {
        const int left = u - reach, top = v - reach, right = u + reach + 1, bottom = v + reach + 1;
        if (left < 0 || top < 0 || right >= width_ || static_cast<std::size_t>(bottom) * width_ >= sums_.size())
            return std::nullopt;
        Sums s;
        for (std::size_t k = 0; k < s.size(); ++k)
            s[k] = at(right, bottom)[k] - at(left, bottom)[k] - at(right, top)[k] + at(left, top)[k];
        const double n = s[0], side = 2 * reach + 1;
        if (n < 0.95 * side * side)
            return std::nullopt;
        const double x = s[1] / n, y = s[2] / n, w = s[6] / n;
        const double xx = s[3] / n - x * x, xy = s[4] / n - x * y, yy = s[5] / n - y * y;
        const double wx = s[7] / n - w * x, wy = s[8] / n - w * y, ww = s[9] / n - w * w;
        const double det = xx * yy - xy * xy;
        if (!(det > 1e-9))
            return std::nullopt;
        const double a = (wx * yy - wy * xy) / det, b = (wy * xx - wx * xy) / det, c = w - a * x - b * y;
        // n . ray = w, and the ray of a pixel is (x / fx, y / fy, 1).
        const Eigen::Vector3d scaled(a * camera_.fx, b * camera_.fy, c);
        const double rms = std::sqrt(std::max(0.0, ww - a * wx - b * wy)), length = scaled.norm();
        return Plane{-scaled / length, rms / w, rms * camera_.fx / std::sqrt(n * std::min(xx, yy)) / length};
    }

  private:
    using Sums = std::array<double, 10>;
    [[nodiscard]] const Sums& at(int u, int v) const { return sums_[static_cast<std::size_t>(v) * width_ + u]; }
    [[nodiscard]] Sums& at(int u, int v) { return sums_[static_cast<std::size_t>(v) * width_ + u]; }

    Pinhole camera_;
    int width_;
    std::vector<Sums> sums_;
};

constexpr int nearest_reach = 3; // pixels

/// What the smallest squares leave in the median: a camera's noise, or the bend of exact depth. Not less than a share
/// of depth that no light tells.
double usual_rms(const PlaneFits& fits, cv::Size size) {
    constexpr int every = 4;
    constexpr double least = 5e-4;
    std::vector<double> all;
    for (int v = 0; v < size.height; v += every)
        for (int u = 0; u < size.width; u += every)
            if (const auto plane = fits.around(u, v, nearest_reach))
                all.push_back(plane->rms);
    return std::max(least, median(all, 0.0));
}

/// The normal of the widest square around a pixel that is as flat as the smallest; nothing where that is not flat or
/// noise may turn it by more than light tells. Errors of normals make a direct light look weaker, then like none.
std::optional<Eigen::Vector3d> sure_normal(const PlaneFits& fits, int u, int v, double usual) {
    constexpr double most_tilt = 2 * std::numbers::pi / 180;
    constexpr double correlated = 3; // neighbours err alike, which widens a fit's standard error
    std::optional<PlaneFits::Plane> best = fits.around(u, v, nearest_reach);
    if (!best || best->rms > 3 * usual)
        return std::nullopt;
    const double most = 1.3 * std::max(best->rms, usual);
    for (const int reach : {5, 8, 12, 18}) {
        const auto wider = fits.around(u, v, reach);
        if (!wider || wider->rms > most)
            break;
        best = wider;
    }
    if (correlated * best->tilt > most_tilt)
        return std::nullopt;
    return best->normal;
}

/// Darker values have few steps, brighter ones may be clipped.
bool is_exposed(const cv::Vec3b& colour) {
    constexpr uchar darkest = 24, brightest = 242;
    return std::ranges::all_of(colour.val, [](uchar c) { return c >= darkest && c <= brightest; });
}

Eigen::Vector3d linear(const cv::Vec3b& stored) {
    return {linear_from_srgb(stored[2] / 255.0), linear_from_srgb(stored[1] / 255.0),
            linear_from_srgb(stored[0] / 255.0)};
}

shared::vec3 as_shared(const Eigen::Vector3d& v) {
    return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

} // namespace

shared::LightConstants Light::on_gpu(const Eigen::Matrix3d& world_from_camera) const {
    const Eigen::Matrix3d camera_from_light =
        in_world ? Eigen::Matrix3d(world_from_camera.transpose()) : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
    return {as_shared(camera_from_light * direct), as_shared(tint), as_shared(camera_from_light * gradient),
            static_cast<float>(power), shadows ? 1 : 0};
}

void LightSamples::add(const LightFrame& frame) {
    const cv::Mat1f& z_m = frame.depth.z_m;
    if (frame.visibility.size() != z_m.size() || frame.colour.size() != z_m.size() ||
        frame.normals.normals.size() != z_m.size())
        throw Error("the light of a frame needs depth, normals, visibility and colour of one size");
    constexpr int visibilities = 8;
    constexpr double grazing = 0.2, darkest = 0.05;
    const Eigen::Matrix3d turn =
        in_world_ ? Eigen::Matrix3d(frame.world_from_camera.linear()) : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
    const int index = static_cast<int>(frames_.size());
    std::map<int, std::vector<std::pair<std::uint32_t, LightSample>>> bins;
    const PlaneFits fits(z_m, frame.depth.camera);
    const double usual = usual_rms(fits, z_m.size());
    // Every so many pixels: there are many more of them than samples.
    const int step = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(z_m.total()) / 60000)));
    for (int v = 0; v < z_m.rows; v += step)
        for (int u = 0; u < z_m.cols; u += step) {
            const double visible = static_cast<double>(frame.visibility(v, u));
            if (!(z_m(v, u) > 0) || !(visible >= darkest) || !is_exposed(frame.colour(v, u)) ||
                (!frame.colour_known.empty() && frame.colour_known(v, u) == 0))
                continue;
            const std::optional<Eigen::Vector3d> normal = sure_normal(fits, u, v, usual);
            if (!normal || !(-normal->dot(frame.depth.camera.ray(u, v).normalized()) > grazing))
                continue;
            LightSample sample{turn * *normal, linear(frame.colour(v, u)), std::min(visible, 1.0), index, u, v, -1};
            const int bin =
                bin_of(sample.normal) * visibilities + std::min(visibilities - 1, static_cast<int>(visible * 8));
            bins[bin].emplace_back(hash(static_cast<std::uint32_t>(v * z_m.cols + u), 17U), sample);
        }
    // Each bin's in the order of their hashes, the bins in turns: else floors would outvote everything.
    for (auto& [bin, members] : bins)
        std::ranges::sort(members, {}, [](const auto& each) { return each.first; });
    std::size_t taken = 0;
    for (std::size_t rank = 0; taken < per_frame_; ++rank) {
        const std::size_t before = taken;
        for (const auto& [bin, members] : bins)
            if (rank < members.size() && taken < per_frame_) {
                samples_.push_back(members[rank].second);
                ++taken;
            }
        if (taken == before)
            break;
    }
    frames_.push_back({frame.depth.camera, z_m.clone(), frame.world_from_camera});
}

Eigen::Vector3d LightSamples::place(const LightSample& sample) const {
    const Kept& frame = frames_[static_cast<std::size_t>(sample.frame)];
    const double z = static_cast<double>(frame.z_m(sample.v, sample.u));
    const Eigen::Vector3d seen = frame.camera.ray(sample.u, sample.v) * z;
    return in_world_ ? frame.world_from_camera * seen : seen;
}

/// Samples within a cube of half a metre whose chromaticities are alike. Without a world, cubes are those of a frame. A
/// chromaticity begins a new group if it is not near one already there, so that no border cuts through a wall's noise.
void LightSamples::group() {
    constexpr double side_m = 1, alike = 0.1;
    constexpr int fewest = 15;
    struct Group {
        Eigen::Vector2d chromaticity;
        std::vector<std::size_t> members;
    };
    std::map<std::array<int, 4>, std::vector<Group>> cubes;
    for (std::size_t i = 0; i < samples_.size(); ++i) {
        const LightSample& sample = samples_[i];
        const Eigen::Vector3d at = place(sample) / side_m;
        const auto floored = [](double x) { return static_cast<int>(std::clamp(std::floor(x), -1e6, 1e6)); };
        std::vector<Group>& groups =
            cubes[{in_world_ ? -1 : sample.frame, floored(at.x()), floored(at.y()), floored(at.z())}];
        const Eigen::Vector2d chromaticity(std::log(sample.colour.x() / sample.colour.y()),
                                           std::log(sample.colour.z() / sample.colour.y()));
        const auto distance = [&](const Group& group) { return (group.chromaticity - chromaticity).norm(); };
        const auto nearest = std::ranges::min_element(groups, {}, distance);
        if (nearest != groups.end() && distance(*nearest) < alike)
            nearest->members.push_back(i);
        else
            groups.push_back({chromaticity, {i}});
    }
    albedos_ = 0;
    for (const auto& [cube, groups] : cubes)
        for (const Group& group : groups) {
            std::vector<int> bins;
            double least = 1, most = 0;
            for (const std::size_t i : group.members) {
                bins.push_back(bin_of(samples_[i].normal));
                least = std::min(least, samples_[i].visibility);
                most = std::max(most, samples_[i].visibility);
            }
            std::ranges::sort(bins);
            const bool one_bin = bins.front() == bins.back();
            if (static_cast<int>(group.members.size()) < fewest || (one_bin && most - least < 0.2))
                continue; // tells nothing of light
            for (const std::size_t i : group.members)
                samples_[i].albedo = albedos_;
            ++albedos_;
        }
}

Eigen::Vector3d LightSamples::forward() const {
    if (!in_world_ || frames_.empty())
        return Eigen::Vector3d::UnitZ();
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Kept& frame : frames_)
        sum += frame.world_from_camera.linear().col(2);
    return sum.norm() > 1e-9 ? Eigen::Vector3d(sum.normalized()) : Eigen::Vector3d::UnitZ();
}

double LightSamples::lit(const LightSample& sample, const Eigen::Vector3d& towards) const {
    const Kept& own = frames_[static_cast<std::size_t>(sample.frame)];
    const double z = static_cast<double>(own.z_m(sample.v, sample.u));
    const double lift = static_cast<double>(shared::shadow_bias(static_cast<float>(z)));
    const Eigen::Vector3d from = place(sample) + sample.normal * lift, ray = towards.normalized();
    if (!in_world_)
        return sees_light(own, from, ray) ? 1 : 0;
    return std::ranges::all_of(frames_, [&](const Kept& frame) { return sees_light(frame, from, ray); }) ? 1 : 0;
}

bool LightSamples::sees_light(const Kept& frame, const Eigen::Vector3d& from, const Eigen::Vector3d& ray) const {
    const Eigen::Isometry3d camera_from_light =
        in_world_ ? frame.world_from_camera.inverse() : Eigen::Isometry3d::Identity();
    const Eigen::Vector3d start = camera_from_light * from, step = camera_from_light.linear() * ray;
    for (int i = 0; i < shared::shadow_steps; ++i) {
        const Eigen::Vector3d at = start + step * static_cast<double>(shared::shadow_step(i));
        if (!(at.z() > 0.01))
            continue;
        const double u = std::round(frame.camera.fx * at.x() / at.z() + frame.camera.cx);
        const double v = std::round(frame.camera.fy * at.y() / at.z() + frame.camera.cy);
        if (!(u >= 0 && v >= 0 && u < frame.z_m.cols && v < frame.z_m.rows))
            continue; // beyond the image nothing is known: open
        const double there = static_cast<double>(frame.z_m(static_cast<int>(v), static_cast<int>(u)));
        const double behind = at.z() - there;
        if (there > 0 && behind > static_cast<double>(shared::shadow_bias(static_cast<float>(at.z()))) &&
            behind < static_cast<double>(shared::shadow_thickness))
            return false;
    }
    return true;
}

} // namespace scanshade
