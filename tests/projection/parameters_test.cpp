// Rows of settings: text in, text out, and every refusal names the row and what was expected.
#include "projection/base/parameters.h"

#include "projection/base/error.h"
#include "projection/base/nearest_word.h"
#include "tests/support/says.h"

#include <gtest/gtest.h>

namespace scanshade {
namespace {

enum class Level { low, high };
constexpr std::array level_words{Named{"low", Level::low}, Named{"high", Level::high}};
/// With a word for what was not given.
constexpr std::array maybe_words{Named<std::optional<Level>>{"", std::nullopt},
                                 Named<std::optional<Level>>{"high", Level::high}};

struct Settings {
    bool adaptive = false;
    int passes = 2;
    float radius = 0.5F;
    double sigma = 0.1;
    std::string quality = "high", note;
    Level level = Level::high;
    std::optional<Level> maybe;
    std::optional<double> limit;

    std::vector<Parameter> parameters() {
        return {{.name = "adaptive", .value = &adaptive},
                {.name = "passes", .value = &passes, .low = 0, .high = 8},
                {.name = "radius", .value = &radius, .unit = "m", .low = 0, .high = 100000},
                {.name = "sigma", .value = &sigma, .unit = "rad", .low = 0},
                {.name = "quality", .value = &quality, .choices = {"low", "high"}},
                {.name = "note", .value = &note},
                {.name = "level", .value = OneOf(&level, level_words)},
                {.name = "maybe", .value = OneOf(&maybe, maybe_words)},
                {.name = "limit", .value = &limit, .low = 0}};
    }
};
enum Row { adaptive, passes, radius, sigma, quality, note, level, maybe, limit };

using tests::says;

std::string refusal(const Parameter& row, const std::string& text) {
    return tests::refusal([&] { set(row, text); });
}

TEST(Parameters, TextSetsTheVariableTheRowIsBoundTo) {
    Settings settings;
    const auto rows = settings.parameters();
    set(rows[adaptive], "true");
    set(rows[passes], "8");
    set(rows[radius], "0.25");
    set(rows[sigma], "1e-3");
    set(rows[quality], "low");
    set(rows[note], "any text, -1");
    EXPECT_TRUE(settings.adaptive);
    EXPECT_EQ(settings.passes, 8);
    EXPECT_EQ(settings.radius, 0.25F);
    EXPECT_EQ(settings.sigma, 1e-3);
    EXPECT_EQ(settings.quality, "low");
    EXPECT_EQ(settings.note, "any text, -1");
    set(rows[level], "low");
    set(rows[maybe], "high");
    set(rows[limit], "2.5");
    EXPECT_EQ(settings.level, Level::low);
    EXPECT_EQ(settings.maybe, Level::high);
    EXPECT_EQ(settings.limit, 2.5);
    for (const char* no : {"false", "0", "off", "no"}) {
        settings.adaptive = true;
        set(rows[adaptive], no);
        EXPECT_FALSE(settings.adaptive) << no;
    }
}

TEST(Parameters, PrintedValuesReadBackTheSameAndAreShort) {
    Settings settings;
    const auto rows = settings.parameters();
    settings.radius = 0.1F;
    settings.sigma = 0.1 + 0.2;
    EXPECT_EQ(value_text(rows[radius]), "0.1") << "not the 0.10000000149 a float is as a double";
    EXPECT_EQ(value_text(rows[sigma]), "0.30000000000000004");
    EXPECT_EQ(value_text(rows[adaptive]), "false");
    EXPECT_EQ(value_text(rows[quality]), "high");
    EXPECT_EQ(value_text(rows[level]), "high");
    for (const Row not_given : {maybe, limit})
        EXPECT_EQ(value_text(rows[not_given]), "");
    for (const Parameter& row : rows) {
        const std::string text = value_text(row);
        set(row, text);
        EXPECT_EQ(value_text(row), text);
    }
    EXPECT_EQ(settings.sigma, 0.1 + 0.2);
}

TEST(Parameters, RangesReadAsPeopleWriteThem) {
    Settings settings;
    const auto rows = settings.parameters();
    EXPECT_EQ(range_text(rows[adaptive]), "yes | no");
    EXPECT_EQ(range_text(rows[passes]), "0 .. 8");
    EXPECT_EQ(range_text(rows[radius]), "m, 0 .. 100000");
    EXPECT_EQ(range_text(rows[sigma]), "rad, 0 or more");
    EXPECT_EQ(range_text(rows[quality]), "low | high");
    EXPECT_EQ(range_text(rows[note]), "");
    EXPECT_EQ(range_text(rows[level]), "low | high");
    EXPECT_EQ(range_text(rows[maybe]), "high");
    EXPECT_EQ(range_text(rows[limit]), "0 or more");
}

TEST(Parameters, WhatCannotBeIsRefusedByNameAndLeavesTheSettingAlone) {
    Settings settings;
    const auto rows = settings.parameters();
    const std::string why = refusal(rows[radius], "-1");
    EXPECT_TRUE(says(why, "radius"));
    EXPECT_TRUE(says(why, "'-1'"));
    EXPECT_TRUE(says(why, "m, 0 .. 100000"));
    for (const char* text : {"", "abc", "1m", " 1", "nan", "inf", "1e9", "1e999", "0,5"})
        EXPECT_NE(refusal(rows[radius], text), "") << text;
    for (const char* text : {"", "2.5", "9", "-1", "99999999999", "0x2"})
        EXPECT_NE(refusal(rows[passes], text), "") << text;
    for (const char* text : {"", "High", "medium"})
        EXPECT_TRUE(says(refusal(rows[quality], text), "low | high")) << text;
    for (const char* text : {"", "High", "medium"})
        EXPECT_TRUE(says(refusal(rows[level], text), "low | high")) << text;
    EXPECT_TRUE(says(refusal(rows[level], "hgih"), "did you mean high?"));
    for (const char* text : {"-1", "nan", "far"})
        EXPECT_NE(refusal(rows[limit], text), "") << text;
    EXPECT_EQ(settings.level, Level::high);
    EXPECT_FALSE(settings.limit);
    EXPECT_TRUE(says(refusal(rows[adaptive], "maybe"), "yes | no"));
    EXPECT_EQ(settings.radius, 0.5F);
    EXPECT_EQ(settings.passes, 2);
    EXPECT_EQ(settings.quality, "high");
}

TEST(Parameters, ALimitItselfIsAllowedThoughItIsNoFloat) {
    // The float nearest to 1e-4 is smaller, and the one nearest to 0.2 is larger.
    float value = 0.1F;
    const Parameter row{.name = "value", .value = &value, .low = 1e-4, .high = 0.2};
    set(row, "0.0001");
    set(row, "0.2");
    EXPECT_EQ(value, 0.2F);
    EXPECT_TRUE(says(refusal(row, "0.2001"), "value"));
}

TEST(Parameters, ValuesSetInCodeAreCheckedToo) {
    Settings settings;
    const auto rows = settings.parameters();
    for (const Parameter& row : rows)
        EXPECT_NO_THROW(check(row)) << row.name;
    settings.radius = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THROW(check(rows[radius]), Misuse);
    settings.passes = 9;
    EXPECT_THROW(check(rows[passes]), Misuse);
    settings.quality = "best";
    EXPECT_THROW(check(rows[quality]), Misuse);
    settings.level = static_cast<Level>(7);
    EXPECT_THROW(check(rows[level]), Misuse);
}

TEST(Parameters, NumbersGoInAndOutWithoutText) {
    Settings settings;
    const auto rows = settings.parameters();
    set(rows[radius], 0.1);
    EXPECT_EQ(settings.radius, 0.1F);
    EXPECT_EQ(number_of(rows[radius]), 0.1) << "as it was typed, not 0.10000000149";
    EXPECT_EQ(number_of(rows[passes]), 2);
    set(rows[sigma], 0.3);
    EXPECT_EQ(number_of(rows[sigma]), 0.3);
    EXPECT_THROW(set(rows[radius], -1), Misuse);
    EXPECT_EQ(settings.radius, 0.1F);
}

TEST(NearestWord, MistypedWordsAreUnderstoodAndStrangeOnesAreNot) {
    const std::vector<std::string> known{"--quality", "--quiet", "--radius", "surfel", "run", "refine"};
    EXPECT_EQ(nearest_word("--quailty", known), "--quality");
    EXPECT_EQ(nearest_word("--radios", known), "--radius");
    EXPECT_EQ(nearest_word("surfle", known), "surfel");
    EXPECT_EQ(nearest_word("rnu", known), "run");
    for (const char* strange : {"", "x", "--unheard-of", "fly"})
        EXPECT_EQ(nearest_word(strange, known), "") << strange;
    EXPECT_EQ(suggestion("rum", known), "; did you mean run?");
    EXPECT_EQ(suggestion("parallel", known), "");
}

} // namespace
} // namespace scanshade
