// A frame that is computed with its neighbours.
#include "apps/frame/sequence_steps.h"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <iterator>

namespace scanshade {
namespace {

std::string names_of(const Capture& capture, const std::vector<std::size_t>& indices) {
    std::vector<std::string> names;
    for (const std::size_t index : indices)
        names.push_back(capture.entries[index].name);
    return fmt::format("{}", fmt::join(names, ", "));
}

} // namespace

SequenceAoOptions sequence_options(SequenceAoOptions asked, const Capture& capture, double radius_m) {
    if (asked.reach > 0)
        return asked;
    std::vector<std::optional<Eigen::Isometry3d>> poses;
    std::ranges::transform(capture.entries, std::back_inserter(poses), &CaptureEntry::world_from_camera);
    asked.reach = reach_for(poses, radius_m);
    return asked;
}

double compute_in_sequence(Work& work, const Capture& capture, SequenceAo& sequence) {
    SequenceAoResult result = sequence.compute(work.row.index);
    work.ao = std::move(result.ao);
    work.looked_at = std::move(result.depth);
    work.row.passes = std::move(result.timings);
    work.row.other_frames = result.others();
    std::ranges::move(result.remarks.findings, std::back_inserter(work.row.findings));
    std::ranges::move(result.remarks.warnings, std::back_inserter(work.row.warnings));
    if (!result.fused.empty())
        work.row.notes.push_back("depth is averaged with frames " + names_of(capture, result.fused) + ".");
    if (!result.neighbours.empty())
        work.row.notes.push_back("surfaces of frames " + names_of(capture, result.neighbours) + " occlude, too.");
    if (!result.averaged.empty())
        work.row.notes.push_back("visibility is averaged with frames " + names_of(capture, result.averaged) + ".");
    for (const LeftOut& other : result.left_out)
        work.row.notes.push_back(
            fmt::format("frame {} is left out: {:.0f} % of its surfaces overlap this frame, {:.0f} % contradict it, "
                        "alignment error {:.1f} times the limit.",
                        capture.entries[other.index].name, 100 * other.agreement.overlap,
                        100 * other.agreement.contradicted, other.agreement.alignment_error));
    return share_of_gain(work.row.other_frames);
}

} // namespace scanshade
