// A hook's processes. A keeper stands between the worker and the hook's shell: it survives a kill -9 of the worker just
// long enough to end the hook.
#include "apps/jobs/hook.h"

#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/stopwatch.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

extern char** environ; // NOLINT(readability-redundant-declaration)

namespace scanshade {
namespace {

// ---------------------------------------------------------------------------------------------------- commands

std::string braced(const std::string& name) { return "{" + name + "}"; }

std::string variable_of(const std::string& name) {
    std::string variable = "SCANSHADE_";
    for (const char c : name)
        variable += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    return variable;
}

/// Which characters a shell sees within quotes.
std::vector<bool> quoted_in(const std::string& flag, std::string_view command) {
    std::vector<bool> quoted(command.size());
    char quote = 0;
    for (std::size_t i = 0; i < command.size(); ++i) {
        quoted[i] = quote != 0;
        const char c = command[i];
        if (c == '\\' && quote != '\'' && i + 1 < command.size())
            quoted[++i] = true;
        else if (quote == 0 && (c == '\'' || c == '"'))
            quote = c;
        else if (c == quote)
            quote = 0;
    }
    if (quote != 0)
        throw Misuse(fmt::format("{}: '{}' has a quote that is not closed", flag, command));
    return quoted;
}

/// Values begin with '-' in names that somebody chose; a command would take them for options.
void refuse_options(const std::vector<std::pair<std::string, std::string>>& values) {
    for (const auto& [name, value] : values)
        if (value.starts_with('-') || value.find('\0') != std::string::npos)
            throw Error(fmt::format("{}: {} would be taken for an option: write ./NAME", braced(name),
                                    in_quotes(as_utf8(value))));
}

// ---------------------------------------------------------------------------------------------------- processes

/// Everything the keeper needs, made before fork(): after it, only system calls are safe.
struct Start {
    std::array<const char*, 4> arguments;
    const char** environment;
    int messages, lock;
    pid_t parent;
};

volatile std::sig_atomic_t group = 0; // of the hook; the keeper's own

constexpr int end_gently = SIGUSR1, end_now = SIGTERM;

/// Until all are gone, or a second has passed: what left the group does not hold us.
void end_group() {
    ::kill(-static_cast<pid_t>(group), SIGKILL);
    for (int tries = 0; tries < 1000; ++tries) {
        const pid_t gone = ::waitpid(-1, nullptr, WNOHANG);
        if (gone < 0 && errno == ECHILD)
            return;
        if (gone == 0) {
            const timespec moment{0, 1'000'000};
            ::nanosleep(&moment, nullptr);
        }
    }
}

void on_end_now(int) {
    end_group();
    ::_exit(128 + SIGTERM);
}
void on_end_gently(int) { ::kill(-static_cast<pid_t>(group), SIGTERM); }

void handle(int signal, void (*handler)(int)) {
    struct sigaction action = {};
    action.sa_handler = handler;
    action.sa_flags = SA_RESTART;
    ::sigaction(signal, &action, nullptr);
}

[[noreturn]] void become_shell(const Start& start, const sigset_t& none) {
    ::setpgid(0, 0);
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    for (const int signal : {SIGINT, SIGHUP, SIGTERM, SIGUSR1, SIGPIPE, SIGCHLD})
        handle(signal, SIG_DFL);
    const int nothing = ::open("/dev/null", O_RDWR);
    ::dup2(nothing, 0);
    ::dup2(nothing, 1);
    ::dup2(start.messages, 2);
    ::close_range(3, ~0U, 0);
    ::sigprocmask(SIG_SETMASK, &none, nullptr);
    ::execve("/bin/sh", const_cast<char* const*>(start.arguments.data()), const_cast<char* const*>(start.environment));
    ::_exit(127);
}

/// Starts the shell, waits for it, ends what it left, and exits as it did.
[[noreturn]] void keep(const Start& start) {
    sigset_t none, all;
    sigemptyset(&none);
    sigfillset(&all);
    ::sigprocmask(SIG_SETMASK, &all, nullptr);
    ::prctl(PR_SET_PDEATHSIG, end_now);
    if (::getppid() != start.parent)
        ::_exit(128 + SIGTERM);
    ::prctl(PR_SET_CHILD_SUBREAPER, 1);
    // Only the lock of its own task: others must not stay locked for as long as this hook takes.
    const int lower = std::min(start.messages, start.lock), upper = std::max(start.messages, start.lock);
    if (lower > 3)
        ::close_range(3, static_cast<unsigned>(lower) - 1, 0);
    if (upper > lower + 1)
        ::close_range(static_cast<unsigned>(std::max(lower + 1, 3)), static_cast<unsigned>(upper) - 1, 0);
    ::close_range(static_cast<unsigned>(upper) + 1, ~0U, 0);
    // Shares the memory until the shell takes its place: a copy of a large process' page tables takes milliseconds.
    const pid_t shell = ::vfork(); // NOLINT(clang-analyzer-security.insecureAPI.vfork)
    if (shell == 0)
        become_shell(start, none);
    if (shell < 0)
        ::_exit(126);
    ::setpgid(shell, shell);
    group = shell;
    for (const int signal : {SIGINT, SIGHUP, SIGPIPE}) // a terminal's end is the worker's to judge
        handle(signal, SIG_IGN);
    handle(end_now, on_end_now);
    handle(end_gently, on_end_gently);
    ::sigprocmask(SIG_SETMASK, &none, nullptr);
    int status = 0;
    while (::waitpid(shell, &status, 0) < 0 && errno == EINTR) {
    }
    ::sigprocmask(SIG_SETMASK, &all, nullptr);
    end_group();
    ::_exit(WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status));
}

/// The last bytes of what a process says.
class Tail {
  public:
    explicit Tail(int pipe) : pipe_(pipe) {}
    /// Reads what is there, after waiting for it. False at the end.
    bool read(int wait_ms) {
        pollfd waited{pipe_, POLLIN, 0};
        if (::poll(&waited, 1, wait_ms) <= 0)
            return true;
        std::array<char, 4096> bytes;
        const ssize_t count = ::read(pipe_, bytes.data(), bytes.size());
        if (count > 0)
            text_.append(bytes.data(), static_cast<std::size_t>(count));
        constexpr std::size_t most = 4096;
        if (text_.size() > most)
            text_.erase(0, text_.size() - most);
        return count > 0 || (count < 0 && (errno == EINTR || errno == EAGAIN));
    }
    [[nodiscard]] const std::string& text() const { return text_; }

  private:
    int pipe_;
    std::string text_;
};

struct Pipe {
    Pipe() {
        if (::pipe2(ends.data(), O_CLOEXEC | O_NONBLOCK) != 0)
            throw Outage(fmt::format("no pipe for a hook: {}", std::strerror(errno)));
        ::fcntl(ends[1], F_SETFL, 0); // the hook's end blocks, as commands expect
    }
    ~Pipe() {
        ::close(ends[0]);
        close_writing();
    }
    Pipe(const Pipe&) = delete;
    Pipe& operator=(const Pipe&) = delete;
    void close_writing() {
        if (ends[1] >= 0)
            ::close(std::exchange(ends[1], -1));
    }
    std::array<int, 2> ends{};
};

} // namespace

void check_hooks(const Hooks& hooks) {
    if (!hooks.fetch.empty())
        check_hook("--fetch", hooks.fetch, {"source", "dir"}, {"out", "task"});
    if (!hooks.deliver.empty())
        check_hook("--deliver", hooks.deliver, {"out", "task"}, {"source", "dir"});
}

void check_hook(const std::string& flag, std::string_view command, const std::vector<std::string>& placeholders,
                const std::vector<std::string>& foreign) {
    const std::vector<bool> quoted = quoted_in(flag, command);
    for (const std::string& name : placeholders) {
        const std::string word = braced(name);
        if (command.find(word) == std::string_view::npos)
            throw Misuse(fmt::format("{}: '{}' lacks {}", flag, command, word));
        for (auto at = command.find(word); at != std::string_view::npos; at = command.find(word, at + 1))
            if (quoted[at])
                throw Misuse(fmt::format("{}: '{}' has {} within quotes: write it without, it is quoted already", flag,
                                         command, word));
    }
    for (const std::string& name : foreign)
        if (command.find(braced(name)) != std::string_view::npos)
            throw Misuse(fmt::format("{}: '{}' has {}, which this hook does not know", flag, command, braced(name)));
}

std::string shell_text(std::string_view command, const std::vector<std::string>& placeholders) {
    std::string text(command);
    for (const std::string& name : placeholders) {
        const std::string word = braced(name), variable = "\"$" + variable_of(name) + "\"";
        for (auto at = text.find(word); at != std::string::npos; at = text.find(word, at + variable.size()))
            text.replace(at, word.size(), variable);
    }
    return text;
}

std::string HookEnd::reason() const {
    std::string last;
    for (const TextLine& line : text_lines(stderr_tail))
        if (!trimmed(line.text).empty())
            last = trimmed(line.text);
    std::string text = ended_because.empty() ? fmt::format("exit code {}", exit_code) : "ended: " + ended_because;
    constexpr std::size_t most = 300;
    if (!last.empty())
        text += ": " + as_utf8(last.substr(0, most));
    return text;
}

HookEnd run_hook(std::string_view command, const std::vector<std::pair<std::string, std::string>>& values,
                 const HookWatch& watch) {
    refuse_options(values);
    std::vector<std::string> placeholders, variables;
    for (const auto& [name, value] : values) {
        placeholders.push_back(name);
        variables.push_back(variable_of(name) + "=" + value);
    }
    const std::string text = shell_text(command, placeholders);
    std::vector<const char*> environment;
    for (char** each = environ; *each; ++each)
        if (!std::string_view(*each).starts_with("SCANSHADE_"))
            environment.push_back(*each);
    for (const std::string& each : variables)
        environment.push_back(each.c_str());
    environment.push_back(nullptr);

    Pipe pipe;
    const Start start{{"sh", "-c", text.c_str(), nullptr},
                      environment.data(),
                      pipe.ends[1],
                      watch.lock >= 0 ? watch.lock : pipe.ends[1],
                      ::getpid()};
    const Stopwatch stopwatch;
    const pid_t keeper = ::fork();
    if (keeper == 0)
        keep(start);
    if (keeper < 0)
        throw Outage(fmt::format("no process for a hook: {}", std::strerror(errno)));
    pipe.close_writing();

    constexpr double grace_s = 5; // to remove half of an upload
    HookEnd end;
    Tail tail(pipe.ends[0]);
    int status = 0;
    bool listening = true;
    double told_s = 0, checked_s = 0;
    while (::waitpid(keeper, &status, WNOHANG) == 0) {
        // Its pipe closes when the keeper ends. Whoever left the group and holds it costs the wait of a poll.
        if (listening)
            listening = tail.read(20);
        else
            ::usleep(1000);
        const double now_s = stopwatch.seconds();
        if (end.ended_because.empty()) {
            if (now_s > watch.limit_s)
                end.ended_because = fmt::format("no end after {} s", watch.limit_s);
            else if (watch.ends_because && now_s - checked_s > watch.every_s) {
                end.ended_because = watch.ends_because();
                checked_s = stopwatch.seconds();
            }
            if (!end.ended_because.empty()) {
                told_s = now_s;
                ::kill(keeper, end_gently);
            }
        } else if (now_s - told_s > grace_s) {
            told_s = now_s;
            ::kill(keeper, end_now);
        }
    }
    for (int left = 64; left > 0 && listening; --left) // what it said at last
        listening = tail.read(0);
    end.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    end.stderr_tail = tail.text();
    end.took_s = stopwatch.seconds();
    return end;
}

} // namespace scanshade
