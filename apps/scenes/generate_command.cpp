// `scanshade generate`: a capture of a synthetic scene with exact truth.
#include "apps/command.h"
#include "apps/scenes/generate.h"
#include "projection/base/error.h"

#include <fmt/format.h>

namespace scanshade {
namespace {

class Generate final : public Command {
  public:
    Words words() override { return {"SCENE", "which scene to generate", &scene_, 1, 1}; }

    std::vector<Stage> stages() override {
        std::vector<Parameter> rows = options_.parameters();
        rows.insert(rows.begin(),
                    {.name = "out", .help = "folder of the capture", .value = &out_, .writes = Writes::folder});
        rows.push_back({.name = "quiet", .help = "prints only failures", .value = &quiet_});
        return {{"capture", rows}};
    }

    int run() override {
        if (out_.empty())
            throw Misuse("generate needs -o FOLDER for the capture");
        options_.scene = scene_.front();
        generate(options_, out_, [&](int done, int total) {
            if (!quiet_)
                fmt::print(stderr, "  frame {} of {}\n", done, total);
        });
        if (quiet_)
            return all_well;
        if (options_.cloud > 0) {
            fmt::print(stderr, "{}: a cloud of {} points -> {}\n", options_.scene, options_.cloud, out_);
            return all_well;
        }
        fmt::print(stderr, "{} seen by {}: {} frames -> {}\n", options_.scene, options_.sensor, options_.frames, out_);
        return all_well;
    }

  private:
    std::vector<std::string> scene_;
    std::string out_;
    bool quiet_ = false;
    GenerateOptions options_;
};

} // namespace

std::unique_ptr<Command> generate_command() { return std::make_unique<Generate>(); }

} // namespace scanshade
