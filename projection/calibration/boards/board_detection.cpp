// Calls OpenCV's detector of each target and returns points and pixels.
#include "projection/calibration/boards/board_detection.h"

#include "projection/base/error.h"
#include "projection/base/statistics.h"
#include "projection/calibration/boards/charuco.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

namespace scanshade::calibration {
namespace {

std::vector<std::pair<std::string, int>> dictionaries() {
    std::vector<std::pair<std::string, int>> all;
    int index = 0; // OpenCV's enumeration runs in this order
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

using Corners = std::vector<cv::Point2f>;

/// How far a corner is from the next edge that is not its own. Windows are square, so this is in the maximum norm.
double clearance(const Corners& corners, cv::Size count, int column, int row) {
    const auto at = [&](int c, int r) -> cv::Point2d { return corners[r * count.width + c]; };
    const cv::Point2d corner = at(column, row);
    const auto step = [&](int across, int down) -> cv::Point2d {
        const int c = column + across, r = row + down;
        if (c >= 0 && r >= 0 && c < count.width && r < count.height)
            return at(c, r) - corner;
        // The edge of the paper often cuts the outermost squares, so only half of one counts on.
        return 0.5 * (corner - at(column - across, row - down));
    };
    const cv::Point2d right = step(1, 0), left = step(-1, 0), below = step(0, 1), above = step(0, -1);
    const auto to_line = [](cv::Point2d through, cv::Point2d along) {
        return std::abs(through.cross(along)) / (std::abs(along.x) + std::abs(along.y));
    };
    return std::min({to_line(right, below - above), to_line(left, below - above), to_line(below, right - left),
                     to_line(above, right - left)});
}

/// Each corner has its own window, as large as its squares allow: more pixels mean less noise, but an edge of another
/// corner draws the result away. The share leaves room for blur, the least for first corners that are pixels off, and
/// the most for edges that a lens bends.
void refine_corners(const cv::Mat1b& grey, Corners& corners, cv::Size count) {
    constexpr double share = 0.8;
    constexpr int least_half = 4, most_half = 15;
    const Corners found = corners;
    for (int i = 0; i < static_cast<int>(corners.size()); ++i) {
        const double clear = clearance(found, count, i % count.width, i / count.width);
        const int half = std::clamp(static_cast<int>(share * clear), least_half, most_half);
        Corners one{found[i]};
        cv::cornerSubPix(grey, one, {half, half}, {-1, -1},
                         {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 100, 1e-4});
        corners[i] = one.front();
    }
}

/// How clearly four squares meet at a pixel, in grey values: the darker of two opposite squares is this much brighter
/// than the brighter of the other two. Not positive where only an edge passes; none beyond the image.
std::optional<double> crossing(const cv::Mat1b& grey, cv::Point2d at, cv::Point2d along_row, cv::Point2d along_column) {
    constexpr double inside = 0.3; // of a square from the corner to where its brightness is taken
    const int half = std::max(1, static_cast<int>(std::min(cv::norm(along_row), cv::norm(along_column)) / 10));
    std::array<double, 4> squares{};
    for (int i = 0; i < 4; ++i) {
        const cv::Point2d middle = at + inside * ((i % 2 == 0 ? 1 : -1) * along_row + (i < 2 ? 1 : -1) * along_column);
        const cv::Rect patch(static_cast<int>(std::lround(middle.x)) - half,
                             static_cast<int>(std::lround(middle.y)) - half, 2 * half + 1, 2 * half + 1);
        if ((patch & cv::Rect({}, grey.size())) != patch)
            return std::nullopt;
        squares[i] = cv::mean(grey(patch))[0];
    }
    const auto [low_a, high_a] = std::minmax(squares[0], squares[3]);
    const auto [low_b, high_b] = std::minmax(squares[1], squares[2]);
    return std::max(low_a - high_b, low_b - high_a);
}

/// Whether a whole row or column of corners lies one square beyond the corners found: then they are part of a larger
/// board.
bool goes_on(const cv::Mat1b& grey, const Corners& corners, cv::Size count) {
    constexpr double as_clear = 0.5; // as a typical corner of the board
    std::vector<double> found;
    const auto at = [&](int c, int r) -> cv::Point2d { return corners[r * count.width + c]; };
    for (int row = 1; row < count.height; ++row)
        for (int column = 1; column < count.width; ++column)
            if (const auto clear = crossing(grey, at(column, row), at(column, row) - at(column - 1, row),
                                            at(column, row) - at(column, row - 1)))
                found.push_back(*clear);
    const double wanted = as_clear * median(found);
    // Lines of corners that end at one side of the board: `from` is a line's last corner, `inward` the step back.
    const auto beyond = [&](int lines, auto&& from, cv::Point inward) {
        int seen = 0, clear = 0;
        for (int line = 0; line < lines; ++line) {
            const cv::Point last = from(line), other = from(line > 0 ? line - 1 : 1);
            const cv::Point2d end = at(last.x, last.y), before = at(last.x + inward.x, last.y + inward.y),
                              first = at(last.x + 2 * inward.x, last.y + 2 * inward.y);
            const cv::Point2d next = 3 * end - 3 * before + first; // straight on, with perspective and lens
            if (const auto here = crossing(grey, next, next - end, end - at(other.x, other.y))) {
                ++seen;
                clear += *here > wanted;
            }
        }
        return seen >= 3 && 2 * clear > seen;
    };
    const int right = count.width - 1, bottom = count.height - 1;
    return wanted > 0 && (beyond(count.height, [&](int row) { return cv::Point(0, row); }, {1, 0}) ||
                          beyond(count.height, [&](int row) { return cv::Point(right, row); }, {-1, 0}) ||
                          beyond(count.width, [&](int column) { return cv::Point(column, 0); }, {0, 1}) ||
                          beyond(count.width, [&](int column) { return cv::Point(column, bottom); }, {0, -1}));
}

std::optional<BoardView> find_chessboard(const cv::Mat1b& grey, const Target& target, const std::string& name) {
    Corners corners;
    const int flags = cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK;
    if (!cv::findChessboardCorners(grey, target.count, corners, flags))
        return std::nullopt;
    refine_corners(grey, corners, target.count);
    BoardView view = view_of(corners, target, name);
    if (goes_on(grey, corners, target.count))
        view.flaw = BoardView::Flaw::larger;
    return view;
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
    const CharucoCorners found =
        find_charuco_corners(grey, {target.count, square, marker, dictionary_named(target.dictionary)});
    if (found.ids.size() < least_corners)
        return std::nullopt;
    BoardView view{name, {}, {}};
    for (std::size_t i = 0; i < found.ids.size(); ++i) {
        const int columns = target.count.width - 1, column = found.ids[i] % columns, row = found.ids[i] / columns;
        view.points_m.emplace_back((column + 1) * target.square_m, (row + 1) * target.square_m, 0);
        view.pixels.emplace_back(found.pixels[i].x, found.pixels[i].y);
    }
    if (found.older_pattern)
        view.flaw = BoardView::Flaw::older_pattern;
    return view;
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
