// `bench --light-split`: pictures that darken ambient light alone, and colours without their shading, against the
// renderer's own, on generated scenes lit by a sun, by ambient light alone and by an overcast sky.
#include "ao/finish/finish.h"
#include "ao/light/light.h"
#include "apps/lists.h"
#include "apps/measure/trials/bench_part.h"
#include "apps/measure/trials/trial.h"
#include "apps/scenes/generate.h"
#include "apps/scenes/places/scenes.h"
#include "apps/scenes/sensor.h"
#include "apps/scenes/world/light.h"
#include "projection/base/error.h"
#include "projection/base/statistics.h"
#include "projection/base/stopwatch.h"
#include "projection/srgb.h"

#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace scanshade {
namespace {

/// Light of a stored picture, 0 .. 1, and of true light: root mean square of their difference as stored (sRGB, 0 .. 1).
class Rmse {
  public:
    void add(const cv::Mat3b& found, const cv::Mat3f& truth, const cv::Mat1f& visibility) {
        const cv::Mat3b expected = scene::stored_light(truth);
        for (int v = 0; v < found.rows; ++v)
            for (int u = 0; u < found.cols; ++u) {
                if (std::isnan(visibility(v, u)))
                    continue;
                for (int channel = 0; channel < 3; ++channel)
                    sum_ += std::pow((found(v, u)[channel] - expected(v, u)[channel]) / 255.0, 2);
                count_ += 3;
            }
    }
    [[nodiscard]] double value() const { return count_ > 0 ? std::sqrt(sum_ / count_) : 0; }

  private:
    double sum_ = 0, count_ = 0;
};

/// A frame that was rendered, and what the method makes of it.
struct LitShot {
    Eigen::Isometry3d pose;
    DepthImage depth;
    NormalImage normals;
    cv::Mat1f truth, visibility; ///< the latter as computed
    scene::LitImages lit;
    cv::Mat3b photograph;
    std::shared_ptr<const gpu::DeviceBytes> fitted, fitted_normals;
};

/// ambient * by + direct
cv::Mat3f light_of(const scene::LitImages& lit, const cv::Mat1f& visibility, int power) {
    cv::Mat3f sum = lit.direct.clone();
    for (int v = 0; v < sum.rows; ++v)
        for (int u = 0; u < sum.cols; ++u) {
            const float open = std::isnan(visibility(v, u)) ? 1 : visibility(v, u);
            sum(v, u) += static_cast<float>(std::pow(open, power)) * lit.ambient(v, u);
        }
    return sum;
}

class LightPart final : public BenchPart {
  public:
    Stage stage() override {
        return {"ambient light alone, and colours without shading",
                {{"light-split", "measures --shade ambient and --write unshaded on generated lit scenes", &asked_},
                 {"light-split.scenes", "which, with commas", &scenes_},
                 {"light-split.sensors", "which simulated sensors, with commas", &sensors_},
                 {"light-split.method", "that computes visibility, at its defaults", &method_},
                 {"light-split.suns", "estimates five suns, ambient light and an overcast sky; no pictures", &suns_},
                 {"light-split.frames", "of each", &frames_, "", 1, 100},
                 {"light-split.size", "of images", &size_, "pixels"},
                 {"light-split.rays", "of the true visibility, per pixel", &rays_, "", 1, 65536}}};
    }
    [[nodiscard]] bool asked() const override { return asked_; }

    int run(const std::string& choice) override {
        gpu::Device device(choice);
        if (suns_)
            fmt::print("| scene | sensor | light | found | direction off, degrees | direct / ambient | degrees between "
                       "halves | sure |\n| --- | --- | --- | --- | --- | --- | --- | --- |\n");
        else
            fmt::print(
                "RMSE of stored colours (0 .. 1) to the renderer's own; {} of {} frames, {}\n\n"
                "| scene | sensor | light | found | direction off, degrees | direct / ambient | share of ambient, "
                "RMSE | ambient: multiply | ambient | with true light | unshaded: as it is | divided by visibility | "
                "unshaded | ms: multiply | ambient | unshaded |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- "
                "| --- | --- | --- | --- | --- | --- | --- |\n",
                method_, frames_, size_);
        for (const std::string& name : comma_separated(scenes_))
            for (const std::string& sensor : comma_separated(sensors_))
                measure(device, name, sensor);
        return all_well;
    }

  private:
    struct Sky {
        const char* name;
        scene::SceneLight light;
    };

    static std::vector<Sky> skies() {
        using scene::LightKind;
        return {{"ambient", {.kind = LightKind::ambient}},
                {"overcast", {.kind = LightKind::overcast}},
                {"sun 0.5", {.kind = LightKind::sun, .towards = {0.45, -0.35, 0.82}, .ratio = 0.5}},
                {"sun 1.5", {.kind = LightKind::sun, .towards = {0.45, -0.35, 0.82}, .ratio = 1.5}},
                {"sun 4", {.kind = LightKind::sun, .towards = {-0.7, -0.4, 0.6}, .ratio = 4}}};
    }

    static std::vector<Sky> suns() {
        using scene::LightKind;
        std::vector<Sky> all = skies();
        all.push_back({"sun 1.5, elsewhere", {.kind = LightKind::sun, .towards = {0.2, 0.6, 0.77}, .ratio = 1.5}});
        all.push_back({"sun 2.5, elsewhere", {.kind = LightKind::sun, .towards = {-0.8, 0.5, 0.45}, .ratio = 2.5}});
        return all;
    }

    static void report_direction(const std::string& name, const std::string& sensor, const Sky& sky,
                                 const LightEstimate& found) {
        const bool has = found.light.has_direct();
        fmt::print("| {} | {} | {} | {} | {} | {} | {:.1f} | {} |\n", name, sensor, sky.name,
                   found.chosen.empty() ? "too little" : found.chosen,
                   has && sky.light.has_sun()
                       ? fmt::format("{:.1f}", degrees_between(found.light.direct, sky.light.towards))
                       : "",
                   has ? fmt::format("{:.2f}", found.light.direct.norm()) : "", found.spread_deg,
                   !has                        ? ""
                   : found.light.doubt.empty() ? "yes"
                                               : "no");
        fmt::print(stderr, "  {}\n", found.sentence);
        std::fflush(stdout);
    }

    void measure(gpu::Device& device, const std::string& name, const std::string& sensor) {
        const scene::Scene& scene = scene::scene_named(name);
        const scene::World world(scene);
        const Pinhole camera = camera_of_size(parsed_size(size_, "light-split.size"));
        const scene::Optics optics(camera);
        std::vector<LitShot> shots;
        std::vector<DepthImage> recorded;
        std::vector<scene::Geometry> exact;
        for (int i = 0; i < frames_; ++i) {
            LitShot& shot = shots.emplace_back();
            shot.pose = scene::world_from_camera(scene.walk, i * scene.walk.period_s / frames_);
            const Sight sight{world, optics, shot.pose, render_geometry(world, optics, shot.pose), 1, i};
            shot.depth = {camera, sensor_named(sensor).record(sight), {}};
            shot.truth = true_visibility(world, optics, shot.pose, {scene.ao_radius_m, rays_, 1, false}).visibility[0];
            recorded.push_back(shot.depth);
        }
        const DepthNoise noise = measure_noise(recorded);
        const MethodRow& row = method_named(method_);
        const auto setup = set_up({method_, {}, {}}, scene.ao_radius_m);
        FrameAo method(device, row, *setup);
        for (LitShot& shot : shots) {
            shot.visibility = method.compute(shot.depth, noise).visibility;
            shot.fitted = method.fitted_depth();
            shot.fitted_normals = method.fitted_normals();
            shot.normals = method.normals(shot.depth, noise);
        }
        for (const Sky& sky : suns_ ? suns() : skies()) {
            LightSamples samples(true);
            for (LitShot& shot : shots) {
                shot.lit = scene::render_lit(world, optics, shot.pose, sky.light);
                shot.photograph = scene::photograph(shot.lit, shot.truth);
                samples.add({shot.depth, shot.normals, shot.visibility, shot.photograph, {}, shot.pose});
            }
            samples.group();
            if (suns_) {
                report_direction(name, sensor, sky, estimate_light(samples));
                continue;
            }
            report(device, shots, noise, method.errors(noise), scene.ao_radius_m, name, sensor, sky,
                   estimate_light(samples));
        }
    }

    void report(gpu::Device& device, const std::vector<LitShot>& shots, const DepthNoise& noise,
                const shared::ErrorTable& errors, double radius_m, const std::string& name, const std::string& sensor,
                const Sky& sky, const LightEstimate& found) const {
        Light truth{.direct = sky.light.has_sun() ? Eigen::Vector3d(sky.light.ratio * sky.light.towards.normalized())
                                                  : Eigen::Vector3d(0, 0, 0),
                    .gradient = sky.light.gradient(),
                    .power = 1,
                    .shadows = true,
                    .in_world = true};
        Finish finish(device, Packing::on_device);
        Rmse multiply, ambient, by_truth, as_is, divided, unshaded;
        double share_squares = 0, share_count = 0;
        std::array<std::vector<double>, 3> ms;
        for (const LitShot& shot : shots) {
            FinishInput input{.camera = shot.depth.camera,
                              .z_m = shot.depth.z_m,
                              .visibility = shot.visibility,
                              .fitted = shot.fitted,
                              .fitted_normals = shot.fitted_normals,
                              .radius_m = radius_m,
                              .noise = noise,
                              .errors = errors,
                              .colour = shot.photograph};
            const auto made = [&](const FinishOutputs& outputs, std::vector<double>* times) {
                Finished result = finish.compute(input, outputs);
                if (times)
                    for (int round = 0; round < 3; ++round) {
                        const Stopwatch stopwatch;
                        result = finish.compute(input, outputs);
                        times->push_back(stopwatch.ms());
                    }
                return result;
            };
            const cv::Mat3f darker = light_of(shot.lit, shot.truth, 2), open = light_of(shot.lit, shot.truth, 0);
            multiply.add(made({.picture = true}, &ms[0]).picture, darker, shot.visibility);
            as_is.add(shot.photograph, open, shot.visibility);
            divided.add(made({.unshaded = true}, nullptr).unshaded, open, shot.visibility);
            input.shade = Shade::ambient;
            input.light = truth.on_gpu(shot.pose.linear());
            by_truth.add(made({.picture = true}, nullptr).picture, darker, shot.visibility);
            input.light = found.light.on_gpu(shot.pose.linear());
            ambient.add(made({.picture = true}, &ms[1]).picture, darker, shot.visibility);
            unshaded.add(made({.unshaded = true}, &ms[2]).unshaded, open, shot.visibility);
            const Finished parts = made({.split = true}, nullptr);
            add_shares(parts, shot, share_squares, share_count);
        }
        const bool has = found.light.has_direct();
        const std::string off = has && sky.light.has_sun()
                                    ? fmt::format("{:.1f}", degrees_between(found.light.direct, sky.light.towards))
                                    : "";
        fmt::print("| {} | {} | {} | {} | {} | {} | {:.3f} | {:.4f} | {:.4f} | {:.4f} | {:.4f} | {:.4f} | {:.4f} | "
                   "{:.1f} | {:.1f} | {:.1f} |\n",
                   name, sensor, sky.name, found.chosen.empty() ? "too little" : found.chosen, off,
                   has ? fmt::format("{:.2f}", found.light.direct.norm()) : "", std::sqrt(share_squares / share_count),
                   multiply.value(), ambient.value(), by_truth.value(), as_is.value(), divided.value(),
                   unshaded.value(), median(ms[0]), median(ms[1]), median(ms[2]));
        std::fflush(stdout);
        fmt::print(stderr, "  {}\n", found.sentence);
    }

    static double degrees_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
        return std::acos(std::clamp(a.normalized().dot(b.normalized()), -1.0, 1.0)) * 180 / std::numbers::pi;
    }

    /// Green light: that of dark pixels has no share worth the name.
    static void add_shares(const Finished& parts, const LitShot& shot, double& squares, double& count) {
        for (int v = 0; v < shot.truth.rows; ++v)
            for (int u = 0; u < shot.truth.cols; ++u) {
                if (std::isnan(shot.visibility(v, u)) || std::isnan(shot.truth(v, u)) || shot.photograph(v, u)[1] < 24)
                    continue;
                const double mine =
                    linear_from_srgb((parts.ambient.empty() ? shot.photograph(v, u) : parts.ambient(v, u))[1] / 255.0) /
                    linear_from_srgb(shot.photograph(v, u)[1] / 255.0);
                const double a = static_cast<double>(shot.lit.ambient(v, u)[1] * shot.truth(v, u)),
                             d = static_cast<double>(shot.lit.direct(v, u)[1]);
                if (a + d > 0) {
                    squares += std::pow(mine - a / (a + d), 2);
                    ++count;
                }
            }
    }

    bool asked_ = false, suns_ = false;
    std::string scenes_ = "office,staircase,columns,clutter,outdoor,thin", sensors_ = "ideal,kinect",
                method_ = "surfel", size_ = "320x240";
    int frames_ = 6, rays_ = 64;
};

} // namespace

std::unique_ptr<BenchPart> light_split() { return std::make_unique<LightPart>(); }

} // namespace scanshade
