// How a failure says what was being done, to what: errors gain context on their way out.
#pragma once

#include <exception>
#include <stdexcept>
#include <string>
#include <utility>

namespace scanshade {

/// A failure the user can act on: the message names the file, the place in it, and what was expected there.
class Error : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// The command line asked for something that cannot be: exit code 1, with the help at hand.
class Misuse : public Error {
  public:
    using Error::Error;
};

/// Neither input nor program is to blame: a disk is full, a share has gone, a lock is held. The same again may succeed.
class Outage : public Error {
  public:
    using Error::Error;
};

/// The device gave up. Nothing more can be computed on it by this process; a fresh one may.
class DeviceLost : public Outage {
  public:
    using Outage::Outage;
};

/// Runs `action`; a failure inside leaves as `what: <its message>`. Misuse, Outage and DeviceLost stay what they are.
template <class Action>
decltype(auto) during(const std::string& what, Action&& action) {
    try {
        return std::forward<Action>(action)();
    } catch (const Misuse& failure) {
        throw Misuse(what + ": " + failure.what());
    } catch (const DeviceLost& failure) {
        throw DeviceLost(what + ": " + failure.what());
    } catch (const Outage& failure) {
        throw Outage(what + ": " + failure.what());
    } catch (const std::exception& failure) {
        throw Error(what + ": " + failure.what());
    }
}

} // namespace scanshade
