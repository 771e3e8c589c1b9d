#include "tests/support/small_capture.h"

#include "io/cameras/camera_file.h"
#include "io/images/image_file.h"

#include <chrono>
#include <cstdlib>
#include <fcntl.h>
#include <fmt/format.h>
#include <fstream>
#include <stdexcept>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace scanshade::tests {

namespace fs = std::filesystem;

TemporaryFolder::TemporaryFolder() {
    std::string name = (fs::temp_directory_path() / "scanshade-test-XXXXXX").string();
    if (!mkdtemp(name.data()))
        throw std::runtime_error("no temporary folder could be made: " + name);
    path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
}

Camera small_camera() { return {{52.0, 52.0, 31.5, 23.5, {64, 48}}, {}, "test"}; }

cv::Mat1f corner_depth(int index) {
    const Pinhole camera = small_camera().pinhole;
    const double edge = (index % 8 - 4) * 0.05; // x / z of the edge
    cv::Mat1f z_m(camera.size);
    for (int v = 0; v < z_m.rows; ++v)
        for (int u = 0; u < z_m.cols; ++u) // walls z = 2 - |x - edge z|: 45 degrees to the view on either side
            z_m(v, u) = static_cast<float>(2 / (1 + std::abs(camera.ray(u, v).x() - edge)));
    z_m(cv::Rect(2, 2, 6, 5)) = 0;
    return z_m;
}

void write_capture(const fs::path& folder, int frames, Registration registration) {
    for (int i = 0; i < frames; ++i) {
        write_depth_png(folder / fmt::format("depth/{:03}.png", i), corner_depth(i), 1000);
        write_picture(folder / fmt::format("color/{:03}.png", i), cv::Mat3b(48, 64, cv::Vec3b(40, 120, 200)));
    }
    write_camera_file(folder / "camera.json", {small_camera(), 1000, registration, {}});
}

std::string read_bytes(const fs::path& file) {
    std::ifstream stream(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
}

bool program_is_built() { return std::filesystem::exists(SCANSHADE_PROGRAM); }

Ran run_program(const std::string& arguments) { return run_program_at(SCANSHADE_PROGRAM, arguments); }

Ran run_program_at(const std::string& program, const std::string& arguments) {
    const TemporaryFolder folder;
    const std::string command =
        fmt::format("'{}' {} >'{}' 2>'{}'", program, arguments, (folder / "out").string(), (folder / "err").string());
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), read_bytes(folder / "out"),
            read_bytes(folder / "err")};
}

pid_t start_program(const std::vector<std::string>& words, const std::filesystem::path& messages) {
    const pid_t child = fork();
    if (child != 0)
        return child;
    dup2(open("/dev/null", O_WRONLY), STDOUT_FILENO);
    dup2(open(messages.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666), STDERR_FILENO);
    std::vector<char*> arguments = {const_cast<char*>(SCANSHADE_PROGRAM)};
    for (const std::string& word : words)
        arguments.push_back(const_cast<char*>(word.c_str()));
    arguments.push_back(nullptr);
    execv(SCANSHADE_PROGRAM, arguments.data());
    _exit(127);
}

bool wait_for_file(const std::filesystem::path& file) {
    for (int tries = 0; tries < 6000; ++tries, std::this_thread::sleep_for(std::chrono::milliseconds(10)))
        if (std::filesystem::exists(file))
            return true;
    return false;
}

} // namespace scanshade::tests
