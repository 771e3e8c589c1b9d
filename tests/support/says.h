// Checks of messages.
#pragma once

#include "projection/base/error.h"

#include <gtest/gtest.h>
#include <string>

namespace scanshade::tests {

/// Whether `part` is in `text`; shows the text where it is not.
inline testing::AssertionResult says(const std::string& text, const std::string& part) {
    if (text.find(part) != std::string::npos)
        return testing::AssertionSuccess();
    return testing::AssertionFailure() << "\"" << text << "\" does not say \"" << part << "\"";
}

/// The sentence of the Error that `action` throws; empty where it throws none.
template <class Action>
std::string refusal(Action&& action) {
    try {
        action();
    } catch (const Error& error) {
        return error.what();
    }
    return "";
}

} // namespace scanshade::tests
