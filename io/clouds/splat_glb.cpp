// Gaussian splats as points of a binary glTF (Khronos, KHR_gaussian_splatting, release candidate of 2026).
#include "io/clouds/meshes/gltf_file.h"
#include "io/clouds/meshes/mesh_file.h"
#include "io/clouds/packed_splats.h"
#include "io/clouds/splats.h"
#include "io/text.h"
#include "projection/base/statistics.h"
#include "projection/srgb.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <Eigen/Eigenvalues>
#include <fmt/format.h>
#include <limits>
#include <numbers>
#include <set>
#include <tbb/parallel_for.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

using Eigen::Matrix3d, Eigen::Vector3d;

/// A primitive of splats, and where the scene shows it.
struct Shown {
    std::size_t mesh = 0, primitive = 0;
    Eigen::Affine3d place;
    std::size_t first = 0, count = 0; ///< among all splats
    bool linear = false;              ///< colours are linear light, not sRGB
};

std::string attribute(std::string_view name) { return fmt::format("{}:{}", splat_extension, name); }

const OrderedJson& primitive_of(const OrderedJson& json, const Shown& shown) {
    return json["meshes"][shown.mesh]["primitives"][shown.primitive];
}

/// Throws Error for what is not read.
bool is_linear(const OrderedJson& extension) {
    if (const std::string kernel = extension.value("kernel", ""); kernel != "ellipse")
        throw Error(fmt::format("splats of the kernel {} are not read, those of \"ellipse\" are", in_quotes(kernel)));
    if (const auto more = extension.find("extensions"); more != extension.end())
        for (const auto& [name, unused] : more->items())
            if (name.find("compression") != std::string::npos)
                throw Error(fmt::format("splats packed by {} are not read", in_quotes(name)));
    const std::string space = extension.value("colorSpace", "srgb_rec709_display");
    if (space != "srgb_rec709_display" && space != "lin_rec709_display")
        throw Error(fmt::format("splats of the colour space {} are not read", in_quotes(space)));
    return space.starts_with("lin");
}

/// All of the scene, in its order.
std::vector<Shown> shown_in(const GltfFile& gltf, std::size_t& others) {
    std::vector<Shown> all;
    std::set<std::size_t> meshes;
    std::size_t first = 0;
    visit_nodes(gltf.json, [&](const OrderedJson& node, const Eigen::Affine3d& place) {
        if (!node.contains("mesh"))
            return;
        const std::size_t index = whole_in(node, "mesh");
        const OrderedJson& mesh = scanshade::element_of(gltf.json, "meshes", index);
        for (std::size_t i = 0; i < size_of_table(mesh, "primitives"); ++i)
            within(fmt::format("primitive {}", i), [&] {
                const OrderedJson& primitive = mesh["primitives"][i];
                const auto extensions = primitive.find("extensions");
                if (extensions == primitive.end() || !extensions->contains(splat_extension)) {
                    ++others;
                    return;
                }
                if (whole_in(primitive, "mode", 4) != 0)
                    throw Error("splats have the mode 0, points");
                if (!meshes.insert(index).second && i == 0)
                    throw Error(fmt::format("mesh {} of splats is shown by several nodes, which is not read", index));
                const Accessor positions(gltf, whole_in(primitive.at("attributes"), "POSITION"));
                all.push_back({index, i, place, first, positions.count(), is_linear((*extensions)[splat_extension])});
                first += positions.count();
            });
    });
    return all;
}

/// Accessors of a primitive, checked.
struct Attributes {
    Accessor position, rotation, scale, opacity, colour;
    std::vector<Accessor> rest; ///< all coefficients but the first
    std::optional<Accessor> fallback;

    Attributes(const GltfFile& gltf, const OrderedJson& table, std::size_t count)
        : position(found(gltf, table, "POSITION", 3, count)),
          rotation(found(gltf, table, attribute("ROTATION"), 4, count)),
          scale(found(gltf, table, attribute("SCALE"), 3, count)),
          opacity(found(gltf, table, attribute("OPACITY"), 1, count)),
          colour(found(gltf, table, attribute("SH_DEGREE_0_COEF_0"), 3, count)) {
        for (int degree = 1; degree <= 4; ++degree)
            for (int k = 0; k <= 2 * degree; ++k) {
                const std::string name = attribute(fmt::format("SH_DEGREE_{}_COEF_{}", degree, k));
                if (table.contains(name))
                    rest.push_back(found(gltf, table, name, 3, count));
            }
        if (table.contains("COLOR_0"))
            fallback = found(gltf, table, "COLOR_0", 0, count);
    }

  private:
    static Accessor found(const GltfFile& gltf, const OrderedJson& table, const std::string& name, std::size_t width,
                          std::size_t count) {
        return within(name, [&] {
            if (!table.contains(name))
                throw Error("is missing, which splats have");
            const Accessor accessor(gltf, whole_in(table, name.c_str()));
            if (accessor.count() != count)
                throw Error(fmt::format("{} for {}", counted(accessor.count(), "element"), counted(count, "splat")));
            if (width > 0 ? accessor.width() != width : accessor.width() < 3)
                throw Error(fmt::format("elements of {}, expected {}", counted(accessor.width(), "number"), width));
            if (!accessor.is_inside())
                throw Error("lies in no buffer of this file");
            return accessor;
        });
    }
};

double display_from(double colour, bool linear) { return linear ? srgb_from_linear(std::max(colour, 0.0)) : colour; }

/// Numbers below 0 are logarithms: drafts of the extension had these.
bool has_logarithms(const Accessor& scale) {
    for (std::size_t i = 0; i < scale.count(); ++i)
        for (std::size_t k = 0; k < 3; ++k)
            if (scale(i, k) < 0)
                return true;
    return false;
}

/// A Gaussian with the axes `turned` and these sigmas, seen through a node.
void put_through(const Matrix3d& linear, Matrix3d& turned, Vector3d& sigma) {
    const Matrix3d gram = linear.transpose() * linear;
    const double square = gram.trace() / 3;
    if ((gram - square * Matrix3d::Identity()).norm() <= 1e-9 * square) { // turned and scaled alike
        turned = linear * turned / std::sqrt(square);
        sigma *= std::sqrt(square);
    } else {
        const Matrix3d axes = linear * turned * sigma.asDiagonal();
        const Eigen::SelfAdjointEigenSolver<Matrix3d> covariance(axes * axes.transpose());
        turned = covariance.eigenvectors();
        sigma = covariance.eigenvalues().cwiseMax(0).cwiseSqrt();
    }
    if (turned.determinant() < 0)
        turned = -turned;
}

void read_primitive(const Attributes& from, const Shown& shown, bool logarithms, SplatTable& table) {
    const Matrix3d linear = shown.place.linear();
    const bool moved = !linear.isIdentity();
    tbb::parallel_for(std::size_t(0), shown.count, [&](std::size_t i) {
        const auto three = [i](const Accessor& accessor) {
            return Vector3d(accessor(i, 0), accessor(i, 1), accessor(i, 2));
        };
        Eigen::Quaterniond rotation(from.rotation(i, 3), from.rotation(i, 0), from.rotation(i, 1), from.rotation(i, 2));
        Vector3d sigma = three(from.scale);
        if (logarithms)
            sigma = sigma.array().exp();
        if (moved && rotation.norm() > 0) {
            Matrix3d turned = rotation.normalized().toRotationMatrix();
            put_through(linear, turned, sigma);
            rotation = Eigen::Quaterniond(turned);
        }
        Vector3d colour = Eigen::Array3d::Constant(0.5) + colour_of_degree_0 * three(from.colour).array();
        for (double& channel : colour)
            channel = display_from(channel, shown.linear);
        table.set(shown.first + i, {.position = (shown.place * three(from.position)).cast<float>(),
                                    .colour = colour.cast<float>(),
                                    .log_sigma = sigma.array().log().matrix().cast<float>(),
                                    .opacity = static_cast<float>(from.opacity(i, 0)),
                                    .rotation = rotation.cast<float>()});
    });
}

/// Where no number is below 0, sigmas larger than the whole may be logarithms all the same.
std::string doubt_of(const std::vector<Attributes>& all) {
    Eigen::AlignedBox3d box;
    std::vector<float> sigmas;
    for (const Attributes& each : all)
        for (std::size_t i = 0; i < each.scale.count(); ++i) {
            sigmas.push_back(static_cast<float>(std::max({each.scale(i, 0), each.scale(i, 1), each.scale(i, 2)})));
            box.extend(Vector3d(each.position(i, 0), each.position(i, 1), each.position(i, 2)));
        }
    if (sigmas.empty() || static_cast<double>(median(sigmas)) <= box.sizes().maxCoeff())
        return {};
    return fmt::format("half of the splats are wider than all of the scene ({:.3g}): SCALE is taken for sigmas, as the "
                       "extension has it, but may be their logarithms.",
                       box.sizes().maxCoeff());
}

/// The BIN chunk without its padding, to be changed.
std::string bin_of(const GltfFile& gltf) {
    return gltf.has_bin ? gltf.buffers[0].substr(0, whole_in(gltf.json["buffers"][0], "byteLength")) : "";
}

/// The number of an accessor, and the numbers in each of its elements that take a factor or a new value.
class Changes {
  public:
    Changes(const GltfFile& gltf, OrderedJson& json, std::string& bin) : gltf_(gltf), json_(json), bin_(bin) {}

    /// `changed(element, channel, value)` for the first three numbers of each element.
    template <class Changed>
    void each(const OrderedJson& attributes, const std::string& name, const Changed& changed) {
        const std::size_t index = whole_in(attributes, name.c_str());
        if (!done_.insert(index).second)
            throw Error(fmt::format("accessor {} is used twice, so its colours cannot be shaded", index));
        const Accessor accessor(gltf_, index);
        tbb::parallel_for(std::size_t(0), accessor.count(), [&](std::size_t i) {
            for (std::size_t channel = 0; channel < 3; ++channel) {
                const double before = accessor(i, channel), after = changed(i, channel, before);
                if (after != before) {
                    const std::string bytes = accessor.encoded(after);
                    std::memcpy(bin_.data() + accessor.place(i, channel), bytes.data(), bytes.size());
                }
            }
        });
        update_limits(index);
    }

  private:
    /// Which accessors may have, and then must be true.
    void update_limits(std::size_t index) {
        OrderedJson& row = json_["accessors"][index];
        if (!row.contains("min") && !row.contains("max"))
            return;
        GltfFile now{.json = json_, .buffers = {bin_}, .chunks = {}, .binary = true, .has_bin = true};
        const Accessor accessor(now, index);
        for (const char* end : {"min", "max"})
            for (std::size_t k = 0; row.contains(end) && k < accessor.width(); ++k) {
                double value = accessor(0, k);
                for (std::size_t i = 0; i < accessor.count(); ++i)
                    value = end[1] == 'i' ? std::min(value, accessor(i, k)) : std::max(value, accessor(i, k));
                if (accessor.is_float())
                    row[end][k] = value;
            }
    }

    const GltfFile& gltf_;
    OrderedJson& json_;
    std::string& bin_;
    std::set<std::size_t> done_;
};

/// ambient_occlusion is the attribute _AMBIENT_OCCLUSION, and so on.
std::string attribute_of(const std::string& field) {
    std::string name = "_" + field;
    std::ranges::transform(name, name.begin(), [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    return name;
}

/// NaN has no place in glTF.
std::string floats_of(std::span<const float> values) {
    std::string bytes(values.size() * sizeof(float), '\0');
    for (std::size_t i = 0; i < values.size(); ++i) {
        const float value = std::isnan(values[i]) ? -1 : values[i];
        std::memcpy(bytes.data() + i * sizeof value, &value, sizeof value);
    }
    return bytes;
}

/// In place of numbers that are there.
void put_floats(const Accessor& there, const std::string& values, std::string& bin) {
    if (!there.is_float() || there.width() != 1 || there.count() * sizeof(float) != values.size() || !there.is_inside())
        throw Error("the attribute of that name is no float of each splat; it is not replaced");
    for (std::size_t i = 0; i < there.count(); ++i)
        bin.replace(there.place(i, 0), sizeof(float), values, i * sizeof(float), sizeof(float));
}

} // namespace

bool is_splat_glb(std::string_view start) {
    constexpr std::size_t at_json = 20;
    if (!is_glb(start) || start.size() < at_json)
        return false;
    std::uint32_t length = 0;
    std::memcpy(&length, start.data() + 12, sizeof length);
    return start.substr(at_json, length).find(fmt::format("\"{}", splat_extension)) != std::string_view::npos;
}

CloudRecords read_splat_glb(std::string_view bytes, const fs::path& file, std::vector<std::string>& warnings) {
    return within(file.string(), [&] {
        const GltfFile gltf = gltf_file(bytes, file, false);
        refuse_extensions(gltf.json);
        std::size_t others = 0;
        const std::vector<Shown> all = shown_in(gltf, others);
        if (others > 0)
            warnings.push_back(fmt::format("{}: {} beside its splats, which do not occlude.", file.string(),
                                           counted(others, "primitive")));
        std::vector<Attributes> attributes;
        bool logarithms = false;
        for (const Shown& shown : all)
            within(fmt::format("mesh {}: primitive {}", shown.mesh, shown.primitive), [&] {
                attributes.emplace_back(gltf, primitive_of(gltf.json, shown)["attributes"], shown.count);
                logarithms = logarithms || has_logarithms(attributes.back().scale);
            });
        if (logarithms)
            warnings.push_back(file.string() + ": SCALE has numbers below 0: taken as logarithms of sigmas, as drafts "
                                               "of the extension had them.");
        else if (const std::string doubt = doubt_of(attributes); !doubt.empty())
            warnings.push_back(fmt::format("{}: {}", file.string(), doubt));
        SplatTable table(all.empty() ? 0 : all.back().first + all.back().count, file);
        for (std::size_t i = 0; i < all.size(); ++i)
            read_primitive(attributes[i], all[i], logarithms, table);
        return std::move(table).records(std::string(bytes));
    });
}

std::string splat_glb_bytes(const CloudRecords& records, std::string, const std::vector<FieldAddition>& additions) {
    return within("glTF", [&] {
        GltfFile gltf = gltf_file(records.packed, "", false);
        std::size_t others = 0;
        const std::vector<Shown> all = shown_in(gltf, others);
        std::string bin = bin_of(gltf);
        for (const Shown& shown : all)
            for (const FieldAddition& field : additions) {
                const std::string values = floats_of(field.values.subspan(shown.first, shown.count));
                OrderedJson& table = gltf.json["meshes"][shown.mesh]["primitives"][shown.primitive]["attributes"];
                if (table.contains(attribute_of(field.name))) { // of an earlier run
                    put_floats(Accessor(gltf, whole_in(table, attribute_of(field.name).c_str())), values, bin);
                    continue;
                }
                const std::size_t view = stored(gltf.json, bin, values);
                gltf.json["bufferViews"][view]["target"] = 34962; // for vertices
                constexpr int float32 = 5126;
                const std::size_t accessor = appended(
                    gltf.json, "accessors",
                    {{"bufferView", view}, {"componentType", float32}, {"count", shown.count}, {"type", "SCALAR"}});
                table[attribute_of(field.name)] = accessor;
            }
        return glb_bytes(gltf.json, std::move(bin), gltf.chunks);
    });
}

std::string shaded_splat_glb(const CloudRecords& records, std::span<const float> visibility, double strength) {
    return within("glTF", [&] {
        const GltfFile gltf = gltf_file(records.packed, "", false);
        std::size_t others = 0;
        const std::vector<Shown> all = shown_in(gltf, others);
        OrderedJson json = gltf.json;
        std::string bin = bin_of(gltf);
        Changes changes(gltf, json, bin);
        for (const Shown& shown : all) {
            const OrderedJson& table = primitive_of(gltf.json, shown)["attributes"];
            const Attributes from(gltf, table, shown.count);
            const auto light = [&](std::size_t i) { return light_of(visibility[shown.first + i], strength); };
            const auto colour = [&](std::size_t i, std::size_t channel) {
                return 0.5 + colour_of_degree_0 * from.colour(i, channel);
            };
            const auto scaled = [&](std::size_t i, std::size_t channel, double value) {
                if (light(i) == 1)
                    return value;
                return value * (shown.linear ? light(i) : shaded_factor(colour(i, channel), light(i)));
            };
            changes.each(table, attribute("SH_DEGREE_0_COEF_0"), [&](std::size_t i, std::size_t channel, double value) {
                const double before = colour(i, channel);
                if (light(i) == 1 || !std::isfinite(before))
                    return value;
                const double after = shown.linear ? before * light(i) : shaded_channel(before, light(i));
                return (after - 0.5) / colour_of_degree_0;
            });
            for (const auto& [name, unused] : table.items())
                if (name == "COLOR_0" ||
                    (name.starts_with(attribute("SH_DEGREE_")) && name != attribute("SH_DEGREE_0_COEF_0")))
                    changes.each(table, name, scaled);
        }
        return glb_bytes(json, std::move(bin), gltf.chunks);
    });
}

} // namespace scanshade
