// What Capture::load and Capture::examine are made of.
#pragma once

#include "io/captures/capture.h"

#include <fmt/format.h>
#include <string>

namespace scanshade {

[[nodiscard]] inline std::string size_text(cv::Size size) { return fmt::format("{}x{}", size.width, size.height); }

/// Throws Outage where the capture is not there: a network share that disappears while frames are read is not their
/// fault.
void check_still_there(const Capture& capture);

/// From stored numbers: depth in metres without those of low confidence, the camera, and colour if it is wanted.
void load_depth(const Capture& capture, const CaptureEntry& entry, const cv::Mat& stored, Frame& frame,
                bool with_colour);
/// The same for a look: counts of the stored values.
void examine_depth(const Capture& capture, const CaptureEntry& entry, ExaminedFrame& examined);
/// A damaged or unfitting image is a warning.
void load_colour(const Capture& capture, const CaptureEntry& entry, cv::Size depth_size, Frame& frame);
void load_cloud(const Capture& capture, const CaptureEntry& entry, Frame& frame);

// --- what depth is loaded and examined with ---

/// The entry's own camera or the capture's. It must be for images of depth's size: nothing is scaled unasked.
void take_camera(const Capture& capture, const CaptureEntry& entry, cv::Size depth_size, Frame& frame);
[[nodiscard]] DepthEncoding encoding_of(const Capture& capture, const CaptureEntry& entry);
/// Depth corrected below zero is a hole.
void correct(cv::Mat1f& depth_m, const DepthCorrection& correction);
/// Warns of a share of guesses that is worth a word: `beyond` of `all` depths.
void tell_guesses(const Capture& capture, double beyond, double all, Frame& frame);

} // namespace scanshade
