// What every screen-space room but CACAO's shares on the host: upload, normals, the room's own passes, denoise,
// download.
#pragma once

#include "ao/base/method.h"
#include "ao/base/quality.h"
#include "ao/gpu/program.h"
#include "projection/base/error.h"
#include "shaders/shared/screen.h"

#include <map>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

namespace scanshade {

/// Whether a room measures visibility within the radius, or keeps the constants of what it follows.
enum class Profile { metric, published };
inline constexpr std::array profile_words{Named{"metric", Profile::metric}, Named{"published", Profile::published}};

/// As ScreenOptions::curve: the constant that was fitted to scenes with truth, which a room puts in its place.
inline constexpr float fitted_curve = -1;

/// The settings all these rooms have. A room keeps one in its own Options and appends its rows.
struct ScreenOptions {
    float radius = 0.5F;
    float strength = 1, power = 1;
    float curve = 0; ///< k of the tone curve exp(-k (1 - V)), before the two above; 0: none. Rooms that have one of
                     ///< their own append curve_row()
    bool denoise = true;
    int seed = 0;
    // A surface must not occlude itself. The method, not a person, says how that is kept from happening:
    float tangent_sine = 0.02F;   ///< beta_t: samples lower above the tangent plane than this do not count (sine)
    float tangent_sigmas = 4.24F; ///< kappa, 3 sqrt 2: nor does a difference of two depths below three deviations

    [[nodiscard]] std::vector<Parameter> parameters();
    [[nodiscard]] Parameter curve_row();
};

/// The buffers every room has, in this order; a room's own follow from screen_own.
enum ScreenBuffer : int {
    screen_depth,      ///< r32f, metres, 0 = hole; nothing else is invalid
    screen_given,      ///< r32f, three a pixel: the view's normals, where it brings any
    screen_surfaces,   ///< rgba32f: normal, unit, facing the camera, (0, 0, 0) exactly in holes; depth
    screen_noise,      ///< rg32f, 64x64: see lib/noise.glsl
    screen_raw,        ///< r32f: visibility before denoise, finite everywhere
    screen_visibility, ///< r32f: the result, NaN in holes
    screen_own,
    screen_neighbours =
        screen_own ///< only where there are any: rg32ui, their surfaces (lib/surfel.glsl) one after the other
};

/// Everything one configuration runs, as plain data.
struct ScreenTables {
    cv::Rect window;    ///< where what was recorded lies in the image
    cv::Size size;      ///< of the image, with its guard band where there is one
    int neighbours = 0; ///< other views there may be at most
    std::vector<gpu::BufferRow> buffers;
    std::vector<gpu::PassRow> passes;
    bool noisy = false; ///< whether depth has noise

    /// Appends a buffer and tells its index.
    int add_buffer(gpu::BufferRow row);
    /// Appends a pass of one thread per `pixels_a_side` squared pixels of the image.
    void add_pass(std::string name, std::string_view shader, std::vector<int> reads, std::vector<int> writes,
                  std::vector<std::pair<int, int>> constants = {}, int pixels_a_side = 1) {
        add_pass_over(size, std::move(name), shader, std::move(reads), std::move(writes), std::move(constants),
                      pixels_a_side);
    }
    /// The same of an image of size `over`.
    void add_pass_over(cv::Size over, std::string name, std::string_view shader, std::vector<int> reads,
                       std::vector<int> writes, std::vector<std::pair<int, int>> constants = {}, int pixels_a_side = 1);
    /// Appends so many iterations of a separable blur of screen_raw over the pixels of the same surface; `weights` are
    /// those of offsets 0, 1, 2 ... to either side.
    void add_blurs(int iterations, const std::vector<float>& weights);
    /// Ready to run. Passes see texels where they read a buffer, plain storage where they write it.
    [[nodiscard]] std::unique_ptr<gpu::Program> program(gpu::Device& device, std::size_t constants_bytes) const;
    [[nodiscard]] std::size_t pixels() const { return static_cast<std::size_t>(size.area()); }
};

/// A method of which the room itself is only the part from depth and normals to raw visibility. Where it looks at
/// neighbours and there are any, the image has a guard band of guard_px() on every side. add_passes() then finds
/// buffers for them.
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
    /// After each run: what the room's own downloaded buffers say. The first of them is number `first_own`.
    virtual void look_at(gpu::Program& /*program*/, int /*first_own*/) {}

  private:
    using Shape =
        std::tuple<int, int, bool, int, bool>; // width, height, whether normals are supplied, most neighbours, noisy
    [[nodiscard]] ScreenTables tables(const Shape& shape) const;
    gpu::Program& program_for(const Shape& shape, std::size_t constants_bytes);

    gpu::Device& device_;
    ScreenOptions options_;
    std::map<Shape, std::unique_ptr<gpu::Program>> programs_; // of one image size
    Timings timings_;
};

/// The row of that quality. The table has a row for every one.
template <class Levels>
[[nodiscard]] const auto& level_of(const Levels& levels, Quality quality) {
    for (const auto& level : levels)
        if (quality == level.quality)
            return level;
    throw Misuse("no such quality");
}

/// The rows all rooms have, then a room's own.
[[nodiscard]] std::vector<Parameter> joined(std::vector<Parameter> rows, const std::vector<Parameter>& more);

/// Pixels by which the image is widened on every side, where there are neighbours: they saw what lies outside it.
[[nodiscard]] int guard_px(cv::Size size);

/// The constants of one view, widened by `guard` pixels.
[[nodiscard]] shared::ScreenConstants constants_from(const ScreenOptions& options, const View& view, int guard = 0);

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
