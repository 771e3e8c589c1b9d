// OpenCV's ChArUco boards, one interface over its versions. A build whose OpenCV lacks them throws.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace scanshade::calibration {

/// Squares across and down, lengths in metres, and OpenCV's number of the dictionary (DICT_4X4_50 is 0, in its
/// enumeration's order).
struct CharucoLayout {
    cv::Size squares;
    float square_m = 0, marker_m = 0;
    int dictionary = 0;
};

/// Inner corners found in a picture: pixels, and which corner of the board each is, counted row by row.
struct CharucoCorners {
    std::vector<cv::Point2f> pixels;
    std::vector<int> ids;
    bool older_pattern =
        false; ///< the markers are where boards from before OpenCV 4.6 have them, and the corners may be misplaced
};

/// Boards with an even number of rows had the other colour in the first square before OpenCV 4.6. Which pattern a
/// picture shows is decided by where its markers are. OpenCV 4.7 and later read both patterns; 4.6 misplaces the
/// corners of the older one, and `older_pattern` says so. No corners where no board is seen. Throws Misuse where this
/// build has no ChArUco.
[[nodiscard]] CharucoCorners find_charuco_corners(const cv::Mat1b& grey, const CharucoLayout& layout);

} // namespace scanshade::calibration
