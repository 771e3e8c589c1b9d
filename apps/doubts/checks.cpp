#include "apps/doubts/checks.h"

#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <iterator>

namespace scanshade {
namespace {

constexpr std::array rows{
    CheckRow{Check::other, "other", "result", "found by another version", "yes"},
    CheckRow{Check::view_angle, "view_angle", "camera", "angle of view along the wider side, degrees",
             "below 0.5 or above 175"},
    CheckRow{Check::pixel_aspect, "pixel_aspect", "camera", "fx / fy, or its inverse", "above 2"},
    CheckRow{Check::principal_point, "principal_point", "camera",
             "principal point off the image's middle, in widths or heights", "above 0.2"},
    CheckRow{Check::turned_camera, "turned_camera", "camera",
             "principal point in the middle of the image turned by 90 degrees", "yes"},
    CheckRow{Check::lens_fold, "lens_fold", "camera", "share of the pixels beyond the fold of the lens model",
             "above 0.02; fisheye 0.5"},
    CheckRow{Check::no_depth, "no_depth", "depth", "every pixel or point is a hole", "yes"},
    CheckRow{Check::depth_jumps, "depth_jumps", "depth",
             "share of neighbouring depths that differ by more than a fifth", "above 0.2"},
    CheckRow{Check::median_depth, "median_depth", "depth", "median or largest depth / the nearest plausible one",
             "above 1"},
    CheckRow{Check::depth_multiples, "depth_multiples", "depth",
             "common step of stored values whose unit is not stated, mm", "above 1.5"},
    CheckRow{Check::stretched_depth, "stretched_depth", "depth", "values fill the range of the file's numbers", "yes"},
    CheckRow{Check::enlarged_image, "enlarged_image", "depth", "share of rows and columns that repeat the one before",
             "above 0.3, and alike"},
    CheckRow{Check::repeated_lines, "repeated_lines", "depth", "every n-th row repeats, and no column, or the reverse",
             "yes"},
    CheckRow{Check::depth_buffer, "depth_buffer", "depth", "patches are planes as a depth buffer and not as z",
             "above 80 % of 6 and more"},
    CheckRow{Check::depth_kind, "depth_kind", "depth", "patches bend as planes do in ranges or disparities",
             "above 80 % of 6 and more"},
    CheckRow{Check::nearest_end, "nearest_end", "depth", "share of pixels at the smallest depth",
             "above 2 % with noise elsewhere; 5 % at a usual mark; 0.5 % apart"},
    CheckRow{Check::farthest_end, "farthest_end", "depth", "share of pixels at the largest depth", "likewise"},
    CheckRow{Check::holes, "holes", "depth", "share of the pixels that hold a depth, but of an object cut out",
             "below 0.2: a warning"},
    CheckRow{Check::scattered_pixels, "scattered_pixels", "depth",
             "share of the valid pixels with another within two rows and columns", "below 0.3"},
    CheckRow{Check::depth_steps, "depth_steps", "depth", "constant steps of depth / radius", "above 0.022"},
    CheckRow{Check::depth_noise, "depth_noise", "depth",
             "share of the pixels whose noise is above a quarter of the radius", "above 0.3: a warning"},
    CheckRow{Check::pose_scale, "pose_scale", "depth", "depths fit the poses only if multiplied by a number",
             "of 1/20 to 20"},
    CheckRow{Check::radius_in_pixels, "radius_in_pixels", "setting", "radius in pixels, at the median depth",
             "below 2"},
    CheckRow{Check::radius_in_scene, "radius_in_scene", "setting", "extent of an image's scene / radius", "below 2"},
    CheckRow{Check::voxel_room, "voxel_room", "setting", "voxels of vxao in a radius", "below 7.9"},
    CheckRow{Check::few_points, "few_points", "cloud", "points, where there are no faces", "below 10"},
    CheckRow{Check::point_numbers, "point_numbers", "cloud", "x counts the points", "yes"},
    CheckRow{Check::degrees, "degrees", "cloud", "coordinates are in degrees", "yes"},
    CheckRow{Check::coordinate_steps, "coordinate_steps", "cloud", "steps of the coordinates in spacings",
             "above 0.5 along all axes or two; 4 along one, 0.3 in single precision"},
    CheckRow{Check::splats_in_view, "splats_in_view", "setting", "Gaussian splats computed in a camera's view", "yes"},
    CheckRow{Check::radius_in_spacings, "radius_in_spacings", "setting", "radius in spacings of the points", "below 2"},
    CheckRow{Check::radius_in_cloud, "radius_in_cloud", "setting", "extent of a cloud / radius", "below 1"},
    CheckRow{Check::noise_left, "noise_left", "cloud", "share of the rays from fronts that meet backs", "above 0.42"},
    CheckRow{Check::error_by_part, "error_by_part", "cloud",
             "error by the check on a part, where at most 0.12 is expected, RMS", "above 0.3"},
    CheckRow{Check::normals_to_station, "normals_to_station", "cloud",
             "share of the recorded normals that face away from their station", "above 0.05"},
    CheckRow{Check::normals_to_scanner, "normals_to_scanner", "cloud", "the same of the recorded position, up to 0.9",
             "above 0.05"},
    CheckRow{Check::normals_to_space, "normals_to_space", "cloud",
             "share of the recorded normals that face away from all scanners that could be", "above 0.9"},
    CheckRow{Check::normals_to_sky, "normals_to_sky", "cloud", "mean rise of recorded normals of terrain",
             "below -0.5"},
    CheckRow{Check::sides, "sides", "cloud", "probability that the opposite of all sides found is right", "above 0.1"},
    CheckRow{Check::splat_gaps, "splat_gaps", "cloud",
             "share of their surface that Gaussian splats cover, as they stand", "below 0.2"},
    CheckRow{Check::coverage, "coverage", "result", "share of the valid pixels or points with a value", "below 0.2"},
    CheckRow{Check::all_open, "all_open", "result", "share of values that are 1 though there are hollows",
             "above 0.999"},
    CheckRow{Check::all_closed, "all_closed", "result", "share of values that are 0", "above 0.999"},
    CheckRow{Check::texture_overlap, "texture_overlap", "result",
             "share of the texels that several parts of a mesh use", "above 0.01"},
};

constexpr bool in_order() {
    for (std::size_t i = 0; i < rows.size(); ++i)
        if (rows[i].check != static_cast<Check>(i))
            return false;
    return rows.size() == static_cast<std::size_t>(Check::texture_overlap) + 1;
}
static_assert(in_order(), "each check has its row, in the order of Check");

} // namespace

std::span<const CheckRow> all_checks() { return std::span(rows).subspan(1); }

const CheckRow& row_of(Check check) { return rows.at(static_cast<std::size_t>(check)); }

Check check_named(std::string_view name) {
    const auto found = std::ranges::find(rows, name, &CheckRow::name);
    if (found == rows.end())
        throw Error(fmt::format("'{}' is no check", name));
    return found->check;
}

std::string checks_text() {
    std::string text;
    for (const CheckRow& row : all_checks())
        fmt::format_to(std::back_inserter(text), "{:20} {:8} {}: {}\n", row.name, row.subject, row.statistic,
                       row.doubtful);
    return text;
}

std::string checks_markdown() {
    std::string text = "| check | what is measured | doubtful |\n| --- | --- | --- |\n";
    for (const CheckRow& row : all_checks())
        fmt::format_to(std::back_inserter(text), "| `{}` | {} | {} |\n", row.name, row.statistic, row.doubtful);
    return text;
}

} // namespace scanshade
