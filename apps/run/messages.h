// What `scanshade run` tells people about a capture, before and after.
#pragma once

#include "apps/run/settings.h"
#include "apps/walk/report.h"

#include <filesystem>
#include <string>

namespace scanshade {

/// What the shaded pictures of this capture show, and how to have it otherwise.
[[nodiscard]] std::string shading_sentence(const Capture& capture, Registration registration);
/// What is known of the depth's noise, and what is done about it.
[[nodiscard]] std::string noise_sentence(const DepthNoise& noise, const RunSettings& settings);

/// What is there, how many frames of it are taken, and what was chosen for them.
void introduce(const RunReport& report, std::size_t frames);
/// How it went; `table` is the run's frames.csv.
void conclude(const RunReport& report, const std::filesystem::path& table);

} // namespace scanshade
