// The rules for a computed frame, one after the other.
#include "apps/doubts/doubts.h"

#include "apps/doubts/of_points.h"
#include "apps/doubts/of_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <iterator>
#include <opencv2/imgproc.hpp>
#include <span>

namespace scanshade {
namespace {

constexpr double least_share = 0.2;        ///< of valid pixels, and of valid pixels or points with a value
constexpr double least_neighboured = 0.3;  ///< share of the valid pixels with a valid one next to them
constexpr double all_alike = 0.999;        ///< share of the values that are exactly 0, or exactly 1
constexpr std::size_t enough_values = 100; ///< fewer may be alike by chance

/// Shares of the valid pixels with a valid one at most two to the left or right, and above or below.
std::array<double, 2> neighboured(const cv::Mat1f& z_m) {
    std::size_t valid = 0, beside = 0, above = 0;
    for (int v = 2; v + 2 < z_m.rows; v += 5) { // enough to judge by; rows are lost in other steps
        const float *row = z_m[v], *up = z_m[v - 1], *down = z_m[v + 1], *far_up = z_m[v - 2], *far_down = z_m[v + 2];
        for (int u = 2; u + 2 < z_m.cols; u += 3) { // without branches, which holes make unforeseeable
            const int holds = row[u] > 0;
            valid += holds;
            beside += holds & ((row[u - 1] > 0) | (row[u + 1] > 0) | (row[u - 2] > 0) | (row[u + 2] > 0));
            above += holds & ((up[u] > 0) | (down[u] > 0) | (far_up[u] > 0) | (far_down[u] > 0));
        }
    }
    const auto all = static_cast<double>(std::max<std::size_t>(valid, 1));
    return {valid == 0 ? 1 : static_cast<double>(beside) / all, valid == 0 ? 1 : static_cast<double>(above) / all};
}

/// Whether the valid pixels are those of an object without its background: most of the box round them.
bool is_cut_out(const cv::Mat1f& z_m) {
    constexpr double most = 0.4, least = 0.001;
    if (z_m.empty())
        return false;
    const cv::Mat valid = z_m > 0;
    const cv::Rect box = cv::boundingRect(valid);
    const double inside = cv::countNonZero(valid);
    return inside > most * box.area() && inside > least * static_cast<double>(z_m.total());
}

void check_shares(const ComputedFrame& computed, Findings& findings) {
    const bool image = !computed.frame.cloud || (computed.frame.cloud->organised() && !computed.of_points);
    if (computed.valid_share == 0) {
        must_not(findings, Check::no_depth, !any_doubt(computed.frame.findings),
                 [&] { return computed.frame.cloud ? "no point is valid." : "no pixel holds a valid depth."; });
        return;
    }
    if (image)
        add_finding(findings, Check::holes, computed.valid_share, least_share,
                    computed.valid_share < least_share && !is_cut_out(computed.depth.z_m), [&] {
                        return fmt::format("only {:.1f} % of the pixels hold a depth: what hides in the holes cannot "
                                           "occlude.",
                                           100 * computed.valid_share);
                    });
    if (image && !computed.depth.z_m.empty()) {
        const auto shares = neighboured(computed.depth.z_m);
        const double least = std::min(shares[0], shares[1]);
        at_least(findings, Check::scattered_pixels, least, least_neighboured, [&] {
            return fmt::format("only {:.0f} % of the valid pixels have a valid one {}: what hides between them cannot "
                               "occlude.",
                               100 * least, shares[0] < shares[1] ? "beside them" : "above or below them");
        });
    }
    at_least(findings, Check::coverage, computed.coverage, least_share, [&] {
        return fmt::format("only {:.1f} % of the valid {} got a value.", 100 * computed.coverage,
                           computed.frame.cloud ? "points" : "pixels");
    });
}

/// `may_be_open()`: all may be open, as of a convex surface.
template <class MayBeOpen>
void check_values(std::span<const float> values, const MayBeOpen& may_be_open, Findings& findings) {
    std::size_t known = 0, closed = 0, open = 0;
    constexpr std::size_t at_once = 1 << 16; // counts of 32 bits: the compiler makes vectors of them
    for (std::size_t begin = 0; begin < values.size(); begin += at_once) {
        int known_here = 0, closed_here = 0, open_here = 0;
        for (const float value : values.subspan(begin, std::min(at_once, values.size() - begin))) {
            known_here += value == value;
            closed_here += value == 0;
            open_here += value == 1;
        }
        known += known_here;
        closed += closed_here;
        open += open_here;
    }
    if (known < enough_values)
        return;
    const auto of_known = [&](std::size_t count) { return static_cast<double>(count) / static_cast<double>(known); };
    add_finding(findings, Check::all_open, of_known(open), all_alike, of_known(open) > all_alike && !may_be_open(), [] {
        return "every value is exactly 1, fully open: only flat and convex surfaces read so. Otherwise depth unit, "
               "camera or radius are wrong.";
    });
    at_most(findings, Check::all_closed, of_known(closed), all_alike, [] {
        return "every value is exactly 0, fully closed: no real surface reads so. Depth unit, camera, normals or "
               "radius are wrong.";
    });
}

} // namespace

Findings findings_about(const Camera& camera, const DepthImage& depth, const LengthUnit& unit) {
    Findings findings;
    check_camera(camera, findings);
    check_kind(depth, findings);
    check_ends(depth, unit, findings);
    return findings;
}

Findings findings_about(const ComputedFrame& computed, double radius_m, const DepthNoise& noise,
                        const LengthUnit& unit) {
    Findings findings = computed.frame.findings;
    check_shares(computed, findings);
    if (computed.of_points) {
        const Cloud& cloud = *computed.frame.cloud;
        const PointVisibility& found = *computed.of_points;
        check_unit(cloud, findings);
        check_points(cloud, findings);
        check_values(
            found.visibility, [&] { return !has_hollows(cloud, found); }, findings);
        check_radius_of_points(cloud, found, findings);
        check_steps(cloud, found, findings);
        return findings;
    }
    const cv::Mat1f& visibility = computed.visibility;
    if (visibility.isContinuous())
        check_values(
            {visibility.ptr<float>(), visibility.total()},
            [&] { return radius_m > 0 && !has_hollows(computed.depth, radius_m); }, findings);
    check_radius_in_view(computed.depth, radius_m, unit, findings);
    check_noise_in_view(computed.depth, radius_m, noise, unit, findings);
    check_steps_in_view(radius_m, noise, unit, findings);
    if (!computed.frame.cloud) // a cloud's camera is recovered or chosen, not given, unless --camera names it
        std::ranges::move(findings_about(computed.camera, computed.depth, unit), std::back_inserter(findings));
    return findings;
}

} // namespace scanshade
