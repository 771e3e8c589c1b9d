// The library as its users see it: public headers alone, against what the program writes for the same input.
#include <bit>
#include <cstdint>
#include <scanshade/capture.h>
#include <scanshade/relief.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <gtest/gtest.h>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <thread>
#include <unistd.h>

extern "C" int one_image_in_c(void);

namespace {

namespace fs = std::filesystem;
using scanshade::Camera;
using scanshade::Session;
using scanshade::Settings;

const Camera camera{525, 525, 319.5, 239.5};

/// Two walls that meet in a vertical edge, with a hole; millimetres.
cv::Mat1w corner() {
    cv::Mat1w depth(480, 640);
    for (int v = 0; v < depth.rows; ++v)
        for (int u = 0; u < depth.cols; ++u)
            depth(v, u) = static_cast<ushort>(2000 / (1 + 0.0015 * std::abs(u - 320))); // two planes
    depth(cv::Rect(10, 10, 30, 20)) = 0;
    return depth;
}

std::string why(const Settings& settings) {
    try {
        const Session session(settings);
    } catch (const scanshade::Error& error) {
        EXPECT_EQ(error.status(), SCANSHADE_MISUSE);
        return error.what();
    }
    return "";
}

/// A folder for the program's results.
class LibraryTest : public testing::Test {
  protected:
    LibraryTest() : folder(fs::temp_directory_path() / ("library_test_" + std::to_string(getpid()))) {
        fs::remove_all(folder);
        fs::create_directories(folder);
    }
    ~LibraryTest() override { fs::remove_all(folder); }

    int run(const std::string& arguments) const {
        const std::string command =
            std::string(SCANSHADE_PROGRAM) + " " + arguments + " -q 2>" + (folder / "messages").string();
        return std::system(command.c_str());
    }
    static void expect_same_bits(const cv::Mat1f& a, const cv::Mat1f& b) {
        ASSERT_EQ(a.size(), b.size());
        int different = 0;
        for (int v = 0; v < a.rows; ++v)
            for (int u = 0; u < a.cols; ++u) // any NaN is as good as another: a file has one of its own
                different += std::isnan(a(v, u))
                                 ? !std::isnan(b(v, u))
                                 : std::bit_cast<std::uint32_t>(a(v, u)) != std::bit_cast<std::uint32_t>(b(v, u));
        EXPECT_EQ(different, 0);
    }
    fs::path folder;
};

TEST_F(LibraryTest, values_have_the_bits_that_the_program_writes) {
    const fs::path image = folder / "depth.png";
    cv::imwrite(image.string(), corner());
    for (const char* method : {"cacao", "surfel"})
        for (const char* noise : {"none", "kinect", "auto"}) {
            const fs::path out = folder / (std::string(method) + noise);
            ASSERT_EQ(
                run("run " + image.string() + " -o " + out.string() +
                    " --camera 525,525,319.5,239.5 --depth-scale mm --format tiff --write ao,confidence --method " +
                    method + " --depth-noise " + noise),
                0);
            const Session session({{"method", method}, {"depth-noise", noise}});
            const scanshade::Result result = session.compute(corner(), camera, "mm");
            const cv::Mat1f ao = cv::imread((out / "ao" / "depth.tiff").string(), cv::IMREAD_UNCHANGED);
            const cv::Mat1f confidence = cv::imread((out / "confidence" / "depth.tiff").string(), cv::IMREAD_UNCHANGED);
            expect_same_bits(result.visibility(), ao);
            expect_same_bits(result.confidence(), confidence);
        }
}

TEST_F(LibraryTest, frames_of_a_capture_have_the_bits_that_the_program_writes_together_too) {
    ASSERT_EQ(run("generate office -o " + (folder / "capture").string() + " --frames 4 --size 160x120 --truth=false"),
              0);
    for (const char* sequence : {"off", "on"}) {
        const fs::path out = folder / sequence;
        ASSERT_EQ(run("run " + (folder / "capture").string() + " -o " + out.string() +
                      " --format tiff --write ao --method surfel --sequence " + sequence),
                  0);
        const Session session({{"method", "surfel"}, {"sequence", sequence}});
        const scanshade::Capture capture((folder / "capture").string());
        ASSERT_EQ(capture.size(), 4);
        for (const int index : {0, 3, 1}) { // forwards, and back
            const scanshade::Frame frame = capture[index];
            const fs::path file = out / "ao" / (frame.name() + ".tiff");
            expect_same_bits(frame.compute(session).visibility(),
                             cv::Mat1f(cv::imread(file.string(), cv::IMREAD_UNCHANGED)));
        }
    }
}

TEST_F(LibraryTest, threads_share_a_session) {
    const Session session({{"depth-noise", "none"}});
    const cv::Mat1f alone = session.compute(corner(), camera).visibility();
    std::vector<cv::Mat1f> found(4);
    std::vector<std::thread> threads;
    for (cv::Mat1f& one : found)
        threads.emplace_back([&] { one = session.compute(corner(), camera).visibility(); });
    for (std::thread& thread : threads)
        thread.join();
    for (const cv::Mat1f& one : found)
        expect_same_bits(one, alone);
}

TEST_F(LibraryTest, rows_may_be_parts_of_a_larger_image) {
    const Session session({{"depth-noise", "none"}});
    const cv::Mat whole = corner(), part = whole(cv::Rect(100, 50, 320, 240));
    const Camera other{525, 525, 219.5, 189.5};
    expect_same_bits(session.compute(part, other).visibility(), session.compute(part.clone(), other).visibility());
}

/// Points of a floor under a wall: open far from it, half closed beside it.
TEST_F(LibraryTest, points_are_darker_in_a_corner) {
    std::vector<Eigen::Vector3f> points;
    for (int i = 0; i < 100; ++i)
        for (int j = 0; j < 100; ++j) {
            points.emplace_back(0.01F * static_cast<float>(i), 0.01F * static_cast<float>(j), 0.0F);
            points.emplace_back(0.0F, 0.01F * static_cast<float>(j), 0.01F * static_cast<float>(i));
        }
    const Session session({{"cloud.radius", "0.2"}, {"cloud.outside", "2,0.5,2"}});
    const scanshade::Result result = session.compute(points, {}, false, scanshade::with_all);
    const cv::Mat1f visibility = result.visibility();
    ASSERT_EQ(visibility.size(), cv::Size(20000, 1));
    const auto floor = [](int i, int j) { return 2 * (100 * i + j); };
    EXPECT_GT(visibility(floor(60, 50)), 0.95F);
    EXPECT_LT(visibility(floor(3, 50)), 0.75F);
    EXPECT_GT(result.normals()(floor(60, 50))[2], 0.99F); // towards the scanner
}

TEST_F(LibraryTest, a_lens_goes_in_with_all_its_numbers) {
    const Camera rational{525, 525, 319.5, 239.5, {}, false, {0.43, 0.02, 0, 0, 0.001, 0.77, 0.12, 0.006}};
    EXPECT_EQ(rational.to_c().lens, SCANSHADE_RATIONAL);
    const Camera back = Camera::from_c(rational.to_c());
    EXPECT_TRUE(std::equal(std::begin(back.distortion), std::end(back.distortion), rational.distortion));
    Camera polynomial = rational;
    std::fill(polynomial.distortion + 5, polynomial.distortion + 8, 0.0);
    EXPECT_EQ(polynomial.to_c().lens, SCANSHADE_BROWN);
    const Session session({{"depth-noise", "none"}});
    const cv::Mat1f with = session.compute(corner(), rational).visibility(),
                    without = session.compute(corner(), polynomial).visibility();
    EXPECT_GT(cv::countNonZero(with != without), 1000) << "the denominator is used";
    scanshade_camera odd = rational.to_c();
    odd.denominator[2] = INFINITY;
    EXPECT_THROW((void)session.compute(corner(), Camera::from_c(odd)), scanshade::Error);
}

TEST_F(LibraryTest, mistakes_get_the_programs_own_sentence) {
    EXPECT_EQ(why({{"radiuss", "1"}}), "--radiuss: no such flag; did you mean --radius?");
    EXPECT_EQ(why({{"out", "x"}}), "--out: is a setting of the program, not of a session");
    EXPECT_NE(why({{"radius", "wide"}}).find("radius: 'wide' given"), std::string::npos);
    EXPECT_NE(why({{"method", "surfels"}}).find("method: 'surfels' given"), std::string::npos);
    const Session session;
    EXPECT_THROW((void)session.compute(cv::Mat1b(4, 4), camera), scanshade::Error);
    try {
        (void)session.compute(corner(), Camera{525, 525, 319.5, 239.5, {320, 240}});
        ADD_FAILURE() << "a camera of another size was taken";
    } catch (const scanshade::Error& error) {
        EXPECT_EQ(error.status(), SCANSHADE_BAD_INPUT);
        EXPECT_NE(std::string(error.what()).find("320x240"), std::string::npos);
    }
    EXPECT_THROW(scanshade::Capture("/nowhere"), scanshade::Error);
}

/// The same DEM as a file for the program and as an array; its cells are of 1 m without a word on their place.
TEST_F(LibraryTest, relief_has_the_bits_that_the_program_writes) {
    const fs::path folder = fs::path(testing::TempDir()) / "library_relief";
    fs::remove_all(folder);
    fs::create_directories(folder);
    cv::Mat1f heights(60, 80);
    cv::randu(heights, 300, 303);
    heights(20, 30) = NAN;
    const fs::path dem = folder / "dem.tif";
    ASSERT_TRUE(cv::imwrite(dem.string(), heights));
    const std::string words =
        " relief " + dem.string() + " --write svf,openness-neg,ao --radius 5 -q -o " + folder.string();
    ASSERT_EQ(std::system((SCANSHADE_PROGRAM + words + " 2> /dev/null").c_str()), 0);
    const std::vector<std::string> names{"svf", "openness-neg", "ao"};
    const auto maps = scanshade::relief(heights, 1, names, {{"radius", "5"}}),
               of_file = scanshade::relief(dem.string(), names, {{"radius", "5"}});
    for (const auto& [name, file] : {std::pair("svf", "dem_SVF_R5_D16.tif"), std::pair("ao", "dem_AO_R5.tif"),
                                     std::pair("openness-neg", "dem_OPEN-NEG_R5_D16.tif")}) {
        const cv::Mat1f written = cv::imread((folder / file).string(), cv::IMREAD_UNCHANGED);
        expect_same_bits(maps.at(name), written);
        expect_same_bits(of_file.at(name), written);
    }
    const auto refusal = [&](double cell, const scanshade::Settings& settings) {
        try {
            (void)scanshade::relief(heights, cell, {"svf"}, settings);
        } catch (const scanshade::Error& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_NE(refusal(0, {}).find("cells of 0 m"), std::string::npos);
    EXPECT_NE(refusal(1, {{"surface", "top"}}).find("is a setting of the program, not of relief"), std::string::npos);
    EXPECT_NE(refusal(1, {{"radius", "0.1"}}).find("a radius of 0.1"), std::string::npos);
    EXPECT_THROW((void)scanshade::relief((folder / "none.tif").string(), {"svf"}), scanshade::Error);
}

TEST(CInterface, works_from_c) { EXPECT_EQ(one_image_in_c(), 0); }

TEST(CInterface, refuses_null_and_structs_of_no_size) {
    scanshade_session* session = nullptr;
    EXPECT_EQ(scanshade_session_open(nullptr, 0, nullptr), SCANSHADE_MISUSE);
    ASSERT_EQ(scanshade_session_open(nullptr, 0, &session), SCANSHADE_OK);
    scanshade_result* result = nullptr;
    EXPECT_EQ(scanshade_compute_depth(session, nullptr, 0, &result), SCANSHADE_MISUSE);
    scanshade_depth depth{};
    EXPECT_EQ(scanshade_compute_depth(session, &depth, 0, &result), SCANSHADE_MISUSE);
    EXPECT_NE(std::string(scanshade_last_error()).find("size 0 given"), std::string::npos);
    EXPECT_EQ(scanshade_result_info(nullptr), nullptr);
    scanshade_session_close(session);
    scanshade_result_free(nullptr);
}

} // namespace
