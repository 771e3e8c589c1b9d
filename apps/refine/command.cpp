// `scanshade refine`: refines a camera from pictures of a board, organised clouds or a recording, with its uncertainty.
#include "apps/command.h"
#include "apps/refine/refine.h"
#include "apps/refine/report.h"
#include "io/cameras/camera_file.h"
#include "io/output_file.h"
#include "projection/base/error.h"
#include "projection/base/stopwatch.h"

#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace calibration;

class Refine final : public Command {
  public:
    Words words() override {
        return {"PATH", "a folder of pictures of a board (with --board), or a capture", &paths_, 1, 1};
    }

    std::vector<Stage> stages() override {
        std::vector<Stage> stages = refinement_.stages();
        stages.push_back(
            {"output",
             {{.name = "out",
               .help =
                   "the camera's file; its extension sets the format: .json ours, .yml OpenCV, .yaml ROS, .txt COLMAP",
               .value = &out_,
               .writes = Writes::file},
              {.name = "format",
               .help = "the format, whatever the extension",
               .value = &format_,
               .choices = format_choices()},
              {.name = "trajectory",
               .help = "file for the refined poses of a recording, in TUM's format",
               .value = &trajectory_,
               .writes = Writes::file},
              {.name = "report", .help = "HTML page with tables and plots", .value = &report_, .writes = Writes::file},
              {"overwrite", "replace earlier results", &overwrite_}}});
        return stages;
    }

    int run() override {
        const fs::path path = paths_.front();
        const auto format = out_.empty() ? CameraFormat::scanshade : camera_format(out_, format_);
        refuse_to_overwrite();
        const Stopwatch stopwatch;
        refinement_.report_to([&stopwatch](const std::string& what) {
            fmt::print(stderr, "  {:5.1f} s  {}\n", stopwatch.seconds(), what);
        });
        const RecordingResult found = refinement_.refine(path);
        const double took_s = stopwatch.seconds();
        fmt::print("{}", summary_of(found.refinement, took_s));
        write(found, format, took_s);
        return all_well;
    }

  private:
    static std::vector<std::string> format_choices() {
        std::vector<std::string> names = camera_format_names();
        names.insert(names.begin(), "");
        return names;
    }

    void refuse_to_overwrite() const {
        for (const std::string& file : {out_, report_, trajectory_})
            if (!file.empty() && fs::exists(file) && !overwrite_)
                throw Misuse(file + " exists already: --overwrite replaces it, or choose another name");
    }

    void write(const RecordingResult& found, CameraFormat format, double took_s) const {
        const Refinement& result = found.refinement;
        CameraQuality quality{.rms_px = std::nan(""), .view_rms_px = {}, .details = {}};
        if (result.unit == "px") {
            quality.rms_px = result.selection.train_px;
            for (const ViewRow& view : result.views)
                quality.view_rms_px.push_back(view.score.rms());
        }
        quality.details = details_of(result, took_s).dump();
        if (!out_.empty())
            write_camera_file(out_, found.file, format, quality);
        if (!trajectory_.empty())
            write_atomically(trajectory_, trajectory_of(found));
        if (!report_.empty())
            write_atomically(report_, page_of(result, took_s));
        for (const std::string& file : {out_, report_, trajectory_})
            if (!file.empty())
                fmt::print(stderr, "  -> {}\n", file);
    }

    std::string out_, format_, report_, trajectory_;
    bool overwrite_ = false;
    RefineSettings refinement_;
    std::vector<std::string> paths_;
};

} // namespace

std::unique_ptr<Command> refine_command() { return std::make_unique<Refine>(); }

} // namespace scanshade
