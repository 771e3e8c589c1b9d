// What a run survives: kills, a second run at its side, a full disk, a lost device, a frame that crashes the process.
// This program computes nothing itself, so it has no threads and may fork.
#include "apps/command.h"
#include "apps/jobs/job_run.h"
#include "apps/json.h"
#include "apps/walk/resume.h"
#include "io/files.h"
#include "projection/base/error.h"
#include "tests/support/files.h"
#include "tests/support/small_capture.h"

#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <random>
#include <sstream>
#include <sys/mount.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace scanshade {
namespace {

using tests::Ran;
using tests::read_bytes;
using tests::run_program;
using tests::TemporaryFolder;
namespace fs = std::filesystem;

// ---------------------------------------------------------------------------------------------------- helpers

/// Results by name, without reports of times and processes. The page is one, and that of a job comes from `merge`.
std::map<std::string, std::string> results_in(const fs::path& folder) {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder))
        if (const std::string extension = entry.path().extension().string();
            entry.is_regular_file() && extension != ".json" && extension != ".jsonl" && extension != ".csv" &&
            entry.path().stem() != "index")
            files[entry.path().lexically_relative(folder).string()] = read_bytes(entry.path());
    return files;
}

/// The names of files that only one has, or whose bytes differ: the bytes themselves would not help.
std::vector<std::string> differences(const std::map<std::string, std::string>& found,
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

std::vector<fs::path> strays_in(const fs::path& folder) {
    std::vector<fs::path> strays;
    for (const auto& entry : fs::recursive_directory_iterator(folder))
        if (entry.path().filename().string()[0] == '.')
            strays.push_back(entry.path());
    return strays;
}

std::size_t count_in(const fs::path& folder, const std::string& text) {
    std::size_t found = 0;
    for (const auto& entry : fs::recursive_directory_iterator(folder))
        if (entry.path().extension() == ".jsonl") {
            const std::string bytes = read_bytes(entry.path());
            for (auto at = bytes.find(text); at != std::string::npos; at = bytes.find(text, at + 1))
                ++found;
        }
    return found;
}

/// The program started without waiting, in a process group of its own; its messages go nowhere.
pid_t start(const std::string& arguments) {
    const pid_t child = fork();
    if (child != 0)
        return child;
    setpgid(0, 0);
    const std::string line = fmt::format("exec '{}' {} >/dev/null 2>&1", SCANSHADE_PROGRAM, arguments);
    execl("/bin/sh", "sh", "-c", line.c_str(), nullptr);
    _exit(127);
}

int exit_code(int status) { return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status); }

int wait_for(pid_t child) {
    int status = 0;
    waitpid(child, &status, 0);
    return exit_code(status);
}

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

/// Of twenty injections, how many to go on by: all of them only in tests/survival.
int step() { return std::getenv("SCANSHADE_KILLS") ? 1 : 5; }

/// Five files of each frame, that there is much to be caught at.
constexpr const char* all_files = "--write ao,confidence,shaded,panel,cloud";

class ResumeTest : public testing::Test {
  protected:
    void record(int frames) { tests::write_capture(folder / "data/capture", frames); }
    [[nodiscard]] fs::path capture() const { return folder / "data/capture"; }
    [[nodiscard]] fs::path out() const { return folder / "out"; }
    [[nodiscard]] fs::path job() const { return folder / "job"; }
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
    [[nodiscard]] fs::path job_results() const { return job() / "results/data/capture"; }
    [[nodiscard]] std::size_t done_frames() const { return count_in(out(), "{\"frame\":"); }

    TemporaryFolder folder;
};

// ---------------------------------------------------------------------------------------------------- killed

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

TEST_F(ResumeTest, a_share_that_goes_amid_a_run_is_no_fault_of_its_frames) {
    record(120);
    ASSERT_EQ(run(all_files).exit_code, 0);
    const auto expected = results_in(out());
    fs::remove_all(out());
    const pid_t child = start(fmt::format("run {} -o {} {}", capture().string(), out().string(), all_files));
    for (int tries = 0; tries < 60000 && (!fs::exists(out()) || done_frames() < 20); ++tries)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    fs::rename(capture(), folder / "elsewhere");
    EXPECT_EQ(wait_for(child), unfinished);
    const auto records = read_journal(journal_file(out(), "")).records;
    EXPECT_GE(records.size(), 20u);
    for (const auto& [name, record] : records)
        EXPECT_TRUE(record.row.fault == Fault::none || record.row.fault == Fault::outage) << record.row.why;
    EXPECT_LT(results_in(out()).size(), expected.size());

    fs::rename(folder / "elsewhere", capture());
    ASSERT_EQ(run(std::string("--resume ") + all_files).exit_code, 0);
    EXPECT_EQ(differences(results_in(out()), expected), std::vector<std::string>());
    EXPECT_TRUE(strays_in(out()).empty());
}

// ---------------------------------------------------------------------------------------------------- what is redone

TEST_F(ResumeTest, a_second_run_does_nothing_and_what_has_changed_is_done_again) {
    record(5);
    ASSERT_EQ(run("--write ao --depth-noise none").exit_code, 0);
    const auto resumed = [&](const std::string& flags) { // how many frames were done again
        const std::size_t had = done_frames();
        const Ran ran = run("--resume --write ao --depth-noise none " + flags);
        EXPECT_EQ(ran.exit_code, 0) << ran.err;
        return done_frames() - had;
    };
    EXPECT_EQ(resumed(""), 0u);
    EXPECT_EQ(resumed("--gtao.radius 0.1"), 0u) << "another method's setting";
    EXPECT_EQ(resumed("--shade-strength 0.5"), 0u) << "nothing is shaded";
    EXPECT_EQ(resumed("--radius 0.2"), 5u);
    EXPECT_EQ(resumed("--radius 0.2"), 0u);
    EXPECT_EQ(resumed(""), 5u) << "what an earlier setting made has been replaced";

    fs::copy_file(capture() / "depth/001.png", capture() / "depth/003.png", fs::copy_options::overwrite_existing);
    EXPECT_EQ(resumed(""), 1u);
    fs::last_write_time(capture() / "depth/002.png", fs::file_time_type::clock::now());
    EXPECT_EQ(resumed(""), 0u) << "touched, but the same bytes";
    fs::remove(out() / "ao/004.png");
    EXPECT_EQ(resumed(""), 1u);
    EXPECT_TRUE(fs::exists(out() / "ao/004.png"));
    fs::resize_file(out() / "ao/000.png", 10);
    EXPECT_EQ(resumed(""), 1u);
}

TEST_F(ResumeTest, frames_computed_together_are_done_again_where_a_neighbours_pose_has_changed) {
    // Frame 0's pose is corrected by 5 mm. With two frames of reach, frames 0, 1 and 2 used it, and 3 to 6 did not.
    const fs::path recording = folder / "recording", poses = recording / "groundtruth.txt";
    ASSERT_EQ(
        run_program(fmt::format("generate office -o {} --frames 7 --size 64x48 --truth=false", recording.string()))
            .exit_code,
        0);
    const auto run_together = [&](const std::string& flags) {
        const std::size_t had = fs::exists(out()) ? done_frames() : 0;
        const Ran ran = run_program(fmt::format("run {} -o {} --write ao --depth-noise none --method surfel "
                                                "--surfel.quality lowest --sequence on --sequence.reach 2 "
                                                "--sequence.layers 2 --sequence.average 0 {}",
                                                recording.string(), out().string(), flags));
        EXPECT_EQ(ran.exit_code, 0) << ran.err;
        return done_frames() - had;
    };
    ASSERT_EQ(run_together(""), 7U);
    EXPECT_EQ(run_together("--resume"), 0U);
    std::string first; // frame 0's time, as the names of its files tell it
    for (const auto& file : fs::directory_iterator(recording / "depth"))
        if (const std::string stem = file.path().stem().string(); first.empty() || stem < first)
            first = stem;
    std::string rows = read_bytes(poses);
    const auto row = rows.find("\n" + first + " ");
    ASSERT_NE(row, std::string::npos) << first;
    const auto x = row + first.size() + 2, end = rows.find(' ', x);
    rows.replace(x, end - x, fmt::format("{:.6f}", std::stod(rows.substr(x, end - x)) + 0.005));
    tests::write_file(poses, rows);
    EXPECT_EQ(run_together("--resume"), 3U);
    EXPECT_EQ(run_together("--resume"), 0U);
}

TEST_F(ResumeTest, a_resumed_report_holds_all_frames) {
    record(6);
    fs::resize_file(capture() / "depth/002.png", 60);
    ASSERT_EQ(run("--depth-noise none --frames :4").exit_code, 2);
    ASSERT_EQ(run("--depth-noise none --resume").exit_code, 2);
    EXPECT_EQ(done_frames(), 6u) << "a damaged image stays damaged: it is not tried again";
    const std::string table = read_bytes(out() / "frames.csv");
    EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 7);
    EXPECT_NE(table.find("failed"), std::string::npos);
    ASSERT_EQ(run("--depth-noise none --resume --retry").exit_code, 2);
    EXPECT_EQ(done_frames(), 7u);
    tests::write_capture(capture(), 6);
    EXPECT_EQ(run("--depth-noise none --resume").exit_code, 0);
    EXPECT_EQ(done_frames(), 8u);
    const json manifest = json::parse(read_bytes(out() / "manifest.json"));
    ASSERT_EQ(manifest["frames"].size(), 6u);
    for (const json& frame : manifest["frames"]) { // most of them were done by other processes
        EXPECT_EQ(frame["files"].size(), 4u) << frame;
        EXPECT_FALSE(frame["passes"].empty()) << frame;
    }
}

TEST_F(ResumeTest, a_torn_line_costs_one_frame) {
    record(4);
    ASSERT_EQ(run().exit_code, 0);
    const fs::path journal = journal_file(out(), "");
    const std::string whole = read_bytes(journal);
    const auto last_frame = whole.rfind("{\"frame\":");
    fs::resize_file(journal, last_frame + 15);
    ASSERT_EQ(run("--resume").exit_code, 0);
    EXPECT_EQ(read_journal(journal).records.size(), 4u);
    EXPECT_TRUE(is_complete(journal));
    EXPECT_EQ(count_in(out(), "\"name\":\"003\""), 1u);
    EXPECT_EQ(count_in(out(), "\n{\"process\":"), 1u)
        << "the second process' line begins anew, not behind the torn one";
}

TEST_F(ResumeTest, a_line_that_contradicts_itself_costs_one_frame) {
    record(3);
    ASSERT_EQ(run().exit_code, 0);
    const fs::path journal = journal_file(out(), "");
    std::string lines = read_bytes(journal);
    const auto sizes = lines.rfind("\"sizes\":[") + 9, end = lines.find(']', sizes);
    tests::write_file(journal, lines.erase(sizes, end - sizes)); // files, but no size of any
    const Ran resumed = run("--resume");
    ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
    EXPECT_EQ(count_in(out(), "\"name\":\"002\""), 2u);
    EXPECT_EQ(count_in(out(), "\"name\":\"001\""), 1u);
}

// ---------------------------------------------------------------------------------------------------- side by side

TEST_F(ResumeTest, runs_started_on_one_job_by_mistake_do_each_frame_once) {
    for (int i = 0; i < 6; ++i)
        tests::write_capture(folder / fmt::format("data/many/{}", i), 20);
    ASSERT_EQ(plan("--block 10 --write ao").exit_code, 0);
    std::vector<pid_t> runs;
    for (int i = 0; i < 3; ++i)
        runs.push_back(start("run " + job().string()));
    for (const pid_t each : runs)
        EXPECT_EQ(wait_for(each), 0);
    EXPECT_EQ(run_program("status " + job().string()).exit_code, 0);
    EXPECT_EQ(count_in(job(), "{\"frame\":"), 120u);
}

TEST_F(ResumeTest, a_second_plain_run_is_turned_away) {
    record(2);
    const Journal held(out(), "");
    const Ran second = run("--resume");
    EXPECT_EQ(second.exit_code, 4);
    EXPECT_NE(second.err.find("another run is at work"), std::string::npos) << second.err;
}

TEST_F(ResumeTest, a_capture_that_another_run_holds_does_not_keep_the_others_from_being_done) {
    tests::write_capture(folder / "data/one", 2);
    tests::write_capture(folder / "data/two", 2);
    const std::string arguments =
        fmt::format("run {} {} -o {}", (folder / "data/one").string(), (folder / "data/two").string(), out().string());
    {
        const Journal held(out() / "one", "");
        EXPECT_EQ(run_program(arguments + " --resume").exit_code, unfinished);
    }
    EXPECT_FALSE(fs::exists(out() / "one/manifest.json"));
    EXPECT_TRUE(fs::exists(out() / "two/manifest.json"));
    EXPECT_EQ(run_program(arguments + " --resume").exit_code, 0);
    EXPECT_TRUE(fs::exists(out() / "one/manifest.json"));
}

// ---------------------------------------------------------------------------------------------------- the device, the
// disk, a crash

/// Half open everywhere; `before` may throw or worse.
class HalfOpen final : public Method {
  public:
    explicit HalfOpen(std::function<void(const View&)> before) : before_(std::move(before)) {}
    AoMap compute(const View& view) override {
        before_(view);
        AoMap ao{cv::Mat1f(view.surfaces.z_m.size(), 0.5f)};
        ao.visibility.setTo(std::numeric_limits<float>::quiet_NaN(), view.surfaces.z_m <= 0);
        return ao;
    }
    const Timings& timings() const override { return timings_; }

  private:
    std::function<void(const View&)> before_;
    Timings timings_;
};

/// A worker's task for one capture, with a method that can be made to fail.
int work(const fs::path& path, const fs::path& out, const WorkerProcess& worker,
         const std::function<void(const View&)>& before, std::size_t frames_in_tar = 0) {
    const Capture capture = open_capture(path);
    HalfOpen method(before);
    Journal journal(out, "");
    BatchOptions options;
    options.frames.resize(capture.entries.size());
    std::iota(options.frames.begin(), options.frames.end(), 0);
    options.outputs.folder = out;
    std::optional<ResultTars> tars;
    if ((options.outputs.frames_in_tar = frames_in_tar) > 0) {
        options.outputs.waiting = out / tar_folder / ".frames";
        tars.emplace(capture, options.outputs, options.frames, "");
    }
    const Recording recording{journal, "settings",       "task",          "test",
                              false,   worker.carefully, worker.finished, tars ? &*tars : nullptr};
    FrameAo door(method);
    MethodPool pool(door);
    const auto rows = run_recorded(capture, pool, options, recording);
    const auto any = [&](Fault fault) { return std::ranges::count(rows, fault, &FrameRow::fault) > 0; };
    return any(Fault::outage) ? unfinished : any(Fault::crash) ? internal_error : all_well;
}

/// The depth of write_capture()'s frame tells which it is: `index` and what is alike modulo 8.
bool is_frame(const View& view, int index) {
    return cv::norm(view.surfaces.z_m, tests::corner_depth(index), cv::NORM_INF) < 0.002;
}

TEST_F(ResumeTest, a_frame_that_crashes_the_process_is_marked_and_the_others_are_done) {
    record(8);
    const int code = supervise(1, [&](const WorkerProcess& worker) {
        return work(capture(), out(), worker, [](const View& view) {
            if (is_frame(view, 5))
                raise(SIGSEGV);
        });
    });
    EXPECT_EQ(code, internal_error);
    const JournalFacts facts = read_journal(journal_file(out(), ""));
    ASSERT_EQ(facts.records.size(), 8u);
    for (const auto& [name, record] : facts.records) {
        EXPECT_EQ(record.row.status, name == "005" ? FrameStatus::failed : FrameStatus::ok) << name;
        EXPECT_EQ(fs::exists(out() / "ao" / (name + ".png")), name != "005");
    }
    EXPECT_EQ(facts.records.at("005").row.fault, Fault::crash);
    EXPECT_FALSE(facts.complete.empty());
}

TEST_F(ResumeTest, several_frames_of_a_tar_that_crash_the_process_are_marked_in_it) {
    record(8);
    const int code = supervise(1, [&](const WorkerProcess& worker) {
        return work(
            capture(), out(), worker,
            [](const View& view) {
                if (is_frame(view, 2) || is_frame(view, 5) || is_frame(view, 6))
                    raise(SIGSEGV);
            },
            8);
    });
    EXPECT_EQ(code, internal_error);
    const JournalFacts facts = read_journal(journal_file(out(), ""));
    ASSERT_EQ(facts.records.size(), 8u);
    EXPECT_EQ(facts.records.at("005").row.fault, Fault::crash);
    EXPECT_EQ(facts.records.at("007").row.status, FrameStatus::ok);
    EXPECT_TRUE(is_file(out() / "tars/000000.tar/006.json"));
    EXPECT_TRUE(is_file(out() / "tars/000000.tar/007.ao.png"));
    EXPECT_FALSE(is_file(out() / "tars/000000.tar/005.ao.png"));
    EXPECT_TRUE(strays_in(out()).empty());
}

TEST_F(ResumeTest, a_lost_device_gets_a_fresh_process_and_no_frame_is_lost) {
    record(24);
    for (int injection = 0; injection < 20; injection += step()) {
        const fs::path mark = folder / "lost";
        fs::remove_all(out());
        fs::remove(mark);
        const int code = supervise(1, [&](const WorkerProcess& worker) {
            int calls = 0;
            return work(capture(), out(), worker, [&](const View&) {
                if (calls++ == injection && !fs::exists(mark)) {
                    tests::write_file(mark, "once");
                    throw DeviceLost("the device is lost");
                }
            });
        });
        EXPECT_EQ(code, all_well);
        EXPECT_TRUE(fs::exists(mark));
        EXPECT_EQ(read_journal(journal_file(out(), "")).records.size(), 24u);
        EXPECT_EQ(results_in(out()).size(), 72u);
        EXPECT_EQ(count_in(out(), "{\"frame\":"), 24u) << "each once";
        EXPECT_TRUE(strays_in(out()).empty());
    }
}

TEST_F(ResumeTest, a_device_that_stays_lost_is_given_up) {
    record(3);
    const int code = supervise(1, [&](const WorkerProcess& worker) {
        return work(capture(), out(), worker, [](const View&) { throw DeviceLost("the device is lost"); });
    });
    EXPECT_EQ(code, unfinished);
    EXPECT_TRUE(read_journal(journal_file(out(), "")).records.empty()) << "no frame is to blame";
}

TEST_F(ResumeTest, a_full_disk_loses_nothing) {
    record(40);
    ASSERT_EQ(run().exit_code, 0);
    const auto expected = results_in(out());
    std::uintmax_t bytes = 0;
    for (const auto& [name, content] : expected)
        bytes += 4096 * (1 + content.size() / 4096);
    const fs::path disk = folder / "disk";
    fs::create_directories(disk);
    for (int injection = 1; injection <= 20; injection += step()) {
        const auto size = fmt::format("size={}", 40'000 + bytes * static_cast<std::uintmax_t>(injection) / 22);
        if (mount("scanshade-test", disk.c_str(), "tmpfs", 0, size.c_str()) != 0)
            GTEST_SKIP() << "a small tmpfs needs the right to mount";
        const std::string arguments = fmt::format("run {} -o {} --resume", capture().string(), (disk / "out").string());
        const Ran full = run_program(arguments);
        EXPECT_EQ(full.exit_code, 4) << full.err;
        for (const auto& [name, content] : results_in(disk / "out"))
            EXPECT_EQ(content, expected.at(name)) << "whole or not there";
        EXPECT_EQ(mount("scanshade-test", disk.c_str(), "tmpfs", MS_REMOUNT, "size=64m"), 0);
        EXPECT_EQ(run_program(arguments).exit_code, 0);
        EXPECT_EQ(results_in(disk / "out"), expected);
        EXPECT_TRUE(strays_in(disk).empty()) << strays_in(disk).front();
        umount(disk.c_str());
    }
}

// ---------------------------------------------------------------------------------------------------- plans and shards

TEST_F(ResumeTest, a_plan_finds_captures_of_several_layouts_and_no_results) {
    record(7);
    for (int i = 0; i < 2; ++i) {
        fs::create_directories(folder / "data/deep/seq");
        fs::copy_file(capture() / "depth/000.png", folder / fmt::format("data/deep/seq/frame-00000{}.depth.png", i));
    }
    tests::write_file(folder / "data/clouds/a.ply", "ply\n");
    ASSERT_EQ(run("--frames 0").exit_code, 0);
    fs::rename(out(), folder / "data/results");
    const Ran planned = plan("--block 3 --radius 0.4");
    ASSERT_EQ(planned.exit_code, 0) << planned.err;
    const Plan read = read_plan(job());
    std::map<std::string, std::vector<std::size_t>> blocks;
    for (const Task& task : read.tasks)
        blocks[task.name].push_back(task.frames);
    const std::map<std::string, std::vector<std::size_t>> expected = {
        {"data/capture", {2, 2, 3}}, {"data/clouds", {1}}, {"data/deep/seq", {2}}};
    EXPECT_EQ(blocks, expected);
    ASSERT_EQ(read.settings.size(), 1u);
    EXPECT_EQ(read.settings[0], std::pair(std::string("radius"), std::string("0.4")));
    EXPECT_EQ(plan().exit_code, 1) << "a job there is replaced only when asked";
}

TEST_F(ResumeTest, shards_together_do_everything_and_a_late_one_takes_over_from_a_dead_one) {
    for (int i = 0; i < 4; ++i)
        tests::write_capture(folder / fmt::format("data/many/{}", i), 3 + i);
    ASSERT_EQ(plan("--write ao").exit_code, 0);
    ASSERT_EQ(run_program(fmt::format("run {} --shard 2/3", job().string())).exit_code, 0);
    EXPECT_EQ(run_program("status " + job().string()).exit_code, 0) << "shards 1 and 3 never ran";
    const json status = json::parse(run_program("status --json " + job().string()).out);
    EXPECT_EQ(status["tasks"]["done"], status["tasks"]["of"]);
    EXPECT_EQ(status["frames"]["ok"], 3 + 4 + 5 + 6);
    EXPECT_EQ(status["work_done"], 1);
    EXPECT_TRUE(status["running"].empty() && status["failures"].empty());
    EXPECT_EQ(run_program(fmt::format("run {} --shard 4/3", job().string())).exit_code, 1);
    EXPECT_EQ(run_program("merge " + job().string()).exit_code, 0);
    const std::string table = read_bytes(job() / "frames.csv");
    EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 1 + 3 + 4 + 5 + 6);
}

TEST_F(ResumeTest, the_log_is_json_line_by_line_when_asked) {
    record(3);
    fs::resize_file(capture() / "depth/001.png", 60);
    const Ran ran = run("--log json");
    EXPECT_EQ(ran.exit_code, 2);
    std::istringstream lines(ran.err);
    int frames = 0;
    for (std::string line; std::getline(lines, line);) {
        const json text = parsed_or_discarded(line);
        ASSERT_TRUE(text.is_object() && text.contains("time")) << line;
        if (!text.contains("frame"))
            continue;
        ++frames;
        EXPECT_EQ(text["fault"], text["frame"] == "001" ? "input" : "none");
        EXPECT_EQ(text["done"], frames);
    }
    EXPECT_EQ(frames, 3);
}

TEST_F(ResumeTest, gnu_parallel_runs_the_shards) {
    if (std::system("parallel --version >/dev/null 2>&1 </dev/null") != 0)
        GTEST_SKIP() << "GNU parallel is not installed";
    for (int i = 0; i < 6; ++i)
        tests::write_capture(folder / fmt::format("data/many/{}", i), 3);
    ASSERT_EQ(plan("--write ao").exit_code, 0);
    const std::string line = fmt::format("parallel -j2 '{}' run {} --shard {{}}/3 ::: 1 2 3 >/dev/null 2>&1 </dev/null",
                                         SCANSHADE_PROGRAM, job().string());
    EXPECT_EQ(std::system(line.c_str()), 0);
    EXPECT_EQ(run_program("status " + job().string()).exit_code, 0);
    EXPECT_EQ(count_in(job(), "{\"frame\":"), 18u);
}

TEST_F(ResumeTest, a_kubernetes_indexed_job_runs_the_shards) {
    for (int i = 0; i < 6; ++i)
        tests::write_capture(folder / fmt::format("data/many/{}", i), 3);
    ASSERT_EQ(plan("--write ao").exit_code, 0);
    setenv("JOB_COMPLETIONS", "3", 1);
    std::vector<pid_t> pods;
    for (const char* index : {"0", "1", "2"}) {
        setenv("JOB_COMPLETION_INDEX", index, 1);
        pods.push_back(start("run " + job().string()));
    }
    unsetenv("JOB_COMPLETION_INDEX");
    unsetenv("JOB_COMPLETIONS");
    for (const pid_t pod : pods)
        EXPECT_EQ(wait_for(pod), 0);
    EXPECT_EQ(run_program("status " + job().string()).exit_code, 0);
    EXPECT_EQ(count_in(job(), "{\"frame\":"), 18u) << "each once";
}

TEST(CutTest, every_task_is_in_one_shard_and_the_slowest_is_near_the_mean) {
    std::mt19937 random(5);
    std::lognormal_distribution<double> size(3, 1);
    std::vector<Task> tasks(1000);
    for (Task& task : tasks)
        task.cost = size(random);
    const auto parts = cut(tasks, 16);
    std::vector<int> seen(tasks.size());
    double slowest = 0, all = 0;
    for (const auto& part : parts) {
        double load = 0;
        for (const std::size_t task : part) {
            ++seen[task];
            load += tasks[task].cost;
        }
        slowest = std::max(slowest, load);
        all += load;
    }
    EXPECT_EQ(seen, std::vector<int>(tasks.size(), 1));
    EXPECT_LE(slowest, 1.01 * all / 16); // greedy dealing errs by at most the smallest tasks
}

TEST(ExitCodeTest, of_several_captures_the_worse_one_tells_and_well_with_nothing_is_partly_done) {
    EXPECT_EQ(worse(all_well, all_well), all_well);
    EXPECT_EQ(worse(nothing_done, nothing_done), nothing_done);
    EXPECT_EQ(worse(all_well, nothing_done), some_failed);
    EXPECT_EQ(worse(nothing_done, all_well), some_failed);
    const std::array mildest_first{all_well, some_failed, internal_error, unfinished, misuse};
    for (std::size_t i = 0; i < mildest_first.size(); ++i)
        for (std::size_t j = 0; j < mildest_first.size(); ++j)
            EXPECT_EQ(worse(mildest_first[i], mildest_first[j]), mildest_first[std::max(i, j)]);
}

TEST(ShardTest, schedulers_number_their_tasks_in_their_own_ways) {
    const auto shard = [](const std::map<std::string, std::string>& environment) {
        for (const auto& [name, value] : environment)
            setenv(name.c_str(), value.c_str(), 1);
        const Shard found = shard_from("");
        for (const auto& [name, value] : environment)
            unsetenv(name.c_str());
        return std::pair(found.index, found.of);
    };
    EXPECT_EQ(shard({}), std::pair(1, 1));
    EXPECT_EQ(shard({{"SLURM_ARRAY_TASK_ID", "3"}, {"SLURM_ARRAY_TASK_MIN", "0"}, {"SLURM_ARRAY_TASK_COUNT", "8"}}),
              std::pair(4, 8));
    EXPECT_EQ(shard({{"SLURM_ARRAY_TASK_ID", "5"},
                     {"SLURM_ARRAY_TASK_MIN", "1"},
                     {"SLURM_ARRAY_TASK_STEP", "2"},
                     {"SLURM_ARRAY_TASK_COUNT", "3"}}),
              std::pair(3, 3));
    EXPECT_EQ(shard({{"JOB_COMPLETION_INDEX", "0"}, {"JOB_COMPLETIONS", "4"}}), std::pair(1, 4));
    EXPECT_EQ(shard_from("2/8").index, 2);
    for (const char* wrong : {"0/3", "4/3", "a/b", "1/0", "1/2/3", "1", "/", " 1/2", "4294967297/4294967298"})
        EXPECT_THROW((void)shard_from(wrong), Misuse) << wrong;
}

} // namespace
} // namespace scanshade
