// What `scanshade run` tells people about a capture, before and after.
#include "apps/run/messages.h"

#include "apps/walk/progress.h"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace scanshade {
namespace {

/// Frames with that status: the first ten by name, the rest by number.
std::string names_of(const std::vector<FrameRow>& rows, FrameStatus status) {
    std::vector<std::string> names;
    for (const FrameRow& row : rows)
        if (row.status == status)
            names.push_back(row.name);
    constexpr std::size_t most = 10;
    const std::string more = names.size() > most ? fmt::format(" and {} more", names.size() - most) : "";
    names.resize(std::min(names.size(), most));
    return fmt::format("{}{}", fmt::join(names, ", "), more);
}

} // namespace

std::string shading_sentence(const Capture& capture, Registration registration, Shade shade) {
    const bool clouds = std::ranges::none_of(capture.entries, [](const auto& entry) { return entry.cloud.empty(); });
    const bool colour = std::ranges::any_of(capture.entries, [](const auto& entry) { return !entry.colour.empty(); });
    if (clouds)
        return "shaded pictures show the points' own colours, or grey clay where they have none.";
    if (shade == Shade::clay)
        return "shaded pictures show grey clay made from depth, as asked.";
    if (!colour)
        return "shaded pictures show grey clay made from depth: the capture has no colour images.";
    if (registration == Registration::yes)
        return "shaded pictures show the colour images.";
    if (capture.colour_camera)
        return "shaded pictures show the colour images, warped from the secondary camera (" +
               describe(capture.colour_camera->camera) + "); pixels that it did not see are grey clay.";
    const std::string why = registration == Registration::no ? "do not lie on" : "are not known to lie on";
    return fmt::format(
        "shaded pictures show grey clay made from depth, because the colour images {} the depth pixels{}; "
        "--registered yes shades the colour images anyway.",
        why, capture.registration_reason.empty() ? "" : " (" + capture.registration_reason + ")");
}

std::string radius_sentence(const RunSettings& settings, const CaptureJob& job) {
    const Capture& capture = job.capture;
    if (!capture.unit.arbitrary())
        return job.batch.radius_m == settings.radius_m() ? ""
                                                         : fmt::format("{} m, in place of {}, since the scene is small",
                                                                       job.batch.radius_m, settings.radius_m());
    if (!(capture.median_depth > 0))
        return "not known: no depth could be read; the recording's unit is arbitrary";
    const double radius = settings.radius_m();
    return fmt::format("{}, {:.3g} of the median depth of {}; the recording's unit is arbitrary",
                       capture.unit.text(radius), radius / capture.median_depth,
                       capture.unit.text(capture.median_depth));
}

void introduce(const RunReport& report, std::size_t frames, bool by_points) {
    const Capture& capture = report.capture;
    say(fmt::format("{}: {}, {} of {} frames", capture.path.string(), capture.kind, frames, capture.entries.size()));
    if (!capture.depth.origin.empty())
        say(fmt::format("  {}: {} ({})", by_points ? "unit" : "depth", capture.depth.name, capture.depth.origin));
    if (capture.camera)
        say(fmt::format("  camera: {} ({})", describe(*capture.camera), capture.camera->origin));
    if (capture.depth_correction.any())
        say(fmt::format("  depth correction: {} ({})", describe(capture.depth_correction), capture.camera->origin));
    if (!report.radius.empty())
        say("  radius: " + report.radius);
    if (!by_points)
        say("  depth noise: " + report.depth_noise);
    for (const std::string& warning : capture.warnings)
        warn(fmt::format("  warning: {}: {}", capture.path.string(), warning));
    for (const std::string& sentence : report.budget)
        say("  " + sentence);
    say("  " + report.shading);
    if (!report.light.empty())
        say("  " + report.light);
}

void conclude(const RunReport& report, const std::filesystem::path& table) {
    const std::size_t doubtful = count(report.frames, FrameStatus::doubtful);
    const std::size_t done = count(report.frames, FrameStatus::ok) + doubtful;
    const std::string before =
        done > report.done_now ? fmt::format(", {} of them in an earlier run", done - report.done_now) : "";
    const std::string of_them = doubtful > 0 ? fmt::format(", {} doubtful", doubtful) : "";
    say(fmt::format("  {} of {} frames{}{} in {:.1f} s ({}) -> {}", done, report.frames.size(), before, of_them,
                    report.took_ms / 1000, describe(rates_of(report)), table.parent_path().string()));
    if (doubtful > 0)
        warn(fmt::format("  doubtful: {} (reasons in {})", names_of(report.frames, FrameStatus::doubtful),
                         table.string()));
    constexpr double imprecise = 0.25; // RMS: a quarter of all that visibility can be
    const auto errs = [](const FrameRow& row) { return is_done(row.status) && row.expected_error > imprecise; };
    if (const auto frames = std::ranges::count_if(report.frames, errs); frames > 0)
        say(fmt::format("  imprecise: an error above {} RMS is expected of {} frames (expected_error in {})", imprecise,
                        frames, table.string()));
    if (count(report.frames, FrameStatus::failed) > 0)
        warn(fmt::format("  failed: {} (reasons in {})", names_of(report.frames, FrameStatus::failed), table.string()));
    if (const std::size_t skipped = count(report.frames, FrameStatus::skipped); skipped > 0)
        warn(fmt::format("  not finished: {} of {} frames are left; --resume continues", skipped,
                         report.capture.path.string()));
}

} // namespace scanshade
