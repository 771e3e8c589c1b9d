// The table: cameras as their data sets publish them. A start for `refine`, not a calibration of the device at hand.
#include "io/cameras/known_cameras.h"

#include <algorithm>

namespace scanshade {
namespace {

struct Row {
    const char *name, *whose;
    Pinhole pinhole;
    Distortion distortion = {};
};

const cv::Size vga{640, 480};
const Row rows[] = {
    {"primesense", "PrimeSense's nominal camera (Redwood, Open3D)", {525, 525, 319.5, 239.5, vga}},
    {"7-scenes", "7-Scenes' nominal depth camera", {585, 585, 320, 240, vga}},
    {"tum-fr1",
     "TUM freiburg1's colour camera",
     {517.3, 516.5, 318.6, 255.3, vga},
     {0.2624, -0.9531, -0.0054, 0.0026, 1.1633}},
    {"tum-fr2", "TUM freiburg2's camera, its lens left out", {520.9, 521.0, 325.1, 249.7, vga}},
    {"tum-fr3", "TUM freiburg3's rectified camera", {535.4, 539.2, 320.1, 247.6, vga}},
    {"bonn",
     "Bonn dynamic's camera",
     {542.822841, 542.576870, 315.593520, 237.756098, vga},
     {0.039903, -0.099343, -0.000730, -0.000144, 0}},
    {"nyu-colour", "NYU depth v2's colour camera", {518.858, 519.470, 325.582, 253.736, vga}},
    {"nyu-depth", "NYU depth v2's depth camera", {582.62448, 582.69103, 313.04476, 238.44390, vga}},
    {"scenenet", "SceneNet RGB-D's camera", {277.13, 289.71, 160, 120, {320, 240}}},
};

} // namespace

std::optional<Camera> known_camera(const std::string& name) {
    const auto* row =
        std::find_if(std::begin(rows), std::end(rows), [&](const Row& known) { return name == known.name; });
    if (row == std::end(rows))
        return std::nullopt;
    return Camera{row->pinhole, row->distortion, std::string(row->whose) + ", as published"};
}

std::vector<std::string> known_camera_names() {
    std::vector<std::string> names;
    for (const Row& row : rows)
        names.emplace_back(row.name);
    return names;
}

} // namespace scanshade
