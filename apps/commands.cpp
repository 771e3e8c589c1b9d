// The commands that need no more than a page: generate, methods, devices.
#include "ao/gpu/device.h"
#include "ao/method.h"
#include "apps/command.h"
#include "apps/generate.h"
#include "projection/error.h"

#include <fmt/format.h>

namespace scanshade {
namespace {

class Generate final : public Command {
  public:
    Words words() override { return {"SCENE", "which scene to generate", &scene_, 1, 1}; }

    std::vector<Stage> stages() override {
        std::vector<Parameter> rows = options_.parameters();
        rows.insert(rows.begin(), {"out", "folder of the capture", &out_});
        return {{"capture", rows}};
    }

    int run() override {
        if (out_.empty())
            throw Misuse("generate needs -o FOLDER for the capture");
        options_.scene = scene_.front();
        generate(options_, out_, [](int done, int total) { fmt::print(stderr, "  frame {} of {}\n", done, total); });
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
    GenerateOptions options_;
};

class Methods final : public Command {
  public:
    int run() override {
        fmt::print("{:<12} {:<64} {}\n", "method", "idea", "source");
        for (const MethodRow& row : methods())
            fmt::print("{:<12} {:<64} {}\n", row.name, row.summary, row.source);
        return all_well;
    }
};

class Devices final : public Command {
  public:
    int run() override {
        const std::vector<gpu::DeviceInfo> devices = gpu::list_devices();
        fmt::print("{:<6} {:<14} {:<10} {:<44} {:<32} {}\n", "index", "kind", "api", "name", "driver", "usable");
        bool any_usable = false;
        for (const gpu::DeviceInfo& device : devices) {
            any_usable = any_usable || device.unusable.empty();
            fmt::print("{:<6} {:<14} {:<10} {:<44} {:<32} {}\n", device.index, device.kind, device.api, device.name,
                       device.driver, device.unusable.empty() ? "yes" : "no: " + device.unusable);
        }
        if (!any_usable)
            throw Error(
                "no usable Vulkan device: a driver is missing (Debian: mesa-vulkan-drivers has one for every CPU)");
        return all_well;
    }
};

} // namespace

std::unique_ptr<Command> generate_command() { return std::make_unique<Generate>(); }
std::unique_ptr<Command> methods_command() { return std::make_unique<Methods>(); }
std::unique_ptr<Command> devices_command() { return std::make_unique<Devices>(); }

} // namespace scanshade
