// What tests of boards share: the camera in front of which they are held, and the corners that OpenCV finds.
#pragma once

#include "projection/camera.h"

#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace scanshade::tests {

inline const cv::Size image{640, 480};
inline const Camera plain{{525, 525, 319.5, 239.5, image}, {}, "plain"};

/// OpenCV's corners with one window for all, 11x11 pixels.
inline std::vector<cv::Point2d> opencv_corners(const cv::Mat3b& picture, int half = 5) {
    cv::Mat1b grey;
    cv::cvtColor(picture, grey, cv::COLOR_BGR2GRAY);
    std::vector<cv::Point2f> corners;
    EXPECT_TRUE(cv::findChessboardCorners(grey, {9, 6}, corners));
    cv::cornerSubPix(grey, corners, {half, half}, {-1, -1},
                     {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 30, 1e-3});
    return {corners.begin(), corners.end()};
}

} // namespace scanshade::tests
