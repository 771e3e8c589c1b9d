// `bench --hard-cases` and `bench --normals`: methods on the holes, noise and edges of recorded depth.
#include "apps/lists.h"
#include "apps/measure/parts/hard_cases/judge.h"
#include "apps/measure/parts/normal_errors.h"
#include "apps/measure/trials/bench_part.h"
#include "apps/picture.h"
#include "io/images/image_file.h"

#include <fmt/format.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace hard_cases;

/// Prints which gates were missed, and returns the exit code.
int conclude(const gpu::Device& device, std::string misses) {
    for (const std::string& message : device.validation_messages())
        misses += message + "\n";
    fmt::print("\n{}", misses.empty() ? "every gate kept\n" : "missed:\n" + misses);
    return misses.empty() ? all_well : some_failed;
}

void draw(const fs::path& file, const Verdict& of) {
    std::vector<Tile> tiles{{"depth", depth_picture(of.looked_at.depth.z_m)}, {"found", visibility_picture(of.found)}};
    if (!of.expected.empty()) {
        tiles.push_back({"expected", visibility_picture(of.expected)});
        tiles.push_back(
            {"found - expected, blue -0.3 .. red +0.3", difference_picture(cv::Mat1f(of.found - of.expected), 0.3)});
    }
    write_picture(file, panel(tiles));
}

class HardCasesPart final : public BenchPart {
  public:
    Stage stage() override {
        return {
            "hard cases of recorded depth",
            {{"hard-cases", "tests methods on holes, noise, steps, odd sizes and units; exit 2 where a gate is missed",
              &asked_},
             {"hard-cases.methods", "which methods, with commas", &methods_},
             {"hard-cases.only", "only families of cases whose name contains this", &only_},
             {"hard-cases.each", "prints a line for each case, too", &each_},
             {"hard-cases.draw", "folder for a picture of each case: depth, expected, found, difference", &folder_}}};
    }
    [[nodiscard]] bool asked() const override { return asked_; }

    int run(const std::string& choice) override {
        const std::vector<std::string> methods = comma_separated(methods_);
        gpu::Device device(choice);
        std::string misses;
        for (const std::string& name : methods) {
            fmt::print("\n{} on {}\n\n| family | cases | RMSE | worst pixel | mean | least | NaN or out of range | "
                       "runs differ | gates |\n"
                       "|---|---|---|---|---|---|---|---|---|\n",
                       name, device.info().name);
            Subject subject(device, method_named(name));
            for (const Family& family : families())
                if (family.name.find(only_) != std::string::npos)
                    misses += row(subject, name, family);
        }
        return conclude(device, misses);
    }

  private:
    /// Prints the family's row; returns what missed its gate, a line each.
    std::string row(Subject& subject, const std::string& method, const Family& family) const {
        Score all;
        int cases = 0, differ = 0, failed = 0;
        std::string misses;
        subject.judge(family, [&](const Verdict& of) {
            const Score& score = of.score;
            const std::string& name = of.looked_at.name;
            if (!folder_.empty())
                draw(fs::path(folder_) / fmt::format("{}, {}, {}.png", method, family.name, name), of);
            if (each_)
                fmt::print("  {}: {}: rmse {:.4f} worst {:.3f} mean {:.3f} least {:.3f}{}\n", family.name, name,
                           score.rmse(), score.worst, score.mean(), score.least, of.missed);
            if (!of.missed.empty())
                misses += fmt::format("{}: {}: {}:{}\n", method, family.name, name, of.missed);
            all.add(score), ++cases, differ += score.differs, failed += !of.missed.empty();
        });
        fmt::print("| {} | {} | {:.4f} | {:.3f} | {:.3f} | {:.3f} | {} | {} | {} |\n", family.name, cases, all.rmse(),
                   all.worst, all.mean(), all.least, all.wrong, differ,
                   failed == 0 ? "kept" : fmt::format("{} missed", failed));
        std::fflush(stdout);
        return misses;
    }

    bool asked_ = false, each_ = false;
    std::string methods_ = "cacao,surfel", only_, folder_;
};

class NormalsPart final : public BenchPart {
  public:
    Stage stage() override {
        return {
            "normals of recorded depth",
            {{"normals", "measures degrees between normals and truth for each sensor; exit 2 where an aim is missed",
              &asked_}}};
    }
    [[nodiscard]] bool asked() const override { return asked_; }

    int run(const std::string& choice) override {
        gpu::Device device(choice);
        fmt::print("\n| sensor | pixels with a normal, % | median, degrees | 95 % | median at 1 .. 3 m | 95 % | edges "
                   "within 1 px, % |\n"
                   "|---|---|---|---|---|---|---|\n");
        std::string misses;
        for (const NormalCase& which : normal_cases()) {
            const NormalErrors of = normal_errors(device, which);
            fmt::print("| {} | {:.1f} | {:.2f} | {:.1f} | {:.2f} | {:.1f} | {:.1f} |\n", which.name,
                       100 * of.share_with_normal, of.all.median, of.all.percentile_95, of.near.median,
                       of.near.percentile_95, 100 * of.edges_kept);
            if (!(of.near.median <= which.aim))
                misses +=
                    fmt::format("normals, {}: median {:.2f} > {} degrees\n", which.name, of.near.median, which.aim);
        }
        return conclude(device, misses);
    }

  private:
    bool asked_ = false;
};

} // namespace

std::unique_ptr<BenchPart> hard_cases_kept() { return std::make_unique<HardCasesPart>(); }
std::unique_ptr<BenchPart> normals_kept() { return std::make_unique<NormalsPart>(); }

} // namespace scanshade
