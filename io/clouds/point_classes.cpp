#include "io/clouds/point_classes.h"

#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"

#include <array>

namespace scanshade {
namespace {

/// The low bits of a field of bytes, per point; empty where the cloud has no such field.
std::vector<std::uint8_t> bits_of(const Cloud& cloud, const char* field, unsigned mask,
                                  const std::filesystem::path& file) {
    std::vector<std::uint8_t> bits;
    if (cloud.records && cloud.records->field_named(field))
        for (const float value : recorded_field(cloud, field, file))
            bits.push_back(static_cast<std::uint8_t>(static_cast<unsigned>(value) & mask));
    return bits;
}

bool has(const Cloud& cloud, const char* field) {
    return cloud.records && cloud.records->field_named(field).has_value();
}

} // namespace

// Point formats 6 and more have a byte of return numbers; in the older ones other flags share the bytes.
std::vector<std::uint8_t> classes_of(const Cloud& cloud, const std::filesystem::path& file) {
    const bool shared = has(cloud, "return_flags") && !has(cloud, "return_numbers");
    return bits_of(cloud, "classification", shared ? 0x1f : 0xff, file);
}

std::vector<std::uint8_t> returns_of(const Cloud& cloud, const std::filesystem::path& file) {
    return has(cloud, "return_numbers") ? bits_of(cloud, "return_numbers", 0xf, file)
                                        : bits_of(cloud, "return_flags", 0x7, file);
}

std::string_view class_name(std::uint8_t code) {
    static constexpr std::array<std::string_view, 23> names{"never classified",
                                                            "unclassified",
                                                            "ground",
                                                            "low vegetation",
                                                            "medium vegetation",
                                                            "high vegetation",
                                                            "building",
                                                            "low noise",
                                                            "model key-point",
                                                            "water",
                                                            "rail",
                                                            "road surface",
                                                            "overlap",
                                                            "wire guard",
                                                            "wire conductor",
                                                            "tower",
                                                            "insulator",
                                                            "bridge deck",
                                                            "high noise",
                                                            "overhead structure",
                                                            "ignored ground",
                                                            "snow",
                                                            "temporal exclusion"};
    constexpr std::uint8_t users = 64;
    return code < names.size() ? names[code] : code < users ? "reserved" : "user-defined";
}

} // namespace scanshade
