#include "tests/bench/judge.h"

#include <cmath>
#include <cstring>
#include <fmt/format.h>

namespace scanshade::hard_cases {
namespace {

bool is_depth(float z) { return std::isfinite(z) && z > 1e-4F; }

Score score_of(const Case& one, const cv::Mat1f& found, const cv::Mat1f& again, const cv::Mat1f& expected) {
    Score score;
    score.differs = std::memcmp(found.data, again.data, found.total() * 4) != 0;
    const bool line = std::min(found.rows, found.cols) < 2;
    for (int v = 0; v < found.rows; ++v)
        for (int u = 0; u < found.cols; ++u) {
            const float value = found(v, u);
            const bool surface = is_depth(one.depth.z_m(v, u));
            // Without a neighbour there is no normal, and a flying pixel is on no surface: NaN is right there.
            const bool may_be_unknown = !surface || line || one.noise.any();
            score.wrong += std::isnan(value) ? !may_be_unknown : !surface || value < 0 || value > 1;
            if (std::isnan(value))
                continue;
            score.sum += value, score.least = std::min<double>(score.least, value), ++score.values;
            if (expected.empty() || std::isnan(expected(v, u)))
                continue;
            const double error = static_cast<double>(value) - expected(v, u);
            score.squares += error * error, score.worst = std::max(score.worst, std::abs(error)), ++score.pixels;
        }
    return score;
}

/// The limits that a case misses; empty where it keeps all.
std::string missed(const Gate& gate, const Score& score, bool expects) {
    std::string why;
    if (gate.rmse && score.rmse() > *gate.rmse)
        why += fmt::format(" rmse {:.4f} > {:.4f}", score.rmse(), *gate.rmse);
    if (expects && gate.mean && score.mean() < *gate.mean)
        why += fmt::format(" mean {:.3f} < {}", score.mean(), *gate.mean);
    if (expects && gate.least && score.least < *gate.least)
        why += fmt::format(" least {:.3f} < {}", score.least, *gate.least);
    if (score.wrong > 0)
        why += fmt::format(" {} pixels NaN or out of range", score.wrong);
    if (score.differs)
        why += " the second run differs";
    return why;
}

} // namespace

double Score::rmse() const { return pixels > 0 ? std::sqrt(squares / static_cast<double>(pixels)) : 0; }
double Score::mean() const { return values > 0 ? sum / static_cast<double>(values) : 1; }

void Score::add(const Score& other) {
    squares += other.squares, sum += other.sum, worst = std::max(worst, other.worst),
                                                least = std::min(least, other.least);
    pixels += other.pixels, values += other.values, wrong += other.wrong;
}

cv::Mat1f Subject::visibility(const Case& one) {
    if (!method_ || one.radius_m != radius_m_) {
        const auto setup = row_.setup();
        const std::vector<Parameter> rows = setup->parameters();
        set(*row_named(rows, "radius"), fmt::format("{}", one.radius_m));
        method_ = std::make_unique<FrameAo>(device_, row_, *setup);
        radius_m_ = one.radius_m;
    }
    return method_->compute(one.depth, one.noise).visibility;
}

void Subject::judge(const Family& family, const std::function<void(const Verdict&)>& use) {
    const auto count = [&](const Case& one, const cv::Mat1f& expected) {
        const cv::Mat1f found = visibility(one);
        const Score score = score_of(one, found, visibility(one), expected);
        use({one, expected, found, score, missed(family.gate, score, !expected.empty())});
    };
    if (family.cases)
        for (const Case& one : family.cases())
            count(one, one.expected);
    else
        for (const auto& [whole, one] : family.pairs())
            count(one, visibility(whole));
}

} // namespace scanshade::hard_cases
