// ChArUco detection of OpenCV 4.6 (contrib's aruco) and of 4.7 and later (objdetect).
#include "projection/calibration/boards/charuco.h"

#include "projection/base/error.h"

#include <algorithm>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#ifdef HAS_CHARUCO
#include <opencv2/core/version.hpp>
#define CHARUCO_IN_OBJDETECT (CV_VERSION_MAJOR > 4 || (CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR >= 7))
#if CHARUCO_IN_OBJDETECT
#include <opencv2/objdetect/charuco_detector.hpp>
#else
#include <opencv2/aruco/charuco.hpp>
#endif
#endif

namespace scanshade::calibration {
namespace {

struct Markers {
    std::vector<std::vector<cv::Point2f>> corners; ///< four of each marker, clockwise from its own upper left
    std::vector<int> ids;
};

#ifndef HAS_CHARUCO

constexpr bool reads_older_pattern = false;

CharucoCorners detect(const cv::Mat1b&, const CharucoLayout&, bool, Markers&) {
    throw Misuse("this build has no ChArUco boards: its OpenCV came without them");
}

#elif CHARUCO_IN_OBJDETECT

constexpr bool reads_older_pattern = true;

CharucoCorners detect(const cv::Mat1b& grey, const CharucoLayout& layout, bool older_pattern, Markers& markers) {
    cv::aruco::CharucoBoard board(layout.squares, layout.square_m, layout.marker_m,
                                  cv::aruco::getPredefinedDictionary(layout.dictionary));
    board.setLegacyPattern(older_pattern);
    CharucoCorners found;
    cv::aruco::CharucoDetector(board).detectBoard(grey, found.pixels, found.ids, markers.corners, markers.ids);
    return found;
}

#else

constexpr bool reads_older_pattern = false;

CharucoCorners detect(const cv::Mat1b& grey, const CharucoLayout& layout, bool, Markers& markers) {
    const auto dictionary = cv::aruco::getPredefinedDictionary(layout.dictionary);
    const auto board = cv::aruco::CharucoBoard::create(layout.squares.width, layout.squares.height, layout.square_m,
                                                       layout.marker_m, dictionary);
    cv::aruco::detectMarkers(grey, dictionary, markers.corners, markers.ids);
    CharucoCorners found;
    if (!markers.ids.empty())
        cv::aruco::interpolateCornersCharuco(markers.corners, markers.ids, grey, board, found.pixels, found.ids);
    return found;
}

#endif

/// The white squares, which hold the markers, in the order of their numbers.
std::vector<cv::Point> marker_squares(cv::Size squares, bool older_pattern) {
    const int white = older_pattern && squares.height % 2 == 0 ? 0 : 1;
    std::vector<cv::Point> all;
    for (int row = 0; row < squares.height; ++row)
        for (int column = 0; column < squares.width; ++column)
            if ((row + column) % 2 == white)
                all.emplace_back(column, row);
    return all;
}

/// How many markers lie on one plane as a pattern has them, to half a square. A lens bends all patterns alike.
std::size_t fitting_markers(const Markers& markers, const CharucoLayout& layout, bool older_pattern) {
    const std::vector<cv::Point> squares = marker_squares(layout.squares, older_pattern);
    std::vector<cv::Point2f> on_board, in_picture;
    double side_px = 0;
    for (std::size_t i = 0; i < markers.ids.size(); ++i) {
        if (markers.ids[i] < 0 || markers.ids[i] >= static_cast<int>(squares.size()))
            continue;
        const std::vector<cv::Point2f>& corners = markers.corners[i];
        on_board.emplace_back(squares[markers.ids[i]]);
        in_picture.push_back(0.25F * (corners[0] + corners[1] + corners[2] + corners[3]));
        side_px += cv::norm(corners[1] - corners[0]);
    }
    if (on_board.size() < 4)
        return 0;
    const double square_px = side_px / static_cast<double>(on_board.size()) * layout.square_m / layout.marker_m;
    cv::Mat1b fits;
    if (cv::findHomography(on_board, in_picture, cv::RANSAC, 0.5 * square_px, fits).empty())
        return 0;
    return static_cast<std::size_t>(cv::countNonZero(fits));
}

/// Corners to fractions of a pixel, in windows that hold no edge of a marker. OpenCV 4.10 gives them half a pixel too
/// far right and down (0.54 and 0.53 pixels on drawn boards; 0.01 after this).
void refine(const cv::Mat1b& grey, const CharucoLayout& layout, const Markers& markers, CharucoCorners& found) {
    if (found.pixels.empty() || markers.corners.empty())
        return;
    constexpr double share = 0.8; // of what is free around a corner, as for chessboards
    constexpr int least_half = 2, most_half = 15;
    double side_px = std::numeric_limits<double>::infinity();
    for (const std::vector<cv::Point2f>& corners : markers.corners)
        for (std::size_t i = 0; i < corners.size(); ++i)
            side_px = std::min(side_px, cv::norm(corners[i] - corners[(i + 1) % corners.size()]));
    const double free_px = side_px * (layout.square_m - layout.marker_m) / (2 * layout.marker_m);
    const int half = std::clamp(static_cast<int>(share * free_px), least_half, most_half);
    cv::cornerSubPix(grey, found.pixels, {half, half}, {-1, -1},
                     {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 100, 1e-4});
}

} // namespace

CharucoCorners find_charuco_corners(const cv::Mat1b& grey, const CharucoLayout& layout) {
    Markers markers;
    CharucoCorners found = detect(grey, layout, false, markers);
    if (layout.squares.height % 2 == 0 &&
        fitting_markers(markers, layout, true) > fitting_markers(markers, layout, false)) {
        found.older_pattern = !reads_older_pattern;
        if (reads_older_pattern)
            found = detect(grey, layout, true, markers);
    }
    refine(grey, layout, markers, found);
    return found;
}

} // namespace scanshade::calibration
