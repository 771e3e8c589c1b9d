// ChArUco detection of OpenCV 4.6 (contrib's aruco) and of 4.7 and later (objdetect).
#include "projection/calibration/boards/charuco.h"

#include "projection/base/error.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <map>
#include <utility>

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

#ifndef HAS_CHARUCO

CharucoCorners detect(const cv::Mat1b&, const CharucoLayout&, bool) {
    throw Misuse("this build has no ChArUco boards: its OpenCV came without them");
}
constexpr bool reads_older_pattern = false;

#elif CHARUCO_IN_OBJDETECT

CharucoCorners detect(const cv::Mat1b& grey, const CharucoLayout& layout, bool older_pattern) {
    cv::aruco::CharucoBoard board(layout.squares, layout.square_m, layout.marker_m,
                                  cv::aruco::getPredefinedDictionary(layout.dictionary));
    board.setLegacyPattern(older_pattern);
    CharucoCorners found;
    cv::aruco::CharucoDetector(board).detectBoard(grey, found.pixels, found.ids);
    return found;
}
constexpr bool reads_older_pattern = true;

#else

CharucoCorners detect(const cv::Mat1b& grey, const CharucoLayout& layout, bool) {
    const auto dictionary = cv::aruco::getPredefinedDictionary(layout.dictionary);
    const auto board = cv::aruco::CharucoBoard::create(layout.squares.width, layout.squares.height, layout.square_m,
                                                       layout.marker_m, dictionary);
    std::vector<std::vector<cv::Point2f>> markers;
    std::vector<int> marker_ids;
    cv::aruco::detectMarkers(grey, dictionary, markers, marker_ids);
    CharucoCorners found;
    if (!marker_ids.empty())
        cv::aruco::interpolateCornersCharuco(markers, marker_ids, grey, board, found.pixels, found.ids);
    return found;
}
constexpr bool reads_older_pattern = false;

#endif

double unevenness_of(const CharucoCorners& corners, cv::Size squares) {
    std::map<int, cv::Point2d> at;
    for (std::size_t i = 0; i < corners.ids.size(); ++i)
        at[corners.ids[i]] = corners.pixels[i];
    const int columns = squares.width - 1, rows = squares.height - 1;
    std::vector<double> off;
    for (const auto& [id, pixel] : at) {
        const int column = id % columns, row = id / columns;
        for (const auto& [step, between] : {std::pair(1, column > 0 && column + 1 < columns),
                                            std::pair(columns, row > 0 && row + 1 < rows)}) {
            const auto before = at.find(id - step), after = at.find(id + step);
            if (!between || before == at.end() || after == at.end())
                continue;
            const double spacing = cv::norm(after->second - before->second) / 2;
            off.push_back(cv::norm(pixel - 0.5 * (before->second + after->second)) / std::max(spacing, 1e-9));
        }
    }
    return off.empty() ? 0 : median(std::move(off));
}

} // namespace

CharucoCorners find_charuco_corners(const cv::Mat1b& grey, const CharucoLayout& layout) {
    const auto found_in = [&](bool older_pattern) {
        CharucoCorners found = detect(grey, layout, older_pattern);
        found.unevenness = unevenness_of(found, layout.squares);
        return found;
    };
    CharucoCorners found = found_in(false);
    if (reads_older_pattern && layout.squares.height % 2 == 0 &&
        (found.ids.empty() || found.unevenness > most_unevenness))
        if (CharucoCorners older = found_in(true); !older.ids.empty() && older.unevenness <= most_unevenness)
            return older;
    return found;
}

} // namespace scanshade::calibration
