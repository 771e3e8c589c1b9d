// Points that several colour images of a recording show: they link the frames.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace scanshade::calibration {

/// One point of the scene in several images, at most once in each.
struct Track {
    struct Observation {
        int frame;
        cv::Point2d pixel;
    };
    std::vector<Observation> observations;
};

/// SIFT features (Lowe 2004) are matched both ways between frames 1, 2, 4 and 8 apart, and filtered by a fundamental
/// matrix. Chains of matches are tracks. Returns tracks of at least `shortest` observations, longest first, at most
/// `most` of them, spread over the images.
[[nodiscard]] std::vector<Track> find_tracks(const std::vector<cv::Mat1b>& images, int shortest = 3,
                                             std::size_t most = 800);

} // namespace scanshade::calibration
