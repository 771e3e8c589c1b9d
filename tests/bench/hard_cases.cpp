// `developers_bench hard-cases` and `normals`: methods on the holes, noise and edges of recorded depth.
#include "apps/lists.h"
#include "apps/picture.h"
#include "io/images/image_file.h"
#include "tests/bench/judge.h"
#include "tests/bench/normal_errors.h"
#include "tests/bench/part.h"

#include <fmt/format.h>

namespace scanshade::bench {
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

class HardCasesPart final : public Part {
    std::vector<Parameter> rows() override {
        return {{"methods", "which methods, with commas", &methods_},
                {"only", "only families of cases whose name contains this", &only_},
                {"each", "gives each case a row, too", &each_},
                {"draw", "folder for a picture of each case: depth, expected, found, difference", &folder_}};
    }

    int measure(const std::string& choice) override {
        const std::vector<std::string> methods = comma_separated(methods_);
        gpu::Device device(choice);
        std::string misses;
        for (const std::string& name : methods) {
            fmt::print("\n{} on {}\n", name, device.info().name);
            Table table({"family", "cases", "RMSE", "worst pixel", "mean", "least", "NaN or out of range",
                         "runs differ", "gates"});
            Subject subject(device, method_named(name));
            for (const Family& family : families())
                if (family.name.find(only_) != std::string::npos)
                    misses += row(table, subject, name, family);
        }
        return conclude(device, misses);
    }

    /// Prints the family's row; returns what missed its gate, a line each.
    std::string row(Table& table, Subject& subject, const std::string& method, const Family& family) const {
        Score all;
        int cases = 0, differ = 0, failed = 0;
        std::string misses;
        subject.judge(family, [&](const Verdict& of) {
            const Score& score = of.score;
            const std::string& name = of.looked_at.name;
            if (!folder_.empty())
                draw(fs::path(folder_) / fmt::format("{}, {}, {}.png", method, family.name, name), of);
            if (each_)
                table.row(cells(family.name + ": " + name, 1, score, score.differs, of.missed));
            if (!of.missed.empty())
                misses += fmt::format("{}: {}: {}:{}\n", method, family.name, name, of.missed);
            all.add(score), ++cases, differ += score.differs, failed += !of.missed.empty();
        });
        table.row(cells(family.name, cases, all, differ, failed == 0 ? "kept" : fmt::format("{} missed", failed)));
        return misses;
    }

    static std::vector<std::string> cells(const std::string& name, int cases, const Score& of, int differ,
                                          const std::string& gates) {
        return {name,
                fmt::format("{}", cases),
                fmt::format("{:.4f}", of.rmse()),
                fmt::format("{:.3f}", of.worst),
                fmt::format("{:.3f}", of.mean()),
                fmt::format("{:.3f}", of.least),
                fmt::format("{}", of.wrong),
                fmt::format("{}", differ),
                gates};
    }

    bool each_ = false;
    std::string methods_ = "cacao,surfel", only_, folder_;
};

class NormalsPart final : public Part {
    std::vector<Parameter> rows() override { return {}; }

    int measure(const std::string& choice) override {
        gpu::Device device(choice);
        Table table({"sensor", "pixels with a normal, %", "median, degrees", "95 %", "median at 1 .. 3 m", "95 %",
                     "edges within 1 px, %"});
        std::string misses;
        for (const NormalCase& which : normal_cases()) {
            const NormalErrors of = normal_errors(device, which);
            table.row({which.name, fmt::format("{:.1f}", 100 * of.share_with_normal),
                       fmt::format("{:.2f}", of.all.median), fmt::format("{:.1f}", of.all.percentile_95),
                       fmt::format("{:.2f}", of.near.median), fmt::format("{:.1f}", of.near.percentile_95),
                       fmt::format("{:.1f}", 100 * of.edges_kept)});
            if (!(of.near.median <= which.aim))
                misses +=
                    fmt::format("normals, {}: median {:.2f} > {} degrees\n", which.name, of.near.median, which.aim);
        }
        return conclude(device, misses);
    }
};

} // namespace

std::unique_ptr<Command> hard_cases_part() { return std::make_unique<HardCasesPart>(); }
std::unique_ptr<Command> normals_part() { return std::make_unique<NormalsPart>(); }

} // namespace scanshade::bench
