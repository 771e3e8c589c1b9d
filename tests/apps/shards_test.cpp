// Plans of jobs and their shards: each task is in one of them, whatever scheduler starts them. Logs and exit codes.
#include "apps/command.h"
#include "apps/jobs/job.h"
#include "apps/jobs/worker.h"
#include "apps/json.h"
#include "projection/base/error.h"
#include "tests/support/files.h"
#include "tests/support/resumed.h"

#include <array>
#include <cstdlib>
#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

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
