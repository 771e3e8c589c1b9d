// `scanshade view`: opens the page of results in a browser.
#include "apps/command.h"
#include "apps/page/run_page.h"
#include "io/output_file.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cstdlib>
#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <unistd.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;

/// manifest.json, or those of a capture's blocks ("manifest.0-500.json") by their first frames.
std::vector<fs::path> manifests_in(const fs::path& folder) {
    if (fs::exists(folder / "manifest.json"))
        return {folder / "manifest.json"};
    std::vector<std::pair<unsigned long, fs::path>> blocks;
    for (const auto& entry : fs::directory_iterator(folder)) {
        const std::string name = entry.path().filename().string(), begin = "manifest.";
        if (name.starts_with(begin) && name.ends_with(".json"))
            blocks.emplace_back(std::strtoul(name.c_str() + begin.size(), nullptr, 10), entry.path());
    }
    std::ranges::sort(blocks);
    std::vector<fs::path> files;
    for (const auto& [first, file] : blocks)
        files.push_back(file);
    return files;
}

/// The page at `path`: a page, or a folder of results, which gets one where it has none.
fs::path page_at(const fs::path& path) {
    if (!fs::exists(path))
        throw Error(path.string() + ": not there");
    if (!fs::is_directory(path)) {
        if (path.extension() != ".html")
            throw Error(path.string() + ": a folder of results or a page (.html) expected");
        return path;
    }
    if (fs::exists(path / "index.html"))
        return path / "index.html";
    const std::vector<fs::path> manifests = manifests_in(path);
    if (manifests.empty())
        throw Error(path.string() + ": neither index.html nor manifest.json, so these are no finished results; "
                                    "`scanshade merge` makes the page of a job");
    require_folder(path);
    page::write_from_manifests(path, manifests);
    return path / "index.html";
}

/// Starts the program that the desktop has for pages. False where there is no desktop or no such program.
bool open_in_browser(const fs::path& page) {
    const char* named = std::getenv("BROWSER");
    const bool desktop = std::getenv("DISPLAY") || std::getenv("WAYLAND_DISPLAY");
    if (!desktop && !(named && *named))
        return false;
    std::string program = named && *named ? named : "xdg-open", file = page.string();
    char* words[] = {program.data(), file.data(), nullptr};
    posix_spawn_file_actions_t quietly;
    posix_spawn_file_actions_init(&quietly);
    for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
        posix_spawn_file_actions_addopen(&quietly, stream, "/dev/null", O_RDWR, 0);
    pid_t child = 0;
    const int failed = posix_spawnp(&child, program.c_str(), &quietly, nullptr, words, environ);
    posix_spawn_file_actions_destroy(&quietly);
    return failed == 0;
}

class View final : public Command {
  public:
    Words words() override {
        return {"PATH", "a folder of results, of a job or of a report, or a page in it", &paths_, 1, 1};
    }

    int run() override {
        const fs::path page = fs::canonical(page_at(paths_.front()));
        fmt::print("{}\n", page.string());
        if (!open_in_browser(page))
            fmt::print(stderr, "no browser was found here: open that file in one\n");
        return all_well;
    }

  private:
    std::vector<std::string> paths_;
};

} // namespace

std::unique_ptr<Command> view_command() { return std::make_unique<View>(); }

} // namespace scanshade
