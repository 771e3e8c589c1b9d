// The texts of pages that hold no data of a run.
#include "apps/page/shell.h"

#include "apps/page/text.h"

#include <array>
#include <initializer_list>
#include <utility>

namespace scanshade::page {
namespace {

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

std::string joined(std::initializer_list<std::string_view> scripts) {
    std::string all = "\n";
    for (const std::string_view script : scripts)
        all += script;
    return all;
}

/// A page of the body's template; both have the same head.
std::string shell(std::string_view body, std::string_view title, const std::string& script) {
    const std::string head = filled(head_html, {{"title", escaped(title)}, {"style", style_css}});
    return filled(body, {{"head", head}, {"script", script}});
}

} // namespace

std::string run_shell(std::string_view title) {
    return shell(page_html, title,
                 joined({core_js, table_js, plots_js, maps_js, frames_js, camera_js, points_js, run_js}));
}

std::string list_shell(std::string_view title) { return shell(list_html, title, joined({core_js, table_js, list_js})); }

std::string_view shared_style() { return style_css; }
std::string_view document_style() { return document_css; }

} // namespace scanshade::page
