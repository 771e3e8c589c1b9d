// Pictures, clouds and recordings made into evidence, with notes on what was left out.
#include "apps/refine_sources.h"

#include "io/camera_file.h"
#include "io/image_file.h"
#include "io/layouts.h"
#include "projection/calibration/organised_evidence.h"
#include "projection/calibration/sequence.h"
#include "projection/error.h"
#include "projection/project.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <opencv2/imgproc.hpp>

namespace scanshade {
namespace fs = std::filesystem;
using namespace calibration;
namespace {

Camera with_lens(Camera camera, LensModel lens) {
    if (lens == LensModel::kannala_brandt && camera.distortion.model != lens)
        camera.distortion = {.model = lens};
    return camera;
}

/// The camera to start from, where the user gave one; sized to the images, of which a mismatch is refused.
std::optional<Camera> given_camera(const FirstCamera& first, cv::Size size) {
    if (!first.camera.empty()) {
        Camera camera = camera_from_argument(first.camera).camera;
        if (camera.pinhole.size.empty())
            camera.pinhole.size = size;
        if (camera.pinhole.size != size)
            throw Error(fmt::format("the images are {}x{}, but the camera ({}) is for {}x{}", size.width, size.height,
                                    camera.origin, camera.pinhole.size.width, camera.pinhole.size.height));
        check(camera);
        return with_lens(camera, first.lens);
    }
    if (first.fov_degrees > 0) {
        const double f = size.width / 2.0 / std::tan(first.fov_degrees * CV_PI / 360);
        return with_lens({{f, f, (size.width - 1) / 2.0, (size.height - 1) / 2.0, size},
                          {},
                          fmt::format("--fov {} degrees", first.fov_degrees)},
                         first.lens);
    }
    return std::nullopt;
}

struct Picture {
    std::string name;
    cv::Mat3b pixels;
};

/// The readable pictures of a folder; of others, and of those not of the commonest size, a note.
std::vector<Picture> pictures_in(const fs::path& folder, std::vector<std::string>& notes) {
    std::vector<Picture> all;
    std::map<std::pair<int, int>, int> sizes;
    for (const fs::path& file : files_in(folder)) {
        if (!has_colour_extension(file))
            continue;
        try {
            all.push_back({file.filename().string(), read_colour(file)});
            ++sizes[{all.back().pixels.cols, all.back().pixels.rows}];
        } catch (const std::exception& failure) {
            notes.push_back(fmt::format("{}; not used.", failure.what()));
        }
    }
    if (all.empty())
        throw Error(folder.string() + ": no pictures (PNG, JPEG ...) of a board that can be read");
    const auto commonest = std::max_element(sizes.begin(), sizes.end(), [](const auto& a, const auto& b) {
                               return a.second < b.second;
                           })->first;
    std::erase_if(all, [&](const Picture& picture) {
        if (std::pair(picture.pixels.cols, picture.pixels.rows) == commonest)
            return false;
        notes.push_back(fmt::format("{}: {}x{} among pictures of {}x{}: sizes are not mixed; not used.",
                                    (folder / picture.name).string(), picture.pixels.cols, picture.pixels.rows,
                                    commonest.first, commonest.second));
        return true;
    });
    return all;
}

std::string text_of(const Target& target) {
    const char* kinds[] = {"chessboard of {}x{} corners", "ChArUco board of {}x{} squares", "grid of {}x{} circles",
                           "asymmetric grid of {}x{} circles"};
    return fmt::format(fmt::runtime(std::string(kinds[static_cast<int>(target.kind)]) + ", {:g} mm"),
                       target.count.width, target.count.height, 1000 * target.square_m);
}

} // namespace

Refinement refine_from_boards(const fs::path& folder, const Target& target, const FirstCamera& first,
                              RefineOptions options) {
    if (!fs::is_directory(folder))
        throw Error(folder.string() + ": not a folder of pictures");
    std::vector<std::string> notes;
    const std::vector<Picture> pictures = pictures_in(folder, notes);
    const cv::Size size = pictures.front().pixels.size();
    std::vector<BoardView> views;
    for (const Picture& picture : pictures)
        if (auto view = find_board(picture.pixels, target, picture.name))
            views.push_back(*std::move(view));
        else
            notes.push_back(fmt::format("no board found in {}; not used.", (folder / picture.name).string()));
    if (views.empty())
        throw Error(
            fmt::format("{}: no {} found in any of {} pictures", folder.string(), text_of(target), pictures.size()));
    const auto given = given_camera(first, size);
    options.ladder.guessed = !given;
    const Camera before = given ? *given : with_lens(guess_from_boards(views, size), first.lens);
    Boards boards(views);
    const std::string cannot = degeneracy(views, boards.start(model_of(before)));
    Refinement result;
    try {
        result = refine(boards, before, camera_rungs(before.distortion.model), options, cannot);
    } catch (const Error& failure) { // what was left out is often why
        std::string all = folder.string() + ": " + failure.what();
        for (const std::string& note : notes)
            all += "\n  " + note;
        throw Error(all);
    }
    result.source = fmt::format("{}, in {} of {} pictures", text_of(target), views.size(), pictures.size());
    result.notes.insert(result.notes.begin(), notes.begin(), notes.end());
    return result;
}

Refinement refine_from_clouds(const Capture& capture, const std::vector<std::size_t>& frames, const FirstCamera& first,
                              RefineOptions options) {
    Organised evidence;
    std::vector<std::string> notes;
    std::size_t used = 0;
    for (const std::size_t index : frames) {
        try {
            const Frame frame = capture.load(index);
            evidence.add(frame.name, *frame.cloud);
            ++used;
        } catch (const std::exception& failure) {
            notes.push_back(fmt::format("{}; not used.", failure.what()));
        }
    }
    if (used == 0)
        throw Error(
            fmt::format("{}: no organised cloud that tells its camera: {}", capture.path.string(), notes.front()));
    const cv::Size size = evidence.size();
    const auto given = given_camera(first, size);
    options.ladder.guessed = !given;
    const double usual = 0.9 * size.width;
    const Camera before = given ? *given
                                : Camera{{usual, usual, (size.width - 1) / 2.0, (size.height - 1) / 2.0, size},
                                         {},
                                         "guessed: a usual lens, principal point in the middle"};
    Refinement result =
        refine(evidence, with_lens(before, first.lens), camera_rungs(before.distortion.model), options, "");
    result.source = fmt::format("pixels and points of {} organised cloud{}", used, used == 1 ? "" : "s");
    if (!result.after.distortion.any())
        result.notes.push_back(
            fmt::format("the points lie on a pinhole's rays to {:.1g} px: no lens distortion is left in "
                        "them (rectified, or never there).",
                        result.climb.train_px));
    result.notes.insert(result.notes.begin(), notes.begin(), notes.end());
    return result;
}

namespace {

/// Some of the frames that can be loaded with colour and depth, evenly spread; of the others a note.
std::vector<SequenceFrame> frames_of(const Capture& capture, const std::vector<std::size_t>& wanted,
                                     const RecordingOptions& recording, std::vector<std::string>& notes,
                                     std::vector<double>& stamps_s) {
    std::vector<SequenceFrame> frames;
    const std::size_t count = std::min<std::size_t>(wanted.size(), static_cast<std::size_t>(recording.frames));
    for (std::size_t i = 0; i < count; ++i) {
        const std::size_t index = wanted[count == 1 ? 0 : i * (wanted.size() - 1) / (count - 1)];
        const CaptureEntry& entry = capture.entries[index];
        try {
            const Frame frame = capture.load(index);
            SequenceFrame part{frame.name, {}, frame.depth_m, {}};
            const cv::Mat3b colour =
                frame.colour.empty() && !entry.colour.empty() ? read_colour(entry.colour) : frame.colour;
            if (colour.empty())
                throw Error(frame.name + ": no colour image");
            cv::cvtColor(colour, part.grey, cv::COLOR_BGR2GRAY);
            if (recording.poses != "ignore")
                part.world_from_camera = frame.world_from_camera;
            frames.push_back(std::move(part));
            stamps_s.push_back(entry.stamp_s.value_or(static_cast<double>(index)));
        } catch (const std::exception& failure) {
            notes.push_back(fmt::format("{}; not used.", failure.what()));
        }
    }
    constexpr std::size_t least = 3;
    if (frames.size() < least)
        throw Error(fmt::format("{}: {} frames with colour and depth, at least {} expected{}", capture.path.string(),
                                frames.size(), least, notes.empty() ? "" : "\n  " + notes.front()));
    return frames;
}

/// Recorded poses are kept where they explain the frames nearly as well as refined ones would; otherwise refined.
Sequence adjusted(const std::vector<SequenceFrame>& frames, const Camera& depth_camera, const Model& first,
                  SequenceOptions& how, const std::string& poses) {
    constexpr double nearly = 1.3;
    const bool recorded =
        std::all_of(frames.begin(), frames.end(), [](const auto& part) { return part.world_from_camera; });
    how.refine_poses = (poses != "keep" && how.registered) || !recorded; // what is unregistered hangs by its poses
    Sequence refined(frames, depth_camera, first, how);
    if (poses != "auto" || !how.refine_poses || !recorded)
        return refined;
    how.refine_poses = false;
    Sequence kept(frames, depth_camera, first, how);
    const auto error = [&](const Sequence& sequence) {
        Free free{}; // a wrong camera must not speak against the poses
        free[f] = free[k1] = true;
        const Fit fit = sequence.fit(sequence.start(first), free, Views(frames.size(), true), false);
        return std::sqrt(fit.rss / fit.residuals);
    };
    if (error(kept) <= nearly * error(refined))
        return kept;
    how.refine_poses = true;
    return refined;
}

std::string names_of_climbed(const Climb& climb) {
    std::string names;
    for (const Step& step : climb.steps)
        if (step.climbed)
            names += (names.empty() ? "" : ", ") + step.name;
    return names;
}

std::string overlap_sentence(double before_mm, double after_mm) {
    return fmt::format("overlapping depths of different frames differ by {:.2f} mm (median), {:.2f} mm before.",
                       after_mm, before_mm);
}

} // namespace

RecordingResult refine_from_recording(const Capture& capture, const std::vector<std::size_t>& wanted,
                                      const FirstCamera& first, const RecordingOptions& recording,
                                      RefineOptions options) {
    RecordingResult result;
    std::vector<std::string> notes = capture.warnings;
    std::vector<SequenceFrame> frames = frames_of(capture, wanted, recording, notes, result.stamps_s);
    if (!capture.camera)
        throw Error(capture.path.string() + ": no camera to start from; give --camera FILE or --camera fx,fy,cx,cy");
    Camera depth_camera = *capture.camera;
    if (depth_camera.pinhole.size.empty())
        depth_camera.pinhole.size = frames.front().depth_m.size();
    check(depth_camera);

    SequenceOptions how;
    how.registered =
        recording.registered == "auto" ? capture.registration != Registration::no : recording.registered == "yes";
    const cv::Size colour_size = frames.front().grey.size();
    if (how.registered && colour_size != depth_camera.pinhole.size)
        throw Error(
            fmt::format("{}: colour is {}x{}, depth {}x{}: not registered; --registered no refines the colour camera",
                        capture.path.string(), colour_size.width, colour_size.height, depth_camera.pinhole.size.width,
                        depth_camera.pinhole.size.height));
    const auto given = given_camera(first, colour_size);
    const double usual = 0.82 * colour_size.width; // a Kinect's colour camera
    const Camera guess{{usual, usual, (colour_size.width - 1) / 2.0, (colour_size.height - 1) / 2.0, colour_size},
                       {},
                       "guessed: a usual lens, principal point in the middle"};
    options.ladder.guessed = !how.registered && !given;
    const Camera before = given ? *given : how.registered ? depth_camera : guess;

    std::vector<Rung> rungs = camera_rungs(before.distortion.model);
    if (!how.registered)
        rungs.insert(rungs.begin(), {"place", {turn_x, turn_y, turn_z, shift_x, shift_y, shift_z}});

    options.ladder.folds = std::min(options.ladder.folds, 4);
    // Depth errors hang together across a scene in ways that no cluster covers: a real error of the camera is far
    // beyond this.
    options.ladder.least_sigmas = std::max(options.ladder.least_sigmas, 5.0);
    Sequence sequence = adjusted(frames, depth_camera, model_of(before), how, recording.poses);
    if (how.registered && !how.refine_poses)
        for (const Rung& rung : depth_rungs())
            rungs.push_back(rung);
    const Fit start = sequence.start(model_of(before));
    result.refinement = refine(sequence, before, rungs, options, sequence.degeneracy(start));
    Refinement& r = result.refinement;
    const auto overlap = [&](const Fit& fit) {
        return sequence.overlap_mm(how.registered ? fit.model : model_of(depth_camera), sequence.poses(fit));
    };
    const double overlap_before_mm = overlap(start);
    if (const double after_mm = overlap(r.climb.fit); how.registered && r.changed() && after_mm > overlap_before_mm)
        r = refine(sequence, before, rungs, options,
                   fmt::format(
                       "what explains the tracks better ({}) lets depths of different frames overlap worse: {:.2f} mm, "
                       "{:.2f} mm before",
                       names_of_climbed(r.climb), after_mm, overlap_before_mm));
    r.source = fmt::format("{} points seen {} times in {} frames, {}, poses {}", sequence.points(),
                           sequence.sightings(), sequence.views(),
                           how.registered ? "colour registered with depth" : "colour not registered with depth",
                           how.refine_poses ? "refined" : "kept");
    const auto poses = sequence.poses(r.climb.fit);
    for (std::size_t i = 0; i < poses.size(); ++i)
        result.poses.emplace_back(sequence.view_name(i), poses[i]);
    r.notes.push_back(overlap_sentence(overlap_before_mm, overlap(r.climb.fit)));
    r.notes.insert(r.notes.begin(), notes.begin(), notes.end());
    return result;
}

} // namespace scanshade
