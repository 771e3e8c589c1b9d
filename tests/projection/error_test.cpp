// during(): context for every failure, and every failure's type kept.
#include "projection/error.h"

#include <gtest/gtest.h>
#include <new>
#include <vector>

namespace scanshade {
namespace {

class Locked : public Outage { // as rooms above derive their own
  public:
    using Outage::Outage;
};

/// The message with which `thrown` leaves two layers of context, as a Left.
template <class Left, class Thrown>
std::string leaves_as(const Thrown& thrown) {
    try {
        during("frame 0017", [&] { during("depth.png", [&]() -> void { throw thrown; }); });
    } catch (const Left& failure) {
        return failure.what();
    } catch (const std::exception& failure) {
        return std::string("another type: ") + failure.what();
    }
    return "nothing";
}

template <class Type>
class KeptType : public testing::Test {};
using OurTypes = testing::Types<Error, Misuse, Outage, DeviceLost, Locked>;
TYPED_TEST_SUITE(KeptType, OurTypes);

TYPED_TEST(KeptType, our_errors_leave_as_what_they_are_with_the_context_in_front) {
    try {
        during("frame 0017", [] { during("depth.png", []() -> void { throw TypeParam("ends early"); }); });
        FAIL() << "nothing was thrown";
    } catch (const Error& failure) {
        EXPECT_TRUE(typeid(failure) == typeid(TypeParam));
        EXPECT_STREQ(failure.what(), "frame 0017: depth.png: ends early");
    }
}

TEST(During, a_mistake_of_the_program_is_no_error_of_the_input) {
    EXPECT_EQ(leaves_as<InternalError>(std::logic_error("never empty")), "frame 0017: depth.png: never empty");
    EXPECT_EQ(leaves_as<InternalError>(std::runtime_error("a library's")), "frame 0017: depth.png: a library's");
    EXPECT_EQ(leaves_as<InternalError>(std::bad_alloc()),
              std::string("frame 0017: depth.png: ") + std::bad_alloc().what());
    EXPECT_FALSE((std::is_base_of_v<Error, InternalError>));
}

TEST(During, the_exception_that_began_it_is_nested_inside) {
    try {
        during("frame 0017", [] { during("depth.png", [] { (void)std::vector<int>().at(3); }); });
        FAIL() << "nothing was thrown";
    } catch (const InternalError& failure) {
        EXPECT_THROW(std::rethrow_if_nested(failure), std::out_of_range);
    }
}

TEST(During, results_come_through_unchanged) {
    int value = 7;
    int& same = during("context", [&]() -> int& { return value; });
    EXPECT_EQ(&same, &value);
}

} // namespace
} // namespace scanshade
