// --shade, --light and --write unshaded,light from the command line.
#include "apps/json.h"
#include "projection/srgb.h"
#include "tests/support/says.h"
#include "tests/support/small_capture.h"

#include <algorithm>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

namespace scanshade::tests {
namespace {

namespace fs = std::filesystem;

class LightCliTest : public testing::Test {
  protected:
    void SetUp() override {
        if (!program_is_built())
            GTEST_SKIP() << "the program is not built";
    }
    [[nodiscard]] fs::path capture() const { return folder.path() / "office"; }
    [[nodiscard]] fs::path out() const { return folder.path() / "out"; }
    void generate(const std::string& how) const {
        const Ran ran = run_program(fmt::format("generate office -o '{}' --size 160x120 --frames 3 --step 40 --sensor "
                                                "ideal --truth-rays 16 {}",
                                                capture().string(), how));
        ASSERT_EQ(ran.exit_code, 0) << ran.err;
    }
    [[nodiscard]] Ran run(const std::string& how, const fs::path& to) const {
        return run_program(fmt::format("run '{}' -o '{}' --page no {}", capture().string(), to.string(), how));
    }
    [[nodiscard]] std::string bytes(const fs::path& in, const char* kind) const {
        std::string all;
        std::vector<fs::path> files;
        for (const auto& entry : fs::directory_iterator(in / kind))
            files.push_back(entry.path());
        std::ranges::sort(files);
        for (const fs::path& file : files)
            all += read_bytes(file);
        return all;
    }
    TemporaryFolder folder;
};

TEST_F(LightCliTest, a_resumed_run_has_the_bytes_of_one_without_a_break) {
    generate("--light sun");
    const std::string how = "--shade ambient --light 0.45,-0.35,0.82 --write shaded,unshaded,light";
    const Ran whole = run(how, out());
    ASSERT_EQ(whole.exit_code, 0) << whole.err;
    EXPECT_TRUE(says(whole.err, "light: ")) << whole.err;
    const fs::path other = folder.path() / "resumed";
    ASSERT_EQ(run(how, other).exit_code, 0);
    fs::remove(fs::directory_iterator(other / "unshaded")->path());
    const Ran resumed = run(how + " --resume", other);
    ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
    for (const char* kind : {"shaded", "unshaded", "ambient", "direct"})
        EXPECT_EQ(bytes(out(), kind), bytes(other, kind)) << kind;
    const json manifest = json::parse(read_bytes(out() / "manifest.json"));
    EXPECT_TRUE(says(manifest["light"].get<std::string>(), "1.00 times as much direct light")) << manifest["light"];
}

TEST_F(LightCliTest, direct_light_is_what_was_given_and_none_by_itself) {
    generate("--light sun");
    const auto made = [&](const char* name, const std::string& light) {
        const fs::path to = folder.path() / name;
        const Ran ran = run("--shade ambient --write shaded,light" + light, to);
        EXPECT_EQ(ran.exit_code, 0) << ran.err;
        return to;
    };
    const auto brightness = [](const fs::path& in) {
        double sum = 0;
        for (const auto& entry : fs::directory_iterator(in / "direct"))
            sum += cv::sum(cv::imread(entry.path().string()))[1];
        return sum;
    };
    const fs::path by_itself = made("auto", ""), none = made("none", " --light none"),
                   weak = made("weak", " --light 0.27,-0.21,0.5"), strong = made("strong", " --light 1.08,-0.84,2");
    EXPECT_EQ(bytes(by_itself, "shaded"), bytes(none, "shaded"));
    EXPECT_EQ(brightness(by_itself), 0) << "all light is ambient";
    EXPECT_GT(brightness(weak), 0);
    EXPECT_GT(brightness(strong), 1.5 * brightness(weak)) << "its length is its strength";
    ASSERT_EQ(run("--write shaded", out()).exit_code, 0);
    EXPECT_EQ(bytes(by_itself, "shaded"), bytes(out(), "shaded")) << "visibility multiplies all of the colour";
}

TEST_F(LightCliTest, pictures_are_those_of_today_unless_something_else_is_asked_for) {
    generate("--light sun");
    ASSERT_EQ(run("--write shaded", out()).exit_code, 0);
    ASSERT_EQ(run("--write shaded --shade multiply", folder.path() / "multiplied").exit_code, 0);
    ASSERT_EQ(run("--write shaded --shade clay", folder.path() / "clay").exit_code, 0);
    EXPECT_EQ(bytes(out(), "shaded"), bytes(folder.path() / "multiplied", "shaded"));
    EXPECT_NE(bytes(out(), "shaded"), bytes(folder.path() / "clay", "shaded"));
}

TEST_F(LightCliTest, a_capture_without_colour_shows_clay_and_says_so) {
    generate("--light sun");
    fs::remove_all(capture() / "rgb");
    fs::remove(capture() / "rgb.txt");
    const Ran ran = run("--shade ambient", out());
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_TRUE(says(read_bytes(out() / "frames.csv"), "shaded shows clay"));
    const Ran alone = run("--write unshaded", folder.path() / "alone");
    EXPECT_TRUE(says(read_bytes(folder.path() / "alone" / "frames.csv"), "no unshaded")) << alone.err;
}

/// The eight bits of the default are those of the floats, rounded; a colour image of 16 bits gives 16.
TEST_F(LightCliTest, pictures_of_light_have_the_bits_that_were_asked_for) {
    generate("--light sun");
    const std::string how = "--write unshaded,light,indirect --light none --shade ambient";
    ASSERT_EQ(run(how, out()).exit_code, 0);
    const auto image = [&](const fs::path& in, const char* kind, const char* extension) {
        std::vector<fs::path> files;
        for (const auto& entry : fs::directory_iterator(in / kind))
            if (entry.path().extension() == extension)
                files.push_back(entry.path());
        return files.empty() ? cv::Mat() : cv::imread(std::ranges::min(files).string(), cv::IMREAD_UNCHANGED);
    };
    const auto encoding = [](const fs::path& in) {
        return json::parse(read_bytes(in / "manifest.json")).value("colour_encoding", "");
    };
    EXPECT_TRUE(says(encoding(out()), "sRGB")) << encoding(out());
    const fs::path floats = folder.path() / "floats", resumed = folder.path() / "resumed";
    ASSERT_EQ(run(how + " --colour-format tiff", floats).exit_code, 0);
    EXPECT_TRUE(says(encoding(floats), "linear light")) << encoding(floats);
    for (const char* kind : {"unshaded", "ambient", "direct", "indirect"}) {
        const cv::Mat3b coarse = image(out(), kind, ".png");
        const cv::Mat3f fine = image(floats, kind, ".tiff");
        ASSERT_EQ(coarse.size(), fine.size()) << kind;
        ASSERT_FALSE(fine.empty()) << kind;
        for (int v = 0; v < fine.rows; v += 7)
            for (int u = 0; u < fine.cols; u += 7)
                for (int c = 0; c < 3; ++c)
                    ASSERT_NEAR(255 * srgb_from_linear(std::clamp(static_cast<double>(fine(v, u)[c]), 0.0, 1.0)),
                                coarse(v, u)[c], fine(v, u)[c] > 0.9F ? 300 : 1.1) // near white, bytes keep the hue
                        << kind;
    }
    for (const auto& entry : fs::directory_iterator(capture() / "rgb")) {
        cv::Mat deep;
        cv::imread(entry.path().string()).convertTo(deep, CV_16U, 257, -100);
        cv::imwrite(entry.path().string(), deep);
    }
    ASSERT_EQ(run(how, resumed).exit_code, 0);
    const std::string first = bytes(resumed, "unshaded");
    EXPECT_EQ(image(resumed, "unshaded", ".png").type(), CV_16UC3);
    EXPECT_EQ(image(resumed, "indirect", ".png").type(), CV_16UC3);
    fs::remove(fs::directory_iterator(resumed / "unshaded")->path());
    ASSERT_EQ(run(how + " --resume", resumed).exit_code, 0);
    EXPECT_EQ(bytes(resumed, "unshaded"), first);
    const Ran wrong = run(how + " --colour-format jpg --overwrite", out());
    EXPECT_NE(wrong.exit_code, 0);
    EXPECT_TRUE(says(wrong.err, "png16")) << wrong.err;
}

TEST_F(LightCliTest, settings_out_of_range_are_refused_before_anything_is_opened) {
    generate("");
    for (const char* light : {"sideways", "1,2", "0,0,0", "nan,0,1", "1,2,3,4"}) {
        const Ran ran = run(fmt::format("--shade ambient --light {}", light), out());
        EXPECT_NE(ran.exit_code, 0);
        EXPECT_TRUE(says(ran.err, "expected auto, none, or X,Y,Z")) << ran.err;
    }
    EXPECT_FALSE(fs::exists(out()));
    const Ran ran = run("--shade ambient --light none --write shaded", out());
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_TRUE(says(ran.err, "all of it is")) << ran.err;
}

} // namespace
} // namespace scanshade::tests
