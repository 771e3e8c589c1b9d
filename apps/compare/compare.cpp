// `scanshade compare`: how far the maps of one run are from those of another, or from truth, as numbers and pictures.
#include "ao/compare.h"
#include "apps/command.h"
#include "apps/compare/error_classes.h"
#include "apps/compare/error_figures.h"
#include "apps/compare/map_set.h"
#include "apps/csv.h"
#include "apps/json.h"
#include "apps/page/preview.h"
#include "apps/page/run_page.h"
#include "apps/picture.h"
#include "apps/walk/progress.h"
#include "io/clouds/cloud_file.h"
#include "io/clouds/format.h"
#include "io/images/image_file.h"
#include "io/output_file.h"
#include "projection/base/error.h"

#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

namespace fs = std::filesystem;

/// The result of one pair of maps.
struct Row {
    std::string name;
    Difference difference;
    std::string why; ///< empty unless it failed
};

/// A map, or a cloud's field ambient_occlusion as one row.
cv::Mat1f values_of(const fs::path& file) {
    if (!has_cloud_extension(file))
        return read_ao(file);
    std::vector<std::string> warnings;
    const std::vector<float> values = recorded_field(read_cloud(file, warnings), "ambient_occlusion", file);
    return cv::Mat1f(values, true).reshape(0, 1);
}

class Compare final : public Command {
  public:
    Words words() override {
        return {"PATH",
                "A and B: results of runs, folders of maps, maps, or clouds with the field ambient_occlusion. B may be "
                "a generated capture: its truth is taken",
                &paths_, 1, 2};
    }

    std::vector<Stage> stages() override {
        return {{"input",
                 {{.name = "truth",
                   .help = "compares A with the truth of the generated capture that A was made from",
                   .value = &truth_}}},
                {"output",
                 {{.name = "out",
                   .help = "folder for difference/NAME.png, compare.csv, compare.json and a page of them, index.html",
                   .value = &out_,
                   .writes = Writes::folder},
                  {.name = "scale",
                   .help = "the difference that is shown in full blue (A too dark) or full red (A too bright)",
                   .value = &scale_,
                   .low = 1e-3,
                   .high = 1},
                  {.name = "json", .help = "prints JSON instead of tables", .value = &as_json_},
                  {.name = "overwrite", .help = "replaces an earlier comparison", .value = &overwrite_}}}};
    }

    int run() override {
        if (paths_.size() == 1 && !truth_)
            throw Misuse("compare needs two PATHs, or one and --truth");
        if (!out_.empty() && fs::exists(fs::path(out_) / "compare.json") && !overwrite_)
            throw Misuse(out_ + "/compare.json exists already: --overwrite replaces it, or choose another -o");
        const MapSet a = find_maps(paths_[0]);
        const MapSet b = other_than(a);
        introduce(a, b);
        PairSums pairs;
        std::vector<Row> rows;
        for (const MapPair& pair : paired(a, b))
            rows.push_back(compared(pair, pairs, a.confidence));
        return conclude(a, b, rows, pairs);
    }

  private:
    MapSet other_than(const MapSet& a) const {
        if (paths_.size() == 1)
            return truth_of(a);
        MapSet b = find_maps(paths_[1]);
        if (truth_ && b.kind != "truth")
            throw Misuse(fmt::format("--truth: {} is no generated capture with truth/ao", paths_[1]));
        return b;
    }

    static void introduce(const MapSet& a, const MapSet& b) {
        say(fmt::format("A {} ({}), {} maps", a.path.string(), a.kind, a.files.size()));
        say(fmt::format("B {} ({}), {} maps", b.path.string(), b.kind, b.files.size()));
        if (a.radius_m && b.radius_m && std::abs(*a.radius_m - *b.radius_m) > 1e-6 * *b.radius_m)
            say(fmt::format("  warning: A was made with a radius of {:g} m, B with {:g} m: their values cannot agree",
                            *a.radius_m, *b.radius_m));
    }

    Row compared(const MapPair& pair, PairSums& pairs, const std::map<std::string, fs::path>& confidence) {
        try {
            const cv::Mat1f a = values_of(pair.a), b = values_of(pair.b);
            Row row{pair.name, during(pair.a.string() + " and " + pair.b.string(), [&] { return compare(a, b); }), {}};
            pairs.add(pair_sums(a, b));
            if (const auto map = confidence.find(pair.name); map != confidence.end() && a.rows > 1)
                by_confidence_.add(a, b, of_one_size(read_ao(map->second), a, map->second));
            if (!out_.empty() && a.rows > 1)
                write_difference(pair.name, a, b);
            return row;
        } catch (const Error& failure) {
            say(fmt::format("failed: {}", failure.what()));
            return {pair.name, {}, failure.what()};
        }
    }

    static PixelClasses of_one_size(const cv::Mat1f& confidence, const cv::Mat1f& map, const fs::path& file) {
        if (confidence.size() != map.size())
            throw Error(fmt::format("{}: {}x{} expected, as its map, found {}x{}", file.string(), map.cols, map.rows,
                                    confidence.cols, confidence.rows));
        return by_confidence(confidence);
    }

    void write_difference(const std::string& name, const cv::Mat1f& a, const cv::Mat1f& b) const {
        cv::Mat1f apart;
        cv::subtract(a, b, apart);
        write_picture(fs::path(out_) / "difference" / (name + ".png"), difference_picture(apart, scale_));
        write_atomically(fs::path(out_) / "previews" / (name + ".js"),
                         page::preview_script({.z_m = {}, .visibility = a, .reference = b}));
    }

    int conclude(const MapSet& a, const MapSet& b, const std::vector<Row>& rows, const PairSums& pairs) const {
        std::vector<Difference> good;
        for (const Row& row : rows)
            if (row.why.empty())
                good.push_back(row.difference);
        const Difference all = total(good, pairs);
        if (as_json_) {
            fmt::print("{}\n", text_of(report_json(a, b, rows, all)));
        } else {
            print_table(rows, all);
            print_confidence();
        }
        const std::size_t alone = a.files.size() + b.files.size() - 2 * rows.size();
        if (alone > 0)
            say(fmt::format("{} maps are in one of the two only", alone));
        if (!out_.empty())
            write_reports(a, b, rows, all);
        if (good.size() == rows.size())
            return all_well;
        return good.empty() ? nothing_done : some_failed;
    }

    static void print_table(const std::vector<Row>& rows, const Difference& all) {
        fmt::print("{:<24}{}\n", "image", figure_heads());
        for (const Row& row : rows)
            fmt::print("{:<24}{}\n", row.name, row.why.empty() ? figure_cells(row.difference) : "  failed");
        fmt::print("{:<24}{}\n", "all (rms over images)", figure_cells(all));
    }

    /// Shows whether values of less confidence have larger errors.
    void print_confidence() const {
        if (by_confidence_.names().empty())
            return;
        fmt::print("\n{:<24}{:>10}{:>9}\n", "A's confidence", "pixels", "RMSE");
        for (std::size_t i = 0; i < by_confidence_.names().size(); ++i)
            fmt::print("{:<24}{:>10.0f}{:>9.4f}\n", by_confidence_.names()[i], by_confidence_.pixels(i),
                       by_confidence_.rms(i));
    }

    json confidence_json() const {
        json classes = json::array();
        for (std::size_t i = 0; i < by_confidence_.names().size(); ++i)
            if (by_confidence_.pixels(i) > 0)
                classes.push_back({{"confidence", by_confidence_.names()[i]},
                                   {"pixels", by_confidence_.pixels(i)},
                                   {"rms", by_confidence_.rms(i)}});
        return classes;
    }

    json report_json(const MapSet& a, const MapSet& b, const std::vector<Row>& rows, const Difference& all) const {
        json images = json::array();
        for (const Row& row : rows)
            images.push_back(row.why.empty() ? json{{"image", row.name}, {"difference", to_json(row.difference)}}
                                             : json{{"image", row.name}, {"why", row.why}});
        return {{"a", a.path.string()}, {"b", b.path.string()},  {"b_is", b.kind},
                {"scale", scale_},      {"total", to_json(all)}, {"by_confidence", confidence_json()},
                {"images", images}};
    }

    void write_reports(const MapSet& a, const MapSet& b, const std::vector<Row>& rows, const Difference& all) const {
        std::string csv = "image," + figure_csv_heads() + ",why\n";
        for (const Row& row : rows)
            csv += csv_field(row.name) + "," + figure_csv(row.difference) + "," + csv_field(row.why) + "\n";
        write_atomically(fs::path(out_) / "compare.csv", csv);
        write_page(a, b, rows, all);
        write_atomically(fs::path(out_) / "compare.json",
                         text_of(report_json(a, b, rows, all)) + "\n"); // last: it says that the rest is there
    }

    /// Frames as in the page of a run, with errors in place of times.
    void write_page(const MapSet& a, const MapSet& b, const std::vector<Row>& rows, const Difference& all) const {
        page::RunPage page;
        for (std::size_t i = 0; i < rows.size(); ++i) {
            const auto& [name, d, why] = rows[i];
            constexpr double none = std::numeric_limits<double>::quiet_NaN();
            page::Row line{.index = i,
                           .name = name,
                           .status = why.empty() ? "ok" : "failed",
                           .why = why,
                           .fault = {},
                           .valid_share = none,
                           .coverage = none,
                           .mean_visibility = none,
                           .ms = {none, none, none, none, none},
                           .warnings = {},
                           .notes = {},
                           .files = {},
                           .world_from_camera = {}};
            if (why.empty())
                line.errors = {{"rmse", d.rms}, {"bias", d.bias}, {"mae", d.mae}, {"worst", d.worst}, {"ssim", d.ssim}};
            for (const char* file : {"difference/{}.png", "previews/{}.js"})
                if (const std::string whole = fmt::format(fmt::runtime(file), name); fs::exists(fs::path(out_) / whole))
                    line.files.push_back(whole);
            page.add(line);
        }
        json facts = json::array();
        for (const auto& [title, value] : {std::pair("RMSE", all.rms), std::pair("bias", all.bias),
                                           std::pair("MAE", all.mae), std::pair("SSIM", all.ssim)})
            if (std::isfinite(value))
                facts.push_back({title, fmt::format("{:.4f}", value)});
        const json head{
            {"kind", "compare"},
            {"version", SCANSHADE_VERSION},
            {"title", "Comparison"},
            {"subtitle", fmt::format("A {} ({}) with B {} ({})", a.path.string(), a.kind, b.path.string(), b.kind)},
            {"facts", facts},
            {"notes",
             {fmt::format("The AO is A's, the reference is B's. Differences: blue where A is darker, red where it is "
                          "brighter, white where both agree; full colour at {:g}.",
                          scale_)}},
            {"details", json::object()}};
        page.write(out_, head);
    }

    std::vector<std::string> paths_;
    std::string out_;
    ErrorByClass by_confidence_;
    double scale_ = 0.5;
    bool truth_ = false, overwrite_ = false, as_json_ = false;
};

} // namespace

std::unique_ptr<Command> compare_command() { return std::make_unique<Compare>(); }

} // namespace scanshade
