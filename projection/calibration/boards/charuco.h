// OpenCV's ChArUco boards, one interface over its versions. A build whose OpenCV lacks them throws.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace scanshade::calibration {

/// Squares across and down, lengths in metres, and OpenCV's number of the dictionary (DICT_4X4_50 is 0, in its enumeration's order).
struct CharucoLayout {
    cv::Size squares;
    float square_m = 0, marker_m = 0;
    int dictionary = 0;
};

/// Inner corners found in a picture: pixels, and which corner of the board each is, counted row by row.
struct CharucoCorners {
    std::vector<cv::Point2f> pixels;
    std::vector<int> ids;
    /// The median distance of a corner to the middle of its two neighbours in a row or column, in spacings. Perspective and lenses
    /// leave below 0.1, a board of another pattern than the layout's more than 0.4 (board_detection_test). 0 where none has two.
    double unevenness = 0;
};
inline constexpr double most_unevenness = 0.2;

/// Boards with an even number of rows were printed with the other colour in the first square before OpenCV 4.6. OpenCV 4.7 and
/// later find both patterns; 4.6 misplaces the corners of the older one, which their unevenness shows. No corners where no board is
/// seen. Throws Misuse where this build has no ChArUco.
[[nodiscard]] CharucoCorners find_charuco_corners(const cv::Mat1b& grey, const CharucoLayout& layout);

} // namespace scanshade::calibration
