// Errors: they gain context on their way out and keep their types.
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

/// The command line asked for something impossible: exit code 1.
class Misuse : public Error {
  public:
    using Error::Error;
};

/// Neither input nor program is at fault: a full disk, a lost share, a held lock. A retry may succeed.
class Outage : public Error {
  public:
    using Error::Error;
};

/// The device was lost. This process cannot use it any more; a new process may.
class DeviceLost : public Outage {
  public:
    using Outage::Outage;
};

/// There is not enough memory. A retry may succeed on a larger machine, or when others leave this one more.
class OutOfMemory : public Outage {
  public:
    using Outage::Outage;
};

/// A foreign exception left during(): a bug of the program, not bad input. The exception is nested inside. Code that
/// calls a library must convert the library's exceptions about bad input to Error.
class InternalError : public std::logic_error {
  public:
    using std::logic_error::logic_error;
};

/// For a foreign exception that is being handled: throws OutOfMemory for a failed allocation, else an InternalError
/// with the exception nested inside.
[[noreturn]] void throw_foreign(const std::string& what, const std::exception& failure);

/// Runs `action`; a failure inside leaves as `what: <its message>`. Errors keep their types, a failed
/// allocation becomes OutOfMemory, and any other exception an InternalError.
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
        throw_foreign(what, failure);
    }
}

} // namespace scanshade
