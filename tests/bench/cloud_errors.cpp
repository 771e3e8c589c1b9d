// `developers_bench cloud-errors`: whether the points of clouds err as much as expected; fits what is expected.
//
// Clouds of each scene come in all combinations of the settings, like those of `developers_bench clouds`.
#include "ao/cloud/cloud_ao.h"
#include "apps/lists.h"
#include "apps/scenes/places/scenes.h"
#include "apps/scenes/scanner.h"
#include "io/output_file.h"
#include "projection/base/statistics.h"
#include "tests/bench/cloud_error_fit.h"
#include "tests/bench/error_fit.h"
#include "tests/bench/part.h"

#include <cmath>
#include <cstdio>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <map>
#include <string>
#include <tbb/parallel_for.h>
#include <vector>

namespace scanshade::bench {
namespace {

using Eigen::Vector3d;

/// One cloud: how it was made, and its RMS expected and found.
struct CloudSum {
    double expected = 0, found = 0;
};

class CloudErrorsFitted final : public Part {
  public:
    Words words() override { return {"SCENE", "generated scenes", &scenes_, 1, 1 << 20}; }

  private:
    std::vector<Parameter> rows() override {
        return {{"points", "how many points, with commas", &points_},
                {"stations", "scanned from so many places, with commas; 0 = even density", &stations_},
                {"radii", "in radii of the scene, with commas", &radii_},
                {"noises", "sigmas of the points along their normals, with commas", &noises_, "m"},
                {"normals", "any of recorded,none: what the points come with", &normals_},
                {"judged", "points of each cloud, about", &judged_, "", 100, 1000000},
                {"fit", "file for tables fitted to these scenes, as ao/cloud/expected_errors.txt is", &fit_},
                {"each-scene-left-out", "judges every scene by tables fitted to the others", &each_left_out_}};
    }

    int measure(const std::string&) override {
        const std::vector<std::string>& names = scenes_;
        std::vector<CloudErrorSample> samples;
        for (std::size_t scene = 0; scene < names.size(); ++scene) {
            fmt::print(stderr, "{} ...\n", names[scene]);
            measure(scene::World(scene::scene_named(names[scene])), static_cast<int>(scene), samples);
        }
        CloudErrorTables own = shipped_cloud_errors();
        if (!fit_.empty()) {
            own = fitted_cloud_errors(samples);
            own.made_by =
                fmt::format("developers_bench cloud-errors {} --points {} --stations {} --radii {} --noises {} "
                            "--normals {} --judged {} --fit FILE",
                            fmt::join(scenes_, " "), points_, stations_, radii_, noises_, normals_, judged_);
            write_atomically(fit_, text_of(own));
        }
        std::vector<CloudErrorTables> by_scene(names.size(), own);
        if (each_left_out_)
            tbb::parallel_for(std::size_t(0), names.size(), [&](std::size_t scene) {
                by_scene[scene] = fitted_cloud_errors(samples, static_cast<int>(scene));
            });
        tell(names, samples, by_scene);
        return all_well;
    }

    void measure(const scene::World& world, int scene, std::vector<CloudErrorSample>& samples) {
        for (const int points : whole_numbers("points", points_, 200))
            for (const int stations : whole_numbers("stations", stations_, 0))
                for (const double times : numbers("radii", radii_, 0.01)) {
                    const double radius = times * world.scene().ao_radius_m;
                    std::vector<float> truth; // noise does not change what is true
                    std::size_t step = 1;
                    for (const double noise : numbers("noises", noises_, 0)) {
                        const auto cloud = scene::scanned_cloud(world, static_cast<std::size_t>(points),
                                                                {.stations = stations, .noise_m = noise});
                        if (truth.empty()) {
                            step = std::max<std::size_t>(1, cloud.points.size() / static_cast<std::size_t>(judged_));
                            truth = scene::true_visibility(world, cloud, {radius, 1024, 1, false}, step);
                        }
                        for (const std::string& kind : comma_separated(normals_))
                            add(samples, cloud, truth, step, radius, kind, scene);
                    }
                }
    }

    void add(std::vector<CloudErrorSample>& samples, const scene::SceneCloud& cloud, const std::vector<float>& truth,
             std::size_t step, double radius, const std::string& kind, int scene) {
        if (kind != "recorded" && kind != "none")
            throw Misuse(fmt::format("--normals: '{}' given, expected recorded or none", kind));
        PointSet set{cloud.points};
        if (kind == "recorded")
            set.normals = cloud.normals;
        CloudAo method({.radius = radius, .keep_signs = true});
        const PointVisibility found = method.compute(set);
        for (std::size_t i = 0; i < truth.size(); i += step) {
            const float off = found.visibility[i] - truth[i];
            if (std::isnan(off))
                continue;
            const bool turned = found.normals[i].cast<double>().dot(cloud.normals[i]) < 0;
            samples.push_back({method.signs()[i], off * off, kind == "none" && turned, scene, clouds_});
        }
        ++clouds_;
    }

    static void tell(const std::vector<std::string>& names, const std::vector<CloudErrorSample>& samples,
                     const std::vector<CloudErrorTables>& by_scene) {
        std::vector<std::pair<std::string, Calibration>> rows;
        for (const std::string& name : names)
            rows.emplace_back(name, Calibration());
        for (const char* name : {"all", "checked", "unchecked", "recorded normals", "no normals", "unknown sides"})
            rows.emplace_back(name, Calibration());
        std::map<int, CloudSum> clouds;
        for (const CloudErrorSample& sample : samples) {
            const auto scene = static_cast<std::size_t>(sample.scene);
            const float expected = expected_error(sample.signs, by_scene[scene]);
            const bool recorded = sample.signs.side > 1, checked = !std::isnan(sample.signs.repeat);
            const auto add = [&](std::size_t row) { rows[row].second.add(expected, sample.square); };
            add(scene);
            add(names.size());
            add(names.size() + (checked ? 1 : 2));
            add(names.size() + (recorded ? 3 : 4));
            if (sample.signs.side < 0.01F)
                add(names.size() + 5);
            CloudSum& cloud = clouds[sample.cloud];
            cloud.expected += static_cast<double>(expected * expected);
            cloud.found += static_cast<double>(sample.square);
        }
        Table table({"points", "an eighth of them each, by expected error: expected/found", "all"});
        for (auto& [name, calibration] : rows)
            if (calibration.whole().found > 0)
                table.row({name, text_of_bins(calibration), text_of(calibration.whole())});
        std::vector<double> times;
        std::size_t near = 0;
        for (const auto& [number, cloud] : clouds) {
            times.push_back(std::sqrt(cloud.found / cloud.expected));
            near += times.back() < 1.5 && times.back() > 1 / 1.5;
        }
        fmt::print("\n{} of {} clouds err by what is expected within a factor of 1.5; nine of ten by at most {:.2f} "
                   "times.\n",
                   near, clouds.size(), quantile(times, 0.9));
    }

    std::vector<std::string> scenes_;
    std::string points_ = "60000,15000", stations_ = "0,6", radii_ = "1,6", noises_ = "0,0.003,0.01",
                normals_ = "recorded,none", fit_;
    int judged_ = 4000, clouds_ = 0;
    bool each_left_out_ = false;
};

} // namespace

std::unique_ptr<Command> cloud_errors_part() { return std::make_unique<CloudErrorsFitted>(); }

} // namespace scanshade::bench
