// What an entry of a listing holds of its files, in few bytes: a capture may have a million entries.
#pragma once

#include <filesystem>
#include <fmt/format.h>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <string_view>
#include <utility>

namespace scanshade {

/// An optional value that most entries lack: a pointer where there is none, and copied with its owner.
template <class T>
class Rare {
  public:
    Rare() = default;
    Rare(std::nullopt_t) {}
    Rare(T value) : value_(std::make_unique<T>(std::move(value))) {}
    Rare(const std::optional<T>& value) : value_(value ? std::make_unique<T>(*value) : nullptr) {}
    Rare(const Rare& other) : value_(other.value_ ? std::make_unique<T>(*other.value_) : nullptr) {}
    Rare(Rare&&) noexcept = default;
    Rare& operator=(const Rare& other) { return *this = Rare(other); }
    Rare& operator=(Rare&&) noexcept = default;
    ~Rare() = default;

    [[nodiscard]] bool has_value() const { return value_ != nullptr; }
    explicit operator bool() const { return has_value(); }
    operator std::optional<T>() const { return value_ ? std::optional<T>(*value_) : std::nullopt; }
    [[nodiscard]] T value_or(T other) const { return value_ ? *value_ : std::move(other); }
    T& operator*() { return *value_; }
    const T& operator*() const { return *value_; }
    T* operator->() { return value_.get(); }
    const T* operator->() const { return value_.get(); }

  private:
    std::unique_ptr<T> value_;
};

/// A file's path, or none. Neighbours in a listing share the name of their folder: whole paths would take most of a
/// capture's memory, and `std::filesystem::path` several times as much.
class StoredPath {
  public:
    StoredPath() = default;
    StoredPath(std::string_view path);
    StoredPath(const std::string& path) : StoredPath(std::string_view(path)) {}
    StoredPath(const char* path) : StoredPath(std::string_view(path)) {}
    StoredPath(const std::filesystem::path& path) : StoredPath(std::string_view(path.native())) {}

    [[nodiscard]] bool empty() const { return !parts_.has_value(); }
    [[nodiscard]] std::string string() const { return empty() ? std::string() : *parts_->folder + parts_->name; }
    [[nodiscard]] std::filesystem::path path() const { return string(); }
    operator std::string() const { return string(); }
    operator std::filesystem::path() const { return path(); }
    friend bool operator==(const StoredPath& a, const StoredPath& b) { return a.string() == b.string(); }
    friend std::ostream& operator<<(std::ostream& out, const StoredPath& path) { return out << path.string(); }

  private:
    struct Parts {
        std::shared_ptr<const std::string> folder; ///< with its slash
        std::string name;
    };
    Rare<Parts> parts_;
};

} // namespace scanshade

template <>
struct fmt::formatter<scanshade::StoredPath> : fmt::formatter<std::string> {
    template <class Context>
    auto format(const scanshade::StoredPath& path, Context& context) const {
        return fmt::formatter<std::string>::format(path.string(), context);
    }
};
