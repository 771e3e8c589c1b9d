// Normals of prepared depth are close to those of the generated scenes.
#include "tests/bench/normal_errors.h"

#include <gtest/gtest.h>

namespace scanshade {

void PrintTo(const NormalCase& which, std::ostream* out) { *out << which.name; }

namespace {

class Normals : public testing::TestWithParam<NormalCase> {};

TEST_P(Normals, are_as_true_as_they_should_be) {
    static gpu::Device device;
    EXPECT_LE(normal_errors(device, GetParam()).near.median, GetParam().aim);
    for (const std::string& message : device.validation_messages())
        ADD_FAILURE() << message;
}

INSTANTIATE_TEST_SUITE_P(sensors, Normals, testing::ValuesIn(normal_cases()));

} // namespace
} // namespace scanshade
