// Refines from a recording: chooses frames, first cameras and poses, selects the model, and collects the results.
#include "apps/refine/recording.h"

#include "io/images/image_file.h"
#include "projection/base/error.h"
#include "projection/calibration/recording/agreement.h"
#include "projection/calibration/recording/overlap.h"
#include "projection/calibration/recording/planes.h"
#include "projection/calibration/recording/sequence.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

namespace scanshade {
using namespace calibration;
namespace {

// ---------------------------------------------------------------------------------------------------- frames

/// The frames used of a recording, and notes about the others.
struct RecordingData {
    std::vector<SequenceFrame> frames;
    std::vector<double> stamps_s;
    bool stamped = true; ///< `stamps_s` are times, not indices in the recording
    std::vector<std::string> notes;
};

/// From the capture's trajectory; else from the frames before and after, per second or, without stamps, per frame.
Motion motion_of(const Capture& capture, std::size_t index) {
    const CaptureEntry& entry = capture.entries[index];
    Motion motion = entry.motion.value_or({});
    if (motion.any() || !entry.world_from_camera || index == 0 || index + 1 == capture.entries.size())
        return motion;
    const CaptureEntry &before = capture.entries[index - 1], &after = capture.entries[index + 1];
    if (!before.world_from_camera || !after.world_from_camera)
        return {};
    constexpr double longest_s = 0.25; // a hand-held camera moves evenly for no longer
    const double apart_s = after.stamp_s && before.stamp_s ? *after.stamp_s - *before.stamp_s : 2;
    if (after.stamp_s && !(apart_s > 0 && apart_s < longest_s))
        return {};
    return motion_between(*before.world_from_camera, *after.world_from_camera, apart_s, *entry.world_from_camera);
}

cv::Mat1b grey_of(const Frame& frame, const CaptureEntry& entry) {
    const cv::Mat3b colour = frame.colour.empty() && !entry.colour.empty() ? colour_of(entry) : frame.colour;
    if (colour.empty())
        throw Error(frame.name + ": no colour image");
    cv::Mat1b grey;
    cv::cvtColor(colour, grey, cv::COLOR_BGR2GRAY);
    return grey;
}

SequenceFrame frame_of(const Capture& capture, std::size_t index, const RecordingOptions& recording, bool with_colour) {
    const CaptureEntry& entry = capture.entries[index];
    const Frame frame = capture.load(index);
    SequenceFrame part{.name = frame.name, .grey = {}, .depth_m = frame.depth_m};
    if (with_colour)
        part.grey = grey_of(frame, entry);
    if (recording.poses != "ignore") {
        part.world_from_camera = frame.world_from_camera;
        part.motion = motion_of(capture, index);
        if (entry.colour_stamp_s && entry.stamp_s)
            part.colour_later_s = *entry.colour_stamp_s - *entry.stamp_s;
    }
    return part;
}

/// At most `most` indices among `all`, evenly spaced.
std::vector<std::size_t> evenly_spaced(std::size_t all, std::size_t most) {
    std::vector<std::size_t> indices(std::min(all, most));
    for (std::size_t i = 0; i < indices.size(); ++i)
        indices[i] = indices.size() == 1 ? 0 : i * (all - 1) / (indices.size() - 1);
    return indices;
}

/// Loads evenly spaced frames. A frame that cannot be loaded with the images needed gets a note.
RecordingData recording_data(const Capture& capture, const std::vector<std::size_t>& wanted,
                             const RecordingOptions& recording, bool with_colour, const SelectionOptions& selection) {
    RecordingData data{.frames = {}, .stamps_s = {}, .notes = capture.warnings};
    std::string first_failure;
    if (selection.say)
        selection.say(fmt::format("reading {} of {} frames",
                                  std::min(wanted.size(), static_cast<std::size_t>(recording.frames)), wanted.size()));
    for (const std::size_t position : evenly_spaced(wanted.size(), static_cast<std::size_t>(recording.frames))) {
        const std::size_t index = wanted[position];
        const CaptureEntry& entry = capture.entries[index];
        try {
            data.frames.push_back(frame_of(capture, index, recording, with_colour));
            data.stamps_s.push_back(entry.stamp_s.value_or(static_cast<double>(index)));
            data.stamped = data.stamped && entry.stamp_s;
        } catch (const std::exception& failure) {
            data.notes.push_back(fmt::format("{}; not used.", failure.what()));
            first_failure = first_failure.empty() ? "\n  " + data.notes.back() : first_failure;
        }
    }
    constexpr std::size_t least = 3;
    if (data.frames.size() < least)
        throw Error(fmt::format("{}: {} frames with {}depth, at least {} expected{}", capture.path.string(),
                                data.frames.size(), with_colour ? "colour and " : "", least, first_failure));
    return data;
}

/// How recordings get observations that tell more.
std::string what_helps(std::size_t recorded, std::size_t used, bool with_colour) {
    return fmt::format("What helps: frames that show {} up to the corners of the image, from near and far, with the "
                       "camera turned and tilted in between{}; or pictures of a chessboard (--board).",
                       with_colour ? "things with texture" : "walls, floor and tables of several directions",
                       used < recorded ? fmt::format("; more of the {} frames (--frames, now {})", recorded, used)
                                       : "");
}

/// Frames midway between those of recording_data(); frames that cannot be loaded are left out.
std::vector<SequenceFrame> frames_between(const Capture& capture, const std::vector<std::size_t>& wanted,
                                          const RecordingOptions& recording) {
    constexpr std::size_t enough = 8;
    std::vector<std::size_t> between;
    const std::vector<std::size_t> taken = evenly_spaced(wanted.size(), static_cast<std::size_t>(recording.frames));
    for (std::size_t i = 0; i + 1 < taken.size(); ++i)
        if (taken[i + 1] - taken[i] > 1)
            between.push_back((taken[i] + taken[i + 1]) / 2);
    std::vector<SequenceFrame> frames;
    for (const std::size_t position : evenly_spaced(between.size(), enough))
        try {
            frames.push_back(frame_of(capture, wanted[between[position]], recording, true));
        } catch (const std::exception&) { // counts as absent
        }
    return frames;
}

// ---------------------------------------------------------------------------------------------------- cameras

const CaptureEntry* first_with_colour(const Capture& capture) {
    const auto found = std::find_if(capture.entries.begin(), capture.entries.end(),
                                    [](const CaptureEntry& entry) { return !entry.colour.empty(); });
    return found == capture.entries.end() ? nullptr : &*found;
}

/// Sets the capture's first camera: its own (or --camera), --fov, or the EXIF of registered colour. Returns whether it
/// is a guess.
bool set_first_camera(Capture& capture, const FirstCamera& first, bool registered, cv::Size size) {
    const bool known = capture.camera.has_value();
    if (!known) {
        capture.camera = given_camera({}, first.fov_degrees, first.lens, size);
        if (const CaptureEntry* entry = first_with_colour(capture); !capture.camera && registered && entry)
            if (const Camera guess = guessed_camera(entry->colour, first.lens, size); guess.origin.starts_with("EXIF"))
                capture.camera = guess;
    }
    if (!capture.camera)
        throw Error(capture.path.string() + ": no camera to start from; give --camera FILE, fx,fy,cx,cy or the name of "
                                            "a known one, or --fov DEGREES");
    if (capture.camera->pinhole.size.empty())
        capture.camera->pinhole.size = size;
    check(*capture.camera);
    if (capture.camera->pinhole.size != size)
        throw Error(fmt::format("{}: depth is {}x{}, but the camera ({}) is for {}x{}", capture.path.string(),
                                size.width, size.height, capture.camera->origin, capture.camera->pinhole.size.width,
                                capture.camera->pinhole.size.height));
    return !known && first.fov_degrees == 0;
}

/// Starts from the recorded depth correction, which refined numbers replace.
Model first_model(const Camera& camera, const DepthCorrection& correction) {
    Model model = model_of(camera);
    model[depth_scale] = correction.scale;
    model[depth_offset] = correction.offset_m;
    model[depth_curve] = correction.curve_per_m;
    return model;
}

// ---------------------------------------------------------------------------------------------------- refining

std::string overlap_sentence(double before_mm, double after_mm) {
    return fmt::format(
        "overlapping depths of different frames differ by {:.2f} mm (mean, each up to 5 %), {:.2f} mm before.",
        after_mm, before_mm);
}

/// Whether depth edges now lie on colour edges, on frames that were not refined where there are some.
std::string agreement_sentence(const std::vector<SequenceFrame>& between, const RecordingData& data,
                               const Camera& depth_camera, const Fit& before, const Fit& after) {
    const std::vector<SequenceFrame>& frames = between.empty() ? data.frames : between;
    const auto of = [&](const Fit& fit) {
        return outline_agreement(frames, depth_camera, fit.model, Sequence::gap_px(fit));
    };
    const OutlineAgreement then = of(before), now = of(after);
    return fmt::format("{:.0f} % of {} points on depth edges lie on a colour edge, {:.0f} % before; with colour "
                       "translated at random {:.0f} +- {:.0f} %: {:.1f} sigma above chance, {:.1f} before ({} {}).",
                       100 * now.share, now.points, 100 * then.share, 100 * now.by_chance, 100 * now.chance_sigma,
                       now.sigmas(), then.sigmas(), frames.size(),
                       between.empty() ? "frames, the refined ones" : "frames that were not refined");
}

/// A focal length that a short walk cannot free would otherwise reappear as a lens, or as a second focal length.
void with_focal_length_as_rival(std::vector<ParameterGroup>& groups) {
    const auto is = [](const ParameterGroup& group, Unknown unknown) { return group.unknowns.front() == unknown; };
    if (std::none_of(groups.begin(), groups.end(), [&](const ParameterGroup& group) { return is(group, f); }))
        return;
    for (ParameterGroup& group : groups)
        if (!group.rival && group.unknowns.front() < camera_unknowns && !is(group, f))
            group.rival = f;
}

/// Refines. While that makes the overlap of depths worse, refines again without the group freed last. `overlap` returns
/// its millimetres under a fit.
template <class Overlap>
Refinement refined_where_depths_agree(Problem& problem, const Model& first, const Camera& before,
                                      std::vector<ParameterGroup> groups, const RefineOptions& options,
                                      const std::string& degeneracy, Overlap&& overlap) {
    with_focal_length_as_rival(groups);
    const double before_mm = overlap(problem.start(first));
    std::vector<Step> rejected;
    Refinement r = refine(problem, first, before, groups, options, degeneracy);
    for (double after_mm = overlap(r.selection.fit); r.changed() && after_mm > before_mm;
         after_mm = overlap(r.selection.fit)) {
        const auto last = std::find_if(r.selection.steps.rbegin(), r.selection.steps.rend(),
                                       [](const Step& step) { return step.freed; });
        rejected.push_back(
            {last->name, false,
             fmt::format("not supported: depths of different frames would overlap worse, {:.2f} mm, {:.2f} "
                         "mm before",
                         after_mm, before_mm)});
        std::erase_if(groups, [&](const ParameterGroup& group) { return group.name == rejected.back().name; });
        r = refine(problem, first, before, groups, options, degeneracy);
    }
    r.selection.steps.insert(r.selection.steps.end(), rejected.begin(), rejected.end());
    if (std::isfinite(before_mm))
        r.notes.push_back(overlap_sentence(before_mm, overlap(r.selection.fit)));
    return r;
}

/// Keeps recorded poses where they fit the frames nearly as well as refined poses; otherwise refines them.
Sequence sequence_of(const std::vector<SequenceFrame>& frames, const Camera& depth_camera, const Model& first,
                     SequenceOptions& how, const std::string& poses) {
    constexpr double nearly = 1.3;
    const bool recorded =
        std::all_of(frames.begin(), frames.end(), [](const auto& part) { return part.world_from_camera; });
    how.refine_poses = (poses != "keep" && how.registered) || !recorded; // unregistered images need fixed poses
    Sequence refined(frames, depth_camera, first, how);
    if (poses != "auto" || !how.refine_poses || !recorded)
        return refined;
    how.refine_poses = false;
    Sequence kept(frames, depth_camera, first, how);
    const auto error = [&](const Sequence& sequence, bool keeps) {
        Free free{}; // a wrong camera, clock or depth must not count against the poses
        free[f] = free[k1] = true;
        free[time_offset] = sequence.determines_time();
        free[depth_scale] = free[depth_offset] = keeps;
        const Fit fit = sequence.fit(sequence.start(first), free, Views(frames.size(), true), false);
        return std::sqrt(fit.rss / std::max(1, fit.residuals - fit.unknowns)); // refined poses are unknowns, too
    };
    if (error(kept, true) <= nearly * error(refined, false))
        return kept;
    how.refine_poses = true;
    return refined;
}

void take_poses(const Problem& problem, const std::vector<Eigen::Isometry3d>& poses, RecordingResult& result) {
    for (std::size_t i = 0; i < poses.size(); ++i)
        result.poses.emplace_back(problem.view_name(i), poses[i]);
}

/// Of registered images: the fit's camera, depth correction and time offset.
void take_camera(const Capture& capture, bool stamped, RecordingResult& result) {
    const Model& model = result.refinement.selection.fit.model;
    result.file.camera = result.refinement.after;
    result.file.depth_correction = depth_correction_of(model);
    if (const auto& c = result.file.depth_correction; c != depth_correction_of(result.refinement.selection.start.model))
        result.refinement.notes.push_back(
            fmt::format("true depth is {}: a recorded 1 m is {:.4f} m, 3 m are {:.4f} m.", describe(c), c(1), c(3)));
    if (stamped)
        result.file.pose_time_offset_s = capture.pose_time_offset_s + model[time_offset];
}

RecordingResult refine_tracks(const Capture& capture, const RecordingData& data,
                              const std::vector<SequenceFrame>& between, const Camera& before, SequenceOptions how,
                              const RecordingOptions& recording, RefineOptions options,
                              std::vector<ParameterGroup> groups, const Model& first) {
    RecordingResult result{.refinement = {},
                           .file = {.camera = *capture.camera, .depth_units_per_metre = {}, .warnings = {}}};
    Sequence sequence = sequence_of(data.frames, *capture.camera, first, how, recording.poses);
    if (sequence.determines_time())
        groups.insert(groups.begin() + (how.registered ? 0 : 1), {"time offset", {time_offset}});
    if (how.registered && !how.refine_poses)
        for (const ParameterGroup& group : depth_groups())
            groups.push_back(group);
    const Fit start = sequence.start(first);
    const auto overlap = [&](const Fit& fit) {
        return overlap_mm(sequence.depth_images(), how.registered ? fit.model : model_of(*capture.camera),
                          sequence.poses(fit));
    };
    result.refinement =
        refined_where_depths_agree(sequence, first, before, groups, options, sequence.degeneracy(start), overlap);
    Refinement& r = result.refinement;
    r.source = fmt::format("{} points seen {} times in {} frames, {}, poses {}", sequence.points(),
                           sequence.observations(), sequence.views(),
                           how.registered ? "colour registered with depth"
                                          : fmt::format("{} points of depth edges on edges of colour, which is not "
                                                        "registered with depth",
                                                        sequence.outline_points()),
                           how.refine_poses ? "refined" : "kept");
    if (!how.registered)
        r.notes.push_back(agreement_sentence(between, data, *capture.camera, start, r.selection.fit));
    take_poses(sequence, sequence.poses(r.selection.fit), result);
    if (how.registered) {
        take_camera(capture, data.stamped, result);
    } else {
        result.file.depth_correction = capture.depth_correction;
        result.file.registration = Registration::no;
        result.file.colour =
            ColourCamera{r.after, pose_from_parameters(r.selection.fit.model.values.data() + rotation_x)};
    }
    if (r.selection.free[time_offset])
        r.notes.push_back(fmt::format("{} were taken {:.1f} {} after the time of their {}.",
                                      how.registered ? "images" : "colour images",
                                      r.selection.fit.model[time_offset] * (data.stamped ? 1000 : 1),
                                      data.stamped ? "ms" : "frames", how.registered ? "poses" : "depth and poses"));
    return result;
}

RecordingResult refine_planes(const Capture& capture, const RecordingData& data, const Camera& before,
                              const RefineOptions& options, const Model& first) {
    RecordingResult result{.refinement = {},
                           .file = {.camera = *capture.camera, .depth_units_per_metre = {}, .warnings = {}}};
    std::vector<PlaneFrame> frames;
    for (const SequenceFrame& part : data.frames)
        frames.push_back({part.name, part.depth_m, part.world_from_camera});
    Planes planes(std::move(frames), first);
    const auto overlap = [&](const Fit& fit) {
        return planes.linked() ? overlap_mm(planes.depth_images(), fit.model, planes.poses()) : std::nan("");
    };
    for (const std::vector<ParameterGroup>& groups : planes.group_orders()) {
        Refinement r = refined_where_depths_agree(planes, first, before, groups, options, planes.degeneracy(), overlap);
        if (result.refinement.unit.empty() || r.selection.held_out_px < result.refinement.selection.held_out_px)
            result.refinement = std::move(r);
        if (!result.refinement.changed())
            break; // another order would free nothing either
    }
    result.refinement.source = planes.summary();
    take_camera(capture, false, result);
    result.file.pose_time_offset_s = capture.pose_time_offset_s;
    result.file.registration = capture.registration;
    result.file.colour = capture.colour_camera;
    return result;
}

} // namespace

RecordingResult refine_from_recording(Capture capture, const std::vector<std::size_t>& wanted, const FirstCamera& first,
                                      const RecordingOptions& recording, RefineOptions options) {
    const DepthCorrection correction = capture.depth_correction;
    capture.depth_correction = {}; // the model holds it, and may change it
    const bool with_colour =
        recording.observations == "tracks" || (recording.observations == "auto" && first_with_colour(capture));
    SequenceOptions how;
    how.registered =
        recording.registered == "auto" ? capture.registration != Registration::no : recording.registered == "yes";
    if (!how.registered)
        capture.depth_correction = correction;
    RecordingData data = recording_data(capture, wanted, recording, with_colour, options.selection);
    options.what_helps = what_helps(wanted.size(), data.frames.size(), with_colour);
    options.what_contradicts =
        "The frames contradict each other: things that moved, blur, colour that does not belong to "
        "the depth (--registered no), or recorded poses that are off (--poses ignore).";
    if (options.selection.say)
        options.selection.say(with_colour ? "following points through the images" : "looking for planes in the depth");
    const cv::Size depth_size = data.frames.front().depth_m.size();
    options.selection.guessed = set_first_camera(capture, first, how.registered, depth_size);
    options.selection.folds = std::min(options.selection.folds, 4);
    // Depth errors are correlated across a scene in ways that no cluster covers. Real errors of a camera are far larger
    // than this. Sigmas are already wider where few clusters tell, so that this is no more than it says.
    options.selection.least_sigmas = std::max(options.selection.least_sigmas, 4.0);

    const auto with_notes = [&](RecordingResult result) {
        result.stamps_s = data.stamps_s;
        std::vector<std::string>& notes = result.refinement.notes;
        notes.insert(notes.begin(), data.notes.begin(), data.notes.end());
        return result;
    };
    const Camera& depth_camera = *capture.camera;
    if (!with_colour) {
        capture.depth_correction = correction;
        return with_notes(refine_planes(capture, data, depth_camera, options, first_model(depth_camera, correction)));
    }
    const cv::Size colour_size = data.frames.front().grey.size();
    if (how.registered && colour_size != depth_size)
        throw Error(fmt::format(
            "{}: colour is {}x{}, depth {}x{}: not registered; --registered no refines the colour camera",
            capture.path.string(), colour_size.width, colour_size.height, depth_size.width, depth_size.height));
    if (how.registered)
        return with_notes(refine_tracks(capture, data, {}, depth_camera, how, recording, options,
                                        camera_groups(depth_camera.distortion.model),
                                        first_model(depth_camera, correction)));
    auto secondary = given_camera(first.colour_camera, 0, first.lens, colour_size);
    Model model;
    if (!secondary && capture.colour_camera) {
        secondary = capture.colour_camera->camera;
        model = model_of(*secondary);
        to_pose_parameters(capture.colour_camera->colour_from_depth, model.values.data() + rotation_x);
    } else {
        options.selection.guessed = !secondary;
        if (!secondary)
            secondary = guessed_camera(first_with_colour(capture)->colour, first.lens, colour_size);
        model = model_of(*secondary);
    }
    std::vector<ParameterGroup> groups = camera_groups(secondary->distortion.model);
    groups.insert(groups.begin(), extrinsics_group());
    return with_notes(refine_tracks(capture, data, frames_between(capture, wanted, recording), *secondary, how,
                                    recording, options, groups, model));
}

} // namespace scanshade
