#include "ao/horizon/horizon.h"

#include "ao/horizon/dominance.h"
#include "ao/horizon/kernels.h"
#include "ao/horizon/padded.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <memory>
#include <numbers>
#include <tbb/parallel_for.h>

namespace scanshade::horizon {

namespace {

constexpr double degree = std::numbers::pi / 180;

double radius_in_cells(double cell, const Settings& settings) {
    const double radius = settings.radius / cell;
    return settings.profile == Profile::rvt ? std::nearbyint(radius) : radius;
}

void check(const HeightField& field, const Settings& settings) {
    constexpr double most = 4096;
    if (!(field.cell > 0) || !std::isfinite(field.cell))
        throw Misuse(fmt::format("cells of size {}, expected a number above 0", field.cell));
    const double radius = radius_in_cells(field.cell, settings);
    if (!(radius >= 1 && radius <= most))
        throw Misuse(
            fmt::format("a radius of {:.4g} cells of {:.4g}, expected 1 .. {} cells", radius, field.cell, most));
    if (settings.directions < 1 || settings.directions > most)
        throw Misuse(fmt::format("{} directions, expected 1 .. {}", settings.directions, most));
    if (!(settings.exaggeration > 0) || !std::isfinite(settings.exaggeration))
        throw Misuse(fmt::format("an exaggeration of {}, expected a number above 0", settings.exaggeration));
    const Dominance& rows = settings.dominance;
    if (rows.least < 1 || rows.most < rows.least || rows.most > most || rows.step < 1 || rows.angle < 1 ||
        rows.angle > 359 || !(rows.observer > 0) || !std::isfinite(rows.observer))
        throw Misuse(
            fmt::format("local dominance of radii {} .. {} by {} cells, {} degrees, an observer of {}: expected 1 "
                        "<= least <= most <= {}, steps of 1 cell and 1 degree at least, an observer above 0",
                        rows.least, rows.most, rows.step, rows.angle, rows.observer, most));
}

/// The anisotropic sky's brightness.
double brightness(double angle, const Settings& settings) {
    const bool low = settings.anisotropy == Anisotropy::low;
    const double least = low ? 0.4 : 0.1, power = low ? 4 : 8;
    const double toward = std::abs(std::cos((angle - settings.azimuth * degree) / 2));
    return (1 - least) * std::pow(toward, power) + least;
}

/// A plane as slopes towards the east and the north.
struct Plane {
    float east = 0, north = 0;
};

/// The least-squares plane through those of the 3x3 cells that are known.
Plane plane_of_known(const cv::Mat1f& z, int row, int column) {
    double n = 0, x = 0, y = 0, h = 0, xx = 0, xy = 0, yy = 0, xh = 0, yh = 0;
    const double here = z(row, column);
    for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i) {
            const int r = row - j, c = column + i;
            if (r < 0 || c < 0 || r >= z.rows || c >= z.cols || std::isnan(z(r, c)))
                continue;
            const double height = z(r, c) - here;
            n += 1, x += i, y += j, h += height;
            xx += i * i, xy += i * j, yy += j * j, xh += i * height, yh += j * height;
        }
    if (n < 3)
        return {};
    xx -= x * x / n, xy -= x * y / n, yy -= y * y / n, xh -= x * h / n, yh -= y * h / n;
    const double det = xx * yy - xy * xy;
    constexpr double least = 1e-9; // cells in one line
    if (det < least)
        return {};
    return {static_cast<float>((xh * yy - yh * xy) / det), static_cast<float>((yh * xx - xh * xy) / det)};
}

/// Slopes of the planes of `count` cells of a row, times `scale`.
void planes_of(const cv::Mat1f& z, int row, int column, int count, float scale, float* __restrict east,
               float* __restrict north) {
    std::fill_n(east, count, std::nanf(""));
    const int first = std::max(column, 1) - column, last = std::min(column + count, z.cols - 1) - column;
    if (row > 0 && row + 1 < z.rows) {
        const float* n = z[row - 1] + column;
        const float* m = z[row] + column;
        const float* s = z[row + 1] + column;
        const float sixth = scale / 6;
        for (int x = first; x < last; ++x) {
            east[x] = ((n[x + 1] - n[x - 1]) + (m[x + 1] - m[x - 1]) + (s[x + 1] - s[x - 1])) * sixth;
            north[x] = ((n[x - 1] - s[x - 1]) + (n[x] - s[x]) + (n[x + 1] - s[x + 1])) * sixth;
        }
    }
    for (int x = 0; x < count; ++x)
        if (std::isnan(east[x]) || std::isnan(north[x])) { // at borders and holes
            const Plane plane = plane_of_known(z, row, column + x);
            east[x] = plane.east * scale, north[x] = plane.north * scale;
        }
}

/// A walk over all rows: the tables of its directions, and the field that it reads.
struct Walk {
    std::unique_ptr<Padded> field;
    std::vector<Ray> rays;                    ///< profile exact
    std::vector<std::vector<Offset>> offsets; ///< profile rvt
    std::vector<double> angles;               ///< of the directions, for the anisotropic sky
    std::vector<float> east, north;           ///< unit vectors of the directions

    [[nodiscard]] int directions() const { return static_cast<int>(angles.size()); }
};

Walk exact_walk(const HeightField& field, const Settings& settings) {
    Walk walk;
    const double radius = settings.radius / field.cell;
    const double from = settings.noise == Noise::none ? 0 : least_distance(radius, settings.noise);
    const int rim = static_cast<int>(std::ceil(radius)) + 2;
    walk.field = std::make_unique<Padded>(field.z, rim, Border::nothing, 1.0F, 1.0F);
    walk.rays = rays_of(settings.directions, radius, std::min(from, radius), settings.exaggeration / field.cell,
                        walk.field->stride());
    for (const Ray& ray : walk.rays) {
        walk.angles.push_back(ray.azimuth);
        walk.east.push_back(ray.east), walk.north.push_back(ray.north);
    }
    return walk;
}

Walk rvt_walk(const HeightField& field, const Settings& settings) {
    Walk walk;
    const int radius = static_cast<int>(radius_in_cells(field.cell, settings));
    walk.field = std::make_unique<Padded>(field.z, radius + 1, Border::mirrored,
                                          static_cast<float>(settings.exaggeration), static_cast<float>(field.cell));
    walk.offsets =
        rvt_offsets(settings.directions, radius, least_distance(radius, settings.noise), walk.field->stride());
    for (int i = 0; i < settings.directions; ++i) {
        const double angle = 2 * std::numbers::pi / settings.directions * i;
        walk.angles.push_back(angle); // counterclockwise, as RVT weighs the sky
        walk.east.push_back(static_cast<float>(-std::sin(angle))),
            walk.north.push_back(static_cast<float>(std::cos(angle)));
    }
    return walk;
}

/// Leaves out the directions that do not count.
void keep(Walk& walk, Sky sky) {
    if (sky == Sky::whole || walk.angles.empty())
        return;
    constexpr float least = 1e-6F; // directions along the border between halves are in neither
    Walk kept{std::move(walk.field), {}, {}, {}, {}, {}};
    for (std::size_t i = 0; i < walk.angles.size(); ++i) {
        const float toward = sky == Sky::north   ? walk.north[i]
                             : sky == Sky::south ? -walk.north[i]
                             : sky == Sky::east  ? walk.east[i]
                                                 : -walk.east[i];
        if (toward < least)
            continue;
        kept.angles.push_back(walk.angles[i]), kept.east.push_back(walk.east[i]), kept.north.push_back(walk.north[i]);
        if (!walk.rays.empty())
            kept.rays.push_back(std::move(walk.rays[i]));
        if (!walk.offsets.empty())
            kept.offsets.push_back(std::move(walk.offsets[i]));
    }
    if (kept.angles.empty())
        throw Misuse("no direction lies in that half of the sky; four directions are enough");
    walk = std::move(kept);
}

/// What is the same for all cells.
struct Job {
    const HeightField& field;
    const Settings& settings;
    const Wanted& wanted;
    Layers& layers;
    int first = 0;              ///< row of the field that is the layers' row 0
    const Walk* sky = nullptr;  ///< sky views and openness; null = none is wanted
    const Walk* ball = nullptr; ///< ao; null = not wanted
    std::vector<float> brightness{};
    float sum_of_brightness = 0;
};

/// Up to most_cells cells of one row.
class Chunk {
  public:
    Chunk(const Job& job, int row, int column, int count) : job_(job), row_(row), column_(column), count_(count) {
        planes_of(job.field.z, row, column, count, static_cast<float>(job.settings.exaggeration / job.field.cell),
                  east_.data(), north_.data());
    }

    void compute() {
        Sums sky = sums(), ball;
        std::swap(sky.ao, ball.ao);
        for (int i = 0; job_.sky && i < job_.sky->directions(); ++i) {
            const Part part{job_.brightness[static_cast<std::size_t>(i)], plane_toward(*job_.sky, i)};
            look(*job_.sky, i);
            kernels().add(horizons_, count_, part, sky);
        }
        const auto radius = static_cast<float>(job_.settings.radius / job_.field.cell);
        for (int i = 0; job_.ball && i < job_.ball->directions(); ++i) {
            const Part part{0, plane_toward(*job_.ball, i)};
            kernels().look_in_ball(cells(*job_.ball), job_.ball->rays[static_cast<std::size_t>(i)], radius, horizons_);
            kernels().add(horizons_, count_, part, ball);
        }
        finish();
    }

  private:
    /// Where the sums go: the layers themselves, set to 0.
    Sums sums() {
        const auto row_of = [&](cv::Mat1f& layer) -> float* {
            if (layer.empty())
                return nullptr;
            float* row = layer[row_ - job_.first] + column_;
            std::fill_n(row, count_, 0.0F);
            return row;
        };
        Layers& layers = job_.layers;
        return {row_of(layers.svf),          row_of(layers.asvf), row_of(layers.openness),
                row_of(layers.openness_neg), row_of(layers.ao),   job_.settings.definition};
    }

    [[nodiscard]] Cells cells(const Walk& walk) const {
        return {walk.field->at(row_, column_), count_, walk.field->known(row_, column_, count_)};
    }

    void look(const Walk& walk, int i) {
        const auto direction = static_cast<std::size_t>(i);
        if (walk.offsets.empty())
            return kernels().look(cells(walk), walk.rays[direction], job_.wanted.openness_neg, horizons_);
        kernels().look_at(cells(walk), walk.offsets[direction], horizons_);
        // RVT's floor for directions without data.
        for (int x = 0; x < count_; ++x) {
            horizons_.high[x] = std::max(horizons_.high[x], -rvt_floor);
            horizons_.low[x] = std::min(horizons_.low[x], rvt_floor);
        }
    }

    const float* plane_toward(const Walk& walk, int i) {
        const float east = walk.east[static_cast<std::size_t>(i)], north = walk.north[static_cast<std::size_t>(i)];
        for (int x = 0; x < count_; ++x)
            plane_[x] = east_[x] * east + north_[x] * north;
        return plane_.data();
    }

    void finish() {
        const auto share_of = [](const Walk* walk) { return walk ? 1.0F / static_cast<float>(walk->directions()) : 0; };
        const float share = share_of(job_.sky);
        Row up;
        for (int x = 0; x < count_; ++x)
            up[x] = 1 / std::sqrt(1 + east_[x] * east_[x] + north_[x] * north_[x]);
        Layers& layers = job_.layers;
        scale(layers.svf, share, job_.settings.definition == Definition::surface ? &up : nullptr);
        scale(layers.asvf, 1 / job_.sum_of_brightness, nullptr);
        scale(layers.openness, share, nullptr, 128);
        scale(layers.openness_neg, share, nullptr, 128);
        scale(layers.ao, share_of(job_.ball), &up);
    }

    /// NaN where the field is.
    void scale(cv::Mat1f& layer, float share, const Row* up, float largest = 1) {
        if (layer.empty())
            return;
        float* values = layer[row_ - job_.first] + column_;
        const float* heights = job_.field.z[row_] + column_;
        for (int x = 0; x < count_; ++x)
            values[x] *= share;
        for (int x = 0; up && x < count_; ++x)
            values[x] *= (*up)[x];
        // To 2^-17 of the largest value, far below the error of directions: files are a quarter smaller.
        const float coarse = largest * 96;
        for (int x = 0; exact_ && x < count_; ++x)
            values[x] = (values[x] + coarse) - coarse;
        for (int x = 0; x < count_; ++x)
            values[x] = std::isnan(heights[x]) ? heights[x] : values[x];
    }

    static constexpr float rvt_floor = 1000;

    const Job& job_;
    int row_, column_, count_;
    bool exact_ = job_.settings.profile == Profile::exact;
    Row east_, north_, plane_;
    Horizons horizons_;
};

} // namespace

Layers layers_of(const HeightField& field, const Settings& settings, const Wanted& wanted, cv::Range rows) {
    check(field, settings);
    if (rows == cv::Range::all())
        rows = {0, field.z.rows};
    Layers layers;
    for (const auto& [layer, asked] :
         {std::pair(&layers.svf, wanted.svf), std::pair(&layers.asvf, wanted.asvf),
          std::pair(&layers.openness, wanted.openness), std::pair(&layers.openness_neg, wanted.openness_neg),
          std::pair(&layers.ao, wanted.ao)})
        if (asked)
            layer->create(rows.size(), field.z.cols);
    if (wanted.dominance)
        layers.dominance = dominance_of(field, settings, rows);
    const bool sky_wanted = wanted.svf || wanted.asvf || wanted.openness || wanted.openness_neg;
    const bool exact = settings.profile == Profile::exact;
    Walk rays, cells;
    if (wanted.ao || (sky_wanted && exact))
        rays = exact_walk(field, settings);
    if (sky_wanted && !exact)
        cells = rvt_walk(field, settings);
    keep(rays, settings.sky), keep(cells, settings.sky);
    Job job{field,
            settings,
            wanted,
            layers,
            rows.start,
            sky_wanted ? exact ? &rays : &cells : nullptr,
            wanted.ao ? &rays : nullptr};
    if (!job.sky && !job.ball)
        return layers;
    for (const double angle : (job.sky ? job.sky : job.ball)->angles)
        job.brightness.push_back(static_cast<float>(brightness(angle, settings)));
    for (const float each : job.brightness)
        job.sum_of_brightness += each;
    tbb::parallel_for(rows.start, rows.end, [&](int row) {
        for (int column = 0; column < field.z.cols; column += most_cells)
            Chunk(job, row, column, std::min(most_cells, field.z.cols - column)).compute();
    });
    return layers;
}

int reach_of(double cell, const Settings& settings, const Wanted& wanted) {
    constexpr int rim = 3; // of padded fields, whose holes decide on the kernel; and of planes
    const int radius = static_cast<int>(std::ceil(radius_in_cells(cell, settings))) + rim;
    return wanted.dominance ? std::max(radius, settings.dominance.most + rim) : radius;
}

Slopes slopes_of(const HeightField& field, double exaggeration) {
    Slopes slopes{cv::Mat1f(field.z.size()), cv::Mat1f(field.z.size())};
    const auto scale = static_cast<float>(exaggeration / field.cell);
    tbb::parallel_for(0, field.z.rows, [&](int r) {
        planes_of(field.z, r, 0, field.z.cols, scale, slopes.east[r], slopes.north[r]);
        for (int c = 0; c < field.z.cols; ++c)
            if (const float height = field.z(r, c); std::isnan(height))
                slopes.east(r, c) = slopes.north(r, c) = height;
    });
    return slopes;
}

} // namespace scanshade::horizon
