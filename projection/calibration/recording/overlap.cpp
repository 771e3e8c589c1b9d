// Transforms one frame's depth into another, and compares both.
#include "projection/calibration/recording/overlap.h"

#include "projection/calibration/recording/geometry.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace scanshade::calibration {
namespace {

/// Distances of one frame's surface from another's, on every eighth pixel, millimetres.
void add_distances(const cv::Mat1f& depth_a, const cv::Mat1f& depth_b, const Eigen::Isometry3d& b_from_a,
                   const Model& model, std::vector<double>& distances_mm) {
    constexpr int stride = 8;
    constexpr double most = 0.05; // of the depth: larger distances are to other surfaces, or a camera far off
    const Camera camera = camera_of(model);
    for (int v = stride; v < depth_a.rows - stride; v += stride)
        for (int u = stride; u < depth_a.cols - stride; u += stride) {
            if (!(depth_a(v, u) > 0))
                continue;
            const Eigen::Vector3d point =
                b_from_a * (corrected_m(model, depth_a(v, u)) * ray_of(camera, Eigen::Vector2d(u, v)));
            if (point.z() <= 0.1)
                continue;
            Eigen::Vector2d pixel;
            pixel_of(model.lens, model.values.data(), point.data(), pixel.data());
            const double z = depth_at(depth_b, pixel);
            if (z > 0)
                distances_mm.push_back(1000 * std::min(std::abs(corrected_m(model, z) - point.z()), most * z));
        }
}

} // namespace

double overlap_mm(const std::vector<cv::Mat1f>& depths_m, const Model& model,
                  const std::vector<Eigen::Isometry3d>& poses) {
    std::vector<double> distances_mm;
    for (std::size_t a = 0; a < depths_m.size(); ++a)
        for (const std::size_t b : {a + 1, a + 4, a + 10})
            if (b < depths_m.size())
                add_distances(depths_m[a], depths_m[b], poses[b].inverse() * poses[a], model, distances_mm);
    return distances_mm.empty() ? std::nan("")
                                : std::accumulate(distances_mm.begin(), distances_mm.end(), 0.0) /
                                      static_cast<double>(distances_mm.size());
}

} // namespace scanshade::calibration
