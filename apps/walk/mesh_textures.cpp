#include "apps/walk/mesh_textures.h"

#include "ao/texture/texture_ao.h"
#include "io/clouds/mesh_textures.h"
#include "io/files.h"
#include "io/images/png_output.h"
#include "io/output_file.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <set>

namespace scanshade {
namespace {

namespace fs = std::filesystem;

/// The faces that one image shows.
struct ImagePlan {
    std::size_t material = 0, set = 0;
    int tile = 0; ///< UDIM's number; 0 = the material has one image
    std::vector<int> faces;
};

/// Those of a material that coordinates of a set can place.
std::vector<int> placed_faces(const TexturedMesh& mesh, std::size_t material, std::size_t set) {
    std::vector<int> faces;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
        if (mesh.material[i] == static_cast<int>(material) && has_place(mesh.sets[set][i]))
            faces.push_back(static_cast<int>(i));
    return faces;
}

/// Whether charts lie in one image and hardly overlap: coordinates made for textures that are not repeated.
bool is_atlas(const std::vector<TextureCorners>& corners, const std::vector<int>& faces) {
    constexpr float rounding = 1e-4F;
    constexpr double most_overlap = 0.01;
    constexpr int enough = 512; // texels, to see overlap
    const bool inside = std::ranges::all_of(faces, [&](int face) {
        return std::ranges::all_of(corners[static_cast<std::size_t>(face)], [](const Eigen::Vector2f& corner) {
            return corner.minCoeff() >= -rounding && corner.maxCoeff() <= 1 + rounding;
        });
    });
    if (!inside || faces.empty())
        return false;
    const Texels texels = texels_of(corners, faces, enough);
    return !texels.too_many && texels.overlap() < most_overlap;
}

/// The one that the material's occlusion texture uses already, else the first atlas, else the first with coordinates.
std::size_t chosen_set(const TexturedMesh& mesh, std::size_t material) {
    if (const auto named = mesh.materials[material].set; named && *named < mesh.sets.size())
        return *named;
    std::optional<std::size_t> any;
    for (std::size_t set = 0; set < mesh.sets.size(); ++set) {
        const std::vector<int> faces = placed_faces(mesh, material, set);
        if (mesh.sets.size() == 1 || is_atlas(mesh.sets[set], faces))
            return set;
        if (!any && !faces.empty())
            any = set;
    }
    return any.value_or(0);
}

/// UDIM's number of the image that a face lies in as a whole; 0 if it lies in several, or in none of those numbered.
int tile_of(const TextureCorners& corners) {
    constexpr float rounding = 1e-4F;
    const Eigen::Vector2f middle = (corners[0] + corners[1] + corners[2]) / 3;
    const float column = std::floor(middle.x()), row = std::floor(1 - middle.y()); // rows go up
    if (column < 0 || column > 9 || row < 0 || row > 99)
        return 0;
    for (const Eigen::Vector2f& corner : corners)
        if (std::abs(corner.x() - column - 0.5F) > 0.5F + rounding ||
            std::abs(1 - corner.y() - row - 0.5F) > 0.5F + rounding)
            return 0;
    return 1001 + static_cast<int>(column) + 10 * static_cast<int>(row);
}

/// One image, or one for each tile where whole numbers in coordinates name images.
std::vector<ImagePlan> images_of(const TexturedMesh& mesh, std::size_t material) {
    ImagePlan all{material, chosen_set(mesh, material), 0, {}};
    all.faces = placed_faces(mesh, material, all.set);
    if (all.faces.empty())
        return {};
    std::map<int, std::vector<int>> tiles;
    if (mesh.tiles)
        for (const int face : all.faces)
            tiles[tile_of(mesh.sets[all.set][static_cast<std::size_t>(face)])].push_back(face);
    constexpr int first_tile = 1001;
    if (tiles.empty() || tiles.contains(0) || (tiles.size() == 1 && tiles.contains(first_tile)))
        return {all};
    std::vector<ImagePlan> plans;
    for (auto& [tile, faces] : tiles)
        plans.push_back({material, all.set, tile, std::move(faces)});
    return plans;
}

/// A material's name as a part of file names, unlike those before.
std::string file_word(const MeshMaterial& material, std::size_t index, std::set<std::string>& taken) {
    constexpr std::size_t longest = 100;
    std::string word = material.name.empty() ? fmt::format("material{}", index) : shortened(material.name, longest);
    for (char& c : word)
        if (static_cast<unsigned char>(c) <= ' ' || std::string_view("/\\:*?\"<>|%#").find(c) != std::string_view::npos)
            c = '_';
    while (!taken.insert(word).second)
        word += '_';
    return word;
}

/// 0 is a value in textures, unlike in maps of images with holes.
cv::Mat integers(const cv::Mat1f& visibility, int depth) {
    cv::Mat values;
    visibility.convertTo(values, depth, depth == CV_8U ? 255 : 65535);
    return values;
}

std::string overlap_doubt(const std::string& name, double overlap) {
    return fmt::format("{}: {:.0f} % of the texture is used by more than one part of the surface (overlapping texture "
                       "coordinates); values there are means.",
                       name, 100 * overlap);
}

/// Files of one mesh, as they are written.
class TextureFiles {
  public:
    TextureFiles(Work& work, const Outputs& outputs)
        : work_(work), outputs_(outputs), cloud_(*work.frame.cloud), mesh_(textured_mesh(cloud_, work.entry.cloud)),
          inside_(holds_images(cloud_)) {}

    void write() {
        const TextureAo ao(cloud_.points, mesh_.triangles, mesh_.reversed,
                           {work_.of_points.radius, outputs_.texture.rays, outputs_.texture.seed});
        std::vector<std::vector<ImagePlan>> plans;
        for (std::size_t i = 0; i < mesh_.materials.size(); ++i)
            if (auto images = images_of(mesh_, i); !images.empty())
                plans.push_back(std::move(images));
        if (plans.empty())
            throw Error(work_.entry.cloud.string() + ": no face has finite texture coordinates, so no texture");
        const bool alone = plans.size() == 1;
        for (const std::vector<ImagePlan>& images : plans) {
            const std::size_t material = images.front().material;
            const std::string word = file_word(mesh_.materials[material], material, taken_);
            const bool tiled = images.front().tile > 0;
            const auto name = [&](const std::string& tile) {
                return work_.entry.name + (alone && !tiled ? "" : "." + word) + (tiled ? "." + tile : "") + ".ao" +
                       extension(outputs_.format);
            };
            OcclusionLink link{material, images.front().set, name("<UDIM>"), ""};
            for (const ImagePlan& plan : images)
                write_image(ao, plan, name(std::to_string(plan.tile)), link);
            links_.push_back(std::move(link));
            note_faces_left_out(images);
        }
        write_linked();
    }

  private:
    [[nodiscard]] std::string name_of(std::size_t material) const {
        const std::string& name = mesh_.materials[material].name;
        return name.empty() ? fmt::format("material {}", material) : name;
    }

    template <class Write>
    void wrote(const fs::path& name, const Write& write) {
        const fs::path file = fs::path(texture_folder) / name;
        if (std::ranges::find(work_.row.files, file) != work_.row.files.end())
            return;
        write(outputs_.files_folder() / file);
        work_.row.files.push_back(file);
    }

    void write_image(const TextureAo& ao, const ImagePlan& plan, const std::string& name, OcclusionLink& link) {
        const int size = outputs_.texture.size,
                  margin = outputs_.texture.margin < 0 ? size / 128 : outputs_.texture.margin;
        const OcclusionTexture made =
            during(name_of(plan.material), [&] { return ao.image(mesh_.sets[plan.set], plan.faces, size, margin); });
        if (inside_)
            link.png = encoded_png(integers(made.visibility, CV_8U));
        wrote(name, [&](const fs::path& file) {
            if (is_float(outputs_.format))
                write_ao(file, made.visibility, outputs_.format);
            else
                write_ao_integers(file, integers(made.visibility, outputs_.format == AoFormat::png8 ? CV_8U : CV_16U));
        });
        work_.row.notes.push_back(fmt::format(
            "{0}: {1} x {1} texels, {2:.0f} % covered; {3} rays from {4}, means on the surface, a margin of {5}.", name,
            size, 100.0 * static_cast<double>(made.covered) / (1.0 * size * size), made.rays,
            made.half ? "every second" : "each", margin));
        constexpr double hardly_any = 0.01;
        at_most(work_.row.findings, Check::texture_overlap, made.overlap, hardly_any,
                [&] { return overlap_doubt(name_of(plan.material), made.overlap); });
        for (const auto& [stage, ms] : made.timings)
            work_.row.passes.emplace_back("texture " + stage, ms);
    }

    void note_faces_left_out(const std::vector<ImagePlan>& images) {
        std::size_t shown = 0;
        for (const ImagePlan& plan : images)
            shown += plan.faces.size();
        const auto all =
            static_cast<std::size_t>(std::ranges::count(mesh_.material, static_cast<int>(images.front().material)));
        if (shown < all)
            work_.row.warnings.push_back(
                fmt::format("{}: {} without finite texture coordinates, left out of its texture.",
                            name_of(images.front().material), counted(all - shown, "face")));
    }

    void write_linked() {
        if (!inside_ && is_float(outputs_.format) && lower_extension(work_.entry.cloud) == ".gltf") {
            work_.row.notes.push_back("glTF takes PNG and JPEG: --format png16 or png8 links the textures.");
            links_.clear();
        }
        const fs::path folder = fs::path(work_.entry.cloud).parent_path();
        const LinkedFiles linked =
            linked_mesh(cloud_, work_.entry.cloud, work_.entry.name, mesh_, links_, outputs_.texture.replace);
        for (const LinkedFiles::File& each : linked.files)
            wrote(each.name, [&](const fs::path& file) { write_atomically(file, each.bytes); });
        std::ranges::copy(linked.notes, std::back_inserter(work_.row.notes));
        for (const fs::path& name : linked.copies)
            for (const fs::path& each : tiles_named(folder, name))
                if (is_file(folder / each))
                    wrote(each, [&](const fs::path& file) { write_atomically(file, read_bytes(folder / each)); });
                else
                    work_.row.notes.push_back(fmt::format("{} is not there, which the mesh names.", each.string()));
    }

    /// The files that <UDIM> in a name stands for; else the name.
    static std::vector<fs::path> tiles_named(const fs::path& folder, const fs::path& name) {
        const std::string text = name.string(), word = "<UDIM>";
        const std::size_t at = text.find(word);
        if (at == std::string::npos)
            return {name};
        std::vector<fs::path> there;
        for (int tile = 1001; tile < 2000; ++tile)
            if (fs::path each = std::string(text).replace(at, word.size(), std::to_string(tile));
                is_file(folder / each))
                there.push_back(std::move(each));
        return there;
    }

    Work& work_;
    const Outputs& outputs_;
    const Cloud& cloud_;
    TexturedMesh mesh_;
    bool inside_; ///< the mesh's file holds its images
    std::set<std::string> taken_;
    std::vector<OcclusionLink> links_;
};

} // namespace

void write_mesh_textures(Work& work, const Outputs& outputs) {
    try {
        if (!work.frame.cloud || !work.by_points)
            throw Error(work.entry.name + ": no mesh, so no texture; expected faces");
        TextureFiles(work, outputs).write();
    } catch (const Outage&) {
        throw;
    } catch (const Error& none) {
        if (work.row.files.empty())
            throw;
        work.row.warnings.push_back(std::string(none.what()) + ".");
    }
}

} // namespace scanshade
