// Frames as comments of a PLY file: exact where the points are still those, else not believed, and why.
#include "io/clouds/recorded_frames.h"

#include "io/clouds/cloud_file.h"
#include "io/text.h"
#include "tests/support/files.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <gtest/gtest.h>
#include <numbers>

namespace scanshade {
namespace {

using Eigen::Isometry3d, Eigen::Vector3d;

constexpr std::size_t points_of_frame = 400;

/// Three frames that look round from 1/3, 2/3 and 1 m beside the origin, at a wavy wall.
struct Recorded {
    std::vector<FoundFrame> frames;
    std::vector<Vector3d> points;

    Recorded() {
        for (int i = 1; i <= 3; ++i) {
            FoundFrame frame{{525.0 / i, 524.7, 319.5, 239.1, {640, 480}}};
            frame.world_from_camera.translation() = Vector3d(i / 3.0, 0.1, -0.2 * i);
            frame.world_from_camera.linear() =
                Eigen::AngleAxisd(0.3 * i, Vector3d(1, 2, 0.5).normalized()).toRotationMatrix();
            frame.first = points.size();
            for (std::size_t k = 0; k < points_of_frame; ++k) {
                const double u = 20.0 * static_cast<double>(k % 20), v = 15.0 * static_cast<double>(k) / 20;
                points.push_back(frame.world_from_camera * frame.camera.point(u, v, 2 + 0.3 * std::sin(0.1 * u)));
            }
            frame.last = points.size();
            frames.push_back(frame);
        }
    }
};

class RecordedFrames : public testing::Test {
  protected:
    /// What the file says of its frames, with other points and comments, or its own.
    std::vector<FoundFrame> read(const std::vector<Vector3d>& points, const std::vector<std::string>& comments) {
        warnings.clear();
        write_new_ply(folder / "all.ply", points, {}, {}, comments);
        return recorded_frames(read_cloud(folder / "all.ply", warnings), warnings);
    }
    void expect_doubt(const std::vector<Vector3d>& points, const std::vector<std::string>& comments,
                      const std::string& words) {
        EXPECT_TRUE(read(points, comments).empty()) << words;
        ASSERT_EQ(warnings.size(), 1U) << words;
        EXPECT_NE(warnings[0].find("comments on its depth frames are not believed"), std::string::npos) << warnings[0];
        EXPECT_NE(warnings[0].find(words), std::string::npos) << warnings[0];
    }

    tests::TemporaryFolder folder;
    std::vector<std::string> warnings;
    const Recorded made;
    const std::vector<std::string> comments = frame_comments(made.frames, made.points);
};

TEST_F(RecordedFrames, are_read_as_they_were_written) {
    const std::vector<FoundFrame> found = read(made.points, comments);
    EXPECT_TRUE(warnings.empty());
    ASSERT_EQ(found.size(), 3U);
    for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_EQ(found[i].camera, made.frames[i].camera);
        EXPECT_EQ(found[i].world_from_camera.matrix(), made.frames[i].world_from_camera.matrix());
        EXPECT_EQ(found[i].first, made.frames[i].first);
        EXPECT_EQ(found[i].last, made.frames[i].last);
    }
    std::vector<std::string> others = comments;
    others.insert(others.begin() + 1, "one cloud of 3 frames");
    EXPECT_EQ(read(made.points, others).size(), 3U);
    EXPECT_TRUE(read(made.points, {"one cloud of 3 frames", "scanshade"}).empty());
    EXPECT_TRUE(warnings.empty()) << "a file that names no frames";
}

TEST_F(RecordedFrames, hold_of_rounded_points_and_those_without_coordinates) {
    std::vector<Vector3d> rounded = made.points;
    for (Vector3d& point : rounded)
        point = (point * 1000).array().round().matrix() / 1000;
    EXPECT_EQ(read(rounded, comments).size(), 3U);
    std::vector<Vector3d> holes = made.points;
    holes[7] = Vector3d::Constant(NAN);
    EXPECT_EQ(read(holes, frame_comments(made.frames, holes)).size(), 3U);
}

TEST_F(RecordedFrames, are_not_those_of_edited_points) {
    std::vector<Vector3d> fewer(made.points.begin(), made.points.end() - 1),
        shuffled = made.points, moved = made.points, turned = made.points, scaled = made.points;
    expect_doubt(fewer, comments, "written for 1200 points, and there are 1199");
    std::ranges::reverse(shuffled);
    expect_doubt(shuffled, comments, "the points of frame 1 are no longer where they were");
    for (std::size_t i = 0; i < moved.size(); ++i) {
        moved[i].y() += 0.002;
        turned[i] = Eigen::AngleAxisd(0.05 * std::numbers::pi / 180, Vector3d::UnitZ()) * turned[i];
        scaled[i] *= 1000;
    }
    expect_doubt(moved, comments, "frame 1 are no longer where they were: off by 0.");
    expect_doubt(turned, comments, "no longer where they were");
    expect_doubt(scaled, comments, "no longer where they were");
}

TEST_F(RecordedFrames, that_are_damaged_are_named) {
    const auto with = [&](std::size_t comment, std::size_t word, const std::string& value) {
        std::vector<std::string> damaged = comments;
        std::string text;
        std::size_t number = 0;
        for (const std::string_view each : words(comments[comment]))
            text += (number++ == word ? value : std::string(each)) + " ";
        damaged[comment] = text;
        return damaged;
    };
    // Words of a frame: scanshade frame FIRST LAST fx fy cx cy width height, twelve of the pose, three of the check.
    expect_doubt(made.points, with(0, 2, "2:"), "line 3 is not of version 1");
    expect_doubt(made.points, with(0, 3, "4"), "there are 3 frames, expected 4");
    expect_doubt(made.points, with(1, 4, "wide"), "line 4: \"wide\", expected a number");
    expect_doubt(made.points, with(1, 4, "-525"), "line 4: its camera has no size or no focal length");
    expect_doubt(made.points, with(1, 8, "640.5"), "line 4: \"640.5\", expected a whole number");
    expect_doubt(made.points, with(1, 6, "nan"), "line 4: \"nan\", expected a number");
    expect_doubt(made.points, with(1, 10, "0.5"), "line 4: its pose is no rotation");
    expect_doubt(made.points, with(1, 3, "390"), "line 5: its points do not begin where those before end");
    expect_doubt(made.points, with(2, 3, "99999"), "line 5: \"99999\", expected a whole number up to 1200");
    expect_doubt(made.points, with(3, 2, "1300"), "line 6: \"1300\", expected a whole number up to 1200");
    expect_doubt(made.points, with(3, 4, ""), "line 6: 22 numbers, expected 23");
    expect_doubt(made.points, with(1, 13, "0.34"), "the points of frame 1 are no longer where they were");
    std::vector<std::string> without_first(comments.begin() + 1, comments.end()), without_last = comments;
    expect_doubt(made.points, without_first, "there are 3 frames, expected 0");
    without_last.pop_back();
    expect_doubt(made.points, without_last, "there are 2 frames, expected 3");
}

TEST_F(RecordedFrames, of_few_points_tell_too_little) {
    std::vector<FoundFrame> single;
    for (std::size_t i = 0; i < 30; ++i)
        single.push_back({made.frames[0].camera, made.frames[0].world_from_camera, i, i + 1});
    const std::vector<Vector3d> points(made.points.begin(), made.points.begin() + 30);
    expect_doubt(points, frame_comments(single, points), "too few points a frame");
}

TEST_F(RecordedFrames, too_many_for_a_header_are_left_out) {
    std::vector<FoundFrame> many;
    for (std::size_t i = 0; i < 4000; ++i)
        many.push_back({made.frames[0].camera, made.frames[0].world_from_camera, 0, 0});
    many.back().last = made.points.size();
    const std::vector<std::string> short_one = frame_comments(many, made.points);
    ASSERT_EQ(short_one.size(), 1U);
    EXPECT_NE(short_one[0].find("4000 frames are left out"), std::string::npos) << short_one[0];
    EXPECT_TRUE(read(made.points, short_one).empty());
    EXPECT_TRUE(warnings.empty());
}

} // namespace
} // namespace scanshade
