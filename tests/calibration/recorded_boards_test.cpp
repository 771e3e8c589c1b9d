// Recorded chessboards, where they are at hand: the full model is OpenCV's, corners leave less residual than OpenCV's,
// and damaged pictures and cameras are refused by name.
#include "io/images/image_file.h"
#include "projection/calibration/boards/board_detection.h"
#include "projection/calibration/boards/boards.h"
#include "projection/calibration/model_selection.h"
#include "projection/calibration/refinement.h"
#include "tests/support/chessboards.h"
#include "tests/support/data.h"
#include "tests/support/says.h"
#include "tests/support/small_capture.h"

#include <cmath>
#include <filesystem>
#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace calibration;
using namespace tests;

/// OpenCV's own answer to the same corners with the same model.
struct OpenCvAnswer {
    double rms = 0;
    cv::Matx33d camera;
    cv::Mat1d sigmas;
};

OpenCvAnswer opencv_calibrates(const std::vector<BoardView>& views) {
    std::vector<std::vector<cv::Point3f>> points;
    std::vector<std::vector<cv::Point2f>> pixels;
    for (const BoardView& view : views) {
        points.emplace_back();
        pixels.emplace_back();
        for (std::size_t i = 0; i < view.pixels.size(); ++i) {
            points.back().emplace_back(cv::Point3d(view.points_m[i].x(), view.points_m[i].y(), 0));
            pixels.back().emplace_back(cv::Point2d(view.pixels[i].x(), view.pixels[i].y()));
        }
    }
    OpenCvAnswer answer;
    cv::Mat lens, rotations, translations, pose_sigmas, errors;
    cv::Mat camera;
    answer.rms =
        cv::calibrateCamera(points, pixels, image, camera, lens, rotations, translations, answer.sigmas, pose_sigmas,
                            errors, 0, {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 100, 1e-12});
    answer.camera = camera;
    return answer;
}

/// With `plain_window`, corners as OpenCV's sample refines them: the same window for all views, which reaches into the
/// neighbouring squares of distant boards.
std::vector<BoardView> chessboards(const fs::path& folder, bool plain_window) {
    std::vector<BoardView> views;
    for (int i = 1; i <= 14; ++i) {
        const fs::path file = folder / ("left" + std::string(i < 10 ? "0" : "") + std::to_string(i) + ".jpg");
        if (!fs::exists(file))
            continue;
        const cv::Mat3b picture = read_colour(file);
        auto view = find_board(picture, {}, file.filename().string());
        EXPECT_TRUE(view) << file;
        if (!view)
            continue;
        if (plain_window) {
            cv::Mat1b grey;
            cv::cvtColor(picture, grey, cv::COLOR_BGR2GRAY);
            std::vector<cv::Point2f> corners;
            EXPECT_TRUE(cv::findChessboardCorners(grey, {9, 6}, corners));
            cv::cornerSubPix(grey, corners, {11, 11}, {-1, -1},
                             {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 30, 0.1});
            for (std::size_t c = 0; c < corners.size(); ++c)
                view->pixels[c] = {corners[c].x, corners[c].y};
        }
        views.push_back(*view);
    }
    return views;
}

Refinement full_model(const std::vector<BoardView>& views) {
    Boards boards(views);
    RefineOptions options;
    options.selection.guessed = true;
    options.model = ModelChoice::full;
    return refine(boards, guess_from_boards(views, image), camera_groups(LensModel::brown_conrady), options, "");
}

TEST(Chessboards, FullModelIsOpenCvsToTheLastDigitAndSigma) {
    const fs::path folder = data_folder() / "chessboard_left";
    NEEDS(folder);
    for (const bool plain_window : {true, false}) {
        const std::vector<BoardView> views = chessboards(folder, plain_window);
        ASSERT_EQ(views.size(), 13);
        const OpenCvAnswer theirs = opencv_calibrates(views);
        const Refinement ours = full_model(views);
        std::printf("%s window: OpenCV %.4f px, ours %.4f px; fx %.2f and %.2f +- %.2f\n",
                    plain_window ? "fixed" : "own", theirs.rms, ours.selection.train_px, theirs.camera(0, 0),
                    ours.after.pinhole.fx, ours.selection.fit.sigma(f));
        EXPECT_LE(ours.selection.train_px, theirs.rms * (1 + 1e-6)); // the same least squares
        // OpenCV stops a little before the minimum; 2 combined sigmas are a hundred times more than is needed.
        EXPECT_NEAR(ours.after.pinhole.fx, theirs.camera(0, 0), 0.1 * ours.selection.fit.sigma(f));
        EXPECT_NEAR(ours.after.pinhole.cy, theirs.camera(1, 2), 0.1 * ours.selection.fit.sigma(cy));
        // OpenCV divides by the number of points less the unknowns where each point has two residuals.
        const double points = 13 * 54, unknowns = 9 + 13 * 6;
        const double theirs_per_residual = theirs.sigmas(2) * std::sqrt((points - unknowns) / (2 * points - unknowns));
        EXPECT_NEAR(ours.selection.fit.sigma(cx), theirs_per_residual, 0.01 * theirs_per_residual);
        if (!plain_window)
            continue;
        EXPECT_LE(ours.selection.train_px, 0.4095); // the published value
        for (const ViewRow& view : ours.views)
            EXPECT_EQ(view.outlying, view.name == "left02.jpg") << view.name << " " << view.score.rms();
    }
}

TEST(Chessboards, TheSelectedModelIsNoWorseThanTheFullModelOnHeldOutViews) {
    const fs::path folder = data_folder() / "chessboard_left";
    NEEDS(folder);
    const std::vector<BoardView> views = chessboards(folder, false);
    Boards boards(views);
    RefineOptions options;
    options.selection.guessed = true;
    const Refinement result =
        refine(boards, guess_from_boards(views, image), camera_groups(LensModel::brown_conrady), options, "");
    ASSERT_TRUE(result.full);
    EXPECT_LE(result.selection.held_out_px, result.full->held_out_px);
    EXPECT_LT(result.selection.held_out_px, 0.19);
    EXPECT_FALSE(result.selection.free[k3]);
    EXPECT_TRUE(monotone(result.selection.fit.model));
}

TEST(Chessboards, CornersLeaveLessResidualThanOpenCvsUsualWindow) {
    // chessboard_right is the other camera of OpenCV's stereo pair (samples/data/right*.jpg).
    int folders = 0;
    for (const char* name : {"chessboard_left", "chessboard_right"}) {
        std::vector<BoardView> ours, theirs;
        if (!fs::exists(data_folder() / name))
            continue;
        ++folders;
        for (const auto& file : fs::directory_iterator(data_folder() / name)) {
            if (file.path().extension() != ".jpg")
                continue;
            const cv::Mat3b picture = read_colour(file);
            const auto view = find_board(picture, {}, file.path().filename().string());
            ASSERT_TRUE(view) << file;
            EXPECT_EQ(view->flaw, BoardView::Flaw::none) << file;
            ours.push_back(*view);
            theirs.push_back(*view);
            theirs.back().pixels.clear();
            for (const cv::Point2d pixel : opencv_corners(picture))
                theirs.back().pixels.emplace_back(pixel.x, pixel.y);
        }
        EXPECT_EQ(ours.size(), 13);
        const double ours_px = opencv_calibrates(ours).rms, theirs_px = opencv_calibrates(theirs).rms;
        std::printf("%s: %.4f px, OpenCV's window of 11x11 %.4f px\n", name, ours_px, theirs_px);
        EXPECT_LE(ours_px, 0.95 * theirs_px);
    }
    if (folders == 0)
        GTEST_SKIP() << "no recorded chessboards; SCANSHADE_DATA names the folder of recorded data";
}

TEST(Chessboards, AWrongBoardOrSquareIsRefusedWithTheReason) {
    const fs::path folder = data_folder() / "chessboard_left";
    NEEDS(folder);
    const tests::Ran part = tests::run_program("refine '" + folder.string() + "' --board 8x6");
    EXPECT_EQ(part.exit_code, 3);
    EXPECT_TRUE(says(part.err, "the board is larger than 8x6 corners in 11 of the 11 pictures"));
    const tests::Ran millimetres = tests::run_program("refine '" + folder.string() + "' --board 9x6 --square 25");
    EXPECT_EQ(millimetres.exit_code, 1);
    EXPECT_TRUE(says(millimetres.err, "square: '25' given, expected m"));
}

TEST(Chessboards, TheVerdictIsOnTheTerminalThePageAndInTheCamera) {
    const fs::path folder = data_folder() / "chessboard_left";
    NEEDS(folder);
    const tests::TemporaryFolder out;
    const tests::Ran ran =
        tests::run_program("refine '" + folder.string() + "' --board 9x6 -o '" + (out / "camera.json").string() +
                           "' --report '" + (out / "page.html").string() + "'");
    const char* verdict = "sound: held-out views are off by 0.18 px";
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_TRUE(says(ran.out, verdict));
    EXPECT_TRUE(says(tests::read_bytes(out / "camera.json"), verdict));
    EXPECT_TRUE(says(tests::read_bytes(out / "page.html"), verdict));
}

// ---------------------------------------------------------------------------------------------------- damaged data

/// Each damaged picture of data/broken/chessboard, and the message it must cause.
struct BrokenPicture {
    const char *name, *said;
};
constexpr BrokenPicture broken_pictures[] = {
    {"left01_truncated.jpg", "left01_truncated.jpg: JPEG ends early"},
    {"no_board.jpg", "no board found in"},
    {"other_size.jpg", "other_size.jpg: 320x240 among pictures of 640x480"},
};

TEST(BrokenData, DamagedPicturesAreLeftOutByNameAndTheOthersUsed) {
    const fs::path folder = data_folder() / "broken/chessboard", sound = data_folder() / "chessboard_left";
    NEEDS(folder);
    for (const BrokenPicture& broken : broken_pictures) {
        const tests::TemporaryFolder mixed;
        for (const auto& file : fs::directory_iterator(sound))
            if (file.path().extension() == ".jpg")
                fs::copy_file(file.path(), mixed / file.path().filename());
        fs::copy_file(folder / broken.name, mixed / broken.name);
        const tests::Ran ran = tests::run_program("refine '" + mixed.path().string() + "' --board 9x6");
        EXPECT_EQ(ran.exit_code, 0) << broken.name << ran.err;
        EXPECT_TRUE(says(ran.out, broken.said));
        EXPECT_TRUE(says(ran.out, "in 13 of"));
    }
}

TEST(BrokenData, TheSameViewFourTimesIsNoCalibration) {
    const fs::path folder = data_folder() / "broken/chessboard";
    NEEDS(folder);
    const tests::Ran ran = tests::run_program("refine '" + folder.string() + "' --board 9x6");
    EXPECT_EQ(ran.exit_code, 3);
    EXPECT_TRUE(says(ran.err, "1 different view of the board among 4 images"));
    for (const BrokenPicture& broken : broken_pictures) // the message names the pictures left out
        EXPECT_TRUE(says(ran.err, broken.said));
}

/// Each case of data/broken/camera as refine's first camera.
struct BrokenCamera {
    const char *name, *said; ///< empty = it is sound
};
constexpr BrokenCamera broken_cameras[] = {
    {"ok_open3d.json", ""},
    {"row_major.json", "row by row"},
    {"negative_fx.json", "fx is -525"},
    {"zero_fy.json", "fy is 0"},
    {"nan_cx.json", "NaN"},
    {"wrong_size.json", "320x240"},
    {"trailing_comma.json", "line 3, column 16"},
    {"missing_matrix.json", "\"intrinsic_matrix\""},
    {"matrix_8_numbers.json", "has 8 numbers, expected 9"},
};

TEST(BrokenData, ADamagedFirstCameraIsRefusedByName) {
    const fs::path folder = data_folder() / "broken/camera", boards = data_folder() / "chessboard_left";
    NEEDS(folder);
    for (const BrokenCamera& broken : broken_cameras) {
        const tests::Ran ran = tests::run_program("refine '" + boards.string() + "' --board 9x6 --camera '" +
                                                  (folder / broken.name).string() + "'");
        EXPECT_EQ(ran.exit_code, *broken.said ? 3 : 0) << broken.name << ran.err;
        EXPECT_TRUE(says(ran.err, broken.said)) << broken.name;
        if (*broken.said) {
            EXPECT_TRUE(says(ran.err, broken.name));
        }
    }
}

} // namespace
} // namespace scanshade
