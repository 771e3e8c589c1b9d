// What a run survives: a lost share, a lost device, a full disk, a frame that crashes the process. This program
// computes nothing itself, so it has no threads and may fork.
#include "apps/command.h"
#include "apps/jobs/worker.h"
#include "apps/walk/resume.h"
#include "io/files.h"
#include "projection/base/error.h"
#include "tests/support/files.h"
#include "tests/support/resumed.h"

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fmt/format.h>
#include <functional>
#include <gtest/gtest.h>
#include <limits>
#include <numeric>
#include <sys/mount.h>
#include <thread>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

/// Of twenty injections, how many to go on by: all of them only in tests/survival.
int step() { return std::getenv("SCANSHADE_KILLS") ? 1 : 5; }

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

} // namespace
} // namespace scanshade
