// `bench --flatness`: real captures have no truth, but planes do. Where nothing stands before them, they are open.
#include "apps/lists.h"
#include "apps/measure/parts/flat_surfaces.h"
#include "apps/measure/trials/bench_part.h"
#include "apps/picture.h"
#include "io/images/image_file.h"
#include "projection/base/error.h"
#include "projection/base/statistics.h"

#include <cmath>
#include <fmt/format.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;

class FlatnessPart final : public BenchPart {
  public:
    Stage stage() override {
        return {
            "flatness of planes in real captures",
            {{"flatness", "captures, with commas: how open their planes read where nothing stands on them", &captures_},
             {"flatness.methods", "which methods, with commas, at their defaults", &methods_},
             {"flatness.radii", "of the methods, with commas", &radii_, "m"},
             {"flatness.frames", "how many of each capture", &frames_, "", 1, 1000},
             {"flatness.depth-noise", "as run's --depth-noise", &depth_noise_},
             {"flatness.camera", "as run's --camera, for captures without one", &camera_},
             {"flatness.draw", "folder for pictures: depth, the pixels that count, visibility", &folder_}}};
    }
    [[nodiscard]] bool asked() const override { return !captures_.empty(); }

    int run(const std::string& choice) override {
        gpu::Device device(choice);
        fmt::print("| capture | method | radius, m | planes | on planes, % | of them open, % | mean | lowest 5 % | "
                   "without a value, % |\n"
                   "| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n");
        bool any_failed = false;
        for (const std::string& path : comma_separated(captures_))
            try {
                measure(device, path);
            } catch (const Error& failure) {
                fmt::print("| {} | {} |\n", fs::path(path).filename().string(), failure.what());
                any_failed = true;
            }
        return any_failed ? some_failed : all_well;
    }

  private:
    void measure(gpu::Device& device, const fs::path& path) {
        TrialRequest request;
        request.frames = frames_;
        request.depth_noise = depth_noise_;
        request.capture.camera = camera_;
        request.leave_bad_out = true;
        const TrialCapture capture = load_trial(path, request);
        for (const double radius_m : numbers("flatness.radii", radii_, 0.01)) {
            const FlatSurfaces flat = flat_surfaces(capture.frames, radius_m);
            for (const std::string& method : comma_separated(methods_)) {
                Trial trial(device, {method, method, {}}, capture.noise, radius_m);
                row(capture, flat, trial, radius_m);
            }
        }
    }

    void row(const TrialCapture& capture, const FlatSurfaces& flat, Trial& trial, double radius_m) const {
        const std::string& method = trial.configuration().method;
        std::vector<double> values;
        double pixels = 0, on_planes = 0, open = 0, missing = 0, sum = 0;
        for (std::size_t i = 0; i < capture.frames.size(); ++i) {
            const TrialFrame& frame = capture.frames[i];
            const cv::Mat1f found = trial.compute(frame);
            for (int v = 0; v < found.rows; ++v)
                for (int u = 0; u < found.cols; ++u) {
                    const uchar mark = flat.of_planes[i](v, u);
                    const float value = found(v, u);
                    pixels += frame.exact_z_m(v, u) > 0;
                    on_planes += mark > 0;
                    open += mark == 255;
                    missing += mark > 0 && std::isnan(value);
                    if (mark == 255 && !std::isnan(value))
                        values.push_back(static_cast<double>(value));
                }
            if (!folder_.empty())
                draw(fs::path(folder_) / fmt::format("{}-{}-{}-{}.png", capture.name, frame.name, method, radius_m),
                     frame, flat.of_planes[i], found);
        }
        for (const double value : values)
            sum += value;
        const std::string figures =
            values.empty()
                ? " | "
                : fmt::format("{:.3f} | {:.3f}", sum / static_cast<double>(values.size()), quantile(values, 0.05));
        fmt::print("| {} | {} | {} | {} | {:.0f} | {:.0f} | {} | {:.2f} |\n", capture.name, method, radius_m,
                   flat.planes, 100 * on_planes / pixels, 100 * open / on_planes, figures, 100 * missing / on_planes);
        std::fflush(stdout);
    }

    static void draw(const fs::path& file, const TrialFrame& frame, const cv::Mat1b& of_planes,
                     const cv::Mat1f& found) {
        fs::create_directories(file.parent_path());
        cv::Mat1f counts(of_planes.size(), 0.0F);
        counts.setTo(0.5, of_planes == 1);
        counts.setTo(1, of_planes == 255);
        write_picture(file, panel({{"depth", depth_picture(frame.exact_z_m)},
                                   {"on planes, open", visibility_picture(counts)},
                                   {"visibility", visibility_picture(found)}}));
    }

    std::string captures_, methods_ = "cacao,surfel,gtao,hbao", radii_ = "0.5,0.15", depth_noise_ = "auto", camera_,
                           folder_;
    int frames_ = 5;
};

} // namespace

std::unique_ptr<BenchPart> flatness_of_planes() { return std::make_unique<FlatnessPart>(); }

} // namespace scanshade
