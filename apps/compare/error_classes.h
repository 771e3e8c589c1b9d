// Classes of pixels whose errors differ: by place, by distance from depth edges, by viewing angle, by range, by
// confidence.
#pragma once

#include "projection/camera.h"

#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace scanshade {

/// Each pixel's class, an index into `names`, or `none` where there is no depth.
struct PixelClasses {
    static constexpr unsigned char none = 255;
    std::vector<std::string> names;
    cv::Mat1b of;
};

/// By distance in pixels to the nearest pixel at a jump of depth. At a jump 1/z differs by more than 1 % and neither
/// side's slope predicts the other (1/z is linear on planes), or the depth ends.
[[nodiscard]] PixelClasses by_edge_distance(const cv::Mat1f& z_m);
/// By the angle between the surface's normal and the direction to the camera.
[[nodiscard]] PixelClasses by_grazing_angle(const cv::Mat1f& z_m, const Pinhole& camera);
/// By depth.
[[nodiscard]] PixelClasses by_range(const cv::Mat1f& z_m);

/// What by_place() tells apart, in the order of its classes. A pixel belongs to the first that fits.
enum Place : unsigned char {
    thin_thing,   ///< falls off to both sides within 4 cm, along one of four lines in the image
    deep_corner,  ///< true visibility below 0.2
    near_hole,    ///< the recorded depth has a hole within 4 pixels
    near_edge,    ///< a jump of depth within 8 pixels
    open_flat,    ///< true visibility of at least 0.95
    between_them, ///< all others: folds, contacts, and what lies around them
    place_count
};
/// By what a pixel shows and what is near it. `exact_z_m` and `truth` say what is there, `recorded_z_m` what the sensor
/// saw of it; all of one size.
[[nodiscard]] PixelClasses by_place(const cv::Mat1f& exact_z_m, const cv::Mat1f& recorded_z_m, const cv::Mat1f& truth,
                                    const Pinhole& camera);

/// By confidence (projection/confidence.h); pixels without one (NaN) have no class.
[[nodiscard]] PixelClasses by_confidence(const cv::Mat1f& confidence);

/// Differences of two maps, gathered by class over any number of images.
class ErrorByClass {
  public:
    /// The class names must be the same for all images.
    void add(const cv::Mat1f& a, const cv::Mat1f& b, const PixelClasses& classes);
    void add(const ErrorByClass& other);
    [[nodiscard]] const std::vector<std::string>& names() const { return names_; }
    [[nodiscard]] double pixels(std::size_t i) const { return sums_[i].n; }
    /// Root mean square of the class; NaN where it has no pixel.
    [[nodiscard]] double rms(std::size_t i) const;
    /// Mean of a - b; NaN likewise.
    [[nodiscard]] double bias(std::size_t i) const;

  private:
    struct Sum {
        double n = 0, apart = 0, squares = 0;
    };
    std::vector<std::string> names_;
    std::vector<Sum> sums_;
};

} // namespace scanshade
