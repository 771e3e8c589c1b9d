// Points as the page draws them: the nodes of an octree, a file each, of which the page loads those that a view needs.
#pragma once

#include <cstddef>
#include <Eigen/Core>
#include <filesystem>
#include <functional>
#include <opencv2/core.hpp>
#include <span>
#include <string>
#include <vector>

namespace scanshade::page {

/// A number that points have in their file besides: intensity, class, time ...
struct Field {
    std::string name;
    bool whole = false; ///< integers
};

/// One value per point each; all but `points` may be empty. Points that are not finite are left out.
struct Points {
    std::span<const Eigen::Vector3d> points;
    std::span<const cv::Vec3b> colours = {};                 ///< BGR
    std::span<const float> visibility = {}, confidence = {}; ///< 0 .. 1, NaN = none
    std::span<const Eigen::Vector3f> normals = {};           ///< zero = none
    Eigen::Vector3d up = {0, -1, 0};                         ///< as of a camera's space
    std::vector<Field> fields = {};
    /// Fills in a point's values of `fields`, NaN = none. Called from several threads.
    std::function<void(std::size_t point, std::span<double> values)> read = {};
};

inline constexpr std::size_t most_fields = 24; ///< those behind are counted, not written

/// Writes FOLDER/STEM.000.js, FOLDER/STEM.001.js ... of at most `most` points, evenly chosen; returns these names
/// without the folder. Each point is in one file: a node of an octree (octree.h), the first its root. The octree's cube
/// is round all but stray points, which are left out. Positions have 16 bits in the boxes of the deepest nodes, and the
/// same steps in all. Fields get 16 bits, exact for integers that differ by less than 65535. Each file is atomic, the
/// first is written last, and after an error none is left; equal inputs give equal bytes. Memory: 16 bytes for each of
/// at most 2 `most` points, and a few megabytes for each core.
std::vector<std::filesystem::path> write_points(const std::filesystem::path& folder, const std::filesystem::path& stem,
                                                const Points& cloud, std::size_t most);

} // namespace scanshade::page
