// The texts of pages that hold no data of a run.
#include "apps/page/shell.h"

#include "apps/page/text.h"

#include <fmt/format.h>
#include <initializer_list>
#include <utility>
#include <vector>

namespace scanshade::page {
namespace {

/// A file of this folder. A page's policy names the hash of each script and style that it holds.
struct Part {
    std::string_view text, sha256; ///< the hash in hexadecimal digits
};

#include "files.inc"

/// The template with its marks {{name}} replaced, in one pass: what is put in is not searched.
std::string filled(std::string_view form, std::initializer_list<std::pair<std::string_view, std::string_view>> values) {
    std::string text;
    while (true) {
        const std::size_t at = form.find("{{");
        text += form.substr(0, at);
        if (at == std::string_view::npos)
            return text;
        const std::size_t end = form.find("}}", at);
        const std::string_view name = form.substr(at + 2, end - at - 2);
        for (const auto& [known, value] : values)
            if (known == name)
                text += value;
        form.remove_prefix(end + 2);
    }
}

/// Each part in an element of its own, with exactly the bytes of its hash.
std::string elements(std::string_view tag, const std::vector<Part>& parts) {
    std::string html;
    for (const Part& part : parts)
        html += fmt::format("<{0}>{1}</{0}>\n", tag, part.text);
    return html;
}

/// "'sha256-...'" for each part, as policies have it.
std::string hashes(const std::vector<Part>& parts) {
    std::string all;
    for (const Part& part : parts) {
        std::string bytes;
        for (std::size_t i = 0; i + 1 < part.sha256.size(); i += 2)
            bytes += static_cast<char>(std::stoi(std::string(part.sha256.substr(i, 2)), nullptr, 16));
        all += fmt::format(" 'sha256-{}'", base64(bytes));
    }
    return all;
}

/// The Content-Security-Policy: only these scripts and styles run, and with `from_folder` scripts and pictures of the
/// page's folder. 'self' is that folder's server; for a page on disk browsers differ in what it is, so that file: is
/// named, too. Nothing else is loaded, nothing sent, and no markup in data can change where addresses lead.
std::string policy(const std::vector<Part>& scripts, const std::vector<Part>& styles, bool from_folder) {
    const std::string_view folder = from_folder ? " 'self' file:" : "";
    const std::string script_rule = scripts.empty() ? "" : fmt::format("script-src{}{}; ", folder, hashes(scripts));
    return fmt::format("default-src 'none'; {}style-src{}; img-src{} data:; base-uri 'none'; form-action 'none'",
                       script_rule, hashes(styles), folder);
}

/// The same head for all pages.
std::string head(std::string_view title, const std::vector<Part>& scripts, const std::vector<Part>& styles,
                 bool from_folder) {
    return filled(head_html.text, {{"title", escaped(title)},
                                   {"policy", policy(scripts, styles, from_folder)},
                                   {"styles", elements("style", styles)}});
}

/// A page of the body's template that shows index.js beside it.
std::string shell(const Part& body, std::string_view title, const std::vector<Part>& scripts) {
    std::vector<Part> all = scripts;
    all.push_back(begin_js);
    const std::string top =
        filled(top_html.text, {{"head", head(title, all, {style_css}, true)}, {"title", escaped(title)}});
    return filled(body.text,
                  {{"top", top}, {"scripts", elements("script", scripts)}, {"begin", elements("script", {begin_js})}});
}

} // namespace

std::string run_shell(std::string_view title) {
    return shell(page_html, title,
                 {core_js, link_js, table_js, plots_js, maps_js, frames_js, camera_js, chunks_js, octree_js, sources_js,
                  painter_js, colourings_js, colour_control_js, clip_js, picking_js, points_js, run_js});
}

std::string list_shell(std::string_view title) { return shell(list_html, title, {core_js, table_js, list_js}); }

std::string document_shell(std::string_view title, std::string_view main) {
    return filled(document_html.text, {{"head", head(title, {}, {style_css, document_css}, false)},
                                       {"title", escaped(title)},
                                       {"version", SCANSHADE_VERSION},
                                       {"main", main}});
}

} // namespace scanshade::page
