// Calibration targets found in images: chessboard, ChArUco board and circle grids, to fractions of a pixel.
#pragma once

#include "projection/calibration/boards/boards.h"

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

namespace scanshade::calibration {

/// A flat target. `count` is inner corners of a chessboard, squares of a ChArUco board, circles of a grid.
struct Target {
    enum class Kind { chessboard, charuco, circles, asymmetric_circles } kind = Kind::chessboard;
    cv::Size count{9, 6};
    /// Between neighbouring corners or circles; in an asymmetric grid, half the distance between circles of one row.
    double square_m = 0.025;
    double marker_m = 0;               ///< side of a ChArUco marker; 0 = three quarters of a square
    std::string dictionary = "4x4_50"; ///< of the ChArUco markers
};

/// The names that Target::dictionary takes: 4x4_50 ... 7x7_1000.
[[nodiscard]] std::vector<std::string> dictionary_names();

/// The board in a picture, named `name`; none where the picture shows no board, or too little of a ChArUco board.
/// Throws Error where the target is impossible (fewer than 3x3 points, an unknown dictionary).
[[nodiscard]] std::optional<BoardView> find_board(const cv::Mat3b& picture, const Target& target,
                                                  const std::string& name);

} // namespace scanshade::calibration
