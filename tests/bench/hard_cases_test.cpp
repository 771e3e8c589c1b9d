// Hard cases of recorded depth: methods keep the gates of every family.
#include "ao/gpu/device.h"
#include "tests/bench/judge.h"

#include <gtest/gtest.h>

namespace scanshade::hard_cases {

void PrintTo(const Family& family, std::ostream* out) { *out << family.name; }

namespace {

class HardCases : public testing::TestWithParam<std::tuple<std::string, Family>> {};

TEST_P(HardCases, keep_their_gates) {
    static gpu::Device device;
    const auto& [method, family] = GetParam();
    int cases = 0;
    Subject(device, method_named(method)).judge(family, [&](const Verdict& of) {
        EXPECT_EQ(of.missed, "") << of.looked_at.name;
        ++cases;
    });
    EXPECT_GT(cases, 0);
    for (const std::string& message : device.validation_messages())
        ADD_FAILURE() << message;
}

INSTANTIATE_TEST_SUITE_P(cacao_and_surfel, HardCases,
                         testing::Combine(testing::Values("cacao", "surfel"), testing::ValuesIn(families())));

} // namespace
} // namespace scanshade::hard_cases
