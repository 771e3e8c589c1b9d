// `scanshade refine`: refines a camera from pictures of a board, organised clouds or a recording, with its uncertainty.
#include "apps/command.h"
#include "apps/refine/recording.h"
#include "apps/refine/report.h"
#include "apps/refine/sources.h"
#include "io/cameras/camera_file.h"
#include "io/output_file.h"
#include "projection/base/error.h"
#include "projection/base/stopwatch.h"

#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <numeric>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace calibration;

cv::Size parsed_count(const std::string& text) {
    int width = 0, height = 0;
    char rest = 0;
    if (std::sscanf(text.c_str(), "%dx%d%c", &width, &height, &rest) != 2 || width < 3 || height < 3 || width > 200 ||
        height > 200)
        throw Misuse(fmt::format(
            "board: '{}' given, expected columns x rows of the target's points, such as 9x6, each 3 .. 200", text));
    return {width, height};
}

class Refine final : public Command {
  public:
    Words words() override {
        return {"PATH", "a folder of pictures of a board (with --board), or a capture", &paths_, 1, 1};
    }

    std::vector<Stage> stages() override {
        return {
            {"target",
             {{"board", "inner corners of a chessboard, squares of a ChArUco board, circles of a grid: columns x rows",
               &board_},
              {.name = "target",
               .help = "kind of target",
               .value = &target_,
               .choices = {"chessboard", "charuco", "circles", "asymmetric-circles"}},
              {"square", "distance between corners, or between circles (25 mm: 0.025)", &square_m_, "m", 1e-6, 1},
              {"marker", "side of a ChArUco marker; 0 = three quarters of a square", &marker_m_, "m", 0, 1},
              {.name = "dictionary",
               .help = "dictionary of the ChArUco markers",
               .value = &dictionary_,
               .choices = dictionary_names()}}},
            {"recording",
             {{.name = "observations",
               .help = "tracks of points in colour images, or planes in depth images; auto = tracks where there is "
                       "colour",
               .value = &recording_.observations,
               .choices = {"auto", "tracks", "depth"}},
              {.name = "registered",
               .help =
                   "whether colour and depth pixels coincide; if not, the colour camera and its extrinsics are refined",
               .value = &recording_.registered,
               .choices = {"auto", "yes", "no"}},
              {.name = "poses",
               .help = "keep recorded poses as exact, refine them too, or ignore and estimate them; auto keeps them "
                       "unless refined poses fit clearly better",
               .value = &recording_.poses,
               .choices = {"auto", "keep", "refine", "ignore"}},
              {"frames", "most frames to use, evenly spaced", &recording_.frames, "", 3, 1000},
              {"depth-scale", "mm, tum, sun, nyu, m, or units per metre; replaces the capture's own", &depth_scale_}}},
            {"camera",
             {{"camera",
               "first camera: a file, fx,fy,cx,cy, or the name of a known one; default: the capture's own, EXIF, or a "
               "guess",
               &first_.camera},
              {"colour-camera", "first camera of the secondary colour camera, where colour is not registered",
               &first_.colour_camera},
              {"fov", "first camera: horizontal field of view; 0 = not known", &first_.fov_degrees, "degrees", 0, 175},
              {.name = "lens",
               .help = "lens model: brown (most lenses) or fisheye (wide lenses)",
               .value = &lens_,
               .choices = {"brown", "fisheye"}}}},
            {"model",
             {{.name = "model",
               .help = "selected = only parameters that held-out views support, full = all",
               .value = &model_,
               .choices = {"selected", "full"}},
              {.name = "outliers",
               .help = "views with more than 3 times the median error",
               .value = &outliers_,
               .choices = {"keep", "downweight", "drop"}},
              {"folds", "number of folds of held-out views", &options_.selection.folds, "", 2, 100},
              {"sigmas", "least difference between a new number and its start, in sigmas",
               &options_.selection.least_sigmas, "", 0, 100}}},
            {"output",
             {{.name = "out",
               .help =
                   "the camera's file; its extension sets the format: .json ours, .yml OpenCV, .yaml ROS, .txt COLMAP",
               .value = &out_,
               .writes = Writes::file},
              {.name = "format",
               .help = "the format, whatever the extension",
               .value = &format_,
               .choices = format_choices()},
              {.name = "trajectory",
               .help = "file for the refined poses of a recording, in TUM's format",
               .value = &trajectory_,
               .writes = Writes::file},
              {.name = "report", .help = "HTML page with tables and plots", .value = &report_, .writes = Writes::file},
              {"overwrite", "replace earlier results", &overwrite_}}}};
    }

    int run() override {
        const fs::path path = paths_.front();
        const auto format = out_.empty() ? CameraFormat::scanshade : camera_format(out_, format_);
        refuse_to_overwrite();
        apply_flags();
        const Stopwatch stopwatch;
        const RecordingResult found = board_.empty() ? from_capture(path) : camera_alone(from_boards(path));
        const double took_s = stopwatch.seconds();
        fmt::print("{}", summary_of(found.refinement, took_s));
        write(found, format, took_s);
        return all_well;
    }

  private:
    static std::vector<std::string> format_choices() {
        std::vector<std::string> names = camera_format_names();
        names.insert(names.begin(), "");
        return names;
    }

    void refuse_to_overwrite() const {
        for (const std::string& file : {out_, report_, trajectory_})
            if (!file.empty() && fs::exists(file) && !overwrite_)
                throw Misuse(file + " exists already: --overwrite replaces it, or choose another name");
    }

    void apply_flags() {
        first_.lens = lens_ == "fisheye" ? LensModel::kannala_brandt : LensModel::brown_conrady;
        options_.model = model_ == "full" ? ModelChoice::full : ModelChoice::selected;
        options_.outliers = outliers_ == "drop"         ? Outliers::drop
                            : outliers_ == "downweight" ? Outliers::downweight
                                                        : Outliers::keep;
    }

    Refinement from_boards(const fs::path& folder) const {
        using Kind = Target::Kind;
        const Kind kind = target_ == "charuco"              ? Kind::charuco
                          : target_ == "circles"            ? Kind::circles
                          : target_ == "asymmetric-circles" ? Kind::asymmetric_circles
                                                            : Kind::chessboard;
        return refine_from_boards(folder, {kind, parsed_count(board_), square_m_, marker_m_, dictionary_}, first_,
                                  options_);
    }

    static RecordingResult camera_alone(Refinement refinement) {
        CameraFile file{.camera = refinement.after, .depth_units_per_metre = {}, .warnings = {}};
        return {.refinement = std::move(refinement), .file = std::move(file)};
    }

    RecordingResult from_capture(const fs::path& path) const {
        Capture capture = open_capture(path, {first_.camera, depth_scale_, 0.02});
        std::vector<std::size_t> frames(capture.entries.size());
        std::iota(frames.begin(), frames.end(), std::size_t{0});
        if (!capture.entries.front().cloud.empty())
            return camera_alone(refine_from_clouds(capture, frames, first_, options_));
        return refine_from_recording(std::move(capture), frames, first_, recording_, options_);
    }

    /// TUM's format: rows of time tx ty tz qx qy qz qw.
    static std::string trajectory_of(const RecordingResult& result) {
        std::string rows = "# refined poses, camera to world\n# timestamp tx ty tz qx qy qz qw\n";
        for (std::size_t i = 0; i < result.poses.size(); ++i) {
            const Eigen::Vector3d t = result.poses[i].second.translation();
            const Eigen::Quaterniond q(result.poses[i].second.linear());
            rows += fmt::format("{:.6f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n", result.stamps_s[i], t.x(),
                                t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
        }
        return rows;
    }

    void write(const RecordingResult& found, CameraFormat format, double took_s) const {
        const Refinement& result = found.refinement;
        CameraQuality quality{.rms_px = std::nan(""), .view_rms_px = {}, .details = {}};
        if (result.unit == "px") {
            quality.rms_px = result.selection.train_px;
            for (const ViewRow& view : result.views)
                quality.view_rms_px.push_back(view.score.rms());
        }
        quality.details = details_of(result, took_s).dump();
        if (!out_.empty())
            write_camera_file(out_, found.file, format, quality);
        if (!trajectory_.empty())
            write_atomically(trajectory_, trajectory_of(found));
        if (!report_.empty())
            write_atomically(report_, page_of(result, took_s));
        for (const std::string& file : {out_, report_, trajectory_})
            if (!file.empty())
                fmt::print(stderr, "  -> {}\n", file);
    }

    std::vector<std::string> paths_;
    std::string board_, target_ = "chessboard", dictionary_ = "4x4_50", lens_ = "brown", model_ = "selected",
                        outliers_ = "keep";
    std::string out_, format_, report_, trajectory_, depth_scale_;
    double square_m_ = 0.025, marker_m_ = 0;
    bool overwrite_ = false;
    FirstCamera first_;
    RecordingOptions recording_;
    RefineOptions options_;
};

} // namespace

std::unique_ptr<Command> refine_command() { return std::make_unique<Refine>(); }

} // namespace scanshade
