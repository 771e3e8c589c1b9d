// Pages in a real browser: browser.js looks at them in Chromium, and each claim here is one of its checks. Skipped
// where node, Chromium or the packages of `tests/run` are absent.
#include "apps/page/run_page.h"
#include "io/clouds/cloud_file.h"
#include "io/images/image_file.h"
#include "projection/base/error.h"
#include "tests/support/files.h"
#include "tests/support/points.h"
#include "tests/support/small_capture.h"
#include "tests/support/tile.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fmt/format.h>
#include <fstream>
#include <gtest/gtest.h>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using tests::run_program;
using tests::TemporaryFolder;

std::string quoted(const fs::path& path) {
    std::string text = "'";
    for (const char c : path.string())
        text += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return text + "'";
}

/// Names that end a string, a tag or an address where a page is careless.
const std::vector<std::string> hostile_names = {"a'b\"c",
                                                "50% #1?x=2&y",
                                                "line\nbreak",
                                                "<img src=x onerror=window.hit=1>",
                                                "\xC3\xBC\xE2\x80\xA8n",
                                                "}});window.hit=1;((",
                                                "back\\slash"};
/// As the program names such frames: without control characters and backslashes.
std::string name_shown(std::string name) {
    std::ranges::replace_if(
        name, [](char c) { return c == '\n' || c == '\\'; }, '_');
    return name;
}

/// The browser's results, found once for all claims.
class BrowserTest : public testing::Test {
  protected:
    static void SetUpTestSuite() {
        const fs::path modules = fs::path(SCANSHADE_PROGRAM).parent_path() / "browser/node_modules";
        const char* named = std::getenv("SCANSHADE_CHROMIUM");
        const fs::path chromium = named ? named : "/usr/bin/chromium";
        for (const char* package : {"playwright-core", "html-validate", "axe-core"})
            if (!fs::exists(modules / package))
                missing_ = fmt::format("{} is not in {}", package, modules.string());
        if (!fs::exists(chromium))
            missing_ = chromium.string() + " is not there; SCANSHADE_CHROMIUM names another one";
        if (std::system("node --version >/dev/null 2>&1") != 0)
            missing_ = "node is not there";
        if (!missing_.empty())
            return;
        folder_ = std::make_unique<TemporaryFolder>();
        nlohmann::json spec = pages();
        spec["modules"] = modules;
        spec["chromium"] = chromium;
        spec["scratch"] = *folder_ / "scratch/x";
        fs::create_directories(*folder_ / "scratch");
        std::ofstream(*folder_ / "spec.json") << spec.dump(1);
        const fs::path result = *folder_ / "result.json";
        const std::string command =
            fmt::format("node '{}/tests/page/browser.js' '{}' '{}' 2>'{}'", SCANSHADE_SOURCE,
                        (*folder_ / "spec.json").string(), result.string(), (*folder_ / "said").string());
        if (std::system(command.c_str()) == 0)
            results_ = nlohmann::json::parse(tests::read_bytes(result));
        else
            broken_ = tests::read_bytes(*folder_ / "said");
    }
    static void TearDownTestSuite() {
        if (!std::getenv("SCANSHADE_KEEP"))
            folder_.reset();
        else if (folder_)
            fmt::print("kept: {}\n", folder_.release()->path().string());
    }

    void SetUp() override {
        if (!missing_.empty())
            GTEST_SKIP() << missing_ << "; tests/run installs it";
        ASSERT_EQ(broken_, "");
    }

    /// What the browser found amiss.
    static std::string found(const std::string& check) {
        return results_.contains(check) ? results_[check].get<std::string>() : "no such check: " + check;
    }

    static void must(const std::string& arguments, int code = 0) {
        const tests::Ran ran = run_program(arguments);
        if (ran.exit_code != code)
            throw std::runtime_error(fmt::format("{}: exit code {}: {}", arguments, ran.exit_code, ran.err));
    }

  private:
    static nlohmann::json pages() {
        const fs::path& home = folder_->path();
        nlohmann::json spec;
        // A recording with poses and colour, whole and merged.
        constexpr int frames = 6;
        must(fmt::format("generate office --frames {} --size 320x240 -o '{}/office'", frames, home.string()));
        must(fmt::format("run '{0}/office' -o '{0}/run' --cloud '{0}/all.ply'", home.string()));
        spec["frames"] = frames;
        add_values(spec, home / "office", home / "run");
        const auto manifest = nlohmann::json::parse(tests::read_bytes(home / "run/manifest.json"));
        const auto& pose = manifest["frames"].back()["world_from_camera"];
        spec["last_position"] = {pose[3], pose[7], pose[11]};
        must(fmt::format("compare '{0}/run' '{0}/office' -o '{0}/compare'", home.string()));
        // A cloud of two chunks with a stray point.
        std::vector<Eigen::Vector3d> points = tests::corner(110000);
        points.emplace_back(5000, 0, 0);
        write_new_ply(home / "corner.ply", points, {}, {});
        must(
            fmt::format("run '{0}/corner.ply' -o '{0}/cloud' --clouds points", home.string())); // doubtful: either side
        spec["cloud_said"] = "110,000 points of 110,001, 1 far away left out";
        spec["cloud_stem"] = "points/corner";
        spec["cloud_box"] = {{0, 0, 0}, {2, 2, 2}};
        add_tiles(spec, home);
        add_hostile(spec, home);
        fs::copy_file(fs::directory_iterator(home / "office/depth")->path(), home / "lost.png"); // it has no camera
        must(fmt::format("run '{0}/office' '{0}/corner.ply' '{0}/lost.png' -o '{0}/list' --frames 0:1", home.string()),
             2);
        spec["pages"]["failed"] = home / "list/lost/index.html";
        must(fmt::format("run '{0}/office' -o '{0}/old' --page no --frames 0:2", home.string()));
        if (fs::exists(home / "old/index.html") || fs::exists(home / "old/previews"))
            throw std::runtime_error("--page no wrote a page");
        must(fmt::format("view '{}/old'", home.string()));
        must(fmt::format("bench '{0}/office' -o '{0}/bench' --methods cacao --frames 1 --rounds 1", home.string()));
        must(fmt::format("refine '{0}/office' -o '{0}/camera.json' --report '{0}/camera.html'", home.string()));
        spec["pages"]["camera"] = home / "camera.html";
        write_large_page(home / "large");
        for (const char* page : {"run", "cloud", "hostile", "list", "bench", "large", "old"})
            spec["pages"][page] = home / page / "index.html";
        spec["pages"]["comparison"] = home / "compare/index.html";
        return spec;
    }

    /// Pixels of the first frame with what was recorded and computed there, and a dark one.
    static void add_values(nlohmann::json& spec, const fs::path& capture, const fs::path& run) {
        const auto manifest = nlohmann::json::parse(tests::read_bytes(run / "manifest.json"));
        const std::string name = manifest["frames"][0]["name"];
        const cv::Mat1f z_m = depth_in_metres(
            read_stored_depth(capture / "depth" / (name + ".png")),
            depth_encoding(std::to_string(static_cast<int>(manifest["capture"]["depth"]["units_per_metre"])),
                           "the manifest"));
        const cv::Mat1f ao = read_ao(run / "ao" / (name + ".png"));
        spec["size"] = {z_m.cols, z_m.rows};
        // Previews hold every second pixel of this size, beginning with the second.
        for (int v = 41; v < z_m.rows - 20; v += 60)
            for (int u = 41; u < z_m.cols - 20; u += 80)
                if (z_m(v, u) > 0 && z_m(v, u + 1) > 0 && std::abs(z_m(v, u + 1) - z_m(v, u)) < 0.01F * z_m(v, u))
                    spec["values"].push_back({{"x", u}, {"y", v}, {"z", z_m(v, u)}, {"ao", ao(v, u)}});
        float darkest = 1;
        for (int v = 40; v < z_m.rows - 40; ++v)
            for (int u = 40; u < z_m.cols - 40; ++u) {
                const double mean = cv::mean(ao(cv::Rect(u - 3, v - 3, 7, 7)))[0]; // a NaN is never below
                if (mean < static_cast<double>(darkest)) {
                    darkest = static_cast<float>(mean);
                    spec["dark"] = {u, v};
                }
            }
    }

    /// The same tile at the origin, in UTM and geocentric coordinates; and two tiles side by side as one capture.
    static void add_tiles(nlohmann::json& spec, const fs::path& home) {
        const Eigen::Vector3d utm(448262, 5411932, 120), geocentric(4157222, 664789, 4774952);
        for (const auto& [name, shift] :
             {std::pair<const char*, Eigen::Vector3d>{"origin", {0, 0, 0}}, {"utm", utm}, {"geocentric", geocentric}}) {
            (void)tests::write_file(home / "tiles" / name / "tile.las", tests::tile(shift));
            must(fmt::format("run '{0}/tiles/{1}/tile.las' -o '{0}/tiles/{1}/out'", home.string(), name));
            spec["tiles"][name] = home / "tiles" / name / "out/index.html";
        }
        (void)tests::write_file(home / "tiles/both/a.las", tests::tile(utm));
        (void)tests::write_file(home / "tiles/both/b.las",
                                tests::tile(utm + Eigen::Vector3d(tests::tile_side_m, 0, 0)));
        must(fmt::format("run '{0}/tiles/both' -o '{0}/tiles/both/out'", home.string()));
        spec["tiles"]["both"] = home / "tiles/both/out/index.html";
        spec["utm"] = {utm.x(), utm.y(), utm.z()};
    }

    static void add_hostile(nlohmann::json& spec, const fs::path& home) {
        // The folders' names join to the end of a script.
        const fs::path capture = home / "c<" / "script><script>window.hit=1<" / "script>";
        tests::write_capture(capture, static_cast<int>(hostile_names.size()) + 1);
        for (std::size_t i = 0; i < hostile_names.size(); ++i)
            for (const char* part : {"color", "depth"})
                fs::rename(capture / part / fmt::format("{:03}.png", i), capture / part / (hostile_names[i] + ".png"));
        std::ofstream(capture / fmt::format("depth/{:03}.png", hostile_names.size()), std::ios::binary) << "no PNG";
        must(fmt::format("run {} -o '{}/hostile'", quoted(capture), home.string()), 2);
        spec["hostile_frames"] = hostile_names.size() + 1;
        for (const std::string& name : hostile_names)
            spec["hostile_names"].push_back(name_shown(name));
        spec["hostile_title"] = "script>";
    }

    static void write_large_page(const fs::path& folder) {
        fs::create_directories(folder);
        page::RunPage page;
        for (std::size_t i = 0; i < 10000; ++i) {
            page::Row row{.index = i,
                          .name = fmt::format("frame {:05}", i),
                          .status = i % 1000 == 7 ? "failed" : "ok",
                          .why = i % 1000 == 7 ? "depth ends early" : "",
                          .fault = {},
                          .width = 640,
                          .height = 480,
                          .valid_share = 0.9,
                          .coverage = 0.99 + 0.01 * std::sin(static_cast<double>(i) * 0.01),
                          .mean_visibility = 0.7 + 0.1 * std::sin(static_cast<double>(i) * 0.003),
                          .ms = {4, 1, 20 + static_cast<double>(i % 7), 3, 9},
                          .warnings = {},
                          .notes = {},
                          .files = {fmt::format("ao/frame {:05}.png", i)},
                          .world_from_camera = {}};
            page.add(row);
        }
        page.write(folder, page::run_head({{"version", "0"}, {"capture", {{"path", "/large"}, {"kind", "none"}}}}));
    }

    static inline std::string missing_, broken_;
    static inline std::unique_ptr<TemporaryFolder> folder_;
    static inline nlohmann::json results_ = nlohmann::json::object();
};

TEST_F(BrowserTest, pages_from_disk_complain_of_nothing_and_ask_for_nothing_outside_their_folder) {
    EXPECT_EQ(found("quiet over file"), "");
}
TEST_F(BrowserTest, pages_over_http_complain_of_nothing_and_ask_for_nothing_outside_their_folder) {
    EXPECT_EQ(found("quiet over http"), "");
}
TEST_F(BrowserTest, the_worst_frame_is_shown_first) { EXPECT_EQ(found("worst first"), ""); }
TEST_F(BrowserTest, a_click_on_a_head_sorts_and_another_one_turns_the_order) { EXPECT_EQ(found("sorting"), ""); }
TEST_F(BrowserTest, the_filter_leaves_rows_with_all_its_words) { EXPECT_EQ(found("filter"), ""); }
TEST_F(BrowserTest, chips_show_frames_of_one_status_and_reasons_are_listed) {
    EXPECT_EQ(found("chips and reasons"), "");
}
TEST_F(BrowserTest, keys_change_frame_image_zoom_and_row) { EXPECT_EQ(found("keys"), ""); }
TEST_F(BrowserTest, the_divider_uncovers_one_image_or_the_other) { EXPECT_EQ(found("divider"), ""); }
TEST_F(BrowserTest, strength_goes_from_colour_to_shaded) { EXPECT_EQ(found("strength"), ""); }
TEST_F(BrowserTest, values_under_the_pointer_are_those_recorded_and_computed) { EXPECT_EQ(found("values"), ""); }
TEST_F(BrowserTest, points_of_a_frame_are_drawn_in_every_mode_and_shaded_by_strength) {
    EXPECT_EQ(found("points of a frame"), "");
}
TEST_F(BrowserTest, points_seen_from_the_frames_camera_lie_on_its_picture) {
    EXPECT_EQ(found("points are where the depth is"), "");
}
TEST_F(BrowserTest, the_view_flies_to_the_camera_of_the_chosen_frame_and_turns_by_hand) {
    EXPECT_EQ(found("flight to a frame's camera"), "");
}
TEST_F(BrowserTest, all_nodes_are_the_cloud_the_root_an_even_sample_and_strays_are_counted) {
    EXPECT_EQ(found("points of a cloud"), "");
}
TEST_F(BrowserTest, nodes_of_a_cloud_are_loaded_and_drawn_as_the_view_needs_them) {
    EXPECT_EQ(found("nodes by need"), "");
}
TEST_F(BrowserTest, map_coordinates_are_drawn_as_those_round_the_origin) { EXPECT_EQ(found("map coordinates"), ""); }
TEST_F(BrowserTest, tiles_of_a_capture_lie_side_by_side) { EXPECT_EQ(found("tiles"), ""); }
TEST_F(BrowserTest, a_clouds_page_opens_at_its_points_with_the_pictures_beside) {
    EXPECT_EQ(found("a cloud's page"), "");
}
TEST_F(BrowserTest, points_take_the_colour_of_any_number_with_its_range_or_classes) {
    EXPECT_EQ(found("colourings"), "");
}
TEST_F(BrowserTest, a_picked_point_tells_its_values_and_the_distance_to_the_one_before) {
    EXPECT_EQ(found("picked points"), "");
}
TEST_F(BrowserTest, the_clipping_box_hides_what_is_outside) { EXPECT_EQ(found("clipping box"), ""); }
TEST_F(BrowserTest, the_button_saves_the_picture_of_the_points) { EXPECT_EQ(found("PNG"), ""); }
TEST_F(BrowserTest, a_link_shows_the_same_view) { EXPECT_EQ(found("view in the link"), ""); }
TEST_F(BrowserTest, without_webgl_the_page_says_so_and_the_rest_works) { EXPECT_EQ(found("without WebGL"), ""); }
TEST_F(BrowserTest, hostile_names_are_shown_and_never_run) { EXPECT_EQ(found("hostile names"), ""); }
TEST_F(BrowserTest, what_gets_into_a_page_is_neither_run_nor_loaded) {
    EXPECT_EQ(found("policy over file"), "");
    EXPECT_EQ(found("policy over http"), "");
}
TEST_F(BrowserTest, ten_thousand_rows_scroll_sort_and_plot) { EXPECT_EQ(found("ten thousand rows"), ""); }
TEST_F(BrowserTest, a_comparison_has_errors_worst_first_and_difference_pictures) { EXPECT_EQ(found("comparison"), ""); }
TEST_F(BrowserTest, a_list_has_pictures_worst_first_and_leads_to_the_pages_of_its_captures) {
    EXPECT_EQ(found("list"), "");
}
TEST_F(BrowserTest, the_page_of_a_failed_run_says_what_to_do) { EXPECT_EQ(found("failed run"), ""); }
TEST_F(BrowserTest, sentences_are_not_cut) { EXPECT_EQ(found("whole sentences"), ""); }
TEST_F(BrowserTest, results_without_previews_show_their_images) { EXPECT_EQ(found("older results"), ""); }
TEST_F(BrowserTest, missing_files_are_named) { EXPECT_EQ(found("missing files"), ""); }
TEST_F(BrowserTest, pages_fit_a_phone) { EXPECT_EQ(found("narrow screens"), ""); }
TEST_F(BrowserTest, the_markup_is_valid) { EXPECT_EQ(found("valid markup"), ""); }
TEST_F(BrowserTest, pages_are_accessible_in_light_and_dark) { EXPECT_EQ(found("accessible"), ""); }

} // namespace
} // namespace scanshade
