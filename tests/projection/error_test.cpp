// during(): context for every failure, and every failure's type kept.
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <gtest/gtest.h>
#include <new>
#include <opencv2/core.hpp>
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
using OurTypes = testing::Types<Error, Misuse, Outage, OutOfMemory, DeviceLost, Locked>;
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
    EXPECT_FALSE((std::is_base_of_v<Error, InternalError>));
}

TEST(During, a_failed_allocation_is_no_mistake_of_the_program) {
    for (const std::string& said :
         {leaves_as<OutOfMemory>(std::bad_alloc()),
          leaves_as<OutOfMemory>(cv::Exception(cv::Error::StsNoMem, "Failed to allocate", "", "", 0))})
        EXPECT_TRUE(said.starts_with("frame 0017: depth.png: not enough memory: needs more than the ")) << said;
}

TEST(Memory, what_cannot_fit_is_refused_with_both_numbers) {
    EXPECT_GT(free_memory(), 0u);
    EXPECT_NO_THROW(require_memory(1, "a pixel"));
    try {
        require_memory(std::uint64_t(1) << 50, "a.png");
        FAIL() << "a PiB was found";
    } catch (const OutOfMemory& refusal) {
        EXPECT_TRUE(std::string(refusal.what()).starts_with("a.png needs about 1048576.0 GiB of memory, "))
            << refusal.what();
    }
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
