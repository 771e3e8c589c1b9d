// The texts of pages that hold no data of a run: markup, style and scripts, all in one file.
#pragma once

#include <string>
#include <string_view>

namespace scanshade::page {

/// index.html of a run or a comparison, and of a list of captures; index.js beside it brings the data.
[[nodiscard]] std::string run_shell(std::string_view title);
[[nodiscard]] std::string list_shell(std::string_view title);

/// A page of one column without scripts. `main` is HTML.
[[nodiscard]] std::string document_shell(std::string_view title, std::string_view main);

} // namespace scanshade::page
