// Calls OpenCV's detector of each target and returns points and pixels.
#include "projection/calibration/boards/board_detection.h"

#include "projection/error.h"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

namespace scanshade::calibration {
namespace {

std::vector<std::pair<std::string, int>> dictionaries() {
    std::vector<std::pair<std::string, int>> all;
    int index = cv::aruco::DICT_4X4_50; // the enumeration runs in this order
    for (const char* bits : {"4x4", "5x5", "6x6", "7x7"})
        for (const int count : {50, 100, 250, 1000})
            all.emplace_back(fmt::format("{}_{}", bits, count), index++);
    return all;
}

int dictionary_named(const std::string& name) {
    for (const auto& [known, index] : dictionaries())
        if (known == name)
            return index;
    throw Misuse(
        fmt::format("'{}' is not a marker dictionary, expected one of {}", name, fmt::join(dictionary_names(), ", ")));
}

void check(const Target& target) {
    if (target.count.width < 3 || target.count.height < 3)
        throw Misuse(fmt::format("a board of {}x{} points is too small, at least 3x3 expected", target.count.width,
                                 target.count.height));
    if (!(target.square_m > 0))
        throw Misuse(fmt::format("the board's square is {} m, a positive length expected", target.square_m));
    if (target.kind == Target::Kind::charuco && target.marker_m >= target.square_m)
        throw Misuse(fmt::format("the board's marker of {} m does not fit its square of {} m", target.marker_m,
                                 target.square_m));
}

BoardView view_of(const std::vector<cv::Point2f>& pixels, const Target& target, const std::string& name) {
    BoardView view{name, {}, {}};
    const bool staggered = target.kind == Target::Kind::asymmetric_circles;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
        const auto row = static_cast<int>(i) / target.count.width, column = static_cast<int>(i) % target.count.width;
        const double across = staggered ? 2 * column + row % 2 : column;
        view.points_m.emplace_back(across * target.square_m, row * target.square_m, 0);
        view.pixels.emplace_back(pixels[i].x, pixels[i].y);
    }
    return view;
}

/// The refinement's window must not reach a neighbouring corner: just under half the least distance between two.
int window_half(const std::vector<cv::Point2f>& corners, cv::Size count) {
    constexpr int largest = 11; // as in OpenCV's samples, enough for a blurred edge
    double least = 2.0 * largest + 2;
    for (int i = 0; i < static_cast<int>(corners.size()); ++i) {
        if ((i + 1) % count.width != 0)
            least = std::min(least, cv::norm(corners[i + 1] - corners[i]));
        if (i + count.width < static_cast<int>(corners.size()))
            least = std::min(least, cv::norm(corners[i + count.width] - corners[i]));
    }
    return std::clamp(static_cast<int>(least / 2) - 1, 2, largest);
}

std::optional<BoardView> find_chessboard(const cv::Mat1b& grey, const Target& target, const std::string& name) {
    std::vector<cv::Point2f> corners;
    const int flags = cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK;
    if (!cv::findChessboardCorners(grey, target.count, corners, flags))
        return std::nullopt;
    const int half = window_half(corners, target.count);
    cv::cornerSubPix(grey, corners, {half, half}, {-1, -1},
                     {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 100, 1e-4});
    return view_of(corners, target, name);
}

std::optional<BoardView> find_circles(const cv::Mat1b& grey, const Target& target, const std::string& name) {
    const int layout =
        target.kind == Target::Kind::circles ? cv::CALIB_CB_SYMMETRIC_GRID : cv::CALIB_CB_ASYMMETRIC_GRID;
    std::vector<cv::Point2f> centres;
    if (!cv::findCirclesGrid(grey, target.count, centres, layout) &&
        !cv::findCirclesGrid(grey, target.count, centres, layout | cv::CALIB_CB_CLUSTERING))
        return std::nullopt;
    return view_of(centres, target, name);
}

std::optional<BoardView> find_charuco(const cv::Mat1b& grey, const Target& target, const std::string& name) {
    constexpr std::size_t least_corners = 8;
    const auto square = static_cast<float>(target.square_m);
    const auto marker = target.marker_m > 0 ? static_cast<float>(target.marker_m) : 0.75F * square;
    const auto dictionary = cv::aruco::getPredefinedDictionary(dictionary_named(target.dictionary));
    const auto board =
        cv::aruco::CharucoBoard::create(target.count.width, target.count.height, square, marker, dictionary);
    std::vector<std::vector<cv::Point2f>> markers;
    std::vector<int> ids, corner_ids;
    cv::aruco::detectMarkers(grey, dictionary, markers, ids);
    std::vector<cv::Point2f> corners;
    if (ids.empty() || cv::aruco::interpolateCornersCharuco(markers, ids, grey, board, corners, corner_ids) <= 0)
        return std::nullopt;
    BoardView view{name, {}, {}};
    for (std::size_t i = 0; i < corners.size(); ++i) {
        const cv::Point3f point = board->chessboardCorners[corner_ids[i]];
        view.points_m.emplace_back(point.x, point.y, 0);
        view.pixels.emplace_back(corners[i].x, corners[i].y);
    }
    return corners.size() >= least_corners ? std::optional(view) : std::nullopt;
}

} // namespace

std::vector<std::string> dictionary_names() {
    std::vector<std::string> names;
    for (const auto& [name, index] : dictionaries())
        names.push_back(name);
    return names;
}

std::optional<BoardView> find_board(const cv::Mat3b& picture, const Target& target, const std::string& name) {
    check(target);
    cv::Mat1b grey;
    cv::cvtColor(picture, grey, cv::COLOR_BGR2GRAY);
    switch (target.kind) {
    case Target::Kind::chessboard:
        return find_chessboard(grey, target, name);
    case Target::Kind::charuco:
        return find_charuco(grey, target, name);
    case Target::Kind::circles:
    case Target::Kind::asymmetric_circles:
        return find_circles(grey, target, name);
    }
    return std::nullopt;
}

} // namespace scanshade::calibration
