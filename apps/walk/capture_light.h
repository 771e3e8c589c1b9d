// The light of a capture's colour images, estimated on frames spread over it before the walk begins.
#pragma once

#include "ao/frame.h"
#include "ao/light/light.h"
#include "apps/walk/batch_options.h"

#include "projection/base/error.h"

#include <filesystem>
#include <string>
#include <vector>

namespace scanshade {

/// Frames that are looked at, at most: memory and time are bounded.
inline constexpr std::size_t light_frames = 12;

/// No frame has colour that fits its depth.
class NoLight : public Error {
  public:
    using Error::Error;
};

/// Looks at up to light_frames of `frames` with the run's own method. Directions are in the recording's world if all
/// frames looked at have a pose, else in camera space. Frames that cannot be loaded, and those without colour that fits
/// the depth, are left out. Throws NoLight where none is left.
[[nodiscard]] LightEstimate light_of(const Capture& capture, const std::vector<std::size_t>& frames, FrameAo& method,
                                     const BatchOptions& options, const LightRequest& request);

/// For the report, and to be read again: every number exactly as it is.
[[nodiscard]] std::string text_of(const LightEstimate& estimate, const std::string& task);
/// What an earlier run of the same task wrote; none if the file is not there, or is another task's.
[[nodiscard]] std::optional<LightEstimate> light_in(const std::filesystem::path& file, const std::string& task);

/// From auto, none, or X,Y,Z. Throws Misuse.
[[nodiscard]] LightRequest light_request(const std::string& text);

} // namespace scanshade
