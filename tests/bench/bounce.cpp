// `developers_bench bounce`: the light that neighbours send (--write indirect), against one bounce of rays.
#include "ao/finish/finish.h"
#include "apps/budget/trial.h"
#include "apps/lists.h"
#include "apps/scenes/generate.h"
#include "apps/scenes/places/scenes.h"
#include "apps/scenes/sensor.h"
#include "apps/scenes/world/light.h"
#include "projection/base/error.h"
#include "projection/srgb.h"
#include "tests/bench/part.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <iterator>
#include <limits>
#include <utility>
#include <vector>

namespace scanshade::bench {
namespace {

/// Sums of linear light, found and true, of all channels of all pixels.
class Comparison {
  public:
    void add(const cv::Mat3f& found, const cv::Mat3f& truth, const cv::Mat1f& known) {
        for (int v = 0; v < found.rows; ++v)
            for (int u = 0; u < found.cols; ++u)
                for (int c = 0; c < 3 && !std::isnan(known(v, u)); ++c)
                    add(static_cast<double>(found(v, u)[c]), static_cast<double>(truth(v, u)[c]));
    }
    /// "RMSE, bias, correlation, scale"; the last is the truth's slope over what was found.
    [[nodiscard]] std::string text() const {
        const double xx = xx_ - x_ * x_ / n_, yy = yy_ - y_ * y_ / n_, xy = xy_ - x_ * y_ / n_;
        const double rmse = std::sqrt(std::max(xx_ - 2 * xy_ + yy_, 0.0) / n_);
        if (xx_ <= 0)
            return fmt::format("{:.4f}, {:+.4f}", rmse, (x_ - y_) / n_);
        return fmt::format("{:.4f}, {:+.4f}, {:.2f}, {:.2f}", rmse, (x_ - y_) / n_, xy / std::sqrt(xx * yy), xy_ / xx_);
    }

  private:
    void add(double found, double truth) {
        n_ += 1;
        x_ += found;
        y_ += truth;
        xx_ += found * found;
        yy_ += truth * truth;
        xy_ += found * truth;
    }
    double n_ = 0, x_ = 0, y_ = 0, xx_ = 0, yy_ = 0, xy_ = 0;
};

struct Shot {
    DepthImage depth;
    cv::Mat3b photograph;
    scene::Bounce truth; ///< blue first, as pictures
};

class BouncePart final : public Part {
    std::vector<Parameter> rows() override {
        return {{"scenes", "which, with commas", &scenes_},
                {"sensors", "which simulated sensors, with commas", &sensors_},
                {"methods", "that compute visibility, at their defaults, with commas", &methods_},
                {"frames", "of each", &frames_, "", 1, 100},
                {"size", "of images", &size_, "pixels"},
                {"rays", "of the truth, per pixel", &rays_, "", 1, 65536}};
    }

    int measure(const std::string& choice) override {
        gpu::Device device(choice);
        const std::vector<std::string> methods = comma_separated(methods_);
        fmt::print("Linear light, 0 .. 1: RMSE, bias, correlation, best factor; {} frames of {}, {} rays a pixel\n",
                   frames_, size_, rays_);
        std::vector<std::string> heads{
            "scene", "sensor", "light", "none", "own colour times 1 - V", "with true visibility"};
        std::ranges::copy(methods, std::back_inserter(heads));
        Table table(heads);
        for (const std::string& name : comma_separated(scenes_))
            for (const std::string& sensor : comma_separated(sensors_))
                for (const scene::LightKind kind : {scene::LightKind::ambient, scene::LightKind::sun})
                    table.row(cells(device, name, sensor, kind));
        return all_well;
    }

    [[nodiscard]] std::vector<std::string> cells(gpu::Device& device, const std::string& name,
                                                 const std::string& sensor, scene::LightKind kind) const {
        const scene::Scene& scene = scene::scene_named(name);
        const scene::World world(scene);
        const Pinhole camera = camera_of_size(parsed_size(size_, "size"));
        const scene::Optics optics(camera);
        std::vector<Shot> shots;
        std::vector<DepthImage> recorded;
        const scene::SceneLight light{.kind = kind, .occluded = false};
        for (int i = 0; i < frames_; ++i) {
            const Eigen::Isometry3d pose =
                scene::world_from_camera(scene.walk, (i + 0.5) * scene.walk.period_s / frames_);
            const Sight sight{world, optics, pose, render_geometry(world, optics, pose), 1, i};
            Shot& shot = shots.emplace_back();
            shot.depth = {camera, sensor_named(sensor).record(sight), {}};
            shot.photograph = scene::photograph(render_lit(world, optics, pose, light), {});
            shot.truth = true_bounce(world, optics, pose, light, {scene.ao_radius_m, rays_, 1, false});
            for (cv::Vec3f& pixel : shot.truth.indirect)
                std::swap(pixel[0], pixel[2]);
            recorded.push_back(shot.depth);
        }
        const DepthNoise noise = measure_noise(recorded);
        Finish finish(device, Packing::on_device);
        const auto indirect = [&](const Shot& shot, const cv::Mat1f& visibility, const FrameAo* method) {
            const FinishInput input{.camera = camera,
                                    .z_m = shot.depth.z_m,
                                    .visibility = visibility,
                                    .fitted = method ? method->fitted_depth() : nullptr,
                                    .fitted_normals = method ? method->fitted_normals() : nullptr,
                                    .radius_m = scene.ao_radius_m,
                                    .noise = noise,
                                    .colour = shot.photograph};
            return finish.compute(input, {.indirect = true, .light_values = LightValues::unbounded}).linear.indirect;
        };
        Comparison none, own, by_truth;
        for (const Shot& shot : shots) {
            const cv::Mat1f seen = known(shot, shot.truth.visibility);
            none.add(cv::Mat3f(camera.size, cv::Vec3f()), shot.truth.indirect, seen);
            own.add(own_colour(shot), shot.truth.indirect, seen);
            by_truth.add(indirect(shot, seen, nullptr), shot.truth.indirect, seen);
        }
        std::vector<std::string> row{name,        sensor,     kind == scene::LightKind::sun ? "sun 1.5" : "ambient",
                                     none.text(), own.text(), by_truth.text()};
        for (const std::string& each : comma_separated(methods_)) {
            const MethodRow& method_row = method_named(each);
            const auto setup = set_up({each, {}, {}}, scene.ao_radius_m);
            FrameAo method(device, method_row, *setup);
            Comparison found;
            for (const Shot& shot : shots) {
                const cv::Mat1f visibility = known(shot, method.compute(shot.depth, noise).visibility);
                found.add(indirect(shot, visibility, &method), shot.truth.indirect, visibility);
            }
            row.push_back(found.text());
        }
        return row;
    }

    /// Pixels with recorded depth and a true surface.
    static cv::Mat1f known(const Shot& shot, const cv::Mat1f& visibility) {
        cv::Mat1f both = visibility.clone();
        for (int v = 0; v < both.rows; ++v)
            for (int u = 0; u < both.cols; ++u)
                if (!(shot.depth.z_m(v, u) > 0) || std::isnan(shot.truth.visibility(v, u)))
                    both(v, u) = std::numeric_limits<float>::quiet_NaN();
        return both;
    }

    /// As if all surfaces had the pixel's own colour.
    static cv::Mat3f own_colour(const Shot& shot) {
        cv::Mat3f light(shot.photograph.size());
        for (int v = 0; v < light.rows; ++v)
            for (int u = 0; u < light.cols; ++u)
                for (int c = 0; c < 3; ++c)
                    light(v, u)[c] = static_cast<float>(linear_from_srgb(shot.photograph(v, u)[c] / 255.0)) *
                                     (1 - shot.truth.visibility(v, u));
        return light;
    }

    std::string scenes_ = "office,staircase,clutter,kitchen,attic", sensors_ = "ideal,kinect",
                methods_ = "ssdo,gtao,surfel", size_ = "320x240";
    int frames_ = 3, rays_ = 128;
};

} // namespace

std::unique_ptr<Command> bounce_part() { return std::make_unique<BouncePart>(); }

} // namespace scanshade::bench
