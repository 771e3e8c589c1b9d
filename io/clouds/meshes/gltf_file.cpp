// glTF's containers, buffers and accessors (Khronos, "glTF 2.0", sections 3.6 and 4.4).
#include "io/clouds/meshes/gltf_file.h"

#include "io/clouds/meshes/mesh_file.h"
#include "io/text.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fmt/format.h>
#include <opencv2/core.hpp>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

constexpr std::uint32_t magic = 0x46546c67, json_chunk = 0x4e4f534a, bin_chunk = 0x004e4942;

std::uint32_t u32_at(std::string_view bytes, std::size_t at) {
    if (at + 4 > bytes.size())
        throw Error(fmt::format("byte {}: the file ends in its header, after {}", at, counted(bytes.size(), "byte")));
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
}

void append(std::string& bytes, std::uint32_t value) {
    const auto raw = std::bit_cast<std::array<char, 4>>(value);
    bytes.append(raw.data(), raw.size());
}

std::string from_base64(std::string_view text) {
    std::string bytes;
    std::uint32_t bits = 0;
    int count = 0;
    for (const char c : text) {
        const int value = c >= 'A' && c <= 'Z'   ? c - 'A'
                          : c >= 'a' && c <= 'z' ? c - 'a' + 26
                          : c >= '0' && c <= '9' ? c - '0' + 52
                          : c == '+' || c == '-' ? 62
                          : c == '/' || c == '_' ? 63
                                                 : -1;
        if (c == '=')
            break;
        if (value < 0)
            throw Error(fmt::format("byte {} of a data URI is not base64", bytes.size()));
        bits = bits << 6 | static_cast<std::uint32_t>(value);
        if ((count += 6) >= 8)
            bytes.push_back(static_cast<char>(bits >> (count -= 8)));
    }
    return bytes;
}

std::string without_percents(std::string_view uri) {
    std::string text;
    for (std::size_t i = 0; i < uri.size(); ++i) {
        const auto hex = [&](std::size_t at) {
            const char c = at < uri.size() ? uri[at] : ' ';
            return c >= '0' && c <= '9'   ? c - '0'
                   : c >= 'a' && c <= 'f' ? c - 'a' + 10
                   : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                          : -1;
        };
        if (uri[i] == '%' && hex(i + 1) >= 0 && hex(i + 2) >= 0) {
            text.push_back(static_cast<char>(hex(i + 1) << 4 | hex(i + 2)));
            i += 2;
        } else {
            text.push_back(uri[i]);
        }
    }
    return text;
}

std::string buffer_at(const std::string& uri, const fs::path& file) {
    if (uri.starts_with("data:")) {
        const std::size_t comma = uri.find(',');
        if (comma == std::string::npos || !std::string_view(uri).substr(0, comma).ends_with(";base64"))
            throw Error("a data URI without base64");
        return from_base64(std::string_view(uri).substr(comma + 1));
    }
    const auto path = path_of_uri(uri);
    if (!path)
        throw Error(fmt::format("{} is no file in the folder of the glTF", in_quotes(uri)));
    return read_bytes(file.parent_path() / *path);
}

/// Sizes of glTF's component types, from 5120 on; 5124 is none.
constexpr std::array<std::size_t, 7> component_sizes{1, 1, 2, 2, 0, 4, 4};

/// What integers of these types stand for 1 with.
constexpr std::array<double, 6> full_of_type{127, 255, 32767, 65535, 1, 4294967295.0};

std::size_t width_of(const std::string& type) {
    static const std::array<std::pair<const char*, std::size_t>, 7> widths{
        {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT2", 4}, {"MAT3", 9}, {"MAT4", 16}}};
    for (const auto& [name, width] : widths)
        if (type == name)
            return width;
    throw Error(fmt::format("no type {}", in_quotes(type)));
}

void read_buffers(GltfFile& made, std::string_view bin, const fs::path& file) {
    for (std::size_t i = 0; i < size_of_table(made.json, "buffers"); ++i)
        within(fmt::format("buffer {}", i), [&] {
            const OrderedJson& buffer = element_of(made.json, "buffers", i);
            const std::size_t length = whole_in(buffer, "byteLength");
            made.buffers.push_back(i == 0 && made.has_bin ? std::string(bin)
                                                          : buffer_at(buffer.at("uri").get<std::string>(), file));
            if (made.buffers.back().size() < length)
                throw Error(
                    fmt::format("byteLength {}, there are {}", length, counted(made.buffers.back().size(), "byte")));
        });
}

} // namespace

std::optional<fs::path> path_of_uri(const std::string& uri) {
    return uri.starts_with("data:") || uri.find(':') != std::string::npos ? std::nullopt
                                                                          : path_within(without_percents(uri));
}

std::size_t whole_in(const OrderedJson& object, const char* key, std::optional<std::size_t> usual) {
    const auto found = object.find(key);
    if (found == object.end()) {
        if (usual)
            return *usual;
        throw Error(fmt::format("\"{}\" is missing", key));
    }
    constexpr double most = 9007199254740992.0; // doubles are whole up to 2^53
    const double value = found->is_number() ? found->get<double>() : -1;
    if (!(value >= 0 && value <= most && std::floor(value) == value))
        throw Error(fmt::format("\"{}\" is no whole number", key));
    return static_cast<std::size_t>(value);
}

std::size_t size_of_table(const OrderedJson& json, const char* table) {
    const auto found = json.find(table);
    return found == json.end() || !found->is_array() ? 0 : found->size();
}

const OrderedJson& element_of(const OrderedJson& json, const char* table, std::size_t index) {
    if (index >= size_of_table(json, table))
        throw Error(fmt::format("{}: index {}, the file has {}", table, index, size_of_table(json, table)));
    return json[table][index];
}

bool is_glb(std::string_view start) { return start.starts_with("glTF"); }

GltfFile gltf_file(std::string_view bytes, const fs::path& file, bool with_buffers) {
    GltfFile made;
    std::string_view text = bytes, bin;
    made.binary = is_glb(bytes);
    if (made.binary) {
        if (const std::uint32_t version = u32_at(bytes, 4); version != 2)
            throw Error(fmt::format("glTF of version {}, expected 2", version));
        if (const std::uint32_t length = u32_at(bytes, 8); length > bytes.size())
            throw Error(fmt::format("byte 8: {} said, the file has {}", counted(length, "byte"), bytes.size()));
        const auto chunk_at = [&](std::size_t at) {
            const std::uint32_t length = u32_at(bytes, at);
            if (length > bytes.size() - at - 8)
                throw Error(fmt::format("byte {}: a chunk of {}, the file ends at byte {}", at, counted(length, "byte"),
                                        bytes.size()));
            return bytes.substr(at + 8, length);
        };
        if (u32_at(bytes, 16) != json_chunk)
            throw Error("byte 16: the first chunk is not JSON");
        text = chunk_at(12);
        std::size_t at = 20 + text.size();
        if (at + 8 <= bytes.size() && u32_at(bytes, at + 4) == bin_chunk) {
            bin = chunk_at(at);
            made.has_bin = true;
            at += 8 + bin.size();
        }
        made.chunks = bytes.substr(std::min<std::size_t>(at, bytes.size()));
    }
    made.json = shallow_json<OrderedJson>(text);
    if (!made.json.is_object() || !made.json.contains("asset"))
        throw Error("JSON without \"asset\", which glTF has");
    const std::string version = made.json["asset"].value("version", "none");
    if (!version.starts_with("2."))
        throw Error(fmt::format("glTF of version {}, expected 2.0", in_quotes(version)));
    made.has_bin = made.has_bin && size_of_table(made.json, "buffers") > 0 && !made.json["buffers"][0].contains("uri");
    if (with_buffers)
        read_buffers(made, bin, file);
    else if (made.has_bin)
        made.buffers.emplace_back(bin);
    return made;
}

std::string glb_bytes(const OrderedJson& json, std::string bin, std::string_view chunks) {
    std::string text = json.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    bin.resize((bin.size() + 3) / 4 * 4, '\0');
    const std::uint64_t size = 28 + text.size() + bin.size() + chunks.size();
    if (size > 0xffffffff)
        throw Error(fmt::format("glTF's files end at 4 GiB, and this would have {}", counted(size, "byte")));
    std::string bytes;
    bytes.reserve(size);
    append(bytes, magic);
    append(bytes, 2);
    append(bytes, static_cast<std::uint32_t>(size));
    append(bytes, static_cast<std::uint32_t>(text.size()));
    append(bytes, json_chunk);
    bytes += text;
    append(bytes, static_cast<std::uint32_t>(bin.size()));
    append(bytes, bin_chunk);
    return (bytes += bin).append(chunks);
}

std::size_t appended(OrderedJson& json, const char* table, OrderedJson element) {
    OrderedJson& all = json[table];
    all.push_back(std::move(element));
    return all.size() - 1;
}

std::size_t stored(OrderedJson& json, std::string& bin, std::string_view bytes) {
    bin.resize((bin.size() + 3) / 4 * 4, '\0');
    const std::size_t at = bin.size();
    bin += bytes;
    json["buffers"][0]["byteLength"] = bin.size();
    return appended(json, "bufferViews", {{"buffer", 0}, {"byteOffset", at}, {"byteLength", bytes.size()}});
}

Accessor::Accessor(const GltfFile& file, std::size_t index) {
    within(fmt::format("accessor {}", index), [&] {
        const OrderedJson& row = element_of(file.json, "accessors", index);
        count_ = whole_in(row, "count");
        type_ = whole_in(row, "componentType");
        size_ = type_ >= 5120 && type_ - 5120 < component_sizes.size() ? component_sizes[type_ - 5120] : 0;
        width_ = width_of(row.at("type").get<std::string>());
        fractions_ = row.value("normalized", false);
        if (size_ == 0)
            throw Error(fmt::format("no componentType {}", type_));
        if (row.contains("sparse"))
            throw Error("sparse, which is not read");
        if (!row.contains("bufferView"))
            throw Error("without a buffer view");
        const OrderedJson& view = element_of(file.json, "bufferViews", whole_in(row, "bufferView"));
        const std::size_t buffer = whole_in(view, "buffer"), view_at = whole_in(view, "byteOffset", 0),
                          view_size = whole_in(view, "byteLength"), at = whole_in(row, "byteOffset", 0);
        stride_ = whole_in(view, "byteStride", size_ * width_);
        if (buffer >= file.buffers.size() || view_at > file.buffers[buffer].size() ||
            view_size > file.buffers[buffer].size() - view_at)
            throw Error(fmt::format("its buffer view ends at byte {} of buffer {}, which has {}", view_at + view_size,
                                    buffer, buffer < file.buffers.size() ? file.buffers[buffer].size() : 0));
        if (stride_ < size_ * width_)
            throw Error(fmt::format("elements of {}, {} apart", counted(size_ * width_, "byte"), stride_));
        if (count_ > 0 && (at > view_size || view_size - at < size_ * width_ ||
                           (view_size - at - size_ * width_) / stride_ < count_ - 1))
            throw Error(fmt::format("{} from byte {} on do not fit into a buffer view of {}",
                                    counted(count_, "element"), at, counted(view_size, "byte")));
        begin_ = view_at + at;
        data_ = file.buffers[buffer].data() + begin_;
        inside_ = file.has_bin && buffer == 0;
    });
}

double Accessor::stored(const char* at) const {
    const auto as = [&]<class Number>(Number number) {
        std::memcpy(&number, at, sizeof number);
        return static_cast<double>(number);
    };
    switch (type_) {
    case 5120:
        return as(std::int8_t());
    case 5121:
        return as(std::uint8_t());
    case 5122:
        return as(std::int16_t());
    case 5123:
        return as(std::uint16_t());
    case 5125:
        return as(std::uint32_t());
    default:
        return as(float());
    }
}

double Accessor::operator()(std::size_t element, std::size_t number) const {
    const double value = stored(data_ + element * stride_ + number * size_);
    return fractions_ && !is_float() ? std::max(value / full_of_type[type_ - 5120], -1.0) : value;
}

std::string Accessor::encoded(double value) const {
    const auto bytes_of = []<class Number>(Number number) {
        const auto raw = std::bit_cast<std::array<char, sizeof number>>(number);
        return std::string(raw.data(), raw.size());
    };
    const double whole = fractions_ && !is_float() ? value * full_of_type[type_ - 5120] : value;
    switch (type_) {
    case 5120:
        return bytes_of(cv::saturate_cast<std::int8_t>(whole));
    case 5121:
        return bytes_of(cv::saturate_cast<std::uint8_t>(whole));
    case 5122:
        return bytes_of(cv::saturate_cast<std::int16_t>(whole));
    case 5123:
        return bytes_of(cv::saturate_cast<std::uint16_t>(whole));
    case 5125:
        return bytes_of(static_cast<std::uint32_t>(std::clamp(std::round(whole), 0.0, 4294967295.0)));
    default:
        return bytes_of(static_cast<float>(value));
    }
}

} // namespace scanshade
