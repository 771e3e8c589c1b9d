// What `bench` measures beside methods against truth: each part has a flag that asks for it, and settings of its own.
#pragma once

#include "apps/command.h"

#include <memory>
#include <string>

namespace scanshade {

class BenchPart {
  public:
    virtual ~BenchPart() = default;
    /// The flag that asks for the part stands first.
    virtual Stage stage() = 0;
    [[nodiscard]] virtual bool asked() const = 0;
    /// Prints to stdout what it measures on the Vulkan device of that name. Returns an ExitCode.
    virtual int run(const std::string& device) = 0;
};

std::unique_ptr<BenchPart> cacao_times();
std::unique_ptr<BenchPart> cacao_maps();
std::unique_ptr<BenchPart> cloud_errors();
std::unique_ptr<BenchPart> hard_cases_kept();
std::unique_ptr<BenchPart> normals_kept();

} // namespace scanshade
