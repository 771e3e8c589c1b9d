// The other measurements of `bench`: each part has a flag that asks for it, and settings of its own.
#pragma once

#include "apps/command.h"

#include <memory>
#include <string>

namespace scanshade {

class BenchPart {
  public:
    virtual ~BenchPart() = default;
    /// The first row is the flag that asks for the part.
    virtual Stage stage() = 0;
    [[nodiscard]] virtual bool asked() const = 0;
    /// Measures on the Vulkan device of that name, and prints the results to stdout. Returns an ExitCode.
    virtual int run(const std::string& device) = 0;
};

std::unique_ptr<BenchPart> cacao_times();
std::unique_ptr<BenchPart> cacao_maps();
std::unique_ptr<BenchPart> cloud_errors();
std::unique_ptr<BenchPart> hard_cases_kept();
std::unique_ptr<BenchPart> flatness_of_planes();
std::unique_ptr<BenchPart> normals_kept();
std::unique_ptr<BenchPart> light_split();
std::unique_ptr<BenchPart> light_bounce();
std::unique_ptr<BenchPart> expected_errors();
std::unique_ptr<BenchPart> errors_of_clouds();

} // namespace scanshade
