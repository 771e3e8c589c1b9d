// A second run does again what has changed or is torn, and nothing else. Two runs at the same time do not disturb each
// other.
#include "apps/command.h"
#include "apps/json.h"
#include "apps/results/journal.h"
#include "apps/session/settings.h"
#include "tests/support/files.h"
#include "tests/support/resumed.h"

#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <map>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

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
    EXPECT_EQ(resumed("--in-flight 2"), 0u) << "how it goes, not what comes of it";
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

/// A flag of the wrong class is results that stay though they are other ones, or that are computed again for nothing.
TEST(Affects, every_flag_has_its_class) {
    std::map<Affects, std::string> flags;
    for (const Stage& stage : RunSettings().stages())
        for (const Parameter& row : stage.rows)
            if (row.affects != Affects::results) // all others, and every flag of a method, of clouds and of sequences
                flags[row.affects] += row.name + " ";
    EXPECT_EQ(flags[Affects::as_used],
              "frames camera colour poses depth-scale registered association-limit depth-noise "
              "method radius quality max-error max-ms settings ");
    EXPECT_EQ(flags[Affects::outputs], "write texture-size texture-margin tiles-crs overwrite-occlusion format "
                                       "colour-format shade light shade-strength cloud "
                                       "cloud-resolution "
                                       "colour-cloud page page-points tar ");
    EXPECT_EQ(flags[Affects::nothing], "preset device in-flight out overwrite resume retry strict quiet log shard "
                                       "no-locks scratch scratch-limit dump ");
}

} // namespace
} // namespace scanshade
