// What a file or folder that is no capture is, so that its refusal names the cause.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace scanshade {

/// Of a file: the format that it is in and what to do, or how it begins. `start`: its first bytes.
[[nodiscard]] std::string what_it_is(const std::filesystem::path& file, std::string_view start);
/// Of a folder, behind "no frames found in FOLDER": what is in it, and up to three lines of why that is no capture, the
/// closest first.
[[nodiscard]] std::string why_no_frames(const std::filesystem::path& folder);

} // namespace scanshade
