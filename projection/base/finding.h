// What a check found: a number, its limit, and a doubt where the number is beyond it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace scanshade {

/// All checks; apps/doubts/checks.h describes each.
enum class Check : std::uint8_t {
    other, ///< a doubt of a journal that has no checks
    // the camera
    view_angle,
    pixel_aspect,
    principal_point,
    turned_camera,
    lens_fold,
    // depth as it was stored
    no_depth,
    depth_jumps,
    median_depth,
    depth_multiples,
    stretched_depth,
    enlarged_image,
    repeated_lines,
    // depth in metres
    depth_buffer,
    depth_kind,
    nearest_end,
    farthest_end,
    holes,
    scattered_pixels,
    depth_steps,
    depth_noise,
    pose_scale,
    // how settings suit the scene
    radius_in_pixels,
    radius_in_scene,
    voxel_room,
    // clouds as they were stored
    few_points,
    point_numbers,
    degrees,
    coordinate_steps,
    splats_in_view,
    // clouds
    radius_in_spacings,
    radius_in_cloud,
    noise_left,
    error_by_part,
    normals_to_station,
    normals_to_scanner,
    normals_to_space,
    normals_to_sky,
    sides,
    splat_gaps,
    // results
    coverage,
    all_open,
    all_closed,
    texture_overlap,
};

struct Finding {
    Check check = Check::other;
    double value = 0;     ///< of the check's statistic
    double limit = 0;     ///< beyond which there is a reason to doubt the result
    std::string sentence; ///< of that reason, where the value is beyond; else empty
};
using Findings = std::vector<Finding>;

/// The sentence is made only where `beyond` holds.
template <class Sentence>
void add_finding(Findings& all, Check check, double value, double limit, bool beyond, const Sentence& sentence) {
    all.push_back({check, value, limit, beyond ? std::string(sentence()) : std::string()});
}
template <class Sentence>
void at_most(Findings& all, Check check, double value, double limit, const Sentence& sentence) {
    add_finding(all, check, value, limit, value > limit, sentence);
}
template <class Sentence>
void at_least(Findings& all, Check check, double value, double limit, const Sentence& sentence) {
    add_finding(all, check, value, limit, value < limit, sentence);
}
/// Of a check that is no number: 1 = doubtful, 0 = not.
template <class Sentence>
void must_not(Findings& all, Check check, bool beyond, const Sentence& sentence) {
    add_finding(all, check, beyond ? 1 : 0, 0.5, beyond, sentence);
}

/// Of checks that find a result imprecise, not wrong: beyond their limits there is a warning. The expected error has
/// it in numbers.
[[nodiscard]] constexpr bool only_warns(Check check) { return check == Check::holes || check == Check::depth_noise; }
[[nodiscard]] inline bool is_doubt(const Finding& finding) {
    return !finding.sentence.empty() && !only_warns(finding.check);
}
[[nodiscard]] inline bool is_warning(const Finding& finding) {
    return !finding.sentence.empty() && only_warns(finding.check);
}

/// The sentences of those that `hold`, each once.
template <class Holds>
std::vector<std::string> sentences_in(const Findings& findings, const Holds& holds) {
    std::vector<std::string> sentences;
    for (const Finding& finding : findings)
        if (holds(finding) && std::ranges::find(sentences, finding.sentence) == sentences.end())
            sentences.push_back(finding.sentence);
    return sentences;
}
[[nodiscard]] inline std::vector<std::string> doubts_in(const Findings& findings) {
    return sentences_in(findings, is_doubt);
}
[[nodiscard]] inline std::vector<std::string> warnings_in(const Findings& findings) {
    return sentences_in(findings, is_warning);
}
[[nodiscard]] inline bool any_doubt(const Findings& findings) { return std::ranges::any_of(findings, is_doubt); }

} // namespace scanshade
