// hard_cases: every method over what recorded depth has that rendered depth has not.
//   hard_cases [--methods cacao,surfel] [--only TEXT] [--cases] [--write FOLDER] [--device NAME]
//   hard_cases --normals     how true normals and edges are, of each simulated sensor
// Prints a table per method: difference to the expected answer, worst pixel, pixels that are NaN without reason or
// outside 0 .. 1, cases whose second run gave other bytes. --write draws each case: depth, what was expected, what came
// out, their difference. Exit 0 all gates kept, 1 some missed.
#include "tests/hard_cases/cases.h"
#include "tests/hard_cases/normals.h"

#include "ao/frame.h"
#include "ao/gpu/device.h"
#include "ao/method.h"
#include "apps/method_settings.h"
#include "apps/picture.h"
#include "io/images/image_file.h"
#include "projection/error.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstring>
#include <fmt/format.h>

using namespace scanshade;
using namespace scanshade::hard_cases;

namespace {

/// What came out of one case, or of all cases of a family.
struct Score {
    double squares = 0, worst = 0, sum = 0, least = 1;
    std::size_t pixels = 0, values = 0, wrong = 0;
    bool differs = false;

    [[nodiscard]] double rmse() const { return pixels > 0 ? std::sqrt(squares / static_cast<double>(pixels)) : 0; }
    [[nodiscard]] double mean() const { return values > 0 ? sum / static_cast<double>(values) : 1; }
    void add(const Score& other) {
        squares += other.squares, worst = std::max(worst, other.worst), sum += other.sum,
                                  least = std::min(least, other.least);
        pixels += other.pixels, values += other.values, wrong += other.wrong;
    }
};

bool is_depth(float z) { return std::isfinite(z) && z > 1e-4F; }

class Subject {
  public:
    Subject(gpu::Device& device, const MethodRow& row) : device_(device), row_(row) {}

    cv::Mat1f visibility(const Case& one) {
        if (!method_ || one.radius_m != radius_m_) {
            const auto setup = row_.setup();
            const std::vector<Parameter> rows = setup->parameters();
            set(*row_named(rows, "radius"), fmt::format("{}", one.radius_m));
            method_ = std::make_unique<FrameAo>(device_, row_, *setup);
            radius_m_ = one.radius_m;
        }
        return method_->compute(one.depth, one.noise).visibility;
    }

  private:
    gpu::Device& device_;
    const MethodRow& row_;
    std::unique_ptr<FrameAo> method_;
    double radius_m_ = 0;
};

Score judge(const Case& one, const cv::Mat1f& found, const cv::Mat1f& again, const cv::Mat1f& expected) {
    Score score;
    score.differs = std::memcmp(found.data, again.data, found.total() * 4) != 0;
    const bool line = std::min(found.rows, found.cols) < 2;
    for (int v = 0; v < found.rows; ++v)
        for (int u = 0; u < found.cols; ++u) {
            const float value = found(v, u);
            const bool surface = is_depth(one.depth.z_m(v, u));
            // Without a neighbour there is no normal, and a flying pixel is nobody's: then NaN is an answer.
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

/// What the gate says of a case, or nothing.
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
        why += " another answer the second time";
    return why;
}

void draw(const std::filesystem::path& file, const Case& one, const cv::Mat1f& expected, const cv::Mat1f& found) {
    std::vector<Tile> tiles{{"depth", depth_picture(one.depth.z_m)}, {"found", visibility_picture(found)}};
    if (!expected.empty()) {
        tiles.push_back({"expected", visibility_picture(expected)});
        tiles.push_back(
            {"found - expected, blue -0.3 .. red +0.3", difference_picture(cv::Mat1f(found - expected), 0.3)});
    }
    write_picture(file, panel(tiles));
}

} // namespace

int main(int argc, char** argv) {
    std::vector<std::string> names{"cacao", "surfel"};
    std::string only, device_name, folder;
    bool each = false, normals = false;
    CLI::App app{"Every method over the hard cases"};
    app.add_option("--methods", names, "which methods")->delimiter(',');
    app.add_option("--only", only, "families whose name holds this");
    app.add_flag("--cases", each, "a line for each case, too");
    app.add_flag("--normals", normals, "angles between normals and truth instead");
    app.add_option("--write", folder, "draw every case into this folder");
    app.add_option("--device", device_name, "index or part of the name of a Vulkan device");
    CLI11_PARSE(app, argc, argv);
    try {
        gpu::Device device(device_name);
        std::string misses;
        if (normals) {
            misses = print_normals(device);
            names.clear();
        }
        for (const std::string& name : names) {
            Subject subject(device, method_named(name));
            fmt::print("\n{} on {}\n\n| family | cases | RMSE | worst pixel | mean | least | NaN or out of range | "
                       "runs differ | gates |\n"
                       "|---|---|---|---|---|---|---|---|---|\n",
                       name, device.info().name);
            for (const Family& family : families()) {
                if (family.name.find(only) == std::string::npos)
                    continue;
                Score all;
                int cases = 0, differ = 0, failed = 0;
                const auto count = [&](const Case& one, const cv::Mat1f& expected) {
                    const cv::Mat1f found = subject.visibility(one);
                    const Score score = judge(one, found, subject.visibility(one), expected);
                    if (!folder.empty())
                        draw(std::filesystem::path(folder) / fmt::format("{}, {}, {}.png", name, family.name, one.name),
                             one, expected, found);
                    const std::string why = missed(family.gate, score, !expected.empty());
                    if (each)
                        fmt::print("  {}: {}: rmse {:.4f} worst {:.3f} mean {:.3f} least {:.3f}{}\n", family.name,
                                   one.name, score.rmse(), score.worst, score.mean(), score.least, why);
                    if (!why.empty())
                        misses += fmt::format("{}: {}: {}:{}\n", name, family.name, one.name, why);
                    all.add(score), ++cases, differ += score.differs, failed += !why.empty();
                };
                if (family.cases)
                    for (const Case& one : family.cases())
                        count(one, one.expected);
                else
                    for (const auto& [whole, one] : family.pairs())
                        count(one, subject.visibility(whole));
                fmt::print("| {} | {} | {:.4f} | {:.3f} | {:.3f} | {:.3f} | {} | {} | {} |\n", family.name, cases,
                           all.rmse(), all.worst, all.mean(), all.least, all.wrong, differ,
                           failed == 0 ? "kept" : fmt::format("{} missed", failed));
                std::fflush(stdout);
            }
        }
        for (const std::string& message : device.validation_messages())
            misses += message + "\n";
        fmt::print("\n{}", misses.empty() ? "every gate kept\n" : "missed:\n" + misses);
        return misses.empty() ? 0 : 1;
    } catch (const std::exception& failure) {
        fmt::print(stderr, "{}\n", failure.what());
        return 2;
    }
}
