// Captures small enough to be made anew for each test, in a folder that is removed with it.
#pragma once

#include "projection/frame.h"

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <sys/types.h>
#include <vector>

namespace scanshade::tests {

/// A fresh folder under the system's temporary one; removed with everything in it.
class TemporaryFolder {
  public:
    TemporaryFolder();
    ~TemporaryFolder();
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;

    [[nodiscard]] const std::filesystem::path& path() const { return path_; }
    [[nodiscard]] std::filesystem::path operator/(const std::filesystem::path& part) const { return path_ / part; }

  private:
    std::filesystem::path path_;
};

/// The camera of write_capture(): 64x48 pixels, about 63 degrees wide.
[[nodiscard]] Camera small_camera();

/// Two walls that meet in a vertical edge 2 m away, with a block of holes at the upper left; metres. The edge's column
/// depends on `index`.
[[nodiscard]] cv::Mat1f corner_depth(int index);

/// `frames` corners as color/NNN.png (a plain colour), depth/NNN.png (millimetres) and camera.json.
void write_capture(const std::filesystem::path& folder, int frames, Registration registration = Registration::yes);

/// A command's output and exit code.
struct Ran {
    int exit_code = -1;
    std::string out, err;
};

/// Whether there is a program to run: the tests of the readers are also built without it, with sanitizers.
[[nodiscard]] bool program_is_built();
/// Runs the program with `arguments`, as a shell takes them.
[[nodiscard]] Ran run_program(const std::string& arguments);
/// The same of another program.
[[nodiscard]] Ran run_program_at(const std::string& program, const std::string& arguments);
/// The program started without waiting; what it says goes to a file.
pid_t start_program(const std::vector<std::string>& words, const std::filesystem::path& messages = "/dev/null");
/// Waits until `file` is there; false after a minute.
bool wait_for_file(const std::filesystem::path& file);

[[nodiscard]] std::string read_bytes(const std::filesystem::path& file);

} // namespace scanshade::tests
