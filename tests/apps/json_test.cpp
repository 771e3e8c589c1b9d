// The door for JSON from outside: what a text lacks is the text's fault, what the code does wrong is not.
#include "apps/json.h"

#include "tests/support/says.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

using tests::refusal, tests::says;

TEST(ReadingJson, broken_missing_and_mistyped_values_are_errors_that_name_the_file) {
    const json text{{"frames", "many"}};
    EXPECT_TRUE(
        says(refusal([&] { (void)reading_json("plan.json", [] { return json::parse("{3"); }); }), "plan.json: "));
    EXPECT_TRUE(says(refusal([&] { reading_json("plan.json", [&] { (void)text.at("cost"); }); }), "cost"));
    EXPECT_TRUE(says(refusal([&] { reading_json("plan.json", [&] { (void)text.at("frames").get<int>(); }); }),
                     "a value is of another type than expected"));
}

TEST(ReadingJson, other_exceptions_stay_what_during_makes_of_them) {
    EXPECT_THROW(reading_json("plan.json", []() -> void { throw Outage("share gone"); }), Outage);
    EXPECT_THROW(reading_json("plan.json", []() -> void { throw std::logic_error("never"); }), InternalError);
}

} // namespace
} // namespace scanshade
