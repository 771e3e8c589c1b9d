// Runs and jobs killed at random moments and taken up again leave the bytes of an uninterrupted run.
#include "tests/support/resumed.h"

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fmt/format.h>
#include <functional>
#include <gtest/gtest.h>
#include <random>
#include <sys/wait.h>
#include <thread>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

/// Workers die with the process that started them, but a moment later.
bool all_gone(pid_t group) {
    for (int tries = 0; tries < 1000; ++tries) {
        if (kill(-group, 0) != 0)
            return true;
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return false;
}

/// Starts the program again and again and kills it after a random number of frames and some milliseconds, until `kills`
/// have met it amid its frames; those that met it while it started come on top. Whenever it comes to its end before,
/// and at last, `done` looks at the results in `folder` and clears them.
void kill_at_random(const std::string& arguments, const fs::path& folder, int kills,
                    const std::function<void()>& done) {
    std::mt19937 random(20261121);
    std::uniform_int_distribution<int> some_frames(-10, 60), some_ms(0, 50);
    const auto frames_done = [&] { return fs::exists(folder) ? count_in(folder, "{\"frame\":") : 0; };
    int amid = 0, early = 0, looks = 1;
    while (amid < kills) {
        const std::size_t before = frames_done(),
                          enough = before + static_cast<std::size_t>(std::max(0, some_frames(random)));
        const pid_t child = start(arguments);
        int status = 0;
        bool ended = false;
        while (!(ended = waitpid(child, &status, WNOHANG) == child) && frames_done() < enough)
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        if (!ended) {
            std::this_thread::sleep_for(std::chrono::milliseconds(some_ms(random)));
            kill(child, SIGKILL);
            waitpid(child, &status, 0);
        }
        ASSERT_TRUE(all_gone(child)) << "a worker lives on";
        const int code = exit_code(status);
        ASSERT_TRUE(code == 0 || code == 128 + SIGKILL) << code;
        if (code == 0) {
            done();
            ++looks;
        } else {
            ++(frames_done() > before ? amid : early);
        }
    }
    // A worker dies with its parent, but a moment later.
    for (int tries = 0; tries < 50 && wait_for(start(arguments)) != 0; ++tries)
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
    done();
    fmt::print("{} kills amid frames, {} before the first, {} runs to the end\n", amid, early, looks);
}

/// How often the tests kill: a few times, or as tests/survival says.
int kills() {
    const char* asked = std::getenv("SCANSHADE_KILLS");
    return asked ? std::atoi(asked) : 6;
}

TEST_F(ResumeTest, a_run_killed_at_random_and_resumed_leaves_the_bytes_of_an_uninterrupted_one) {
    record(120);
    ASSERT_EQ(run(all_files).exit_code, 0);
    const auto expected = results_in(out());
    ASSERT_EQ(expected.size(), 720u);
    fs::remove_all(out());
    const std::string arguments =
        fmt::format("run {} -o {} --resume {}", capture().string(), out().string(), all_files);
    kill_at_random(arguments, out(), kills(), [&] {
        EXPECT_EQ(differences(results_in(out()), expected), std::vector<std::string>());
        EXPECT_TRUE(strays_in(out()).empty()) << strays_in(out()).front();
        fs::remove_all(out());
    });
}

TEST_F(ResumeTest, a_job_killed_at_random_and_run_again_leaves_the_bytes_of_a_plain_run) {
    const auto expected = plan_four_blocks();
    kill_at_random("run " + job().string(), job(), kills(), [&] {
        // Tasks that a dying worker still held were left to it.
        for (int tries = 0; tries < 100 && run_program("status " + job().string()).exit_code != 0; ++tries) {
            std::this_thread::sleep_for(std::chrono::milliseconds(100));
            ASSERT_EQ(run_program("run " + job().string()).exit_code, 0);
        }
        EXPECT_EQ(differences(results_in(job_results()), expected), std::vector<std::string>());
        EXPECT_TRUE(strays_in(job()).empty()) << strays_in(job()).front();
        fs::remove_all(job() / "results");
    });
}

TEST_F(ResumeTest, every_run_of_a_job_leaves_the_bytes_of_a_plain_run) {
    const auto expected = plan_four_blocks();
    for (int look = 0; look < kills() / 2; ++look) {
        ASSERT_EQ(run_program("run " + job().string()).exit_code, 0);
        ASSERT_EQ(differences(results_in(job_results()), expected), std::vector<std::string>()) << look;
        fs::remove_all(job() / "results");
    }
}

} // namespace
} // namespace scanshade
