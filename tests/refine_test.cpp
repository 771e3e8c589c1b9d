// Cameras refined from targets, clouds and sequences: what is recovered, how sure it is, and when nothing is changed.
#include "io/image_file.h"
#include "projection/calibration/board_detection.h"
#include "projection/calibration/boards.h"
#include "projection/calibration/ladder.h"
#include "projection/calibration/quality.h"
#include "projection/calibration/solve.h"
#include "projection/error.h"
#include "tests/support/says.h"

#include <ceres/gradient_checker.h>
#include <cstdlib>
#include <filesystem>
#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace calibration;
using tests::says;

const cv::Size image{640, 480};
const Camera plain{{525, 525, 319.5, 239.5, image}, {}, "plain"};

/// Boards held at random before the camera, as a person would: tilted up to 35 degrees, filling a third to most of the
/// image; corners seen with Gaussian noise.
std::vector<BoardView> boards_seen_by(const Camera& camera, int views, double noise_px, std::mt19937& random,
                                      double tilt = 0.6) {
    const cv::Size corners(8, 6);
    const double square_m = 0.03;
    std::uniform_real_distribution<double> even(-1, 1);
    std::normal_distribution<double> noise(0, noise_px);
    const Model model = model_of(camera);
    std::vector<BoardView> all;
    while (static_cast<int>(all.size()) < views) {
        const double z_m = 0.35 + 0.15 * even(random);
        const double pose[6] = {tilt * even(random), tilt * even(random), 0.3 * even(random),
                                0.3 * z_m * even(random), 0.25 * z_m * even(random), z_m};
        BoardView view{"view " + std::to_string(all.size()), {}, {}};
        bool inside = true;
        for (int i = 0; i < corners.area(); ++i) {
            const Eigen::Vector3d on_board((i % corners.width - 3.5) * square_m, (i / corners.width - 2.5) * square_m, 0);
            Eigen::Vector3d point;
            Eigen::Vector2d pixel;
            moved(pose, on_board.data(), point.data());
            pixel_of(model.lens, model.values.data(), point.data(), pixel.data());
            inside = inside && pixel.x() > 0 && pixel.y() > 0 && pixel.x() < image.width - 1 && pixel.y() < image.height - 1;
            view.points_m.push_back(on_board);
            view.pixels.emplace_back(pixel.x() + noise(random), pixel.y() + noise(random));
        }
        if (inside)
            all.push_back(view);
    }
    return all;
}

Free free_rungs(const std::vector<Rung>& rungs) {
    Free free{};
    for (const Rung& rung : rungs)
        for (const Unknown unknown : rung.unknowns)
            free[unknown] = true;
    return free;
}

// ---------------------------------------------------------------------------------------------------- honest sigmas

TEST(Boards, SigmasAreHonest) {
    // A Gaussian error is within 2 sigma 95.4 % of the time and has a mean square of 1 sigma^2: over 200 trials and each
    // number the share is 93 .. 98 % (1.6 standard errors either way) and the mean square 0.8 .. 1.2 (2 standard errors).
    const Camera truth{{531, 527, 327, 236, image}, {-0.25, 0.08, 0.001, -0.0015, 0}, "truth"};
    const std::vector<Rung> rungs = {{"all", {f, aspect, cx, cy, k1, k2, p1, p2}}};
    const Free free = free_rungs(rungs);
    const Model wanted = model_of(truth);
    constexpr int trials = 200;
    std::array<int, unknown_count> within{};
    std::array<double, unknown_count> squares{};
    for (int trial = 0; trial < trials; ++trial) {
        std::mt19937 random(1000 + trial);
        const std::vector<BoardView> views = boards_seen_by(truth, 8, 0.2, random);
        const Boards boards(views);
        const Fit start = boards.start(model_of(guess_from_boards(views, image)));
        const Fit fit = boards.fit(start, free, Views(views.size(), true), true);
        ASSERT_GT(fit.covariance.size(), 0);
        for (const Unknown unknown : rungs[0].unknowns) {
            const double sigmas = (fit.model[unknown] - wanted[unknown]) / fit.sigma(unknown);
            within[unknown] += std::abs(sigmas) <= 2;
            squares[unknown] += sigmas * sigmas / trials;
        }
    }
    double total = 0;
    for (const Unknown unknown : rungs[0].unknowns) {
        std::printf("%-6s within 2 sigma %.1f %%, mean square %.2f\n", std::string(name_of(unknown)).c_str(),
                    100.0 * within[unknown] / trials, squares[unknown]);
        total += 100.0 * within[unknown] / trials / static_cast<double>(rungs[0].unknowns.size());
        EXPECT_GE(100.0 * within[unknown] / trials, 91) << name_of(unknown);
        EXPECT_GT(squares[unknown], 0.75) << name_of(unknown);
        EXPECT_LT(squares[unknown], 1.3) << name_of(unknown);
    }
    EXPECT_GE(total, 93);
    EXPECT_LE(total, 98);
}

// ---------------------------------------------------------------------------------------------------- the ladder

struct Lens {
    const char* name;
    Pinhole pinhole;
    Distortion distortion;
    std::vector<std::string> rungs; ///< what is true of it
};

TEST(Ladder, ClimbsToTheTrueModelAndNoFarther) {
    const std::vector<Lens> lenses = {
        {"pinhole", {525, 525, 319.5, 239.5, image}, {}, {"f"}},
        {"moved centre", {525, 525, 330, 230, image}, {}, {"f", "cx, cy"}},
        {"barrel", {525, 525, 325, 245, image}, {-0.2, 0, 0, 0, 0}, {"f", "cx, cy", "k1"}},
        {"all but k3", {530, 522, 325, 245, image}, {-0.25, 0.15, 0.002, -0.002, 0},
         {"f", "fx, fy", "cx, cy", "k1", "k2", "p1, p2"}}};
    constexpr int trials = 10;
    int right = 0, wrong = 0, false_distortion = 0;
    for (const Lens& lens : lenses)
        for (int trial = 0; trial < trials; ++trial) {
            std::mt19937 random(100 * trial + 7);
            const std::vector<BoardView> views = boards_seen_by({lens.pinhole, lens.distortion, lens.name}, 12, 0.15, random);
            const Boards boards(views);
            const Fit start = boards.start(model_of(guess_from_boards(views, image)));
            LadderOptions options;
            options.guessed = true;
            const Climb climbed =
                climb(boards, start, camera_rungs(LensModel::brown_conrady), Views(views.size(), true), options);
            std::vector<std::string> rungs;
            for (const Step& step : climbed.steps)
                if (step.climbed)
                    rungs.push_back(step.name);
            rungs == lens.rungs ? ++right : ++wrong;
            if (rungs != lens.rungs) {
                std::printf("%s:", lens.name);
                for (const Step& step : climbed.steps)
                    std::printf(" [%s %s: %s]", step.name.c_str(), step.climbed ? "yes" : "no", step.why.c_str());
                std::printf("\n");
            }
            if (!lens.distortion.any())
                false_distortion += climbed.fit.model[k1] != 0 || climbed.fit.model[p1] != 0;
        }
    std::printf("true model in %d of %d\n", right, right + wrong);
    EXPECT_GE(right, 0.9 * (right + wrong));
    EXPECT_EQ(false_distortion, 0);
}

} // namespace
} // namespace scanshade
