// An OBJ and its materials again, with images of occlusion. MTL has no slot for these; map_Ka, the reflectance of
// ambient light, means what they do, and what reads neither ignores it.
#include "io/clouds/meshes/mesh_file.h"

#include "io/files.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <fmt/format.h>
#include <map>
#include <set>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

/// A file's text, line by line, each with its end.
std::vector<std::string_view> lines_of(std::string_view text) {
    std::vector<std::string_view> lines;
    while (!text.empty()) {
        const std::size_t end = std::min(text.find('\n'), text.size() - 1) + 1;
        lines.push_back(text.substr(0, end));
        text.remove_prefix(end);
    }
    return lines;
}

/// What stands behind a line's first word, if it is this one.
std::optional<std::string_view> behind(std::string_view line, std::string_view word) {
    line = trimmed(line);
    if (!line.starts_with(word) || line.size() == word.size() ||
        (line[word.size()] != ' ' && line[word.size()] != '\t'))
        return std::nullopt;
    return trimmed(line.substr(word.size()));
}

/// The file of a texture's line: what follows options, which begin with a minus and take numbers or on and off.
std::string_view file_of_map(std::string_view rest) {
    while (rest.starts_with('-')) {
        const std::size_t option = rest.find_first_of(" \t");
        rest = option == std::string_view::npos ? "" : trimmed(rest.substr(option));
        while (!rest.empty()) {
            const std::string_view word = rest.substr(0, rest.find_first_of(" \t"));
            const bool value = number(word) || word == "on" || word == "off" || (word.size() == 1 && word != "-");
            if (!value)
                break;
            rest = trimmed(rest.substr(word.size()));
        }
    }
    return rest;
}

/// The names behind mtllib: one with blanks, if there is such a file, else a word each.
std::vector<std::string> libraries_in(std::string_view rest, const fs::path& folder) {
    if (const auto path = path_within(rest); path && is_file(folder / *path))
        return {std::string(rest)};
    std::vector<std::string> names;
    for (const std::string_view word : words(rest))
        names.emplace_back(word);
    return names;
}

/// One MTL, and what it gets.
class Materials {
  public:
    Materials(const TexturedMesh& mesh, std::span<const OcclusionLink> links, LinkedFiles& made,
              std::set<std::size_t>& linked)
        : mesh_(mesh), links_(links), made_(made), linked_(linked) {}

    std::string with_links(std::string_view text) {
        std::string out;
        for (const std::string_view line : lines_of(text)) {
            if (const auto name = behind(line, "newmtl")) {
                finish(out);
                begin(std::string(*name));
            }
            out += line;
            if (behind(line, "Ka") && link_ && !written_)
                add_link(out, line);
            look_at(line);
        }
        finish(out);
        return out;
    }

  private:
    void begin(const std::string& name) {
        name_ = name;
        link_ = nullptr;
        written_ = has_map_ = false;
        for (const OcclusionLink& link : links_)
            if (mesh_.materials[link.material].name == name && linked_.insert(link.material).second)
                link_ = &link;
    }

    void look_at(std::string_view line) {
        const auto name = words(line);
        if (name.empty())
            return;
        const bool map = name[0].starts_with("map_") || name[0] == "bump" || name[0] == "disp" || name[0] == "norm" ||
                         name[0] == "decal" || name[0] == "refl";
        if (const auto rest = map ? behind(line, name[0]) : std::nullopt)
            if (const auto path = path_within(file_of_map(*rest)))
                made_.copies.push_back(*path);
        has_map_ = has_map_ || name[0] == "map_Ka";
        if (const auto ka = behind(line, "Ka"); ka && link_) {
            const auto all = words(*ka);
            if (all.size() == 3 && std::ranges::all_of(all, [](std::string_view w) { return number(w) == 0.0; }))
                made_.notes.push_back(fmt::format("material {}: Ka is 0 0 0, so what multiplies it by map_Ka is black.",
                                                  in_quotes(name_)));
        }
    }

    void add_link(std::string& out, std::string_view before) {
        const std::string end = before.ends_with("\r\n") ? "\r\n" : "\n";
        if (!out.empty() && !out.ends_with('\n'))
            out += end;
        at_ = out.size();
        line_ = "map_Ka " + link_->image + end;
        out += line_;
        written_ = true;
    }

    /// A material without Ka gets its link at its end. One that has a map_Ka keeps it.
    void finish(std::string& out) {
        if (!link_)
            return;
        if (has_map_) {
            if (written_)
                out.erase(at_, line_.size());
            made_.notes.push_back(fmt::format("material {} has a map_Ka, which is kept: {} is not linked.",
                                              in_quotes(name_), link_->image));
        } else if (!written_) {
            const std::size_t text_ends = out.find_last_not_of("\r\n \t");
            const std::size_t end = text_ends == std::string::npos ? out.size() : out.find('\n', text_ends);
            const std::string rest = end == std::string::npos ? "" : out.substr(end + 1);
            out.resize(end == std::string::npos ? out.size() : end + 1);
            add_link(out, out);
            out += rest;
        }
        link_ = nullptr;
    }

    const TexturedMesh& mesh_;
    std::span<const OcclusionLink> links_;
    LinkedFiles& made_;
    std::set<std::size_t>& linked_;
    std::string name_, line_;
    const OcclusionLink* link_ = nullptr; ///< of the material at hand
    bool written_ = false, has_map_ = false;
    std::size_t at_ = 0; ///< of the written line
};

} // namespace

LinkedFiles linked_obj(std::string_view bytes, const fs::path& file, const std::string& name, const TexturedMesh& mesh,
                       std::span<const OcclusionLink> links) {
    LinkedFiles made;
    std::vector<LinkedFiles::File> libraries;
    std::set<std::size_t> linked;
    std::map<std::string, std::string> own_names; // of libraries that are there
    std::string obj;
    for (const std::string_view line : lines_of(bytes)) {
        const auto rest = behind(line, "mtllib");
        if (!rest) {
            obj += line;
            continue;
        }
        std::string names;
        for (const std::string& library : libraries_in(*rest, file.parent_path())) {
            const auto path = path_within(library);
            const auto [own, is_new] = own_names.try_emplace(library, library);
            if (is_new && path && is_file(file.parent_path() / *path)) {
                own->second = libraries.empty() ? name + ".mtl" : fmt::format("{}.{}.mtl", name, libraries.size() + 1);
                Materials materials(mesh, links, made, linked);
                libraries.push_back({own->second, materials.with_links(read_bytes(file.parent_path() / *path))});
            } else if (is_new) {
                made.notes.push_back(fmt::format("{}: {} is not there.", file.filename().string(), in_quotes(library)));
            }
            names += (names.empty() ? "" : " ") + own->second;
        }
        const std::size_t at = line.find(*rest);
        obj.append(line.substr(0, at)).append(names).append(line.substr(at + rest->size()));
    }
    for (const OcclusionLink& link : links)
        if (!linked.contains(link.material))
            made.notes.push_back(fmt::format("no MTL has the material {}: {} is not linked.",
                                             in_quotes(mesh.materials[link.material].name), link.image));
    made.files.push_back({name + ".obj", std::move(obj)});
    std::ranges::move(libraries, std::back_inserter(made.files));
    return made;
}

} // namespace scanshade
