// Pages without a browser: names that could break out of a script, files that a run leaves, and what `view`, `merge`
// and several captures make. browser_test looks at the pages themselves.
#include "apps/page/list_page.h"
#include "apps/page/points.h"
#include "apps/page/preview.h"
#include "apps/page/run_page.h"
#include "apps/page/text.h"
#include "apps/results/captures_page.h"
#include "io/captures/capture.h"
#include "io/clouds/cloud_file.h"
#include "io/clouds/number_fields.h"
#include "tests/support/files.h"
#include "tests/support/points.h"
#include "tests/support/says.h"
#include "tests/support/small_capture.h"
#include "tests/support/tile.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using tests::Ran;
using tests::read_bytes;
using tests::run_program;
using tests::says;
using tests::TemporaryFolder;

// ---------------------------------------------------------------------------------------------------- texts

TEST(PageTextTest, html_has_no_character_that_ends_text_or_an_attribute) {
    EXPECT_EQ(page::escaped("<a href='x' title=\"y\">&"), "&lt;a href=&#39;x&#39; title=&quot;y&quot;&gt;&amp;");
}

TEST(PageTextTest, a_script_keeps_its_text_and_cannot_be_ended_by_it) {
    // U+2028 and U+2029 end lines in older scripts, "</script" and "<!--" end or comment out scripts in HTML.
    const std::string text = "</script><!-- & \xE2\x80\xA8 \xE2\x80\xA9 \xE2\x80\xA6";
    const std::string script = page::for_script(nlohmann::json(text).dump());
    for (const char* part : {"<", "&", "\xE2\x80\xA8", "\xE2\x80\xA9"})
        EXPECT_EQ(script.find(part), std::string::npos) << script;
    EXPECT_EQ(nlohmann::json::parse(script).get<std::string>(), text);
}

TEST(PageTextTest, base64_is_that_of_the_standard) { // RFC 4648, section 10
    for (const auto& [plain, coded] :
         {std::pair("", ""), std::pair("f", "Zg=="), std::pair("fo", "Zm8="), std::pair("foo", "Zm9v"),
          std::pair("foob", "Zm9vYg=="), std::pair("fooba", "Zm9vYmE="), std::pair("foobar", "Zm9vYmFy")})
        EXPECT_EQ(page::base64(plain), coded);
    EXPECT_EQ(page::base64("\xff\xfe\xfd"), "//79") << "bytes above 127";
}

// ---------------------------------------------------------------------------------------------------- previews

TEST(PreviewTest, equal_frames_have_equal_previews_and_other_depths_another_one) {
    const cv::Mat1f z_m = tests::corner_depth(0), ao(z_m.size(), 0.5F);
    const page::Preview preview{.z_m = z_m, .visibility = ao, .camera = tests::small_camera().pinhole};
    EXPECT_EQ(page::preview_script(preview), page::preview_script(preview));
    cv::Mat1f nearer;
    z_m.convertTo(nearer, CV_32F, 0.5);
    EXPECT_NE(page::preview_script(preview),
              page::preview_script({.z_m = nearer, .visibility = ao, .camera = preview.camera}));
}

TEST(PreviewTest, a_large_image_becomes_a_small_preview) {
    const cv::Mat1f z_m(3000, 4000, 2.0F), ao(3000, 4000, 1.0F);
    const cv::Mat3b colour(3000, 4000, cv::Vec3b(1, 2, 3));
    const std::string script =
        page::preview_script({.z_m = z_m, .visibility = ao, .camera = {}, .colour = colour, .colour_fits = true});
    EXPECT_TRUE(says(script, "\"size\":[235,176],\"step\":17")); // 17 = 4000 / 240, rounded up
    EXPECT_LT(script.size(), 20000u);
}

TEST(PreviewTest, maps_without_any_value_are_no_error) {
    const cv::Mat1f holes(48, 64, 0.0F), none(48, 64, std::numeric_limits<float>::quiet_NaN());
    EXPECT_TRUE(says(page::preview_script({.z_m = holes, .visibility = none, .confidence = none}), "\"range\":[0,0]"));
}

// ---------------------------------------------------------------------------------------------------- points

TEST(PagePointsTest, no_more_points_are_written_than_asked_for_and_the_page_knows_of_the_rest) {
    const TemporaryFolder folder;
    const tests::Points points = tests::square(30000);
    const std::vector<float> ao(points.size(), 0.5F);
    const auto files = page::write_points(folder.path(), "points/a", {.points = points, .visibility = ao}, 10000);
    ASSERT_EQ(files, std::vector<fs::path>{"points/a.000.js"});
    const std::string script = read_bytes(folder / files[0]);
    for (const char* part : {"\"count\":10000", "\"total\":10000", "\"of\":30000", "\"left_out\":0"})
        EXPECT_TRUE(says(script.substr(0, 400), part));
    (void)page::write_points(folder.path(), "b", {.points = points, .visibility = ao}, 10000);
    EXPECT_EQ(read_bytes(folder / "b.000.js"), script) << "equal clouds, equal bytes";
}

TEST(PagePointsTest, clouds_without_extent_or_points_are_no_error) {
    const TemporaryFolder folder;
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(page::write_points(folder.path(), "none", {.points = {}}, 1000).empty());
    const tests::Points invalid(5, {nan, nan, nan}), same(5, {1, 2, 3}), line = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
    EXPECT_TRUE(page::write_points(folder.path(), "invalid", {.points = invalid}, 1000).empty());
    for (const auto& [name, points] : {std::pair("same", same), std::pair("line", line)}) {
        ASSERT_EQ(page::write_points(folder.path(), name, {.points = points}, 1000).size(), 1u);
        EXPECT_TRUE(
            says(read_bytes(folder / (std::string(name) + ".000.js")), fmt::format("\"count\":{}", points.size())));
    }
}

/// What a script of points holds.
nlohmann::json chunk_in(const fs::path& file) {
    const std::string text = read_bytes(file), call = "scanshade.points(";
    EXPECT_TRUE(text.starts_with(call) && text.ends_with(")\n"));
    return nlohmann::json::parse(text.substr(call.size(), text.size() - call.size() - 2));
}

TEST(PagePointsTest, fields_have_steps_that_keep_integers_and_names_that_end_no_script) {
    const TemporaryFolder folder;
    const auto points = tests::corner(1000);
    const auto read = [](std::size_t i, std::span<double> values) {
        values[0] = static_cast<double>(i % 7);
        values[1] = i == 3 ? std::numeric_limits<double>::quiet_NaN() : 1e9 + static_cast<double>(i);
        values[2] = 4;
        values[3] = std::numeric_limits<double>::quiet_NaN();
        values[4] = static_cast<double>(i) * 1000;
    };
    (void)page::write_points(
        folder.path(), "a",
        {.points = points,
         .fields = {{"</script><b>", true}, {"time", false}, {"constant", true}, {"nothing", false}, {"wide", true}},
         .read = read},
        10000);
    EXPECT_EQ(read_bytes(folder / "a.000.js").find('<'), std::string::npos);
    const auto chunk = chunk_in(folder / "a.000.js");
    const auto fields = chunk["fields"], codes = chunk["codes"];
    ASSERT_EQ(fields.size(), 4u) << "a field without any value is left out";
    ASSERT_EQ(codes.size(), 4u);
    EXPECT_EQ(fields[0],
              nlohmann::json({{"name", "</script><b>"}, {"low", 0}, {"high", 6}, {"step", 1}, {"whole", true}}));
    EXPECT_NEAR(fields[1]["step"].get<double>(), 999.0 / 65534, 1e-9);
    EXPECT_EQ(codes[2], "") << "a constant needs no codes";
    EXPECT_GT(fields[3]["step"].get<double>(), 1) << "integers of a wide range are rounded";
    EXPECT_EQ(fields[3]["name"], "wide");
}

TEST(PagePointsTest, more_fields_than_are_shown_are_counted) {
    const TemporaryFolder folder;
    const auto points = tests::corner(10);
    const std::vector<page::Field> fields(page::most_fields + 5, {"f", true});
    (void)page::write_points(
        folder.path(), "a",
        {.points = points,
         .fields = fields,
         .read = [](std::size_t i, std::span<double> values) { std::ranges::fill(values, static_cast<double>(i)); }},
        10000);
    const auto chunk = chunk_in(folder / "a.000.js");
    EXPECT_EQ(chunk["fields"].size(), page::most_fields);
    EXPECT_EQ(chunk["more_fields"], 5);
}

/// The numbers of a point by their names.
std::map<std::string, double> numbers_of(const Cloud& cloud, std::size_t point) {
    const auto fields = number_fields(*cloud.records);
    std::vector<double> values(fields.size());
    read_numbers(*cloud.records, fields, point, values);
    std::map<std::string, double> named;
    for (std::size_t i = 0; i < fields.size(); ++i)
        named[fields[i].name] = values[i];
    return named;
}

TEST(NumberFieldsTest, bits_of_las_are_taken_apart_and_extra_fields_scaled) {
    const TemporaryFolder folder;
    std::vector<std::string> warnings;
    const Cloud cloud = read_cloud(tests::write_file(folder / "a.las", tests::tile({0, 0, 0})), warnings);
    const std::map<std::string, double> tree = {{"intensity", std::round(1000 * cloud.points[7].x())},
                                                {"return", 2},
                                                {"returns", 3},
                                                {"scanner_channel", 0},
                                                {"classification", 5},
                                                {"user_data", 0},
                                                {"scan_angle", 0},
                                                {"point_source_id", 0},
                                                {"gps_time", 300000 + 0.007}};
    EXPECT_EQ(numbers_of(cloud, 7), tree);
    // An extra field: 32 bits without a sign, whose value is a tenth of what is stored, plus 5.
    std::string description(192, '\0'), file = tests::las_file(6, 34, std::string(34, '\0'));
    description[2] = 5, description[3] = 8 | 16;
    std::string_view("height").copy(description.data() + 4, 32);
    tests::store(description.data() + 112, 0.1);
    tests::store(description.data() + 136, 5.0);
    tests::store(file.data() + 375 + 30, std::uint32_t(120));
    const std::string record = tests::vlr("LASF_Spec", 4, description);
    tests::store(file.data() + 96, static_cast<std::uint32_t>(375 + record.size()));
    tests::store(file.data() + 100, 1U);
    file.insert(375, record);
    const auto numbers = numbers_of(read_cloud(tests::write_file(folder / "b.las", file), warnings), 0);
    EXPECT_DOUBLE_EQ(numbers.at("height"), 17);
}

// ---------------------------------------------------------------------------------------------------- files of a run

class PageFilesTest : public testing::Test {
  protected:
    [[nodiscard]] Ran run(const std::string& flags = "") const {
        return run_program(fmt::format("run '{}' -o '{}' {}", capture().string(), out().string(), flags));
    }
    [[nodiscard]] fs::path capture() const { return folder / "capture"; }
    [[nodiscard]] fs::path out() const { return folder / "out"; }
    /// The texts of index.js: the head, and a line per frame.
    [[nodiscard]] static std::pair<nlohmann::json, nlohmann::json> data_of(const fs::path& results) {
        const std::string script = read_bytes(results / "index.js");
        const std::string head = "scanshade.set_head(", rows = ");\nscanshade.add_rows(";
        const auto at = script.find(rows);
        return {nlohmann::json::parse(script.substr(head.size(), at - head.size())),
                nlohmann::json::parse(script.substr(at + rows.size(), script.rfind(')') - at - rows.size()))};
    }

    TemporaryFolder folder;
};

TEST_F(PageFilesTest, a_run_leaves_a_page_with_every_frame_and_a_preview_of_each) {
    tests::write_capture(capture(), 3);
    tests::write_file(capture() / "depth/001.png", "no PNG");
    const Ran ran = run();
    ASSERT_EQ(ran.exit_code, 2) << ran.err;
    EXPECT_TRUE(says(ran.err, "page -> " + (out() / "index.html").string()));
    const auto [head, rows] = data_of(out());
    ASSERT_EQ(rows.size(), 3u);
    EXPECT_EQ(rows[0][2], "ok");
    EXPECT_EQ(rows[1][2], "failed");
    EXPECT_TRUE(says(rows[1][3], "001.png"));
    EXPECT_EQ(head["title"], "capture");
    EXPECT_TRUE(fs::exists(out() / "previews/000.js"));
    EXPECT_FALSE(fs::exists(out() / "previews/001.js")) << "a failed frame leaves no file";
    EXPECT_TRUE(says(read_bytes(out() / "index.html"), "<title>capture - scanshade</title>"));
}

/// Every script and style of the text, by its start tag: what is between the tags, for the tags without attributes.
std::vector<std::string> between(const std::string& html, const std::string& tag) {
    std::vector<std::string> parts;
    const std::string begin = "\n<" + tag + ">", end = "</" + tag + ">";
    for (std::size_t at = html.find(begin); at != std::string::npos; at = html.find(begin, at)) {
        at += begin.size();
        parts.push_back(html.substr(at, html.find(end, at) - at));
    }
    return parts;
}

TEST_F(PageFilesTest, a_page_runs_its_own_scripts_and_those_of_its_folder_only) {
    tests::write_capture(capture(), 1);
    ASSERT_EQ(run().exit_code, 0);
    const std::string html = read_bytes(out() / "index.html");
    const std::size_t at = html.find("<meta http-equiv=\"Content-Security-Policy\" content=\"");
    ASSERT_NE(at, std::string::npos);
    EXPECT_LT(at, html.find("<style")) << "a policy holds for what follows it";
    EXPECT_LT(at, html.find("<script"));
    const std::string policy = html.substr(at, html.find('>', at) - at);
    EXPECT_TRUE(says(policy, "default-src 'none'"));
    EXPECT_FALSE(says(policy, "unsafe"));
    const auto scripts = between(html, "script"), styles = between(html, "style");
    EXPECT_EQ(scripts.size(), 17u);
    EXPECT_EQ(styles.size(), 1u);
    std::size_t hashes = 0;
    for (std::size_t each = policy.find("'sha256-"); each != std::string::npos;
         each = policy.find("'sha256-", each + 1))
        ++hashes;
    EXPECT_EQ(hashes, scripts.size() + styles.size()); // browser_test sees that they are the right ones
}

TEST_F(PageFilesTest, without_a_page_nothing_of_it_is_written) {
    tests::write_capture(capture(), 2);
    ASSERT_EQ(run("--page no").exit_code, 0);
    for (const char* part : {"index.html", "index.js", "previews"})
        EXPECT_FALSE(fs::exists(out() / part)) << part;
}

TEST_F(PageFilesTest, a_page_is_made_anew_with_the_frames_of_the_run_before) {
    tests::write_capture(capture(), 4);
    ASSERT_EQ(run("--depth-noise none --frames :2").exit_code, 0);
    ASSERT_EQ(data_of(out()).second.size(), 2u);
    ASSERT_EQ(run("--depth-noise none --resume").exit_code, 0);
    ASSERT_EQ(data_of(out()).second.size(), 4u);
    fs::remove(out() / "index.html");
    ASSERT_EQ(run("--depth-noise none --resume").exit_code, 0);
    EXPECT_TRUE(fs::exists(out() / "index.html")) << "a page that was removed comes back, though all frames are done";
    fs::remove(out() / "previews/002.js");
    ASSERT_EQ(run("--depth-noise none --resume").exit_code, 0);
    EXPECT_TRUE(fs::exists(out() / "previews/002.js")) << "so does a preview";
}

TEST_F(PageFilesTest, view_makes_the_page_that_a_run_makes) {
    tests::write_capture(capture(), 2);
    ASSERT_EQ(run().exit_code, 0);
    const auto [head, rows] = data_of(out());
    fs::remove(out() / "index.html");
    const Ran view = run_program(fmt::format("view '{}'", out().string()));
    ASSERT_EQ(view.exit_code, 0) << view.err;
    EXPECT_EQ(view.out, fs::canonical(out() / "index.html").string() + "\n");
    const auto [new_head, new_rows] = data_of(out());
    EXPECT_EQ(new_head, head);
    EXPECT_EQ(new_rows, rows);
}

TEST_F(PageFilesTest, a_manifest_cannot_lead_a_page_out_of_its_folder) {
    tests::write_file(out() / "manifest.json",
                      R"({"frames": [{"index": 0, "name": "a", "status": "ok", "files": ["ao/a.png", "../a.png"]},
                                     {"index": 1, "name": "../b", "status": "ok", "files": ["ao/../b.png"]}]})");
    ASSERT_EQ(run_program(fmt::format("view '{}'", out().string())).exit_code, 0);
    const auto [head, rows] = data_of(out());
    EXPECT_EQ(rows.size(), 2u);
    EXPECT_EQ(head["file_sets"], nlohmann::json::parse(R"([[["ao", ".png"]], []])"));
}

TEST_F(PageFilesTest, a_manifest_nested_without_end_is_refused_and_not_followed) {
    const std::string deep = std::string(200000, '[') + std::string(200000, ']');
    tests::write_file(out() / "manifest.json", R"({"frames": [], "capture": {"camera": )" + deep + "}}");
    const Ran ran = run_program(fmt::format("view '{}'", out().string()));
    EXPECT_EQ(ran.exit_code, 3);
    EXPECT_NE(ran.err.find("nested deeper than 64 levels"), std::string::npos) << ran.err;
}

TEST_F(PageFilesTest, the_cloud_of_a_recording_is_on_its_page_until_the_next_run) {
    const std::string made =
        fmt::format("generate office --frames 2 --size 160x120 --truth=false -o '{}'", capture().string());
    ASSERT_EQ(run_program(made).exit_code, 0);
    ASSERT_EQ(run(fmt::format("--cloud '{}/all.ply'", folder.path().string())).exit_code, 0);
    EXPECT_TRUE(fs::exists(out() / "recording.000.js"));
    EXPECT_EQ(data_of(out()).first["recording_points"], "recording");
    fs::remove(out() / "index.html");
    ASSERT_EQ(run_program(fmt::format("view '{}'", out().string())).exit_code, 0);
    EXPECT_EQ(data_of(out()).first["recording_points"], "recording");
    ASSERT_EQ(run("--overwrite").exit_code, 0);
    EXPECT_FALSE(fs::exists(out() / "recording.000.js"));
    EXPECT_FALSE(data_of(out()).first.contains("recording_points"));
}

TEST_F(PageFilesTest, view_refuses_what_is_no_result) {
    const auto refused = [&](const fs::path& path) {
        const Ran ran = run_program(fmt::format("view '{}'", path.string()));
        EXPECT_EQ(ran.exit_code, 3);
        return ran.err;
    };
    EXPECT_TRUE(says(refused(folder / "none"), "not there"));
    EXPECT_TRUE(says(refused(folder.path()), "neither index.html nor manifest.json"));
    EXPECT_TRUE(says(refused(tests::write_file(folder / "a.txt", "a")), "a page (.html) expected"));
    tests::write_file(folder / "torn/manifest.json", "{\"frames\": [{\"index\": 0, \"na");
    EXPECT_TRUE(says(refused(folder / "torn"), "manifest.json"));
    tests::write_file(folder / "odd/manifest.json", "{\"frames\": [{\"index\": -1}]}");
    EXPECT_TRUE(says(refused(folder / "odd"), "manifest.json"));
    tests::write_file(folder / "list/manifest.json", "[1, 2]");
    EXPECT_TRUE(says(refused(folder / "list"), "a JSON object expected"));
}

TEST_F(PageFilesTest, several_captures_have_a_list_with_links_to_their_pages) {
    tests::write_capture(folder / "a", 2);
    tests::write_capture(folder / "b", 1);
    const Ran ran = run_program(fmt::format("run '{0}/a' '{0}/b' -o '{0}/out'", folder.path().string()));
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    const auto [head, rows] = data_of(out());
    EXPECT_EQ(head["kind"], "list");
    ASSERT_EQ(rows.size(), 2u);
    EXPECT_EQ(rows[0][0], "a");
    EXPECT_EQ(rows[0][1], 2);
    EXPECT_EQ(rows[1][9], "b/index.html");
    EXPECT_TRUE(fs::exists(out() / rows[1][10].get<std::string>())) << rows[1][10];
    EXPECT_TRUE(fs::exists(out() / "b/index.html"));
}

TEST_F(PageFilesTest, the_list_of_captures_names_those_that_could_not_be_opened) {
    tests::write_capture(folder / "a", 1);
    fs::create_directories(folder / "empty");
    ASSERT_EQ(run_program(fmt::format("run '{0}/a' '{0}/empty' -o '{0}/out'", folder.path().string())).exit_code, 2);
    const auto [head, rows] = data_of(out());
    EXPECT_EQ(rows.size(), 1u);
    ASSERT_EQ(head["notes"].size(), 1u);
    EXPECT_TRUE(says(head["notes"][0], "not opened: no frames found in " + (folder / "empty").string()));
}

TEST_F(PageFilesTest, a_list_counts_frames_that_an_interruption_left) {
    CapturesPage page(folder.path());
    const std::size_t first = page.add("a", folder / "a", 3);
    EXPECT_EQ(page.add("a", folder / "a", 2), first) << "a second block of the same capture";
    page.add("b", folder / "b", 4);
    FrameRow done, ended;
    done.status = FrameStatus::ok;
    done.coverage = done.mean_visibility = 0.5;
    ended.status = FrameStatus::failed;
    ended.fault = Fault::outage;
    page.take(first, {done, ended});
    page.write("two", {});
    const auto [head, rows] = data_of(folder.path());
    EXPECT_EQ(rows[0], nlohmann::json({"a", 5, 1, 0, 0, 4, 0.5, 0.5, 0.0, "", ""}));
    EXPECT_EQ(rows[1], nlohmann::json({"b", 4, 0, 0, 0, 4, nullptr, nullptr, nullptr, "", ""}));
}

TEST_F(PageFilesTest, merge_makes_one_page_of_a_capture_computed_in_blocks) {
    tests::write_capture(folder / "data/a", 5);
    const std::string job = (folder / "job").string();
    ASSERT_EQ(run_program(fmt::format("plan '{}' -o '{}' --block 2", (folder / "data").string(), job)).exit_code, 0);
    ASSERT_EQ(run_program(fmt::format("run '{}'", job)).exit_code, 0);
    EXPECT_FALSE(fs::exists(folder / "job/index.html"));
    ASSERT_EQ(run_program(fmt::format("merge '{}' --page no", job)).exit_code, 0);
    EXPECT_FALSE(fs::exists(folder / "job/index.html"));
    const Ran merged = run_program(fmt::format("merge '{}'", job));
    ASSERT_EQ(merged.exit_code, 0) << merged.err;
    const auto [head, rows] = data_of(folder / "job");
    ASSERT_EQ(rows.size(), 1u);
    EXPECT_EQ(rows[0][1], 5);
    EXPECT_EQ(rows[0][2], 5);
    const auto [of_a, frames] = data_of((folder / "job" / rows[0][9].get<std::string>()).parent_path());
    ASSERT_EQ(frames.size(), 5u);
    for (std::size_t i = 0; i < 5; ++i)
        EXPECT_EQ(frames[i][0], i);
}

TEST_F(PageFilesTest, poses_of_a_manifest_are_those_of_the_capture) {
    ASSERT_EQ(
        run_program(fmt::format("generate office --frames 1 --size 160x120 --truth=false -o '{}'", capture().string()))
            .exit_code,
        0);
    ASSERT_EQ(run("--write ao").exit_code, 0);
    const Capture listed = open_capture(capture());
    ASSERT_TRUE(listed.entries.at(0).world_from_camera.has_value());
    const auto manifest = nlohmann::json::parse(read_bytes(out() / "manifest.json"));
    const auto& pose = manifest["frames"][0]["world_from_camera"];
    ASSERT_EQ(pose.size(), 12u);
    for (int i = 0; i < 12; ++i)
        EXPECT_NEAR(pose[static_cast<std::size_t>(i)], listed.entries[0].world_from_camera->matrix()(i / 4, i % 4),
                    1e-6);
    EXPECT_EQ(data_of(out()).second[0][14], pose);
}

} // namespace
} // namespace scanshade
