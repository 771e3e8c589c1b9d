// A glTF file taken apart: its JSON, buffers, and the numbers of accessors, all checked.
#pragma once

#include "io/shallow_json.h"
#include "projection/base/error.h"

#include <cstddef>
#include <Eigen/Geometry>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade {

using OrderedJson = nlohmann::ordered_json; ///< keeps the order of names, so that a file is written as it was

struct GltfFile {
    OrderedJson json;
    std::vector<std::string> buffers;
    std::string_view chunks; ///< of a binary file, behind its BIN chunk, as they are
    bool binary = false;
    bool has_bin = false; ///< buffer 0 is the BIN chunk
};

/// Throws Error naming what is damaged. `with_buffers` = false: the BIN chunk alone is taken.
[[nodiscard]] GltfFile gltf_file(std::string_view bytes, const std::filesystem::path& file, bool with_buffers = true);
/// The file that a URI names in the folder of the glTF; none for others.
[[nodiscard]] std::optional<std::filesystem::path> path_of_uri(const std::string& uri);
/// A GLB of these parts.
[[nodiscard]] std::string glb_bytes(const OrderedJson& json, std::string bin, std::string_view chunks);

/// during(), and what the JSON library throws becomes an Error.
template <class Action>
decltype(auto) within(const std::string& what, Action&& action) {
    return during(what, [&]() -> decltype(auto) {
        try {
            return std::forward<Action>(action)();
        } catch (const OrderedJson::exception& wrong) {
            throw Error(json_problem(wrong.id, wrong.what()));
        }
    });
}

/// object[key] as a whole number; `usual` where it is missing. Throws Error for anything else.
[[nodiscard]] std::size_t whole_in(const OrderedJson& object, const char* key, std::optional<std::size_t> usual = {});
/// file.json[table][index]; Error where there is no such element.
[[nodiscard]] const OrderedJson& element_of(const OrderedJson& json, const char* table, std::size_t index);
/// The size of a table; 0 where it is missing.
[[nodiscard]] std::size_t size_of_table(const OrderedJson& json, const char* table);

/// Appends to a table of the file; returns the new element's index.
std::size_t appended(OrderedJson& json, const char* table, OrderedJson element);
/// Appends bytes to the BIN chunk, behind whole words; returns the index of their buffer view.
std::size_t stored(OrderedJson& json, std::string& bin, std::string_view bytes);

/// Of Gaussian splats, as points with attributes that begin so.
inline constexpr std::string_view splat_extension = "KHR_gaussian_splatting";
/// Throws Error where the file requires an extension that is not read.
void refuse_extensions(const OrderedJson& json);
/// The nodes of the default scene, parents first, each with its place in the scene; where the file has no scene, all
/// of them. Throws Error naming the node.
void visit_nodes(const OrderedJson& json,
                 const std::function<void(const OrderedJson& node, const Eigen::Affine3d& place)>& visit);

/// Elements of numbers, somewhere in a buffer.
class Accessor {
  public:
    Accessor(const GltfFile& file, std::size_t index);
    [[nodiscard]] std::size_t count() const { return count_; }
    [[nodiscard]] std::size_t width() const { return width_; } ///< numbers in an element
    [[nodiscard]] bool is_float() const { return type_ == 5126; }
    [[nodiscard]] bool is_unsigned() const { return type_ == 5121 || type_ == 5123 || type_ == 5125; }
    /// A number, 0 .. 1 or -1 .. 1 where integers stand for fractions.
    [[nodiscard]] double operator()(std::size_t element, std::size_t number) const;
    /// An index of a vertex; only where is_unsigned().
    [[nodiscard]] std::size_t whole(std::size_t element) const {
        return static_cast<std::size_t>(stored(data_ + element * stride_));
    }
    /// Where a number lies in the BIN chunk, which is buffer 0.
    [[nodiscard]] std::size_t place(std::size_t element, std::size_t number) const {
        return begin_ + element * stride_ + number * size_;
    }
    /// Whether all of it lies there.
    [[nodiscard]] bool is_inside() const { return inside_; }
    /// A number as its bytes; the nearest that the type has.
    [[nodiscard]] std::string encoded(double value) const;

  private:
    [[nodiscard]] double stored(const char* at) const;

    const char* data_ = nullptr;
    std::size_t begin_ = 0; ///< of the data in its buffer
    std::size_t count_ = 0, width_ = 0, stride_ = 0, size_ = 0;
    std::size_t type_ = 0; ///< glTF's componentType
    bool fractions_ = false, inside_ = false;
};

} // namespace scanshade
