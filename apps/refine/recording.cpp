// A recording made into evidence: which frames, cameras and poses it starts from, and what comes of it.
#include "apps/refine/sources.h"
#include "io/image_file.h"
#include "projection/calibration/recording/agreement.h"
#include "projection/calibration/recording/overlap.h"
#include "projection/calibration/recording/planes.h"
#include "projection/calibration/recording/sequence.h"
#include "projection/error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

namespace scanshade {
using namespace calibration;
namespace {

// ---------------------------------------------------------------------------------------------------- frames

/// What is taken of a recording, and what was odd about it.
struct Material {
    std::vector<SequenceFrame> frames;
    std::vector<double> stamps_s;
    bool stamped = true; ///< `stamps_s` are times, and not places in the recording
    std::vector<std::string> notes;
};

/// From the trajectory where the capture has told; else from the frames before and after, in their own time or, where
/// there is none, per frame.
Motion motion_of(const Capture& capture, std::size_t index) {
    const CaptureEntry& entry = capture.entries[index];
    if (entry.motion.any() || !entry.world_from_camera || index == 0 || index + 1 == capture.entries.size())
        return entry.motion;
    const CaptureEntry &before = capture.entries[index - 1], &after = capture.entries[index + 1];
    if (!before.world_from_camera || !after.world_from_camera)
        return {};
    constexpr double longest_s = 0.25; // over more than that a hand does not move evenly
    const double apart_s = after.stamp_s && before.stamp_s ? *after.stamp_s - *before.stamp_s : 2;
    if (after.stamp_s && !(apart_s > 0 && apart_s < longest_s))
        return {};
    return motion_between(*before.world_from_camera, *after.world_from_camera, apart_s, *entry.world_from_camera);
}

cv::Mat1b grey_of(const Frame& frame, const CaptureEntry& entry) {
    const cv::Mat3b colour = frame.colour.empty() && !entry.colour.empty() ? read_colour(entry.colour) : frame.colour;
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

/// Places of at most so many frames among all, evenly spread.
std::vector<std::size_t> spread(std::size_t all, std::size_t most) {
    std::vector<std::size_t> places(std::min(all, most));
    for (std::size_t i = 0; i < places.size(); ++i)
        places[i] = places.size() == 1 ? 0 : i * (all - 1) / (places.size() - 1);
    return places;
}

/// Some of the frames that can be loaded with what is needed, evenly spread; of the others a note.
Material material_of(const Capture& capture, const std::vector<std::size_t>& wanted, const RecordingOptions& recording,
                     bool with_colour) {
    Material material{.frames = {}, .stamps_s = {}, .notes = capture.warnings};
    std::string first_trouble;
    for (const std::size_t place : spread(wanted.size(), static_cast<std::size_t>(recording.frames))) {
        const std::size_t index = wanted[place];
        const CaptureEntry& entry = capture.entries[index];
        try {
            material.frames.push_back(frame_of(capture, index, recording, with_colour));
            material.stamps_s.push_back(entry.stamp_s.value_or(static_cast<double>(index)));
            material.stamped = material.stamped && entry.stamp_s;
        } catch (const std::exception& failure) {
            material.notes.push_back(fmt::format("{}; not used.", failure.what()));
            first_trouble = first_trouble.empty() ? "\n  " + material.notes.back() : first_trouble;
        }
    }
    constexpr std::size_t least = 3;
    if (material.frames.size() < least)
        throw Error(fmt::format("{}: {} frames with {}depth, at least {} expected{}", capture.path.string(),
                                material.frames.size(), with_colour ? "colour and " : "", least, first_trouble));
    return material;
}

/// Frames midway between those that material_of takes; what cannot be loaded is left out.
std::vector<SequenceFrame> frames_between(const Capture& capture, const std::vector<std::size_t>& wanted,
                                          const RecordingOptions& recording) {
    constexpr std::size_t enough = 8;
    std::vector<std::size_t> between;
    const std::vector<std::size_t> taken = spread(wanted.size(), static_cast<std::size_t>(recording.frames));
    for (std::size_t i = 0; i + 1 < taken.size(); ++i)
        if (taken[i + 1] - taken[i] > 1)
            between.push_back((taken[i] + taken[i + 1]) / 2);
    std::vector<SequenceFrame> frames;
    for (const std::size_t place : spread(between.size(), enough))
        try {
            frames.push_back(frame_of(capture, wanted[between[place]], recording, true));
        } catch (const std::exception&) { // as good as one that is not there
        }
    return frames;
}

// ---------------------------------------------------------------------------------------------------- cameras

const CaptureEntry* first_with_colour(const Capture& capture) {
    const auto found = std::find_if(capture.entries.begin(), capture.entries.end(),
                                    [](const CaptureEntry& entry) { return !entry.colour.empty(); });
    return found == capture.entries.end() ? nullptr : &*found;
}

/// The capture's camera (which --camera has replaced), --fov, or where colour is registered its EXIF.
/// Returns whether it is a guess.
bool settle_camera(Capture& capture, const FirstCamera& first, bool registered, cv::Size size) {
    const bool told = capture.camera.has_value();
    if (!told) {
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
    return !told && first.fov_degrees == 0;
}

/// Without a correction of its own yet: refined numbers replace the recorded ones.
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

/// Whether depth edges have come to lie on colour edges, on frames that took no part where there are some.
std::string agreement_sentence(const std::vector<SequenceFrame>& between, const Material& material,
                               const Camera& depth_camera, const Fit& before, const Fit& after) {
    const std::vector<SequenceFrame>& frames = between.empty() ? material.frames : between;
    const auto of = [&](const Fit& fit) {
        return outline_agreement(frames, depth_camera, fit.model, Sequence::gap_px(fit));
    };
    const OutlineAgreement then = of(before), now = of(after);
    return fmt::format(
        "{:.0f} % of {} points on depth edges lie on a colour edge, {:.0f} % before; with colour shifted "
        "at random {:.0f} +- {:.0f} %: {:.1f} sigma beyond chance, {:.1f} before ({} {}).",
        100 * now.share, now.points, 100 * then.share, 100 * now.by_chance, 100 * now.chance_sigma, now.sigmas(),
        then.sigmas(), frames.size(), between.empty() ? "frames, the refined ones" : "frames that took no part");
}

/// Refines; where the overlap of depths gets worse by it, again without the last of what was freed, and so on.
/// `overlap` tells its millimetres under a fit.
template <class Overlap>
Refinement refined_where_depths_agree(Evidence& evidence, const Model& first, const Camera& before,
                                      std::vector<Rung> rungs, const RefineOptions& options, const std::string& cannot,
                                      Overlap&& overlap) {
    const double before_mm = overlap(evidence.start(first));
    std::vector<Step> given_up;
    Refinement r = refine(evidence, first, before, rungs, options, cannot);
    for (double after_mm = overlap(r.climb.fit); r.changed() && after_mm > before_mm; after_mm = overlap(r.climb.fit)) {
        const auto last =
            std::find_if(r.climb.steps.rbegin(), r.climb.steps.rend(), [](const Step& step) { return step.climbed; });
        given_up.push_back(
            {last->name, false,
             fmt::format("not supported: depths of different frames would overlap worse, {:.2f} mm, {:.2f} "
                         "mm before",
                         after_mm, before_mm)});
        std::erase_if(rungs, [&](const Rung& rung) { return rung.name == given_up.back().name; });
        r = refine(evidence, first, before, rungs, options, cannot);
    }
    r.climb.steps.insert(r.climb.steps.end(), given_up.begin(), given_up.end());
    if (std::isfinite(before_mm))
        r.notes.push_back(overlap_sentence(before_mm, overlap(r.climb.fit)));
    return r;
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
    const auto error = [&](const Sequence& sequence, bool keeps) {
        Free free{}; // a wrong camera, clock or depth must not speak against the poses
        free[f] = free[k1] = true;
        free[time_offset] = sequence.tells_time();
        free[depth_scale] = free[depth_offset] = keeps;
        const Fit fit = sequence.fit(sequence.start(first), free, Views(frames.size(), true), false);
        return std::sqrt(fit.rss / fit.residuals);
    };
    if (error(kept, true) <= nearly * error(refined, false))
        return kept;
    how.refine_poses = true;
    return refined;
}

void take_poses(const Evidence& evidence, const std::vector<Eigen::Isometry3d>& poses, RecordingResult& result) {
    for (std::size_t i = 0; i < poses.size(); ++i)
        result.poses.emplace_back(evidence.view_name(i), poses[i]);
}

/// One camera took both images: what the fit says of it, of its depths and its clock.
void take_camera(const Capture& capture, bool stamped, RecordingResult& result) {
    const Model& model = result.refinement.climb.fit.model;
    result.file.camera = result.refinement.after;
    result.file.depth_correction = {model[depth_scale], model[depth_offset], model[depth_curve]};
    if (const auto& c = result.file.depth_correction; result.refinement.climb.start.model[depth_scale] != c.scale ||
                                                      result.refinement.climb.start.model[depth_offset] != c.offset_m ||
                                                      result.refinement.climb.start.model[depth_curve] != c.curve_per_m)
        result.refinement.notes.push_back(
            fmt::format("true depth is {}: a recorded 1 m is {:.4f} m, 3 m are {:.4f} m.", describe(c), c(1), c(3)));
    if (stamped)
        result.file.pose_time_offset_s = capture.pose_time_offset_s + model[time_offset];
}

RecordingResult refine_tracks(const Capture& capture, const Material& material,
                              const std::vector<SequenceFrame>& between, const Camera& before, SequenceOptions how,
                              const RecordingOptions& recording, RefineOptions options, std::vector<Rung> rungs,
                              const Model& first) {
    RecordingResult result{.refinement = {},
                           .file = {.camera = *capture.camera, .depth_units_per_metre = {}, .warnings = {}}};
    Sequence sequence = adjusted(material.frames, *capture.camera, first, how, recording.poses);
    if (sequence.tells_time())
        rungs.insert(rungs.begin() + (how.registered ? 0 : 1), {"time offset", {time_offset}});
    if (how.registered && !how.refine_poses)
        for (const Rung& rung : depth_rungs())
            rungs.push_back(rung);
    const Fit start = sequence.start(first);
    const auto overlap = [&](const Fit& fit) {
        return overlap_mm(sequence.depth_images(), how.registered ? fit.model : model_of(*capture.camera),
                          sequence.poses(fit));
    };
    result.refinement =
        refined_where_depths_agree(sequence, first, before, rungs, options, sequence.degeneracy(start), overlap);
    Refinement& r = result.refinement;
    r.source = fmt::format("{} points seen {} times in {} frames, {}, poses {}", sequence.points(),
                           sequence.sightings(), sequence.views(),
                           how.registered ? "colour registered with depth"
                                          : fmt::format("{} points of depth edges on edges of colour, which is not "
                                                        "registered with depth",
                                                        sequence.outline_points()),
                           how.refine_poses ? "refined" : "kept");
    if (!how.registered)
        r.notes.push_back(agreement_sentence(between, material, *capture.camera, start, r.climb.fit));
    take_poses(sequence, sequence.poses(r.climb.fit), result);
    if (how.registered) {
        take_camera(capture, material.stamped, result);
    } else {
        result.file.depth_correction = capture.depth_correction;
        result.file.registration = Registration::no;
        result.file.colour = ColourCamera{r.after, from_six(r.climb.fit.model.values.data() + turn_x)};
    }
    if (r.climb.free[time_offset])
        r.notes.push_back(fmt::format("{} taken {:.1f} {} after the time at which {} paired with {}.",
                                      how.registered ? "images were" : "colour images were",
                                      r.climb.fit.model[time_offset] * (material.stamped ? 1000 : 1),
                                      material.stamped ? "ms" : "frames", "they are",
                                      how.registered ? "poses" : "depth and poses"));
    return result;
}

RecordingResult refine_planes(const Capture& capture, Material material, const Camera& before,
                              const RefineOptions& options, const Model& first) {
    RecordingResult result{.refinement = {},
                           .file = {.camera = *capture.camera, .depth_units_per_metre = {}, .warnings = {}}};
    std::vector<PlaneFrame> frames;
    for (const SequenceFrame& part : material.frames)
        frames.push_back({part.name, part.depth_m, part.world_from_camera});
    Planes planes(std::move(frames), first);
    const auto overlap = [&](const Fit& fit) {
        return planes.linked() ? overlap_mm(planes.depth_images(), fit.model, planes.poses()) : std::nan("");
    };
    for (const std::vector<Rung>& ladder : planes.ladders()) {
        Refinement r = refined_where_depths_agree(planes, first, before, ladder, options, planes.degeneracy(), overlap);
        if (result.refinement.unit.empty() || r.climb.held_out_px < result.refinement.climb.held_out_px)
            result.refinement = std::move(r);
        if (!result.refinement.changed())
            break; // what finds nothing one way finds nothing the other
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
        recording.evidence == "tracks" || (recording.evidence == "auto" && first_with_colour(capture));
    SequenceOptions how;
    how.registered =
        recording.registered == "auto" ? capture.registration != Registration::no : recording.registered == "yes";
    if (!how.registered)
        capture.depth_correction = correction;
    Material material = material_of(capture, wanted, recording, with_colour);
    const cv::Size depth_size = material.frames.front().depth_m.size();
    options.ladder.guessed = settle_camera(capture, first, how.registered, depth_size);
    options.ladder.folds = std::min(options.ladder.folds, 4);
    // Depth errors hang together across a scene in ways that no cluster covers: a real error of the camera is far
    // beyond this.
    options.ladder.least_sigmas = std::max(options.ladder.least_sigmas, 5.0);

    const auto with_notes = [&](RecordingResult result) {
        result.stamps_s = material.stamps_s;
        std::vector<std::string>& notes = result.refinement.notes;
        notes.insert(notes.begin(), material.notes.begin(), material.notes.end());
        return result;
    };
    const Camera& depth_camera = *capture.camera;
    if (!with_colour) {
        capture.depth_correction = correction;
        return with_notes(
            refine_planes(capture, material, depth_camera, options, first_model(depth_camera, correction)));
    }
    const cv::Size colour_size = material.frames.front().grey.size();
    if (how.registered && colour_size != depth_size)
        throw Error(fmt::format(
            "{}: colour is {}x{}, depth {}x{}: not registered; --registered no refines the colour camera",
            capture.path.string(), colour_size.width, colour_size.height, depth_size.width, depth_size.height));
    if (how.registered)
        return with_notes(refine_tracks(capture, material, {}, depth_camera, how, recording, options,
                                        camera_rungs(depth_camera.distortion.model),
                                        first_model(depth_camera, correction)));
    auto beside = given_camera(first.colour_camera, 0, first.lens, colour_size);
    Model model;
    if (!beside && capture.colour_camera) {
        beside = capture.colour_camera->camera;
        model = model_of(*beside);
        to_six(capture.colour_camera->colour_from_depth, model.values.data() + turn_x);
    } else {
        options.ladder.guessed = !beside;
        if (!beside)
            beside = guessed_camera(first_with_colour(capture)->colour, first.lens, colour_size);
        model = model_of(*beside);
    }
    std::vector<Rung> rungs = camera_rungs(beside->distortion.model);
    rungs.insert(rungs.begin(), place_rung());
    return with_notes(refine_tracks(capture, material, frames_between(capture, wanted, recording), *beside, how,
                                    recording, options, rungs, model));
}

} // namespace scanshade
