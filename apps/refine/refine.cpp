// The settings of `refine`, the refinement that they ask for, and its poses as text.
#include "apps/refine/refine.h"

#include "apps/refine/sources.h"
#include "io/captures/capture.h"
#include "projection/base/error.h"

#include <cstdio>
#include <fmt/format.h>
#include <numeric>
#include <utility>

namespace scanshade {

namespace fs = std::filesystem;
using namespace calibration;

namespace {

cv::Size parsed_count(const std::string& text) {
    int width = 0, height = 0;
    char rest = 0;
    if (std::sscanf(text.c_str(), "%dx%d%c", &width, &height, &rest) != 2 || width < 3 || height < 3 || width > 200 ||
        height > 200)
        throw Misuse(fmt::format(
            "board: '{}' given, expected columns x rows of the target's points, such as 9x6, each 3 .. 200", text));
    return {width, height};
}

RecordingResult camera_alone(Refinement refinement) {
    CameraFile file{.camera = refinement.after, .depth_units_per_metre = {}, .warnings = {}};
    return {.refinement = std::move(refinement), .file = std::move(file)};
}

} // namespace

std::vector<Stage> RefineSettings::stages() {
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
           .help = "whether colour and depth pixels coincide; if not, the colour camera and its extrinsics are refined",
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
          {"sigmas", "least difference between a new number and its start, in sigmas", &options_.selection.least_sigmas,
           "", 0, 100}}}};
}

RecordingResult RefineSettings::refine(const fs::path& path) {
    first_.lens = lens_ == "fisheye" ? LensModel::kannala_brandt : LensModel::brown_conrady;
    options_.model = model_ == "full" ? ModelChoice::full : ModelChoice::selected;
    options_.outliers = outliers_ == "drop"         ? Outliers::drop
                        : outliers_ == "downweight" ? Outliers::downweight
                                                    : Outliers::keep;
    return board_.empty() ? from_capture(path) : camera_alone(from_boards(path));
}

Refinement RefineSettings::from_boards(const fs::path& folder) const {
    using Kind = Target::Kind;
    const Kind kind = target_ == "charuco"              ? Kind::charuco
                      : target_ == "circles"            ? Kind::circles
                      : target_ == "asymmetric-circles" ? Kind::asymmetric_circles
                                                        : Kind::chessboard;
    return refine_from_boards(folder, {kind, parsed_count(board_), square_m_, marker_m_, dictionary_}, first_,
                              options_);
}

RecordingResult RefineSettings::from_capture(const fs::path& path) const {
    Capture capture = open_capture(path, {first_.camera, depth_scale_, 0.02});
    require_metres(capture, "refine");
    std::vector<std::size_t> frames(capture.entries.size());
    std::iota(frames.begin(), frames.end(), std::size_t{0});
    if (!capture.entries.front().cloud.empty())
        return camera_alone(refine_from_clouds(capture, frames, first_, options_));
    return refine_from_recording(std::move(capture), frames, first_, recording_, options_);
}

std::string trajectory_of(const RecordingResult& result) {
    std::string rows = "# refined poses, camera to world\n# timestamp tx ty tz qx qy qz qw\n";
    for (std::size_t i = 0; i < result.poses.size(); ++i) {
        const Eigen::Vector3d t = result.poses[i].second.translation();
        const Eigen::Quaterniond q(result.poses[i].second.linear());
        rows += fmt::format("{:.6f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n", result.stamps_s[i], t.x(),
                            t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
    }
    return rows;
}

} // namespace scanshade
