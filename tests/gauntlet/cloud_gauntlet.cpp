// Clouds, real and generated, each perturbed in every way of a table: where is the result wrong without a word?
#include "ao/cloud/extent.h"
#include "ao/gpu/device.h"
#include "ao/merged_cloud.h"
#include "apps/doubts/doubts.h"
#include "apps/frame/point_clouds.h"
#include "apps/scenes/merged_frames.h"
#include "apps/scenes/places/scenes.h"
#include "apps/scenes/scanner.h"
#include "io/captures/capture.h"
#include "io/clouds/cloud_file.h"
#include "projection/base/error.h"
#include "projection/base/stopwatch.h"
#include "tests/gauntlet/check_rows.h"
#include "tests/gauntlet/perturb.h"
#include "tests/support/data.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fmt/format.h>
#include <limits>

namespace scanshade::gauntlet {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d, Eigen::Vector3f;

constexpr std::size_t most_points = 150000; ///< of real clouds; larger ones are thinned
constexpr std::size_t generated_points = 100000, merged_points = 200000;
constexpr double largest_rms = 0.1, largest_share = 0.1; ///< beyond which a result is wrong
constexpr double hardly_any_rms = 0.03;                  ///< sides, or errors, that change so little do not matter
constexpr double stated_enough = 1.33;                   ///< of the stated error: an error found up to that was told

/// A result, with the reasons to doubt it that `run` would give.
struct Result {
    PointVisibility found;
    Findings findings;
    double seconds = 0;
};

/// As the walk computes it with default settings; a radius of 0 is the automatic one.
Result result_of(const TestCloud& test, double radius) {
    const Stopwatch stopwatch;
    Result result;
    const MergedImages images{[]() -> gpu::Device& {
        static gpu::Device device;
        return device;
    }};
    result.found = MergedCloudAo({.radius = radius}, nullptr, images)
                       .compute({test.points, test.normals, {}, test.z_up}, test.scanner);
    result.seconds = stopwatch.ms() / 1000;
    Frame frame;
    frame.cloud = Cloud{{static_cast<int>(test.points.size()), 1}, test.points, {}, test.records};
    const double coverage = attached_points(*frame.cloud, result.found.visibility).coverage;
    result.findings = result.found.findings;
    std::ranges::copy(findings_about({frame, {}, 1, coverage, {}, {}, &result.found}, result.found.radius),
                      std::back_inserter(result.findings));
    return result;
}

/// What is compared: values and normals of the unperturbed cloud's points, found or true.
struct Reference {
    std::vector<float> visibility;
    std::vector<Vector3d> normals;
};

struct References {
    Reference plain;                ///< the unperturbed result
    std::optional<Reference> truth; ///< of generated clouds
    double error = 0;               ///< of the unperturbed result, RMS, where the truth is known
};

struct Difference {
    double rms = std::numeric_limits<double>::quiet_NaN(); ///< of visibility
    double expected = 0;                                   ///< the error that the result states, RMS, of these points
    double other_side = 0;                                 ///< share of the normals
};

/// On the points that both have. Planes more than 60 degrees apart are different planes, not sides.
Difference difference(const Perturbed& perturbed, const PointVisibility& found, const Reference& reference) {
    double squares = 0, stated = 0, values = 0, opposed = 0, normals = 0;
    for (std::size_t i = 0; i < perturbed.original.size(); ++i) {
        const std::uint32_t there = perturbed.original[i];
        if (there == Perturbed::none)
            continue;
        if (const auto off = static_cast<double>(found.visibility[i] - reference.visibility[there]); !std::isnan(off)) {
            squares += off * off;
            stated += static_cast<double>(found.error[i] * found.error[i]);
            values += 1;
        }
        const double alike = (perturbed.turned * reference.normals[there]).dot(found.normals[i].cast<double>());
        normals += std::abs(alike) > 0.5;
        opposed += alike < -0.5;
    }
    return {std::sqrt(squares / values), std::sqrt(stated / values), opposed / std::max(normals, 1.0)};
}

double rms_between(const std::vector<float>& some, const std::vector<float>& others) {
    double squares = 0, values = 0;
    for (std::size_t i = 0; i < some.size(); ++i)
        if (const auto off = static_cast<double>(some[i] - others[i]); !std::isnan(off)) {
            squares += off * off;
            values += 1;
        }
    return std::sqrt(squares / values);
}

double rms_of(const std::vector<float>& errors) { return rms_between(errors, std::vector<float>(errors.size())); }

std::vector<Vector3d> as_doubles(const std::vector<Vector3f>& normals) {
    std::vector<Vector3d> same;
    for (const Vector3f& normal : normals)
        same.push_back(normal.cast<double>());
    return same;
}

/// Runs clouds and prints a line for each row.
class Gauntlet {
  public:
    explicit Gauntlet(std::vector<std::string> words) : words_(std::move(words)) {
        fmt::print("{:<36} {:<16} {:>6} {:>6} {:>7} {:>6} {:>7} {:>6}  {}\n", "cloud", "perturbation", "rms", "stated",
                   "sides %", "rmse", "wrong %", "s", "status");
    }

    [[nodiscard]] bool wants(const std::string& name) const {
        return words_.empty() || std::ranges::any_of(words_, [&](const std::string& word) {
                   return name.find(word) != std::string::npos;
               });
    }

    /// `truth_of` gives the true values and normals for a radius; null where nobody knows them.
    void run(const TestCloud& cloud, const std::function<Reference(double)>& truth_of = nullptr) {
        const Result plain = result_of(cloud, 0);
        const References references = references_of(plain, truth_of);
        const bool as_stated =
            references.error <= std::max(largest_rms, stated_enough * rms_of(plain.found.error)) || !truth_of;
        write_checks(cloud.name, "", as_stated ? RowKind::valid : RowKind::wrong, plain.findings);
        std::vector<Vector3d> finite;
        std::ranges::copy_if(cloud.points, std::back_inserter(finite), [](const auto& p) { return p.allFinite(); });
        const Known known{plain.found.spacing, extent_of(finite).size,
                          cloud.normals.empty() ? references.plain.normals : cloud.normals};
        const bool sides_tell = sides_tell_themselves(cloud);
        for (const Perturbation& perturbation : perturbations()) {
            if ((perturbation.recorded_only && cloud.normals.empty()) || (perturbation.turns_all && !sides_tell) ||
                (perturbation.normals && any_doubt(plain.findings)))
                continue;
            const Perturbed changed = perturbed(cloud, perturbation, known);
            const Result result = result_of(changed.cloud, 0);
            const double radius = result.found.radius;
            if (perturbation.other_density && std::abs(radius / plain.found.radius - 1) > 0.02)
                print(changed, perturbation, result, references_of(result_of(cloud, radius), truth_of));
            else
                print(changed, perturbation, result, references);
        }
    }

    void not_read(const std::string& name, const std::string& why) { fmt::print("{:<36} not read: {}\n", name, why); }

    /// The rows that are wrong without a word. Returns whether there are any.
    bool silently_wrong() const {
        fmt::print("\n{} of {} rows are silently wrong:\n", wrong_.size(), rows_);
        for (const std::string& row : wrong_)
            fmt::print("{}\n", row);
        return !wrong_.empty();
    }

  private:
    /// Where both sides explain a cloud, recorded normals are believed, and rightly so.
    static bool sides_tell_themselves(TestCloud cloud) {
        cloud.normals.clear();
        return !any_doubt(result_of(cloud, 0).findings);
    }

    static References references_of(const Result& plain, const std::function<Reference(double)>& truth_of) {
        References references{{plain.found.visibility, as_doubles(plain.found.normals)}, std::nullopt};
        if (truth_of) {
            references.truth = truth_of(plain.found.radius);
            references.error = rms_between(plain.found.visibility, references.truth->visibility);
        }
        return references;
    }

    void print(const Perturbed& changed, const Perturbation& perturbation, const Result& result,
               const References& references) {
        const std::optional<Reference>& truth = references.truth;
        const Difference off = difference(changed, result.found, references.plain);
        const Difference error = truth ? difference(changed, result.found, *truth) : Difference{};
        const std::string row = fmt::format(
            "{:<36} {:<16} {:>6.3f} {:>6.3f} {:>7.1f} {:>6} {:>7} {:>6.1f}  {}", changed.cloud.name, perturbation.name,
            off.rms, off.expected, 100 * off.other_side, truth ? fmt::format("{:.3f}", error.rms) : "",
            truth ? fmt::format("{:.1f}", 100 * error.other_side) : "", result.seconds,
            any_doubt(result.findings) ? "doubtful: " + doubts_in(result.findings).front() : "ok");
        fmt::print("{}\n", row);
        if (std::getenv("GAUNTLET_NOTES"))
            for (const std::string& note : result.found.notes)
                fmt::print("    {}\n", note);
        std::fflush(stdout);
        ++rows_;
        // What comes no farther from the truth is not wrong, however it differs. An error that was stated is not
        // silent.
        const Difference& judged = truth ? error : off;
        const bool moved = !(off.rms <= largest_rms) && (!truth || error.rms > references.error + hardly_any_rms) &&
                           !(judged.rms <= stated_enough * judged.expected);
        const bool turned = off.other_side > largest_share && off.rms > hardly_any_rms;
        const bool wrong = moved || turned || error.other_side > largest_share;
        write_checks(changed.cloud.name, std::string(perturbation.name), wrong ? RowKind::wrong : RowKind::harmless,
                     result.findings);
        if (wrong && !any_doubt(result.findings))
            wrong_.push_back(row);
    }

    std::vector<std::string> words_, wrong_;
    std::size_t rows_ = 0;
};

void run_generated(Gauntlet& gauntlet, const std::string& name, const char* scene,
                   const std::function<scene::SceneCloud(const scene::World&)>& make) {
    if (!gauntlet.wants(name))
        return;
    const scene::World world(scene::scene_named(scene));
    const scene::SceneCloud made = make(world);
    gauntlet.run({.name = name, .points = made.points, .normals = made.normals}, [&](double radius) {
        return Reference{scene::true_visibility(world, made, {.radius_m = radius, .rays = 256}, 4), made.normals};
    });
}

void run_scanned(Gauntlet& gauntlet) {
    for (const char* scene : {"office", "thin", "staircase", "outdoor"})
        for (const int stations : {0, 6})
            run_generated(gauntlet, fmt::format("{}, {}", scene, stations ? "6 stations" : "even"), scene,
                          [&](const scene::World& world) {
                              return scene::scanned_cloud(world, generated_points, {.stations = stations});
                          });
}

void run_merged(Gauntlet& gauntlet) {
    for (const char* scene : {"office", "thin", "staircase", "library"})
        for (const char* sensor : {"kinect", "tof"})
            for (const bool shuffled : {false, true})
                run_generated(gauntlet, fmt::format("{}, {} frames{}", scene, sensor, shuffled ? ", shuffled" : ""),
                              scene, [&](const scene::World& world) {
                                  return scene::merged_frames(world, merged_points,
                                                              {.sensor = sensor, .shuffled = shuffled});
                              });
}

/// A cloud as the walk reads it; nothing where the file holds a depth image.
std::optional<TestCloud> read(const fs::path& file, const std::string& name) {
    const Frame frame = open_capture(file).load(0, false);
    if (!frame.cloud)
        return std::nullopt;
    TestCloud cloud{.name = name,
                    .points = frame.cloud->points,
                    .normals = recorded_normals(*frame.cloud),
                    .z_up = z_is_up(*frame.cloud),
                    .records = frame.cloud->records};
    if (frame.world_from_camera)
        cloud.scanner = frame.world_from_camera->translation();
    return cloud.points.size() > most_points ? thinned(cloud, most_points) : cloud;
}

void run_real(Gauntlet& gauntlet, const fs::path& data) {
    const std::vector<fs::path> endings{".pcd", ".ply", ".las", ".laz", ".ptx", ".bin", ".e57", ".pclzf"};
    for (const char* folder : {"unorganised", "organised", "las", "terrain_utm", "lidar_kitti", "pclzf", "e57"}) {
        std::vector<fs::path> files;
        if (fs::is_directory(data / folder))
            for (const auto& entry : fs::directory_iterator(data / folder))
                if (std::ranges::find(endings, entry.path().extension()) != endings.end())
                    files.push_back(entry.path());
        std::ranges::sort(files);
        for (const fs::path& file : files) {
            const std::string name = fmt::format("{}/{}", folder, file.filename().string());
            if (!gauntlet.wants(name))
                continue;
            try {
                if (const auto cloud = read(file, name))
                    gauntlet.run(*cloud);
                else
                    gauntlet.not_read(name, "a depth image");
            } catch (const Error& failure) {
                gauntlet.not_read(name, failure.what());
            }
        }
    }
}

} // namespace
} // namespace scanshade::gauntlet

/// Arguments: words, one of which the clouds' names must contain. Exit code: 0 = no row is silently wrong, 1 = some
/// are.
int main(int count, char** arguments) {
    using namespace scanshade::gauntlet;
    Gauntlet gauntlet({arguments + 1, arguments + count});
    run_scanned(gauntlet);
    run_merged(gauntlet);
    run_real(gauntlet, scanshade::tests::data_folder());
    return gauntlet.silently_wrong() ? 1 : 0;
}
