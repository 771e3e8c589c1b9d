// Rows by name.
#include "projection/base/named.h"

#include "tests/support/says.h"

#include <gtest/gtest.h>
#include <vector>

namespace scanshade {
namespace {

struct Row {
    std::string_view name;
    int value;
};
const std::vector<Row> rows = {{"one", 1}, {"two", 2}};

TEST(OneNamed, is_the_row_itself) { EXPECT_EQ(&one_named(rows, "two", "row"), &rows[1]); }

TEST(OneNamed, an_unknown_name_is_told_with_those_there_are) {
    EXPECT_EQ(tests::refusal([] { (void)one_named(rows, "three", "row"); }), "no row 'three', there are: one, two");
    EXPECT_THROW((void)one_named(rows, "", "row"), Misuse);
}

} // namespace
} // namespace scanshade
