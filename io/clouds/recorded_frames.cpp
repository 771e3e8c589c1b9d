// Frames as comments of a PLY file: written exactly, believed only where the points still agree.
#include "io/clouds/recorded_frames.h"

#include "io/clouds/cloud_records.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <array>
#include <cmath>
#include <fmt/format.h>
#include <optional>
#include <string_view>
#include <utility>

namespace scanshade {
namespace {

using Eigen::Vector3d;

constexpr std::uint64_t version = 1;
constexpr std::size_t longest = 768 << 10; ///< bytes of all comments: readers take headers of up to 1 MiB

/// Mean column, row and depth of a frame's points; NaN where one is not before its camera.
Vector3d mean_sight(const FoundFrame& frame, std::span<const Vector3d> points) {
    const Eigen::Isometry3d camera_from_world = frame.world_from_camera.inverse();
    Vector3d sum = Vector3d::Zero();
    std::size_t seen = 0;
    for (const Vector3d& point : points.subspan(frame.first, frame.last - frame.first)) {
        if (!point.allFinite())
            continue;
        const Vector3d p = camera_from_world * point;
        if (!(p.z() > 0))
            return Vector3d::Constant(std::nan(""));
        const Eigen::Vector2d pixel = frame.camera.pixel(p);
        sum += Vector3d(pixel.x(), pixel.y(), p.z());
        ++seen;
    }
    return sum / static_cast<double>(std::max<std::size_t>(seen, 1));
}

/// What a comment says.
struct NamedFrame {
    FoundFrame frame;
    Vector3d sight; ///< mean_sight() when it was written
};

std::string comment_of(const FoundFrame& frame, std::span<const Vector3d> points) {
    const Pinhole& c = frame.camera;
    std::string text = fmt::format("scanshade frame {} {}  {} {} {} {} {} {} ", frame.first, frame.last, c.fx, c.fy,
                                   c.cx, c.cy, c.size.width, c.size.height);
    for (Eigen::Index row = 0; row < 3; ++row)
        for (Eigen::Index column = 0; column < 4; ++column)
            text += fmt::format(" {}", frame.world_from_camera.matrix()(row, column));
    const Vector3d sight = mean_sight(frame, points);
    return text + fmt::format("  {} {} {}", sight.x(), sight.y(), sight.z());
}

/// Throws Error that says what a number had to be.
std::size_t whole(std::string_view word, std::size_t most) {
    const auto found = whole_number(word);
    if (!found || *found > most)
        throw Error(fmt::format("{}, expected a whole number up to {}", in_quotes(word), most));
    return static_cast<std::size_t>(*found);
}
double finite(std::string_view word) {
    const auto found = number(word);
    if (!found || !std::isfinite(*found))
        throw Error(fmt::format("{}, expected a number", in_quotes(word)));
    return *found;
}

/// Of the words behind "comment scanshade frame". Throws Error.
NamedFrame frame_of(std::span<const std::string_view> words, std::size_t points) {
    constexpr std::size_t camera_at = 2, pose_at = 8, sight_at = 20, count = 23, widest = 100000;
    if (words.size() != count)
        throw Error(fmt::format("{}, expected {}", counted(words.size(), "number"), count));
    NamedFrame named;
    named.frame.first = whole(words[0], points);
    named.frame.last = whole(words[1], points);
    if (named.frame.last < named.frame.first)
        throw Error(fmt::format("its points end at {}, before they begin at {}", words[1], words[0]));
    const auto at = [&](std::size_t i) { return finite(words[i]); };
    Pinhole& camera = named.frame.camera;
    camera = {at(camera_at), at(camera_at + 1), at(camera_at + 2), at(camera_at + 3),
              cv::Size(static_cast<int>(whole(words[camera_at + 4], widest)),
                       static_cast<int>(whole(words[camera_at + 5], widest)))};
    if (!(camera.fx > 0 && camera.fy > 0 && camera.size.area() > 0))
        throw Error("its camera has no size or no focal length");
    for (std::size_t i = pose_at; i < sight_at; ++i)
        named.frame.world_from_camera.matrix()(static_cast<Eigen::Index>((i - pose_at) / 4),
                                               static_cast<Eigen::Index>((i - pose_at) % 4)) = at(i);
    const Eigen::Matrix3d turn = named.frame.world_from_camera.linear();
    constexpr double turned = 1e-6;
    if (!((turn * turn.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < turned) ||
        turn.determinant() < 0)
        throw Error("its pose is no rotation");
    named.sight = {at(sight_at), at(sight_at + 1), at(sight_at + 2)};
    return named;
}

/// All frames of a header. Throws Error where they are damaged or speak of other points.
std::vector<NamedFrame> named_frames(std::string_view header, std::size_t points) {
    std::vector<NamedFrame> named;
    std::optional<std::size_t> frames;
    for (const auto& [line_number, text] : text_lines(header)) {
        const std::vector<std::string_view> line = words(text);
        if (line.size() < 3 || line[0] != "comment" || line[1] != "scanshade")
            continue;
        if (line[2] == "frames") {
            // comment scanshade frames 1: F frames of N points
            if (line.size() != 9 || line[3] != fmt::format("{}:", version))
                throw Error(fmt::format("line {} is not of version {}", line_number, version));
            frames = during(fmt::format("line {}", line_number), [&] { return whole(line[4], header.size()); });
            if (const auto of = whole_number(line[7]); of != points)
                throw Error(fmt::format("they were written for {} points, and there are {}", line[7], points));
        } else if (line[2] == "frame") {
            named.push_back(during(fmt::format("line {}", line_number),
                                   [&] { return frame_of(std::span(line).subspan(3), points); }));
            if (named.back().frame.first != (named.size() == 1 ? 0 : named[named.size() - 2].frame.last))
                throw Error(fmt::format("line {}: its points do not begin where those before end", line_number));
        }
    }
    if (named.size() != frames.value_or(0))
        throw Error(fmt::format("there are {}, expected {}", counted(named.size(), "frame"), frames.value_or(0)));
    if (!named.empty() && named.back().frame.last != points)
        throw Error(fmt::format("they end at point {} of {}", named.back().frame.last, points));
    return named;
}

/// Throws Error where the points of a frame are no longer where they were, by their mean. Some points are rounded, say
/// to a millimetre, and their mean is not.
void check_places(std::span<const NamedFrame> named, std::span<const Vector3d> points) {
    constexpr std::size_t enough = 100;
    constexpr double off_px = 0.1, off_depth = 1e-3;
    std::size_t checked = 0;
    for (std::size_t i = 0; i < named.size(); ++i) {
        const auto& [frame, sight] = named[i];
        if (frame.last - frame.first < enough)
            continue;
        checked += frame.last - frame.first;
        const Vector3d off = mean_sight(frame, points) - sight;
        if (!(off.head<2>().cwiseAbs().maxCoeff() < off_px && std::abs(off.z()) < off_depth * sight.z()))
            throw Error(fmt::format("the points of frame {} are no longer where they were: off by {:.2f} pixels and "
                                    "{:.2g} in depth on average",
                                    i + 1, off.head<2>().norm(), off.z()));
    }
    if (2 * checked < points.size())
        throw Error(fmt::format("too few points a frame tell whether they are where they were: {} of {}", checked,
                                points.size()));
}

} // namespace

std::vector<std::string> frame_comments(std::span<const FoundFrame> frames, std::span<const Vector3d> points) {
    std::vector<std::string> comments{
        fmt::format("scanshade frames {}: {} frames of {} points", version, frames.size(), points.size())};
    std::size_t bytes = 0;
    for (const FoundFrame& frame : frames) {
        comments.push_back(comment_of(frame, points));
        bytes += comments.back().size();
        if (bytes > longest)
            return {fmt::format("cameras of {} frames are left out: too many for a header", frames.size())};
    }
    return comments;
}

std::vector<FoundFrame> recorded_frames(const Cloud& cloud, std::vector<std::string>& warnings) {
    std::vector<FoundFrame> frames;
    if (!cloud.records || !cloud.records->header.starts_with("ply"))
        return frames;
    try {
        const std::vector<NamedFrame> named = named_frames(cloud.records->header, cloud.points.size());
        if (!named.empty())
            check_places(named, cloud.points);
        for (const NamedFrame& each : named)
            frames.push_back(each.frame);
    } catch (const Error& failure) {
        warnings.push_back(
            fmt::format("the file's comments on its depth frames are not believed: {}.", failure.what()));
    }
    return frames;
}

} // namespace scanshade
