// A measurement of the developers' program: settings of its own, and tables on stdout.
#pragma once

#include "apps/command.h"
#include "tests/bench/table.h"

#include <memory>
#include <string>
#include <vector>

namespace scanshade::bench {

class Part : public Command {
  public:
    /// The part's own rows and --device.
    std::vector<Stage> stages() final {
        std::vector<Parameter> all = rows();
        all.push_back(
            {"device", "index of a Vulkan device, or a part of its name; empty = the fastest kind", &device_});
        return {{"settings", std::move(all)}};
    }
    int run() final { return measure(device_); }

  private:
    virtual std::vector<Parameter> rows() = 0;
    /// Measures on the Vulkan device of that name, and prints tables. Returns an ExitCode.
    virtual int measure(const std::string& device) = 0;

    std::string device_;
};

std::unique_ptr<Command> bounce_part();
std::unique_ptr<Command> cacao_part();
std::unique_ptr<Command> cacao_maps_part();
std::unique_ptr<Command> calibrate_part();
std::unique_ptr<Command> cloud_errors_part();
std::unique_ptr<Command> clouds_part();
std::unique_ptr<Command> expected_errors_part();
std::unique_ptr<Command> flatness_part();
std::unique_ptr<Command> hard_cases_part();
std::unique_ptr<Command> normals_part();
std::unique_ptr<Command> sides_part();
std::unique_ptr<Command> relief_errors_part();

} // namespace scanshade::bench
