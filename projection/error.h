// How a failure says what was being done, to what: errors gain context on their way out and keep their types.
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

/// An exception that is not ours left during(): a mistake of the program, not of its input. The exception is nested
/// inside. Code that calls a library turns what the library throws about bad input into Error on the spot.
class InternalError : public std::logic_error {
  public:
    using std::logic_error::logic_error;
};

/// Runs `action`; a failure inside leaves as `what: <its message>`. Errors keep their types; any other exception
/// becomes an InternalError.
template <class Action>
decltype(auto) during(const std::string& what, Action&& action) {
    try {
        return std::forward<Action>(action)();
    } catch (Error& failure) { // whatever its type: only the message changes
        static_cast<std::runtime_error&>(failure) = std::runtime_error(what + ": " + failure.what());
        throw;
    } catch (InternalError& failure) {
        static_cast<std::logic_error&>(failure) = std::logic_error(what + ": " + failure.what());
        throw;
    } catch (const std::exception& failure) {
        std::throw_with_nested(InternalError(what + ": " + failure.what()));
    }
}

} // namespace scanshade
