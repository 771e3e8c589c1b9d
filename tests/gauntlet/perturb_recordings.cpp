// What may be wrong with a recording, as a table.
#include "tests/gauntlet/perturb_recordings.h"

#include "apps/scenes/world/random_noise.h"
#include "io/images/image_file.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fstream>
#include <functional>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

namespace scanshade::gauntlet {
namespace {

namespace fs = std::filesystem;
using Copy = RecordingCopy;
using Depth = cv::Mat1w;

constexpr double cropped_share = 0.4; ///< of width and height
constexpr double largest = std::numeric_limits<std::uint16_t>::max();

// --- images ---

void each_depth(const Copy& copy, const std::function<void(Depth&)>& change) {
    for (const fs::path& file : copy.depth) {
        Depth depth = read_stored_depth(file);
        change(depth);
        cv::imwrite(file.string(), depth);
    }
}

/// As above, where the images change their size. The camera learns of it, as from a recorder that writes what it has.
void each_resized(Copy& copy, const std::function<void(Depth&)>& change) {
    each_depth(copy, [&](Depth& depth) {
        change(depth);
        copy.camera.size = depth.size();
    });
    write_camera(copy);
}

void nothing(Copy&) {}

void rows_repeated(Copy& copy) {
    each_depth(copy, [](Depth& depth) {
        for (int v = 2; v < depth.rows; v += 3)
            depth.row(v - 1).copyTo(depth.row(v));
    });
}

void rows_doubled(Copy& copy) {
    each_depth(copy, [](Depth& depth) {
        for (int v = depth.rows - 1; v > 0; --v)
            depth.row(v / 2).copyTo(depth.row(v));
    });
}
cv::Point undoubled(cv::Point pixel, cv::Size) { return {pixel.x, pixel.y / 2}; }

/// Holes are zeros, and are mixed with depths like any other number: that is what makes it wrong.
void interpolated(Copy& copy) {
    each_depth(copy, [](Depth& depth) {
        const cv::Size size = depth.size();
        cv::Mat larger;
        cv::resize(depth, larger, {}, 1.25, 1.25, cv::INTER_LINEAR);
        cv::resize(larger, depth, size, 0, 0, cv::INTER_LINEAR);
    });
}

void upside_down(Copy& copy) {
    each_depth(copy, [](Depth& depth) { cv::flip(depth, depth, 0); });
}
cv::Point not_upside_down(cv::Point pixel, cv::Size size) { return {pixel.x, size.height - 1 - pixel.y}; }

void mirrored(Copy& copy) {
    each_depth(copy, [](Depth& depth) { cv::flip(depth, depth, 1); });
}
cv::Point unmirrored(cv::Point pixel, cv::Size size) { return {size.width - 1 - pixel.x, pixel.y}; }

/// Left and top are cut off, so the principal point should move by as much.
void cropped(Copy& copy) {
    each_resized(copy, [](Depth& depth) {
        const int left = cvRound(cropped_share * depth.cols), top = cvRound(cropped_share * depth.rows);
        depth = depth(cv::Rect(left, top, depth.cols - left, depth.rows - top)).clone();
    });
}
cv::Point uncropped(cv::Point pixel, cv::Size size) {
    const double of_rest = cropped_share / (1 - cropped_share);
    return pixel + cv::Point(cvRound(of_rest * size.width), cvRound(of_rest * size.height));
}

void halved(Copy& copy) {
    each_resized(copy, [](Depth& depth) {
        Depth half(depth.rows / 2, depth.cols / 2);
        for (int v = 0; v < half.rows; ++v)
            for (int u = 0; u < half.cols; ++u)
                half(v, u) = depth(2 * v, 2 * u);
        depth = half;
    });
}
cv::Point unhalved(cv::Point pixel, cv::Size) { return 2 * pixel; }

// --- values ---

/// What a 16-bit image cannot hold becomes a hole.
void each_value(const Copy& copy, const std::function<double(double value, cv::Point pixel)>& changed) {
    each_depth(copy, [&](Depth& depth) {
        for (int v = 0; v < depth.rows; ++v)
            for (int u = 0; u < depth.cols; ++u) {
                const double value = std::round(changed(depth(v, u), {u, v}));
                depth(v, u) = value < largest ? static_cast<std::uint16_t>(value) : 0;
            }
    });
}

/// Where camera.json names the unit, it is wrong there; elsewhere the values are in another unit than the layout's.
template <int per_mille>
void unit(Copy& copy) {
    constexpr double factor = per_mille / 1000.0;
    if (copy.units_per_metre) {
        *copy.units_per_metre /= factor;
        write_camera(copy);
    } else
        each_value(copy, [](double value, cv::Point) { return value * factor; });
}

/// The same of a sensor whose steps are as fine as its unit: not all values are multiples.
template <int factor>
void finer_unit(Copy& copy) {
    if (copy.units_per_metre)
        return unit<1000 * factor>(copy);
    const Noise noise(3, 0, 99);
    each_value(copy, [&](double value, cv::Point p) {
        return value == 0 ? 0 : value * factor + std::floor(factor * (noise.uniform(p.x, p.y) - 0.5));
    });
}

/// Distance along the ray in place of z.
void range_for_z(Copy& copy) {
    each_value(copy, [&](double value, cv::Point p) { return value * copy.camera.ray(p.x, p.y).norm(); });
}

void bytes_swapped(Copy& copy) {
    each_value(copy, [](double value, cv::Point) {
        const auto bits = static_cast<unsigned>(value);
        return (bits >> 8U) | (bits & 255U) << 8U;
    });
}

/// As SUN RGB-D stores millimetres.
void bits_rotated(Copy& copy) {
    const double per_mm = copy.units_per_metre.value_or(copy.layout_units_per_metre) / 1000;
    each_value(copy, [&](double value, cv::Point) {
        const auto bits = static_cast<unsigned>(std::round(value / per_mm));
        return (bits << 3U | bits >> 13U) & 0xffffU;
    });
}

// --- the camera ---

void longer_focal(Copy& copy) {
    copy.camera.fx *= 1.5;
    copy.camera.fy *= 1.5;
    write_camera(copy);
}

void shorter_focal(Copy& copy) {
    copy.camera.fx /= 1.5;
    copy.camera.fy /= 1.5;
    write_camera(copy);
}

/// By 60 pixels of 640.
void principal_off(Copy& copy) {
    copy.camera.cx += 60.0 / 640 * copy.camera.size.width;
    copy.camera.cy -= 60.0 / 640 * copy.camera.size.width;
    write_camera(copy);
}

void y_up(Copy& copy) {
    copy.camera.fy = -copy.camera.fy;
    write_camera(copy);
}

// --- lists ---

std::vector<std::string> lines_of(const fs::path& file) {
    std::ifstream stream(file);
    std::vector<std::string> lines;
    for (std::string line; std::getline(stream, line);)
        if (!line.empty() && line.front() != '#')
            lines.push_back(line);
    return lines;
}

void write_lines(const fs::path& file, const std::vector<std::string>& lines) {
    std::ofstream stream(file);
    for (const std::string& line : lines)
        stream << line << '\n';
}

void half_a_list(Copy& copy) {
    std::vector<std::string> lines = lines_of(copy.folder / "depth.txt");
    lines.resize((lines.size() + 1) / 2);
    write_lines(copy.folder / "depth.txt", lines);
}

/// As after a full disk.
void line_cut(Copy& copy) {
    std::vector<std::string> lines = lines_of(copy.folder / "depth.txt");
    lines.back().resize(lines.back().size() - 8);
    write_lines(copy.folder / "depth.txt", lines);
}

void out_of_order(Copy& copy) {
    std::vector<std::string> lines = lines_of(copy.folder / "depth.txt");
    std::ranges::reverse(lines);
    write_lines(copy.folder / "depth.txt", lines);
}

void later(const fs::path& list, double by_s) {
    if (!fs::exists(list))
        return;
    std::vector<std::string> lines = lines_of(list);
    for (std::string& line : lines) {
        std::size_t stamp = 0;
        const double stamp_s = std::stod(line, &stamp);
        line = fmt::format("{:.6f}{}", stamp_s + by_s, line.substr(stamp));
    }
    write_lines(list, lines);
}

void late_poses(Copy& copy) { later(copy.folder / "groundtruth.txt", 5); }
void late_colour(Copy& copy) { later(copy.folder / "rgb.txt", 0.5); }

// --- files ---

/// A fifth of the images, at least one, end in the middle.
void damaged(Copy& copy) {
    for (std::size_t i = 0; i < copy.depth.size(); i += 5)
        fs::resize_file(copy.depth[i], fs::file_size(copy.depth[i]) / 2);
}

constexpr RecordingPerturbation table[] = {
    {"unperturbed", nothing},
    {"rows-repeated", rows_repeated},
    {"rows-doubled", rows_doubled, undoubled},
    {"interpolated", interpolated},
    {"unit-x10", unit<10000>},
    {"unit-x5", unit<5000>},
    {"unit-x10-fine", finer_unit<10>},
    {"unit-x5-fine", finer_unit<5>},
    {"unit-x1.1", unit<1100>},
    {"unit-x0.2", unit<200>},
    {"unit-x0.1", unit<100>},
    {"range-for-z", range_for_z},
    {"bytes-swapped", bytes_swapped},
    {"bits-rotated", bits_rotated},
    {"upside-down", upside_down, not_upside_down},
    {"mirrored", mirrored, unmirrored},
    {"cropped", cropped, uncropped},
    {"halved", halved, unhalved},
    {"focal-x1.5", longer_focal},
    {"focal-x0.67", shorter_focal},
    {"principal-60px", principal_off},
    {"y-up", y_up},
    {"half-a-list", half_a_list, nullptr, true},
    {"line-cut", line_cut, nullptr, true},
    {"out-of-order", out_of_order, nullptr, true},
    {"poses-5s-late", late_poses, nullptr, true},
    {"colour-0.5s-late", late_colour, nullptr, true},
    {"damaged", damaged},
};

} // namespace

void write_camera(const RecordingCopy& copy) {
    const Pinhole& camera = copy.camera;
    std::ofstream stream(copy.folder / "camera.json");
    stream << fmt::format(R"({{"fx": {}, "fy": {}, "cx": {}, "cy": {}, "width": {}, "height": {})", camera.fx,
                          camera.fy, camera.cx, camera.cy, camera.size.width, camera.size.height);
    if (copy.units_per_metre)
        stream << fmt::format(R"(, "depth_units_per_metre": {})", *copy.units_per_metre);
    stream << "}\n";
}

std::span<const RecordingPerturbation> recording_perturbations() { return table; }

} // namespace scanshade::gauntlet
