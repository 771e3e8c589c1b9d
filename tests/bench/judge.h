// A method over hard cases: its errors, and the gates that it misses.
#pragma once

#include "ao/frame.h"
#include "tests/bench/cases.h"

#include <functional>
#include <memory>
#include <string>

namespace scanshade::hard_cases {

/// The result of one case, or of all cases of a family.
struct Score {
    double squares = 0, worst = 0, sum = 0, least = 1;
    std::size_t pixels = 0, values = 0;
    std::size_t wrong = 0; ///< pixels that are NaN without reason, or outside 0 .. 1
    bool differs = false;  ///< the second run gave other bytes

    [[nodiscard]] double rmse() const;
    [[nodiscard]] double mean() const;
    void add(const Score& other);
};

/// One case, judged.
struct Verdict {
    const Case& looked_at;
    const cv::Mat1f &expected, &found; ///< expected may be empty (cases.h)
    Score score;
    std::string missed; ///< the limits missed, each with its number; empty where all were kept
};

/// A method at its default settings, with the radius of each case.
class Subject {
  public:
    /// Keeps references to both.
    Subject(gpu::Device& device, const MethodRow& row) : device_(device), row_(row) {}

    /// Runs each case of the family twice; `use` sees the verdicts one by one.
    void judge(const Family& family, const std::function<void(const Verdict&)>& use);

  private:
    [[nodiscard]] cv::Mat1f visibility(const Case& one);

    gpu::Device& device_;
    const MethodRow& row_;
    std::unique_ptr<FrameAo> method_;
    double radius_m_ = 0;
};

} // namespace scanshade::hard_cases
