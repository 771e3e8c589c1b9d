// The commands that print lists: methods, devices.
#include "ao/base/method.h"
#include "ao/gpu/device.h"
#include "apps/command.h"
#include "projection/base/error.h"

#include <fmt/format.h>

namespace scanshade {
namespace {

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

std::unique_ptr<Command> methods_command() { return std::make_unique<Methods>(); }
std::unique_ptr<Command> devices_command() { return std::make_unique<Devices>(); }

} // namespace scanshade
