// What every screen-space room but CACAO's shares on the host: upload, normals, the room's own passes, denoise,
// download.
#pragma once

#include "ao/gpu/program.h"
#include "ao/method.h"
#include "projection/error.h"
#include "shaders/shared/screen.h"

#include <memory>
#include <string>
#include <vector>

namespace scanshade {

/// The settings all these rooms have. A room keeps one in its own Options and appends its rows.
struct ScreenOptions {
    float radius = 0.5F;
    float strength = 1, power = 1;
    bool denoise = true;
    float tangent_sine = 0.02F;   ///< beta_t of the rule that keeps a surface from occluding itself
    float tangent_sigmas = 4.24F; ///< kappa of that rule, 3 sqrt 2: a difference of two depths, three deviations
    int seed = 0;

    [[nodiscard]] std::vector<Parameter> parameters();
};

/// The buffers every room has, in this order; a room's own follow from screen_own.
enum ScreenBuffer : int {
    screen_depth,      ///< r32f, metres, 0 = hole; nothing else is invalid
    screen_given,      ///< r32f, three a pixel: the view's normals, where it brings any
    screen_surfaces,   ///< rgba32f: normal, unit, facing the camera, (0, 0, 0) exactly in holes; depth
    screen_noise,      ///< rg32f, 64x64: see lib/noise.glsl
    screen_raw,        ///< r32f: visibility before denoise, finite everywhere
    screen_visibility, ///< r32f: the result, NaN in holes
    screen_own
};

/// Everything one configuration runs, as plain data.
struct ScreenTables {
    cv::Size size;
    std::vector<gpu::BufferRow> buffers;
    std::vector<gpu::PassRow> passes;

    /// Appends a buffer and tells its index.
    int add_buffer(gpu::BufferRow row);
    /// Appends a pass of one thread per `pixels_a_side` squared pixels.
    void add_pass(std::string name, std::string_view shader, std::vector<int> reads, std::vector<int> writes,
                  std::vector<std::pair<int, int>> constants = {}, int pixels_a_side = 1);
    /// Appends so many iterations of a separable blur of screen_raw over the pixels of the same surface; `weights` are
    /// those of offsets 0, 1, 2 ... to either side.
    void add_blurs(int iterations, const std::vector<float>& weights);
    [[nodiscard]] std::size_t pixels() const { return static_cast<std::size_t>(size.area()); }
};

/// A method of which the room itself is only the part from depth and normals to raw visibility.
class ScreenMethod : public Method {
  public:
    AoMap compute(const View& view) final;
    [[nodiscard]] const Timings& timings() const final { return timings_; }

  protected:
    ScreenMethod(gpu::Device& device, const ScreenOptions& options) : device_(device), options_(options) {}

    /// Appends the room's buffers and passes: screen_depth, screen_surfaces, screen_noise -> screen_raw.
    virtual void add_passes(ScreenTables& tables) const = 0;
    /// Appends what makes screen_visibility of screen_raw: the shared 5x5 mean, unless a room has its own.
    virtual void add_denoise(ScreenTables& tables) const;
    /// The room's constant block. It begins with `screen`.
    [[nodiscard]] virtual std::vector<std::byte> constants(const shared::ScreenConstants& screen) const = 0;

  private:
    [[nodiscard]] ScreenTables tables(cv::Size size, bool supplied) const;

    gpu::Device& device_;
    ScreenOptions options_;
    cv::Size size_; // that program_ was made for
    bool supplied_ = false;
    std::unique_ptr<gpu::Program> program_;
    Timings timings_;
};

/// The row of that quality; the choices of the parameter row are those of the table.
template <class Levels>
[[nodiscard]] const auto& level_of(const Levels& levels, const std::string& quality) {
    for (const auto& level : levels)
        if (quality == level.quality)
            return level;
    throw Misuse("no quality '" + quality + "'");
}

/// The rows all rooms have, then a room's own.
[[nodiscard]] std::vector<Parameter> joined(std::vector<Parameter> rows, const std::vector<Parameter>& more);

/// The constants of one view.
[[nodiscard]] shared::ScreenConstants constants_from(const ScreenOptions& options, const View& view);

/// The bytes of a constant block.
template <class Constants>
[[nodiscard]] std::vector<std::byte> bytes_of(const Constants& block) {
    const auto* const first = reinterpret_cast<const std::byte*>(&block);
    return {first, first + sizeof block};
}

/// The options themselves, once every row is found within its range; throws Misuse naming the first that is not.
template <class Options>
[[nodiscard]] Options checked(Options options) {
    for (const Parameter& row : options.parameters())
        check(row);
    return options;
}

} // namespace scanshade
