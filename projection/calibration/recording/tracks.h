// Points that a recording's colour images show again and again: what ties frames to each other.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace scanshade::calibration {

/// One point of the scene as several images show it, at most once each.
struct Track {
    struct Sighting {
        int frame;
        cv::Point2d pixel;
    };
    std::vector<Sighting> sightings;
};

/// Features (SIFT, Lowe 2004) matched both ways between frames 1, 2, 4 and 8 apart, kept where a fundamental matrix
/// explains them, and chained. Tracks of at least `shortest` sightings, longest first, at most `most` of them, spread
/// over the images.
[[nodiscard]] std::vector<Track> find_tracks(const std::vector<cv::Mat1b>& images, int shortest = 3,
                                             std::size_t most = 800);

} // namespace scanshade::calibration
