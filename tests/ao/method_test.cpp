// Laws that every method of the table obeys; a new method is tested as soon as it is in the table.
#include "ao/base/method.h"
#include "ao/gpu/device.h"
#include "tests/support/scenes.h"

#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <map>
#include <opencv2/imgproc.hpp>

namespace scanshade {
namespace {

using namespace tests;

/// Every quality a method offers: its "quality" row's choices, or just its default.
struct Case {
    std::string method, quality;
    bool downsampled;
};

void PrintTo(const Case& c, std::ostream* out) {
    *out << c.method << " " << c.quality << (c.downsampled ? " downsampled" : "");
}

Parameter* row_named(std::vector<Parameter>& rows, const std::string& name) {
    for (Parameter& row : rows)
        if (row.name == name)
            return &row;
    return nullptr;
}

std::vector<Case> cases() {
    std::vector<Case> all;
    for (const MethodRow& method : methods()) {
        const auto setup = method.setup();
        auto rows = setup->parameters();
        const Parameter* quality = row_named(rows, "quality");
        for (const std::string& name : quality ? choices_of(*quality) : std::vector<std::string>{""}) {
            all.push_back({std::string(method.name), name, false});
            if (row_named(rows, "downsampled"))
                all.push_back({std::string(method.name), name, true});
        }
    }
    return all;
}

gpu::Device& device() {
    static gpu::Device opened; // shared: opening takes longer than a frame
    return opened;
}

class Laws : public testing::TestWithParam<Case> {
  protected:
    std::unique_ptr<Method> make(double radius_m, gpu::Device& opened = device()) {
        const auto setup = method_named(GetParam().method).setup();
        auto rows = setup->parameters();
        if (!GetParam().quality.empty())
            set(*row_named(rows, "quality"), GetParam().quality);
        if (GetParam().downsampled)
            set(*row_named(rows, "downsampled"), "true");
        set(*row_named(rows, "radius"), std::to_string(radius_m));
        return setup->make(opened);
    }
    /// Made once for images of all sizes, since pipelines take long to compile.
    AoMap ao(const DepthImage& depth, double radius_m = 0.5) {
        static gpu::Device& opened = device(); // opened before the methods, destroyed after them
        static std::map<std::string, std::unique_ptr<Method>> made;
        auto& one =
            made[fmt::format("{} {} {} {}", GetParam().method, GetParam().quality, GetParam().downsampled, radius_m)];
        if (!one)
            one = make(radius_m, opened);
        return one->compute({depth});
    }
    cv::Mat1f visibility(const DepthImage& depth, double radius_m = 0.5) { return ao(depth, radius_m).visibility; }

    void TearDown() override {
        for (const std::string& message : device().validation_messages())
            ADD_FAILURE() << message;
    }
};

std::string name_of(const testing::TestParamInfo<Case>& info) {
    return info.param.method + "_" + info.param.quality + (info.param.downsampled ? "_downsampled" : "");
}

/// Lowest visibility at least `border` pixels from the rim.
double lowest_inside(const cv::Mat1f& v, int border) {
    double low = 0, high = 0;
    const cv::Mat1f inner = v(cv::Rect(border, border, v.cols - 2 * border, v.rows - 2 * border)).clone();
    cv::minMaxLoc(inner, &low, &high, nullptr, nullptr,
                  inner == inner); // NOLINT(misc-redundant-expression): false for NaN, which is no surface
    return low;
}

TEST_P(Laws, a_plane_is_open_at_any_tilt) {
    // Nothing rises above a plane, so nothing occludes it; depth steps and mips must not pretend otherwise.
    const Pinhole camera = test_camera({320, 240});
    for (const double tilt : {0.0, 45.0, 80.0})
        EXPECT_GE(lowest_inside(visibility(tilted_plane(camera, tilt)), 8), 0.98) << tilt << " degrees";
}

TEST_P(Laws, a_plane_stays_open_from_near_to_far) {
    const Pinhole camera = test_camera({320, 240});
    for (const double z : {0.3, 1.0, 10.0, 100.0})
        EXPECT_GE(lowest_inside(visibility(tilted_plane(camera, z < 50 ? 80.0 : 60.0, z)), 8), 0.98) << z << " m";
}

TEST_P(Laws, values_stay_between_closed_and_open) {
    for (const DepthImage& depth : {ball_on_floor(test_camera()), wall_corner(test_camera())}) {
        const cv::Mat1f v = visibility(depth);
        EXPECT_EQ(v.size(), depth.z_m.size());
        EXPECT_TRUE(cv::checkRange(v, true, nullptr, 0.0, 1.0 + 1e-6));
    }
}

TEST_P(Laws, holes_stay_holes_and_surfaces_get_values) {
    const DepthImage depth = with_holes(ball_on_floor(test_camera()), 0.15);
    const cv::Mat1f v = visibility(depth);
    for (int y = 0; y < v.rows; ++y)
        for (int x = 0; x < v.cols; ++x)
            ASSERT_EQ(std::isnan(v(y, x)), depth.z_m(y, x) == 0) << x << ", " << y;
}

TEST_P(Laws, holes_neither_darken_nor_brighten_their_neighbours) {
    // A plane with holes is still open. Removing random pixels must not shift the mean of a corner.
    const Pinhole camera = test_camera({320, 240});
    EXPECT_GE(lowest_inside(visibility(with_holes(tilted_plane(camera, 30), 0.1)), 0), 0.98);
    const DepthImage corner = wall_corner(camera), punched = with_holes(corner, 0.1);
    const cv::Mat1f whole = visibility(corner), rest = visibility(punched);
    const cv::Mat known = punched.z_m > 0;
    EXPECT_NEAR(cv::mean(whole, known)[0], cv::mean(rest, known)[0], 0.02);
}

TEST_P(Laws, a_corner_darkens_towards_its_edge) {
    const Pinhole camera = test_camera({320, 240});
    const DepthImage corner = wall_corner(camera);
    const cv::Mat1f v = visibility(corner);
    // Mean of each column; the edge of the corner is the deepest column.
    const int edge = cvRound(camera.cx);
    std::vector<double> columns;
    for (int x = edge; x < v.cols - 8; ++x)
        columns.push_back(cv::mean(v(cv::Rect(x, 60, 1, 120)))[0]);
    EXPECT_LT(columns.front(), 0.8);
    EXPECT_GT(columns.back(), columns.front() + 0.1);
    // Monotonic but for the pattern's noise: no column darker than one nearer the edge by more than 0.03.
    // Voxels lose contact nearer than one of them: the edge itself is lighter than what is next to it.
    const double tolerance = GetParam().method == "vxao" ? 0.06 : 0.03;
    double lightest = 0;
    for (double column : columns) {
        EXPECT_GE(column, lightest - tolerance);
        lightest = std::max(lightest, column);
    }
}

TEST_P(Laws, size_is_a_matter_of_units) {
    // Doubling the scene and the radius together changes nothing that matters.
    DepthImage depth = ball_on_floor(test_camera());
    const cv::Mat1f small = visibility(depth, 0.4);
    depth.z_m *= 2;
    const cv::Mat1f large = visibility(depth, 0.8);
    cv::Mat difference;
    cv::absdiff(small, large, difference);
    EXPECT_LT(cv::mean(difference, small == small)[0], 0.004);
}

TEST_P(Laws, same_input_same_bytes) {
    const DepthImage depth = with_holes(ball_on_floor(test_camera()), 0.05);
    const cv::Mat1f one = visibility(depth), two = make(0.5)->compute({depth}).visibility;
    EXPECT_EQ(0, std::memcmp(one.data, two.data, one.total() * 4));
}

TEST_P(Laws, any_size_works) {
    for (const cv::Size size :
         {cv::Size(1, 1), cv::Size(1, 7), cv::Size(9, 1), cv::Size(3, 2), cv::Size(37, 23), cv::Size(161, 119)}) {
        const DepthImage depth = tilted_plane(test_camera(size), 10);
        const cv::Mat1f v = visibility(depth);
        for (int y = 0; y < v.rows; ++y)
            for (int x = 0; x < v.cols; ++x)
                ASSERT_GE(v(y, x), 0.9) << size << " at " << x << ", " << y;
    }
}

TEST_P(Laws, normals_of_the_surface_may_be_brought_along) {
    // A plane with its own normals is as open as with derived ones, also where some are missing.
    const DepthImage depth = tilted_plane(test_camera(), 40);
    const auto s = static_cast<float>(std::sin(40 * CV_PI / 180)), c = static_cast<float>(std::cos(40 * CV_PI / 180));
    NormalImage normals{cv::Mat3f(depth.z_m.size(), cv::Vec3f(s, 0, -c))};
    normals.normals(cv::Rect(60, 40, 9, 9)) = cv::Vec3f();
    EXPECT_GE(lowest_inside(make(0.5)->compute({{depth, normals}}).visibility, 8), 0.98);
}

TEST_P(Laws, an_image_of_holes_is_a_result) {
    DepthImage depth{test_camera(), cv::Mat1f(120, 160, 0.0F), {}};
    EXPECT_EQ(cv::countNonZero(visibility(depth) == 0), 0);
    EXPECT_EQ(cv::countNonZero(visibility(depth) > 0), 0) << "all NaN";
}

INSTANTIATE_TEST_SUITE_P(methods, Laws, testing::ValuesIn(cases()), name_of);

} // namespace
} // namespace scanshade
