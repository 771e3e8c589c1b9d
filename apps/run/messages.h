// Messages of `scanshade run` about a capture, before and after its frames.
#pragma once

#include "apps/results/report.h"
#include "apps/run/capture_job.h"
#include "apps/session/settings.h"

#include <filesystem>
#include <string>

namespace scanshade {

/// What the shaded pictures show, and which flag changes that.
[[nodiscard]] std::string shading_sentence(const Capture& capture, Registration registration,
                                           Shade shade = Shade::multiply);
/// "0.23 units, 0.1 of the median depth of 2.3 units; the recording's unit is arbitrary"; empty where it is metres.
[[nodiscard]] std::string radius_sentence(const RunSettings& settings, const CaptureJob& job);

/// Prints what the capture holds, how many frames are used, and the settings chosen for them. `by_points`: its clouds
/// are computed from their points, so that depth images do not matter.
void introduce(const RunReport& report, std::size_t frames, bool by_points);
/// Prints the result; `table` is the run's frames.csv.
void conclude(const RunReport& report, const std::filesystem::path& table);

} // namespace scanshade
