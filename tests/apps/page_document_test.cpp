// What pages are made of: words that cannot break out, and plots with round ticks.
#include "apps/page/document.h"
#include "tests/support/says.h"

#include <cmath>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

using namespace tests;

TEST(PageTest, ticks_are_round_and_within_the_range) {
    EXPECT_EQ(page::round_ticks(0, 10, 5), (std::vector<double>{0, 2, 4, 6, 8, 10}));
    for (const auto& [low, high] : {std::pair(0.013, 0.31), std::pair(-3.0, 8.5), std::pair(1e4, 7e6)}) {
        const std::vector<double> ticks = page::round_ticks(low, high, 6);
        EXPECT_GE(ticks.size(), 3u);
        EXPECT_LE(ticks.size(), 12u);
        EXPECT_GE(ticks.front(), low - 1e-9 * high);
        EXPECT_LE(ticks.back(), high * (1 + 1e-9));
    }
}

TEST(PageTest, words_cannot_break_out_of_a_page) {
    const std::string html = page::document("a < b", {{"\"quoted\" & more", page::table({"<h>"}, {{"<td>"}})}});
    for (const char* part : {"a &lt; b", "&quot;quoted&quot; &amp; more", "&lt;h&gt;", "&lt;td&gt;"})
        EXPECT_TRUE(says(html, part));
}

TEST(PageTest, a_plot_shows_each_finite_point_and_no_other) {
    page::Plot plot{
        "t",
        "x",
        "y",
        {{"s", {{1, 2, "one"}, {10, std::nan(""), "lost"}, {0, 1, "not on a log axis"}, {100, 3, "two", true}}}},
        true};
    const std::string drawn = page::svg(plot);
    EXPECT_TRUE(says(drawn, "<title>one</title>"));
    EXPECT_TRUE(says(drawn, "<title>two</title>"));
    EXPECT_EQ(drawn.find("lost"), std::string::npos);
    EXPECT_EQ(drawn.find("not on"), std::string::npos);
    EXPECT_TRUE(says(drawn, "class=\"ring\""));
    EXPECT_EQ(drawn.find("nan"), std::string::npos);
    EXPECT_EQ(page::svg({"empty", "x", "y", {}, true}).find("nan"), std::string::npos);
}

} // namespace
} // namespace scanshade
