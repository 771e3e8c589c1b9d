// `developers_bench flatness`: real captures have no truth, but planes do. Where nothing stands before them, they are
// open.
#include "apps/lists.h"
#include "apps/picture.h"
#include "io/images/image_file.h"
#include "projection/base/error.h"
#include "projection/base/statistics.h"
#include "tests/bench/flat_surfaces.h"
#include "tests/bench/part.h"

#include <cmath>
#include <fmt/format.h>

namespace scanshade::bench {
namespace {

namespace fs = std::filesystem;

class FlatnessPart final : public Part {
  public:
    Words words() override { return {"CAPTURE", "real captures", &captures_, 1, 1 << 20}; }

  private:
    std::vector<Parameter> rows() override {
        return {{"methods", "which methods, with commas, at their defaults", &methods_},
                {"radii", "of the methods, with commas", &radii_, "m"},
                {"frames", "how many of each capture", &frames_, "", 1, 1000},
                {"depth-noise", "as run's --depth-noise", &depth_noise_},
                {"camera", "as run's --camera, for captures without one", &camera_},
                {"draw", "folder for pictures: depth, the pixels that count, visibility", &folder_}};
    }

    int measure(const std::string& choice) override {
        gpu::Device device(choice);
        Table table({"capture", "method", "radius, m", "planes", "on planes, %", "of them open, %", "mean",
                     "lowest 5 %", "without a value, %"});
        bool any_failed = false;
        for (const std::string& path : captures_)
            try {
                measure(device, path, table);
            } catch (const Error& failure) {
                table.row({fs::path(path).filename().string(), failure.what()});
                any_failed = true;
            }
        return any_failed ? some_failed : all_well;
    }

    void measure(gpu::Device& device, const fs::path& path, Table& table) {
        TrialRequest request;
        request.frames = frames_;
        request.depth_noise = depth_noise_;
        request.capture.camera = camera_;
        request.leave_bad_out = true;
        const TrialCapture capture = load_trial(path, request);
        for (const double radius_m : numbers("radii", radii_, 0.01)) {
            const FlatSurfaces flat = flat_surfaces(capture.frames, radius_m);
            for (const std::string& method : comma_separated(methods_)) {
                Trial trial(device, {method, method, {}}, capture.noise, radius_m);
                table.row(cells(capture, flat, trial, radius_m));
            }
        }
    }

    [[nodiscard]] std::vector<std::string> cells(const TrialCapture& capture, const FlatSurfaces& flat, Trial& trial,
                                                 double radius_m) const {
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
        const auto figure = [&](double value) { return values.empty() ? "" : fmt::format("{:.3f}", value); };
        return {capture.name,
                method,
                fmt::format("{}", radius_m),
                fmt::format("{}", flat.planes),
                fmt::format("{:.0f}", 100 * on_planes / pixels),
                fmt::format("{:.0f}", 100 * open / on_planes),
                figure(sum / static_cast<double>(values.size())),
                figure(values.empty() ? 0 : quantile(values, 0.05)),
                fmt::format("{:.2f}", 100 * missing / on_planes)};
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

    std::vector<std::string> captures_;
    std::string methods_ = "cacao,surfel,gtao,hbao", radii_ = "0.5,0.15", depth_noise_ = "auto", camera_, folder_;
    int frames_ = 5;
};

} // namespace

std::unique_ptr<Command> flatness_part() { return std::make_unique<FlatnessPart>(); }

} // namespace scanshade::bench
