// Tests of runs and jobs that are ended and taken up again: started aside, and their results compared.
#pragma once

#include "tests/support/small_capture.h"

#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <map>
#include <string>
#include <sys/wait.h>
#include <unistd.h>
#include <vector>

namespace scanshade::tests {

/// Results by name, without reports of times and processes. The page is one, and that of a job comes from `merge`.
inline std::map<std::string, std::string> results_in(const std::filesystem::path& folder) {
    std::map<std::string, std::string> files;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
        if (const std::string extension = entry.path().extension().string();
            entry.is_regular_file() && extension != ".json" && extension != ".jsonl" && extension != ".csv" &&
            entry.path().stem() != "index")
            files[entry.path().lexically_relative(folder).string()] = read_bytes(entry.path());
    return files;
}

/// The names of files that only one has, or whose bytes differ: the bytes themselves would not help.
inline std::vector<std::string> differences(const std::map<std::string, std::string>& found,
                                            const std::map<std::string, std::string>& expected) {
    std::vector<std::string> names;
    for (const auto& [name, bytes] : expected)
        if (const auto other = found.find(name); other == found.end())
            names.push_back("missing: " + name);
        else if (other->second != bytes)
            names.push_back(fmt::format("{} bytes for {}: {}", other->second.size(), bytes.size(), name));
    for (const auto& [name, bytes] : found)
        if (!expected.contains(name))
            names.push_back("unexpected: " + name);
    return names;
}

inline std::vector<std::filesystem::path> strays_in(const std::filesystem::path& folder) {
    std::vector<std::filesystem::path> strays;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
        if (entry.path().filename().string()[0] == '.')
            strays.push_back(entry.path());
    return strays;
}

inline std::size_t count_in(const std::filesystem::path& folder, const std::string& text) {
    std::size_t found = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
        if (entry.path().extension() == ".jsonl") {
            const std::string bytes = read_bytes(entry.path());
            for (auto at = bytes.find(text); at != std::string::npos; at = bytes.find(text, at + 1))
                ++found;
        }
    return found;
}

/// The program started without waiting, in a process group of its own; its messages go nowhere.
inline pid_t start(const std::string& arguments) {
    const pid_t child = fork();
    if (child != 0)
        return child;
    setpgid(0, 0);
    const std::string line = fmt::format("exec '{}' {} >/dev/null 2>&1", SCANSHADE_PROGRAM, arguments);
    execl("/bin/sh", "sh", "-c", line.c_str(), nullptr);
    _exit(127);
}

inline int exit_code(int status) { return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status); }

inline int wait_for(pid_t child) {
    int status = 0;
    waitpid(child, &status, 0);
    return exit_code(status);
}

/// Five files of each frame, that there is much to be caught at.
inline constexpr const char* all_files = "--write ao,confidence,shaded,panel,cloud";

class ResumeTest : public testing::Test {
  protected:
    void record(int frames) { tests::write_capture(folder / "data/capture", frames); }
    [[nodiscard]] std::filesystem::path capture() const { return folder / "data/capture"; }
    [[nodiscard]] std::filesystem::path out() const { return folder / "out"; }
    [[nodiscard]] std::filesystem::path job() const { return folder / "job"; }
    [[nodiscard]] Ran run(const std::string& flags = "") const {
        return run_program(fmt::format("run {} -o {} {}", capture().string(), out().string(), flags));
    }
    [[nodiscard]] Ran plan(const std::string& flags = "") const {
        return run_program(fmt::format("plan {} -o {} {}", (folder / "data").string(), job().string(), flags));
    }
    /// A job of four blocks of one capture, three frames in flight; what a plain run, one frame after the other,
    /// leaves.
    [[nodiscard]] std::map<std::string, std::string> plan_four_blocks() {
        record(120);
        EXPECT_EQ(run(all_files).exit_code, 0);
        EXPECT_EQ(plan(fmt::format("--block 30 --in-flight 3 {}", all_files)).exit_code, 0);
        return results_in(out());
    }
    [[nodiscard]] std::filesystem::path job_results() const { return job() / "results/data/capture"; }
    [[nodiscard]] std::size_t done_frames() const { return count_in(out(), "{\"frame\":"); }

    TemporaryFolder folder;
};

} // namespace scanshade::tests
