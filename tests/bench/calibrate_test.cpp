// `developers_bench calibrate`: its fit is no worse than what was there, run takes it, and it refuses what it cannot
// do.
#include "tests/support/measured.h"
#include "tests/support/says.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

using namespace tests;

Ran calibrated(const std::string& words) { return run_program_at(DEVELOPERS_BENCH, "calibrate " + words); }

TEST_F(MeasureTest, a_fit_is_no_worse_on_its_captures_and_run_takes_it) {
    const std::string file = (folder / "look.json").string();
    const Ran ran = calibrated(fmt::format("{} --free shadow-multiplier,shadow-power --evaluations 8 "
                                           "--depth-noise none --frames 2 -o {}",
                                           capture(), file));
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_TRUE(says(ran.err, "no --held-out")) << "what was not tested is said";
    const json fitted = read(file);
    const json all = fitted["training"].back();
    EXPECT_EQ(all["capture"], "all");
    EXPECT_LE(all["rms_after"].get<double>(), all["rms_before"].get<double>());
    const double multiplier = fitted["settings"]["method cacao"]["cacao.shadow-multiplier"];
    const double power = fitted["settings"]["method cacao"]["cacao.shadow-power"];

    const Ran used = run_program(
        fmt::format("run {} -o {} --write ao --settings {} --cacao.shadow-power 2", capture(), out(), file));
    ASSERT_EQ(used.exit_code, 0) << used.err;
    const json settings = read(folder / "out/manifest.json")["settings"]["method cacao"];
    EXPECT_NEAR(settings["cacao.shadow-multiplier"].get<double>(), multiplier, 1e-5);
    EXPECT_EQ(settings["cacao.shadow-power"], 2) << "flags win over the file's " << power;

    const Ran again =
        run_program(fmt::format("run {} -o {}/again --write ao --settings {}/manifest.json", capture(), out(), out()));
    ASSERT_EQ(again.exit_code, 0) << again.err;
    EXPECT_EQ(read(folder / "out/again/manifest.json")["settings"]["method cacao"], settings)
        << "a manifest serves, too";
}

TEST_F(MeasureTest, a_single_setting_can_be_fitted) {
    const std::string file = (folder / "curve.json").string();
    const Ran ran = calibrated(fmt::format("{} --method ssdo --free curve --ssdo.curve 0.5 "
                                           "--depth-noise none --evaluations 12 --frames 1 -o {}",
                                           capture(), file));
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    const json fitted = read(file), all = fitted["training"].back();
    EXPECT_LT(all["rms_after"].get<double>(), all["rms_before"].get<double>());
    EXPECT_GT(fitted["settings"]["method ssdo"]["ssdo.curve"].get<double>(), 0.6);
}

TEST_F(MeasureTest, a_fit_refuses_what_it_cannot_do) {
    const std::string file = (folder / "look.json").string();
    for (const char* flags : {"--free quality", "--free beauty", "", "--free shadow-power --held-out"})
        EXPECT_EQ(calibrated(fmt::format("{} -o {} {}", capture(), file, flags)).exit_code, 1) << flags;
    const Ran same = calibrated(fmt::format("{0} -o {1} --free shadow-power --held-out {0}", capture(), file));
    EXPECT_EQ(same.exit_code, 1);
    EXPECT_TRUE(says(same.err, "training capture"));
    tests::write_capture(folder / "recorded", 1);
    const Ran none = calibrated(fmt::format("{} -o {} --free shadow-power", (folder / "recorded").string(), file));
    EXPECT_EQ(none.exit_code, 3);
    EXPECT_TRUE(says(none.err, "truth/ao"));
}

} // namespace
} // namespace scanshade
