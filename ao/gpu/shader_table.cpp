#include "ao/gpu/shader_table.h"

#include "projection/base/error.h"

#include <iterator>
#include <string>

namespace scanshade::gpu {
namespace {

#include "words.inc" // generated: one array of words per shader

struct Row {
    std::string_view name;
    std::span<const std::uint32_t> words;
};

const Row table[] = {
#include "table.inc" // generated: {"cacao/blur", {cacao_blur, size}}, ...
};

} // namespace

std::span<const std::uint32_t> shader_words(std::string_view name) {
    for (const Row& row : table)
        if (row.name == name)
            return row.words;
    throw Error("unknown shader " + std::string(name));
}

} // namespace scanshade::gpu
