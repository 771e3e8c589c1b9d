// What may be wrong with a recording, as a table: each row changes the files of a copy.
#pragma once

#include "projection/camera.h"

#include <filesystem>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace scanshade::gauntlet {

/// A copy of a recording: a folder in the recording's own layout, its camera in camera.json.
struct RecordingCopy {
    std::filesystem::path folder;
    std::vector<std::filesystem::path> depth = {}; ///< 16-bit images
    Pinhole camera;                                ///< as camera.json states it
    std::optional<double> units_per_metre = {};    ///< likewise; none = the layout's
    double layout_units_per_metre = 1000;          ///< what it means where camera.json says nothing
};

/// Writes camera.json of a copy.
void write_camera(const RecordingCopy& copy);

struct RecordingPerturbation {
    std::string_view name; ///< also the copy's folder
    void (*apply)(RecordingCopy& copy);
    /// The pixel of the unperturbed image that a pixel of a perturbed image of this size shows; null = the same one.
    cv::Point (*original_of)(cv::Point pixel, cv::Size perturbed) = nullptr;
    bool lists = false; ///< changes TUM's lists: makes sense only there
};

/// The first row changes nothing.
[[nodiscard]] std::span<const RecordingPerturbation> recording_perturbations();

} // namespace scanshade::gauntlet
