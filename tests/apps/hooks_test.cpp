// Hooks: what a name may not do to a shell, how a hook ends, and what becomes of a task around it. Stores are folders
// here, and `cp` moves the data.
#include "apps/jobs/hook.h"

#include "apps/command.h"
#include "apps/jobs/job.h"
#include "apps/jobs/sources.h"
#include "apps/results/journal.h"
#include "projection/base/error.h"
#include "projection/base/stopwatch.h"
#include "tests/support/files.h"
#include "tests/support/says.h"
#include "tests/support/small_capture.h"

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <sys/file.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace scanshade {
namespace {

using nlohmann::json;
using tests::Ran;
using tests::read_bytes;
using tests::refusal;
using tests::run_program;
using tests::says;
using tests::TemporaryFolder;
using tests::write_file;
namespace fs = std::filesystem;

constexpr const char* copy_in = "cp -r {source}/. {dir}";
constexpr const char* copy_out = "mkdir -p {store}/{task} && cp -rT {out} {store}/{task}";

// ---------------------------------------------------------------------------------------------------- names and shells

TEST(HookTest, no_name_is_more_than_a_name_to_the_shell) {
    const TemporaryFolder folder;
    const fs::path said = folder / "said", hacked = folder / "hacked";
    const std::string touch = "touch " + hacked.string();
    const std::vector<std::string> names = {"plain",
                                            "two words",
                                            "$(" + touch + ")",
                                            "`" + touch + "`",
                                            "'; " + touch + "; '",
                                            "\"; " + touch + "; \"",
                                            "a\n" + touch + "\nb",
                                            "a;" + touch,
                                            "a&" + touch,
                                            "a|" + touch,
                                            "a>" + hacked.string(),
                                            "${IFS}" + touch,
                                            "\\",
                                            "'",
                                            "\"",
                                            "a\\nb",
                                            "*",
                                            "~",
                                            "!!",
                                            "{source}",
                                            "{dir}",
                                            "$SCANSHADE_DIR",
                                            "\x01\x7f\xff\xfe",
                                            "end\n",
                                            std::string(100000, 'x')};
    for (const std::string& name : names) {
        const HookEnd end = run_hook("printf %s {source} >" + said.string(), {{"source", name}}, {});
        EXPECT_TRUE(end.well()) << name.substr(0, 100) << ": " << end.reason();
        EXPECT_EQ(read_bytes(said), name);
        EXPECT_FALSE(fs::exists(hacked)) << name;
    }
}

TEST(HookTest, a_name_that_would_be_an_option_is_refused) {
    for (const char* name : {"-rf", "--help", "-"})
        EXPECT_TRUE(says(refusal([&] {
                             (void)run_hook("true {source}", {{"source", name}}, {});
                         }),
                         "would be taken for an option"));
    EXPECT_TRUE(says(refusal([] { (void)sources_from({"-rf"}, ""); }), "write ./NAME"));
}

TEST(HookTest, placeholders_within_quotes_and_missing_ones_are_refused) {
    const auto answer = [](const std::string& command) {
        return refusal([&] { check_hook("--fetch", command, {"source", "dir"}, {"out", "task"}); });
    };
    EXPECT_EQ(answer("cp -r {source}/. {dir}"), "");
    EXPECT_EQ(answer("cp -r \"a b\"/{source} {dir} # 'as it was'"), "");
    EXPECT_EQ(answer("awk '{print}' {source} >{dir}/a"), "");
    EXPECT_TRUE(says(answer("cp '{source}' {dir}"), "{source} within quotes"));
    EXPECT_TRUE(says(answer("cp \"{source}\" {dir}"), "{source} within quotes"));
    EXPECT_TRUE(says(answer("sh -c 'cp {source} {dir}'"), "within quotes"));
    EXPECT_TRUE(says(answer("cp \\{source} {dir}"), "within quotes"));
    EXPECT_TRUE(says(answer("cp {source} /tmp"), "lacks {dir}"));
    EXPECT_TRUE(says(answer("cp {source} {dir} {task}"), "{task}, which this hook does not know"));
    EXPECT_TRUE(says(answer("cp {source} {dir} '"), "a quote that is not closed"));
}

TEST(SourcesTest, tasks_are_named_after_their_sources_and_lie_apart) {
    SourceNames names;
    EXPECT_EQ(names.name_of("s3:bucket/scans/a.ply"), "s3/bucket/scans/a.ply");
    EXPECT_EQ(names.name_of("gs://bucket//scans/./b"), "gs/bucket/scans/b");
    EXPECT_EQ(names.name_of("../../etc/.hidden/-rf"), "etc/_hidden/_rf");
    EXPECT_EQ(names.name_of("/data/a\nb"), "data/a_b");
    EXPECT_EQ(names.name_of("/data/a\tb"), "data/a_b-2");
    EXPECT_EQ(names.name_of("::"), "source");
    EXPECT_TRUE(says(refusal([&] { (void)names.name_of("s3:bucket/scans/a.ply/b"); }), "lies within another one"));
    EXPECT_TRUE(says(refusal([&] { (void)names.name_of("s3:bucket/scans"); }), "has another one within"));
    EXPECT_LT(names.name_of(std::string(5000, 'x')).size(), 256u);
}

TEST(SourcesTest, a_list_has_a_source_a_line_and_maybe_its_size) {
    const TemporaryFolder folder;
    const fs::path list = write_file(folder / "list", "s3:a b\t1000\n\ns3:c\r\n");
    const auto sources = sources_from({"first"}, list);
    ASSERT_EQ(sources.size(), 3u);
    EXPECT_EQ(sources[1].name, "s3:a b");
    EXPECT_EQ(sources[1].bytes, 1000u);
    EXPECT_EQ(sources[2].name, "s3:c");
    for (const auto& [text, message] : {std::pair("a\n-b\n", "line 2: "), std::pair("a\n\xff\n", "line 2: "),
                                        std::pair("a\ta lot\n", "a size in bytes"), std::pair("a\na\n", "listed twice"),
                                        std::pair("\t5\n", "empty name"), std::pair("a\t-5\n", "a size in bytes")})
        EXPECT_TRUE(
            says(refusal([&, &text = text] { (void)sources_from({}, write_file(folder / "bad", text)); }), message));
    EXPECT_TRUE(says(refusal([&] { (void)sources_from({}, folder / "none"); }), "none"));
}

// ---------------------------------------------------------------------------------------------------- ends

/// Processes whose command line contains the text.
int processes_with(const std::string& text) {
    int found = 0;
    for (const auto& entry : fs::directory_iterator("/proc"))
        if (std::ifstream stream(entry.path() / "cmdline", std::ios::binary); stream) {
            const std::string line{std::istreambuf_iterator<char>(stream), {}};
            found += line.find(text) != std::string::npos;
        }
    return found;
}

bool comes_true(const std::function<bool()>& condition) {
    for (int tries = 0; tries < 500; ++tries) {
        if (condition())
            return true;
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return false;
}

TEST(HookTest, what_a_hook_says_is_kept_to_its_last_four_kibibytes) {
    const HookEnd end = run_hook("echo ignored; seq 100000 >&2; echo at last >&2; exit 7", {}, {});
    EXPECT_EQ(end.exit_code, 7);
    EXPECT_EQ(end.stderr_tail.size(), 4096u);
    EXPECT_EQ(end.reason(), "exit code 7: at last");
    EXPECT_EQ(run_hook("exit 7", {}, {}).reason(), "exit code 7");
    EXPECT_EQ(run_hook("kill -9 $$", {}, {}).exit_code, 128 + SIGKILL);
    EXPECT_EQ(run_hook("no-such-command-here", {}, {}).exit_code, 127);
}

TEST(HookTest, a_hook_that_hangs_is_ended_with_all_it_started) {
    const Stopwatch stopwatch;
    const HookEnd end = run_hook("sleep 4242 & sleep 4242 | cat; true", {}, {.limit_s = 0.3});
    EXPECT_FALSE(end.well());
    EXPECT_TRUE(says(end.reason(), "no end after 0.3 s"));
    EXPECT_LT(stopwatch.seconds(), 4) << "SIGTERM is enough here";
    EXPECT_TRUE(comes_true([] { return processes_with(std::string("sleep\0", 6) + "4242") == 0; }));
}

TEST(HookTest, a_hook_that_ignores_signals_is_killed_after_a_grace) {
    const Stopwatch stopwatch;
    const HookEnd end = run_hook("trap '' TERM INT HUP; while :; do sleep 0.4243; done", {}, {.limit_s = 0.2});
    EXPECT_TRUE(says(end.reason(), "no end after 0.2 s"));
    EXPECT_LT(stopwatch.seconds(), 9);
    EXPECT_TRUE(comes_true([] { return processes_with("0.4243") == 0; }));
}

TEST(HookTest, what_a_hook_leaves_behind_ends_with_it) {
    const Stopwatch stopwatch;
    EXPECT_TRUE(run_hook("sleep 4244 & exit 0", {}, {}).well());
    EXPECT_LT(stopwatch.seconds(), 2);
    EXPECT_TRUE(comes_true([] { return processes_with(std::string("sleep\0", 6) + "4244") == 0; }));
}

TEST(HookTest, a_hook_ends_for_its_watchs_reason) {
    int calls = 0;
    const HookEnd end =
        run_hook("sleep 4245", {}, {.ends_because = [&] { return ++calls < 3 ? "" : "no space"; }, .every_s = 0.01});
    EXPECT_EQ(calls, 3);
    EXPECT_TRUE(says(end.reason(), "ended: no space"));
}

TEST(HookTest, a_hook_dies_with_its_killed_worker_and_its_lock_holds_until_then) {
    const TemporaryFolder folder;
    const fs::path lock = write_file(folder / "lock", ""), begun = folder / "begun";
    const pid_t worker = fork();
    if (worker == 0) {
        const int handle = open(lock.c_str(), O_RDWR | O_CLOEXEC);
        flock(handle, LOCK_EX);
        (void)run_hook("touch " + begun.string() + "; sleep 4246", {}, {.lock = handle});
        _exit(0);
    }
    ASSERT_TRUE(tests::wait_for_file(begun));
    kill(worker, SIGKILL);
    waitpid(worker, nullptr, 0);
    EXPECT_TRUE(comes_true([&] { return !in_use(lock); }));
    EXPECT_EQ(processes_with(std::string("sleep\0", 6) + "4246"), 0) << "the lock was free before the hook had ended";
}

// ---------------------------------------------------------------------------------------------------- jobs

class HookedJobTest : public testing::Test {
  protected:
    void SetUp() override {
        for (int i = 0; i < captures; ++i)
            tests::write_capture(folder / fmt::format("archive/{}", i), 2);
    }
    [[nodiscard]] std::string path(const std::string& name) const { return (folder / name).string(); }
    /// A hook with {store} as the store's folder.
    [[nodiscard]] std::string deliver(std::string command = copy_out) const {
        for (auto at = command.find("{store}"); at != std::string::npos; at = command.find("{store}"))
            command.replace(at, 7, path("store"));
        return command;
    }
    [[nodiscard]] Ran plan(const std::string& fetch, const std::string& delivery, const std::string& flags = "") const {
        std::string sources;
        for (int i = 0; i < captures; ++i)
            sources += " " + path(fmt::format("archive/{}", i));
        return run_program(fmt::format("plan {} -o {} --fetch '{}' --deliver '{}' --hook-wait 0.01 --write ao,panel {}",
                                       sources, path("job"), fetch, delivery, flags));
    }
    [[nodiscard]] Ran run(const std::string& flags = "") const {
        return run_program(fmt::format("run {} --scratch {} {}", path("job"), path("scratch"), flags));
    }
    [[nodiscard]] json status() const { return json::parse(run_program("status --json " + path("job")).out); }
    /// Maps and panels in the store, by capture and name.
    [[nodiscard]] std::map<std::string, std::string> delivered(const fs::path& store) const {
        std::map<std::string, std::string> files;
        for (const auto& entry : fs::recursive_directory_iterator(store))
            if (entry.path().extension() == ".png")
                files[entry.path().lexically_relative(store).string()] = read_bytes(entry.path());
        return files;
    }
    [[nodiscard]] std::map<std::string, std::string> expected() const {
        EXPECT_EQ(run_program(fmt::format("run {} -o {} --write ao,panel", path("archive/0"), path("plain"))).exit_code,
                  0);
        std::map<std::string, std::string> files;
        for (const auto& [name, bytes] : delivered(folder / "plain"))
            for (int i = 0; i < captures; ++i)
                files[path(fmt::format("archive/{}/", i)).substr(1) + name] = bytes;
        return files;
    }
    /// What is left in the scratch folder, without its lock.
    [[nodiscard]] std::size_t left_in_scratch() const {
        std::size_t left = 0;
        for (const auto& job : fs::directory_iterator(folder / "scratch"))
            for (const auto& entry : fs::directory_iterator(job))
                left += entry.is_directory();
        return left;
    }
    /// Runs until all is delivered and nothing is left in scratch: processes of a killed run hold their locks for a
    /// moment longer, and a run leaves such tasks alone.
    [[nodiscard]] bool run_to_the_end() const {
        for (int tries = 0; tries < 30; ++tries) {
            if (run().exit_code == all_well && status()["delivered"] == captures && left_in_scratch() == 0)
                return true;
            std::this_thread::sleep_for(std::chrono::milliseconds(50));
        }
        return false;
    }
    [[nodiscard]] std::string journal(int i) const {
        return read_bytes(folder / ("job/results" + path(fmt::format("archive/{}/journal.jsonl", i))));
    }

    static constexpr int captures = 4;
    TemporaryFolder folder;
};

TEST_F(HookedJobTest, a_job_fetches_computes_delivers_and_leaves_only_journals) {
    ASSERT_EQ(plan(copy_in, deliver()).exit_code, all_well);
    EXPECT_EQ(status()["tasks"]["waiting"], captures);
    const Ran ran = run();
    ASSERT_EQ(ran.exit_code, all_well) << ran.err;
    EXPECT_EQ(delivered(folder / "store"), expected());
    EXPECT_EQ(left_in_scratch(), 0u);
    for (const auto& entry : fs::recursive_directory_iterator(folder / "job/results"))
        EXPECT_TRUE(entry.is_directory() || entry.path().filename() == "journal.jsonl") << entry.path();
    EXPECT_EQ(status()["delivered"], captures);
    EXPECT_EQ(status()["frames"]["ok"], 2 * captures);
    EXPECT_EQ(run_program("status " + path("job")).exit_code, all_well);
    const Ran merged = run_program("merge " + path("job"));
    EXPECT_EQ(merged.exit_code, all_well) << merged.err;
    EXPECT_TRUE(says(read_bytes(folder / "job/frames.csv"), path("archive/2").substr(1)));
    // Nothing is fetched again.
    fs::remove_all(folder / "store");
    fs::remove_all(folder / "archive");
    EXPECT_EQ(run().exit_code, all_well);
    EXPECT_FALSE(fs::exists(folder / "store"));
}

TEST_F(HookedJobTest, input_alone_may_be_fetched_and_results_alone_delivered) {
    std::string sources = path("archive/0");
    ASSERT_EQ(
        run_program(fmt::format("plan {} -o {} --fetch '{}' --write ao", sources, path("job"), copy_in)).exit_code, 0);
    ASSERT_EQ(run().exit_code, all_well);
    EXPECT_TRUE(fs::exists(path("job/results") + path("archive/0/ao/000.png")));
    EXPECT_EQ(left_in_scratch(), 0u);
    ASSERT_EQ(run_program(fmt::format("plan {} -o {} --deliver '{}' --write ao --block 1", path("archive"),
                                      path("other"), deliver()))
                  .exit_code,
              0);
    ASSERT_EQ(run_program(fmt::format("run {} --scratch {}", path("other"), path("scratch"))).exit_code, all_well);
    EXPECT_TRUE(fs::exists(folder / "store/archive/3/ao/001.png"));
    EXPECT_FALSE(fs::exists(folder / "other/results/archive/3/ao"));
    EXPECT_EQ(run_program("status " + path("other")).exit_code, all_well);
}

TEST_F(HookedJobTest, a_hook_that_fails_is_tried_again_and_its_words_are_kept) {
    // Fails twice for each task.
    const std::string flaky = "n={out}/../tried; echo >>$n; [ $(wc -l <$n) -gt 2 ] || { echo no route >&2; exit 9; }; ";
    ASSERT_EQ(plan(copy_in, flaky + deliver(), "--hook-tries 3").exit_code, all_well);
    const Ran ran = run();
    ASSERT_EQ(ran.exit_code, all_well) << ran.err;
    EXPECT_TRUE(says(ran.err, "delivery, try 2 of 3: exit code 9: no route"));
    EXPECT_TRUE(says(journal(1), R"("stderr":"no route\n")"));
    EXPECT_TRUE(status()["hooks"].empty()) << "it went well in the end";
}

TEST_F(HookedJobTest, a_task_whose_hook_fails_for_good_is_left_to_the_next_run_and_the_others_are_done) {
    const std::string one = fmt::format("case {{task}} in */2) [ -e {} ] || exit 9;; esac; ", path("open"));
    ASSERT_EQ(plan(copy_in, one + deliver(), "--hook-tries 2").exit_code, all_well);
    EXPECT_EQ(run().exit_code, unfinished);
    EXPECT_EQ(status()["delivered"], captures - 1);
    EXPECT_EQ(status()["frames"]["left"], 0) << "all are computed";
    ASSERT_EQ(status()["hooks"].size(), 1u);
    EXPECT_EQ(run_program("status " + path("job")).exit_code, unfinished);
    const auto lines = [&] {
        const std::string all = journal(2);
        return std::count(all.begin(), all.end(), '\n');
    };
    const auto before = lines();
    write_file(folder / "open", "");
    fs::remove_all(folder / "archive/2"); // neither fetched nor computed again
    EXPECT_EQ(run().exit_code, all_well);
    EXPECT_EQ(lines(), before + 1) << "only the end was added";
    EXPECT_EQ(status()["delivered"], captures);
}

TEST_F(HookedJobTest, a_source_that_is_not_there_or_no_capture_is_refused_once) {
    fs::remove_all(folder / "archive/1");
    fs::remove_all(folder / "archive/3");
    write_file(folder / "archive/3/readme.txt", "no frames");
    ASSERT_EQ(
        plan("[ -e {source} ] || { echo no such source >&2; exit 3; }; " + std::string(copy_in), deliver()).exit_code,
        0);
    const Ran ran = run();
    EXPECT_EQ(ran.exit_code, some_failed) << ran.err;
    EXPECT_TRUE(says(ran.err, "exit code 3: no such source"));
    EXPECT_EQ(status()["delivered"], 2);
    EXPECT_EQ(status()["hooks"].size(), 2u);
    EXPECT_EQ(status()["tasks"]["done"], captures);
    EXPECT_EQ(run_program("status " + path("job")).exit_code, some_failed);
    EXPECT_EQ(run().exit_code, some_failed) << "and is not tried again";
    tests::write_capture(folder / "archive/1", 2);
    EXPECT_EQ(run("--retry").exit_code, some_failed);
    EXPECT_EQ(status()["delivered"], 3);
}

TEST_F(HookedJobTest, a_hook_that_hangs_is_ended_after_its_limit) {
    const std::string hangs =
        fmt::format("case {{source}} in */0) [ -e {0} ] || {{ touch {0}; sleep 4247; }};; esac; ", path("hung"));
    ASSERT_EQ(plan(hangs + copy_in, deliver(), "--hook-limit 1").exit_code, all_well);
    const Ran ran = run();
    ASSERT_EQ(ran.exit_code, all_well) << ran.err;
    EXPECT_TRUE(says(ran.err, "fetch, try 1 of 5: ended: no end after 1 s"));
}

TEST_F(HookedJobTest, the_next_task_is_fetched_while_one_computes_and_space_stays_bounded) {
    // Each input takes a megabyte, and its listed size says so: the limit holds one in work and the next.
    std::string list;
    for (int i = 0; i < captures; ++i)
        list += path(fmt::format("archive/{}", i)) + "\t1000000\n";
    const std::string fat = std::string(copy_in) + " && head -c 1000000 /dev/zero >{dir}/pad.bin";
    const std::string measured = fmt::format("du -sb {0} | cut -f1 >>{1}; find {0} -name in | wc -l >>{2}; ",
                                             path("scratch"), path("sizes"), path("inputs"));
    ASSERT_EQ(run_program(fmt::format("plan -o {} --sources {} --fetch '{}' --deliver '{}' --scratch-limit 0.0035 "
                                      "--write ao,panel",
                                      path("job"), write_file(folder / "list", list).string(), fat,
                                      measured + "sleep 0.3; " + deliver()))
                  .exit_code,
              all_well);
    const Ran ran = run();
    ASSERT_EQ(ran.exit_code, all_well) << ran.err;
    std::ifstream sizes(folder / "sizes");
    for (double bytes = 0; sizes >> bytes;)
        EXPECT_LT(bytes, 3.5e6);
    EXPECT_TRUE(says(read_bytes(folder / "inputs"), "2")) << "the next one was there before this one was delivered";
    EXPECT_EQ(delivered(folder / "store").size(), expected().size());
}

TEST_F(HookedJobTest, an_input_larger_than_the_limit_is_an_outage_that_says_so) {
    const std::string fat = std::string(copy_in) + " && head -c 4000000 /dev/zero >{dir}/pad.bin";
    ASSERT_EQ(plan(fat, deliver(), "--scratch-limit 0.003").exit_code, all_well);
    const Ran ran = run();
    EXPECT_EQ(ran.exit_code, unfinished);
    EXPECT_TRUE(says(ran.err, "does not fit into --scratch-limit, 0.003 GB"));
    EXPECT_EQ(left_in_scratch(), 0u + captures) << "empty folders of unfinished tasks";
    EXPECT_EQ(run("--scratch-limit 1").exit_code, all_well) << "another machine has more";
}

TEST_F(HookedJobTest, a_kill_between_delivery_and_journal_delivers_the_same_again) {
    // The delivery ends well, and then its worker is killed before it can write that down. Once, from the second
    // delivery on: several at the same time may be counted together.
    const std::string kills = fmt::format(
        " && echo {{task}} >>{0} && {{ [ $(grep -c . {0}) -lt 2 ] || [ -e {1} ] || {{ touch {1}; sleep 4248; }}; }}",
        path("deliveries"), path("now"));
    ASSERT_EQ(plan(copy_in, deliver() + kills).exit_code, all_well);
    const pid_t child = tests::start_program({"run", path("job"), "--scratch", path("scratch")});
    ASSERT_TRUE(tests::wait_for_file(folder / "now"));
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    const auto before = delivered(folder / "store");
    fs::path manifest_of_second;
    std::string bytes;
    for (const auto& entry : fs::recursive_directory_iterator(folder / "store"))
        if (entry.path().filename() == "manifest.json" && entry.path().string() > manifest_of_second.string())
            if (const std::string read = read_bytes(entry.path()); !read.empty()) {
                manifest_of_second = entry.path();
                bytes = read;
            }
    EXPECT_TRUE(run_to_the_end());
    ASSERT_EQ(status()["delivered"], captures);
    EXPECT_EQ(delivered(folder / "store"), expected());
    std::size_t whole = 0; // the kill may have cut off another delivery
    for (const auto& [name, picture] : before) {
        const std::string after = delivered(folder / "store").at(name);
        EXPECT_TRUE(after.starts_with(picture)) << name;
        whole += after == picture;
    }
    EXPECT_GE(whole, 2U);
    EXPECT_TRUE(read_bytes(manifest_of_second).starts_with(bytes)) << "not even the report is another one";
    const std::string deliveries = read_bytes(folder / "deliveries");
    EXPECT_GT(std::count(deliveries.begin(), deliveries.end(), '\n'), captures);
    EXPECT_EQ(left_in_scratch(), 0u);
}

TEST_F(HookedJobTest, scratch_of_a_killed_run_makes_room_for_others) {
    ASSERT_EQ(plan(std::string(copy_in) + " && head -c 1000000 /dev/zero >{dir}/pad.bin",
                   fmt::format("[ -e {} ] && ", path("open")) + deliver(), "--hook-tries 1 --scratch-limit 0.003")
                  .exit_code,
              0);
    EXPECT_EQ(run().exit_code, unfinished) << "nothing can be delivered, so that remains fill the space";
    write_file(folder / "open", "");
    EXPECT_EQ(run().exit_code, all_well);
    EXPECT_EQ(delivered(folder / "store"), expected());
}

TEST_F(HookedJobTest, another_users_scratch_is_refused) {
    ASSERT_EQ(plan(copy_in, deliver()).exit_code, all_well);
    ASSERT_EQ(run().exit_code, all_well);
    for (const auto& job : fs::directory_iterator(folder / "scratch"))
        fs::permissions(job, fs::perms::all);
    const Ran refused = run();
    EXPECT_EQ(refused.exit_code, misuse);
    EXPECT_TRUE(says(refused.err, "is not a folder of this user alone"));
}

TEST_F(HookedJobTest, plans_are_checked_before_anything_is_fetched) {
    EXPECT_TRUE(says(plan("cp \"{source}\" {dir}", deliver()).err, "within quotes"));
    EXPECT_EQ(plan("cp {source} /tmp", deliver()).exit_code, misuse);
    EXPECT_EQ(plan(copy_in, "cp -r {out} /tmp").exit_code, misuse);
    EXPECT_EQ(run_program("plan --sources x -o " + path("job")).exit_code, misuse);
    EXPECT_EQ(run_program("plan -o " + path("job")).exit_code, misuse);
    // A plan edited by hand is no better trusted.
    ASSERT_EQ(plan(copy_in, deliver()).exit_code, all_well);
    json plan_json = json::parse(read_bytes(folder / "job/plan.json"));
    plan_json["hooks"]["fetch"] = "cp '{source}' {dir}";
    write_file(folder / "job/plan.json", plan_json.dump());
    const Ran ran = run();
    EXPECT_NE(ran.exit_code, all_well);
    EXPECT_TRUE(says(ran.err, "within quotes"));
}

/// Kills of random moments, with a hook that fails now and then; tests/survival asks for more.
TEST_F(HookedJobTest, a_hooked_job_killed_at_random_delivers_the_bytes_of_a_plain_run) {
    const auto wanted = expected();
    std::mt19937 random(20261124);
    const char* asked = std::getenv("SCANSHADE_KILLS");
    const int kills = asked ? std::atoi(asked) : 6;
    const std::string sometimes = "[ $(($(date +%N | sed s/^0*//) / 1000 % 10)) != 0 ] || exit 9; ";
    int killed = 0, ended = 0, again = 0;
    while (killed < kills) {
        fs::remove_all(folder / "store");
        fs::remove_all(folder / "job");
        fs::remove(folder / "deliveries");
        ASSERT_EQ(plan(sometimes + copy_in,
                       sometimes + deliver() + " && echo {task} >>" + path("deliveries") + " && sleep 0.1")
                      .exit_code,
                  0);
        for (bool done = false; !done;) {
            const pid_t child = tests::start_program({"run", path("job"), "--scratch", path("scratch")});
            std::this_thread::sleep_for(std::chrono::milliseconds(std::uniform_int_distribution(0, 1200)(random)));
            int state = 0;
            if (waitpid(child, &state, WNOHANG) == 0) {
                kill(child, SIGKILL);
                waitpid(child, &state, 0);
                ++killed;
            }
            const int code = WIFEXITED(state) ? WEXITSTATUS(state) : 128 + WTERMSIG(state);
            ASSERT_TRUE(code == all_well || code == unfinished || code == 128 + SIGKILL) << code;
            done = status()["delivered"] == captures;
        }
        ++ended;
        ASSERT_TRUE(run_to_the_end());
        ASSERT_EQ(delivered(folder / "store"), wanted);
        ASSERT_EQ(left_in_scratch(), 0u);
        const std::string deliveries = read_bytes(folder / "deliveries");
        again += static_cast<int>(std::count(deliveries.begin(), deliveries.end(), '\n')) - captures;
    }
    fmt::print("{} kills, {} jobs to the end, {} of {} deliveries twice\n", killed, ended, again, ended * captures);
}

} // namespace
} // namespace scanshade
