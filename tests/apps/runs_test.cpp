// What a run leaves behind, refuses and says, as a user meets it: outputs that cannot be written, results of other
// captures, long names, full memory, a hangup, a full standard output.
#include "apps/command.h"
#include "apps/walk/progress.h"
#include "io/images/image_file.h"
#include "io/output_file.h"
#include "projection/base/error.h"
#include "tests/support/files.h"
#include "tests/support/png.h"
#include "tests/support/says.h"
#include "tests/support/small_capture.h"

#include <chrono>
#include <csignal>
#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <set>
#include <sys/resource.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace scanshade {
namespace {

using nlohmann::json;
using tests::Ran;
using tests::read_bytes;
using tests::run_program;
using tests::says;
using tests::TemporaryFolder;
namespace fs = std::filesystem;

class RunsTest : public testing::Test {
  protected:
    [[nodiscard]] fs::path capture() const { return folder / "capture"; }
    [[nodiscard]] fs::path out() const { return folder / "out"; }
    [[nodiscard]] Ran run(const std::string& flags = "") const { return run_of(capture(), flags); }
    [[nodiscard]] Ran run_of(const fs::path& path, const std::string& flags = "") const {
        return run_program(fmt::format("run '{}' -o '{}' {}", path.string(), out().string(), flags));
    }
    /// The program after other words of the shell; keeps its messages alone.
    [[nodiscard]] Ran shell(const std::string& before, const std::string& arguments) const {
        const fs::path messages = folder / "messages";
        const std::string command =
            fmt::format("{} '{}' {} 2>'{}'", before, SCANSHADE_PROGRAM, arguments, messages.string());
        const int status = std::system(command.c_str());
        return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), "", read_bytes(messages)};
    }
    [[nodiscard]] json manifest() const { return json::parse(read_bytes(out() / "manifest.json")); }

    TemporaryFolder folder;
};

std::size_t files_in(const fs::path& folder) {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

// ---------------------------------------------------------------------------------------------------- nothing was done

TEST_F(RunsTest, a_run_without_a_camera_does_not_block_the_next) {
    tests::write_capture(capture(), 2);
    fs::rename(capture() / "camera.json", folder / "camera.json");
    EXPECT_EQ(run().exit_code, nothing_done);
    EXPECT_TRUE(fs::exists(out() / "manifest.json")) << "it says why";
    const Ran next = run("--camera " + (folder / "camera.json").string());
    EXPECT_EQ(next.exit_code, all_well) << next.err;
    EXPECT_EQ(run("--camera " + (folder / "camera.json").string()).exit_code, misuse) << "now there are results";
}

TEST_F(RunsTest, a_refused_budget_does_not_block_the_next_run) {
    tests::write_capture(capture(), 2);
    EXPECT_EQ(run("--max-error 0.0001").exit_code, misuse);
    const Ran next = run();
    EXPECT_EQ(next.exit_code, all_well) << next.err;
}

// ---------------------------------------------------------------------------------------------------- results of
// others

/// Another capture than write_capture() makes: the same frames' names, farther walls.
void write_other_capture(const fs::path& folder, int frames) {
    tests::write_capture(folder, frames);
    for (int i = 0; i < frames; ++i) {
        cv::Mat1f walls = tests::corner_depth(i);
        walls *= 1.5;
        write_depth_png(folder / fmt::format("depth/{:03}.png", i), walls, 1000);
    }
}

TEST_F(RunsTest, a_scene_too_small_for_the_usual_radius_gets_its_own) {
    tests::write_capture(folder / "room", 2);
    tests::write_capture(folder / "thing", 2);
    for (int i = 0; i < 2; ++i) {
        cv::Mat1f walls = tests::corner_depth(i);
        walls *= 0.2;
        write_depth_png(folder / fmt::format("thing/depth/{:03}.png", i), walls, 1000);
    }
    const auto radius_in = [&](const std::string& manifest) {
        return json::parse(read_bytes(out() / manifest))["settings"]["method cacao"]["cacao.radius"].get<double>();
    };
    const std::string both =
        fmt::format("run '{}' '{}' -o '{}' ", (folder / "room").string(), (folder / "thing").string(), out().string());
    const Ran ran = run_program(both + "--depth-noise none");
    EXPECT_EQ(ran.exit_code, all_well) << ran.err;
    EXPECT_EQ(radius_in("room/manifest.json"), 0.5);
    EXPECT_EQ(radius_in("thing/manifest.json"), 0.1);
    EXPECT_TRUE(says(ran.err, "thing: the scene is only 0.5")) << ran.err;
    EXPECT_FALSE(says(ran.err, "room: the scene"));
    const Ran resumed = run_program(both + "--depth-noise none --resume");
    EXPECT_EQ(resumed.exit_code, all_well);
    EXPECT_TRUE(says(resumed.out + resumed.err, "done already")) << resumed.out << resumed.err;
    // What a person says stays.
    const Ran told = run_program(both + "--depth-noise none --overwrite --radius 0.4 --strict");
    EXPECT_EQ(radius_in("thing/manifest.json"), 0.4);
    EXPECT_EQ(told.exit_code, some_failed) << "more than half of it";
    EXPECT_FALSE(says(told.err, "the scene is only"));
}

TEST_F(RunsTest, results_of_another_capture_are_not_resumed) {
    tests::write_capture(capture(), 2);
    write_other_capture(folder / "other", 2);
    ASSERT_EQ(run().exit_code, all_well);
    const std::string before = read_bytes(out() / "manifest.json");
    const Ran refused = run_of(folder / "other", "--resume");
    EXPECT_EQ(refused.exit_code, misuse);
    EXPECT_TRUE(says(refused.err, "has results of " + fs::canonical(capture()).string()));
    EXPECT_EQ(read_bytes(out() / "manifest.json"), before);
    EXPECT_EQ(run_of(folder / "other", "--overwrite").exit_code, all_well);
    EXPECT_EQ(run_of(folder / "other", "--resume").exit_code, all_well);
}

TEST_F(RunsTest, a_capture_that_was_moved_is_resumed) {
    tests::write_capture(capture(), 2);
    ASSERT_EQ(run().exit_code, all_well);
    fs::rename(capture(), folder / "moved");
    const Ran resumed = run_of(folder / "moved", "--resume");
    EXPECT_EQ(resumed.exit_code, all_well) << resumed.err;
}

TEST_F(RunsTest, a_manifest_lists_files_of_earlier_runs_apart) {
    tests::write_capture(capture(), 4);
    ASSERT_EQ(run("--write ao").exit_code, all_well);
    EXPECT_EQ(manifest()["not_of_this_run"], json::array());
    const Ran fewer = run("--write ao --resume --frames :2");
    ASSERT_EQ(fewer.exit_code, all_well) << fewer.err;
    EXPECT_TRUE(says(fewer.err, "4 files of earlier runs left alone (ao/002.png, ao/003.png, previews/002.js ...)"));
    EXPECT_EQ(manifest()["not_of_this_run"], json({"ao/002.png", "ao/003.png", "previews/002.js", "previews/003.js"}));
    EXPECT_EQ(manifest()["frames"].size(), 2u);
    ASSERT_EQ(run("--write ao --resume").exit_code, all_well);
    EXPECT_EQ(manifest()["not_of_this_run"], json::array()) << "all are its own again";
}

// ---------------------------------------------------------------------------------------------------- outputs

TEST_F(RunsTest, outputs_that_cannot_be_written_are_misuse_with_the_systems_reason) {
    tests::write_capture(capture(), 1);
    tests::write_file(folder / "file", "no folder");
    const std::string in_file = (folder / "file/out").string(), in = capture().string();
    for (const std::string& command :
         {fmt::format("run {} -o {}", in, in_file), fmt::format("run {} -o {}", in, (folder / "file").string()),
          fmt::format("plan {} -o {}", in, in_file),
          fmt::format("generate office --frames 1 --size 64x48 -o {}", in_file),
          fmt::format("compare {0} {0} -o {1}", in, in_file), fmt::format("refine {} -o {}.json", in, in_file),
          fmt::format("run {} -o {} --cloud {}.ply", in, out().string(), in_file)}) {
        const Ran ran = run_program(command);
        EXPECT_EQ(ran.exit_code, misuse) << command << "\n" << ran.err;
        EXPECT_TRUE(says(ran.err, "file: Not a directory")) << command;
    }
    // Not even root makes files there.
    const Ran proc = run_program("run " + in + " -o /proc/out");
    EXPECT_EQ(proc.exit_code, misuse);
    EXPECT_TRUE(says(proc.err, "/proc/out: cannot be written: no file can be made in /proc: No such file"));
    const Ran taken = run_program("refine " + in + " -o " + in);
    EXPECT_EQ(taken.exit_code, misuse);
    EXPECT_TRUE(says(taken.err, "a file is expected: Is a directory"));
    for (const char* part : {"ao", "journal.jsonl"}) { // in the way of a folder, and of a file
        const fs::path other = folder / (std::string("other_") + part);
        part == std::string("ao") ? (void)tests::write_file(other / part, "")
                                  : (void)fs::create_directories(other / part);
        const Ran ran = run_program("run " + in + " -o " + other.string() + " --overwrite");
        EXPECT_EQ(ran.exit_code, misuse) << part << ran.err;
        EXPECT_TRUE(says(ran.err, part == std::string("ao") ? "ao: Not a directory"
                                                            : "jsonl: cannot be written: Is a directory"));
        fs::remove_all(other);
    }
    const Ran longer = run_program("run " + in + " -o " + (folder / "a" / std::string(256, 'n')).string());
    EXPECT_EQ(longer.exit_code, misuse);
    EXPECT_TRUE(says(longer.err, "a name of 256 bytes: File name too long"));
    EXPECT_FALSE(fs::exists(out()));
    EXPECT_EQ(files_in(folder.path()), 2u) << "the check leaves nothing behind";
}

TEST_F(RunsTest, names_longer_than_a_file_system_takes_are_shortened_by_a_hash) {
    // 251 bytes and ".png" are the most that a file can have; suffixes of our own must fit, too.
    const std::string one(250, 'n');
    fs::create_directories(capture());
    for (const char last : {'a', 'b'})
        write_depth_png(capture() / (one + last + ".png"), tests::corner_depth(0), 1000);
    const Ran ran = run("--camera 52,52,31.5,23.5 --write ao,shaded");
    ASSERT_EQ(ran.exit_code, all_well) << ran.err;
    std::set<std::string> names;
    for (const auto& file : fs::directory_iterator(out() / "ao"))
        names.insert(file.path().filename().string());
    ASSERT_EQ(names.size(), 2u);
    fs::remove(capture() / (one + "a.png"));
    ASSERT_EQ(run("--camera 52,52,31.5,23.5 --write ao,shaded --resume").exit_code, all_well);
    EXPECT_TRUE(names.contains(fs::path(manifest()["frames"][0]["files"][0].get<std::string>()).filename().string()))
        << "a name does not depend on the other frames";

    const fs::path longest = folder / std::string(255, 'x');
    write_atomically(longest, "text");
    EXPECT_EQ(read_bytes(longest), "text");
    EXPECT_EQ(shortened("short", 20), "short");
    EXPECT_EQ(shortened(std::string(19, 'a') + "\xc3\xa4" + std::string(20, 'a'), 37).substr(0, 20),
              std::string(19, 'a') + "-")
        << "no half characters";
}

// ---------------------------------------------------------------------------------------------------- memory

/// Of a plane 2 m away, 16-bit: 512 MB of pixels in half a megabyte. Packed row by row, since a child's peak memory
/// begins with that of the process it was forked from.
fs::path write_huge_depth(const fs::path& file) {
    constexpr std::uint32_t side = 16000;
    std::string row(1, '\0'); // no filter
    for (std::uint32_t x = 0; x < side; ++x)
        row += {'\x07', '\xd0'}; // 2000 mm
    z_stream stream = {};
    deflateInit(&stream, 9);
    std::string packed(1 << 20, '\0');
    stream.next_out = reinterpret_cast<Bytef*>(packed.data());
    stream.avail_out = static_cast<uInt>(packed.size());
    for (std::uint32_t y = 0; y < side; ++y) {
        stream.next_in = reinterpret_cast<Bytef*>(row.data());
        stream.avail_in = static_cast<uInt>(row.size());
        deflate(&stream, y + 1 == side ? Z_FINISH : Z_NO_FLUSH);
    }
    packed.resize(stream.total_out);
    deflateEnd(&stream);
    const std::string header =
        tests::big_endian(side) + tests::big_endian(side) + std::string("\x10\0\0\0\0", 5); // 16 bits, grey
    return tests::write_file(file, std::string("\x89PNG\r\n\x1a\n") + tests::png_chunk("IHDR", header) +
                                       tests::png_chunk("IDAT", packed) + tests::png_chunk("IEND", ""));
}

TEST_F(RunsTest, a_huge_depth_image_is_examined_in_little_more_than_its_pixels) {
    const fs::path file = write_huge_depth(folder / "huge.png");
    const pid_t child = fork();
    if (child == 0) {
        const int nowhere = open("/dev/null", O_WRONLY);
        dup2(nowhere, STDOUT_FILENO);
        execl(SCANSHADE_PROGRAM, SCANSHADE_PROGRAM, "inspect", file.c_str(), nullptr);
        _exit(127);
    }
    int status = 0;
    rusage used = {};
    wait4(child, &status, 0, &used);
    ASSERT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), all_well);
    constexpr long kib_of_pixels = 16000L * 16000 * 2 / 1024;
    EXPECT_LT(used.ru_maxrss, kib_of_pixels + 180 * 1024);
    const json facts = json::parse(run_program("inspect --json " + file.string()).out).at(0);
    EXPECT_EQ(facts["depth"]["near_m"], 2.0);
    EXPECT_EQ(facts["depth"]["median_m"], 2.0);
    EXPECT_EQ(facts["depth"]["far_m"], 2.0);
    EXPECT_EQ(facts["depth"]["holes"], 0.0);
}

TEST_F(RunsTest, a_lack_of_memory_is_predicted_and_is_exit_code_4) {
    const fs::path file = write_huge_depth(folder / "huge.png");
    const auto with_memory = [&](int mib, const std::string& arguments) {
        return shell(fmt::format("ulimit -v {};", 1024 * mib), arguments + " >/dev/null");
    };
    const Ran looked = with_memory(400, "inspect " + file.string());
    EXPECT_EQ(looked.exit_code, unfinished);
    EXPECT_TRUE(says(looked.err, "huge.png: an image of 16000x16000 pixels needs about 0.5 GiB of memory, 0."));
    const Ran ran = with_memory(
        1400, fmt::format("run {} -o {} --camera 16000,16000,7999.5,7999.5 --write ao", file.string(), out().string()));
    EXPECT_EQ(ran.exit_code, unfinished) << ran.err;
    EXPECT_TRUE(says(ran.err, "GiB of memory, "));
    // On lavapipe, the device of tests, its images are in the same memory.
    const auto needed_for = [&](const std::string& write) {
        const Ran computed =
            with_memory(6000, fmt::format("run {} -o {} --camera 16000,16000,7999.5,7999.5 --depth-noise none {}",
                                          file.string(), (folder / "computed").string(), write));
        EXPECT_EQ(computed.exit_code, unfinished) << computed.err;
        return computed.err;
    };
    const std::string what = "huge.png: a frame of 16000x16000 pixels needs about ";
    EXPECT_TRUE(says(needed_for("--write ao"), what + "8.6 GiB of memory, "));
    EXPECT_TRUE(says(needed_for(""), what + "11.7 GiB of memory, "));
}

// ---------------------------------------------------------------------------------------------------- signals

int code_of(pid_t child) {
    int status = 0;
    waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

TEST_F(RunsTest, a_hangup_ends_a_run_after_the_frames_in_flight) {
    tests::write_capture(capture(), 400);
    const pid_t child = tests::start_program({"run", capture().string(), "-o", out().string()}, folder / "err");
    ASSERT_TRUE(tests::wait_for_file(out() / "ao/000.png"));
    kill(child, SIGHUP);
    EXPECT_EQ(code_of(child), unfinished);
    EXPECT_GE(manifest()["totals"]["skipped"], 1);
    EXPECT_EQ(manifest()["totals"]["ok"].get<std::size_t>(), files_in(out() / "ao"));
}

TEST_F(RunsTest, a_job_that_is_cut_off_does_not_say_100_percent) {
    tests::write_capture(capture(), 400);
    const fs::path job = folder / "job";
    ASSERT_EQ(run_program(fmt::format("plan {} -o {}", capture().string(), job.string())).exit_code, all_well);
    const pid_t child = tests::start_program({"run", job.string()}, folder / "err");
    ASSERT_TRUE(tests::wait_for_file(job / "results/capture/ao/000.png"));
    kill(child, SIGHUP);
    EXPECT_EQ(code_of(child), unfinished);
    const std::string said = read_bytes(folder / "err");
    EXPECT_TRUE(says(said, "task 1 of 1 is not finished, 0 % of the work"));
    EXPECT_FALSE(says(said, "100 %"));
    EXPECT_FALSE(says(said, " 0:00 left"));
    EXPECT_FALSE(says(run_program("status " + job.string()).out, "100.0 %"));
}

TEST(ProgressTest, all_is_said_to_be_done_only_where_nothing_is_left) {
    EXPECT_EQ(percent_text(0.9999, true), "99");
    EXPECT_EQ(percent_text(1, true), "99");
    EXPECT_EQ(percent_text(0.99999, true, 1), "99.9");
    EXPECT_EQ(percent_text(0.5, true), "50");
    EXPECT_EQ(percent_text(1, false), "100");
    EXPECT_EQ(time_left_text(0.1), "0:01");
}

// ---------------------------------------------------------------------------------------------------- standard output

TEST_F(RunsTest, results_that_cannot_be_printed_are_an_error) {
    tests::write_capture(capture(), 1);
    ASSERT_EQ(run().exit_code, all_well);
    const std::string in = capture().string(), job = (folder / "job").string();
    ASSERT_EQ(run_program("plan " + in + " -o " + job).exit_code, all_well);
    for (const std::string& command :
         {std::string("help"), std::string("help run all"), std::string("--version"), std::string("methods"),
          std::string("devices"), "inspect " + in, "inspect --json " + in, "status " + job, "merge " + job,
          fmt::format("compare {} {}", out().string(), out().string()),
          fmt::format("plan {} -o {}", in, (folder / "job2").string())}) {
        const Ran ran = shell("", command + " >/dev/full");
        EXPECT_EQ(ran.exit_code, unfinished) << command;
        EXPECT_TRUE(says(ran.err, "standard output: No space left on device")) << command;
    }
}

// ---------------------------------------------------------------------------------------------------- plan

TEST_F(RunsTest, plan_lists_what_it_passes_over_and_why) {
    const fs::path data = folder / "data";
    tests::write_capture(data / "capture", 2);
    fs::create_directories(data / "capture/more");
    tests::write_file(data / "notes/read.me", "no frames");
    fs::create_directories(data / "empty");
    tests::write_file(data / ".cache/x", "hidden");
    ASSERT_EQ(
        run_program(fmt::format("run {} -o {}", (data / "capture").string(), (data / "results").string())).exit_code,
        all_well);
    fs::create_directory_symlink(data, data / "round");
    const Ran planned = run_program(fmt::format("plan {} -o {}", data.string(), (folder / "job").string()));
    ASSERT_EQ(planned.exit_code, all_well) << planned.err;
    const std::string at = fs::canonical(data).string();
    const std::set<std::string> expected = {
        at + "/capture/more: in the folder of a capture, which takes no frames from it",
        at + "/notes: no frames among its 1 file (.me)",
        at + "/empty: empty",
        at + "/.cache: hidden, as its name begins with '.'",
        at + "/results: results of an earlier run",
        at + "/round: a link to a folder that was searched already"};
    const auto listed = json::parse(read_bytes(folder / "job/plan.json"))["passed_over"].get<std::set<std::string>>();
    EXPECT_EQ(listed, expected);
    for (const std::string& each : expected)
        EXPECT_TRUE(says(planned.err, "passed over: " + each));
}

} // namespace
} // namespace scanshade
