// Writes the results of `refine` as JSON, as a table, and as a page.
#include "apps/refine/report.h"

#include "apps/page/document.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

namespace scanshade {
using namespace calibration;
namespace {

/// One number of the camera, before and after, with its sigma; NaN where it was fixed.
struct NumberRow {
    std::string name;
    double before, after, sigma;
};

std::vector<NumberRow> numbers_of(const Refinement& r) {
    const Fit& fit = r.selection.fit;
    const Model& before = r.selection.start.model;
    const auto sigma = [&](Unknown unknown) {
        return r.selection.free[unknown] && fit.covariance.size() > 0 ? fit.sigma(unknown) : std::nan("");
    };
    const bool fy_free = fit.covariance.size() > 0 && (r.selection.free[f] || r.selection.free[aspect]);
    std::vector<NumberRow> rows = {
        {"fx", before[f], fit.model[f], sigma(f)},
        {"fy", before[f] * before[aspect], fit.model[f] * fit.model[aspect], fy_free ? sigma_fy(fit) : std::nan("")}};
    for (int i = cx; i < unknown_count; ++i) {
        const auto unknown = static_cast<Unknown>(i);
        if (i < k1 || r.selection.free[i] || before[unknown] != (i == depth_scale ? 1 : 0))
            rows.push_back({std::string(name_of(unknown)), before[unknown], fit.model[unknown], sigma(unknown)});
    }
    return rows;
}

json finite(double value) { return std::isfinite(value) ? json(value) : json(); }

json covariance_json(const Selection& selection) {
    json names = json::array(), rows = json::array();
    if (selection.fit.covariance.size() == 0)
        return json();
    for (int i = 0; i < unknown_count; ++i) {
        if (!selection.free[i])
            continue;
        names.push_back(name_of(static_cast<Unknown>(i)));
        json row = json::array();
        for (int j = 0; j < unknown_count; ++j)
            if (selection.free[j])
                row.push_back(selection.fit.covariance(i, j));
        rows.push_back(row);
    }
    return {{"of", names}, {"matrix", rows}};
}

template <class Number>
json grid_json(const cv::Mat_<Number>& grid) {
    json rows = json::array();
    for (int row = 0; row < grid.rows; ++row) {
        json cells = json::array();
        for (int column = 0; column < grid.cols; ++column)
            cells.push_back(finite(grid(row, column)));
        rows.push_back(cells);
    }
    return rows;
}

json errors_json(const Selection& selection) {
    return {{"train", finite(selection.train_px)},
            {"train_before", finite(selection.train_before_px)},
            {"held_out", finite(selection.held_out_px)},
            {"held_out_before", finite(selection.held_out_before_px)}};
}

double largest(const cv::Mat1d& grid) {
    double most = 0;
    for (const double value : grid)
        most = std::isfinite(value) ? std::max(most, value) : most;
    return most;
}

/// Where the focal length was kept: whether the observations could have told a wrong one, and whether they ask for
/// another one after all.
std::string doubt_of_kept_focal_length(const Selection& found, double most_sigma_px) {
    constexpr double most_sigmas = 2.5;
    if (!found.focal_length_free)
        return {};
    const Fit& free = *found.focal_length_free;
    if (!free.converged || free.covariance.size() == 0)
        return "the focal length is not determined, so it is as it was before";
    const std::string would_be = fmt::format("{:.6g} +- {:.2g} px", free.model[f], free.sigma(f));
    if (mean_pixel_sigma(free) > most_sigma_px)
        return fmt::format("the focal length is hardly determined ({}), so it is as it was before", would_be);
    if (std::abs(free.model[f] - found.fit.model[f]) > most_sigmas * free.sigma(f))
        return fmt::format("the views ask for a focal length of {}, but not clearly enough", would_be);
    return {};
}

/// Why a result is doubtful, and what a person can do about it.
struct Doubt {
    std::string why, advice;
};

std::vector<Doubt> doubts_of(const Refinement& r) {
    constexpr double most_px = 1, most_sigma_px = 0.5, most_over_fitted = 2, least_coverage = 0.4;
    const Selection& found = r.selection;
    if (found.steps.empty())
        return {{"the views determine nothing, so the camera is as it was before", r.what_helps}};
    const bool pixels = r.unit == "px";
    const double sigma_px = mean_pixel_sigma(found.fit);
    const auto outlying =
        std::count_if(r.views.begin(), r.views.end(), [](const ViewRow& view) { return view.outlying && view.used; });
    std::vector<Doubt> doubts;
    if (pixels && found.held_out_px > most_px)
        doubts.push_back({fmt::format("held-out views are off by {:.2g} px", found.held_out_px), r.what_contradicts});
    else if (found.held_out_px > most_over_fitted * found.train_px && (!pixels || found.held_out_px > 0.1))
        doubts.push_back({fmt::format("held-out views are {:.1f} times as far off as fitted ones",
                                      found.held_out_px / found.train_px),
                          r.what_helps});
    if (sigma_px > most_sigma_px)
        doubts.push_back({fmt::format("a pixel is known to {:.2g} px only", sigma_px), r.what_helps});
    else if (const std::string doubt = doubt_of_kept_focal_length(found, most_sigma_px); !doubt.empty())
        doubts.push_back({doubt, r.what_helps});
    if (outlying > 0)
        doubts.push_back(
            {fmt::format("{} of {} views {} outlying", outlying, r.views.size(), outlying == 1 ? "is" : "are"),
             "--outliers drop leaves outlying views out."});
    if (r.coverage.share < least_coverage)
        doubts.push_back(
            {fmt::format("{:.0f} % of the image hold observations", 100 * r.coverage.share), r.what_helps});
    return doubts;
}

/// Each piece of advice once.
std::vector<std::string> advice_of(const Refinement& r) {
    std::vector<std::string> advice;
    for (const Doubt& doubt : doubts_of(r))
        if (!doubt.advice.empty() && std::ranges::find(advice, doubt.advice) == advice.end())
            advice.push_back(doubt.advice);
    return advice;
}

} // namespace

std::string verdict_of(const Refinement& r) {
    std::vector<std::string> doubts;
    for (const Doubt& doubt : doubts_of(r))
        doubts.push_back(doubt.why);
    if (!doubts.empty())
        return fmt::format("doubtful: {}.", fmt::join(doubts, "; "));
    const std::string error = fmt::format("held-out views are off by {:.2g} {}", r.selection.held_out_px, r.unit);
    return r.changed()
               ? fmt::format("sound: {}, and a pixel is known to {:.2g} px.", error, mean_pixel_sigma(r.selection.fit))
               : fmt::format("sound: {}, and nothing asks for another camera.", error);
}

std::string status_of(const Refinement& r) { return r.changed() ? "refined" : "unchanged"; }

json details_of(const Refinement& r, double took_s) {
    json text{{"status", status_of(r)}, {"verdict", verdict_of(r)}, {"advice", advice_of(r)},
              {"source", r.source},     {"took_s", took_s},         {"error_unit", r.unit}};
    text["before"] = to_json(r.before);
    for (const NumberRow& row : numbers_of(r))
        text["numbers"][row.name] = {{"before", row.before}, {"after", row.after}, {"sigma", finite(row.sigma)}};
    text["covariance"] = covariance_json(r.selection);
    text["rms_px"] = errors_json(r.selection);
    if (r.full)
        text["rms_px_full_model"] = errors_json(*r.full);
    for (const Step& step : r.selection.steps)
        text["model_selection"].push_back({{"parameters", step.name}, {"freed", step.freed}, {"why", step.why}});
    for (const ViewRow& view : r.views)
        text["views"].push_back({{"name", view.name},
                                 {"rms_px", finite(view.score.rms())},
                                 {"points", view.score.points},
                                 {"outlying", view.outlying},
                                 {"used", view.used},
                                 {"weight", view.weight}});
    text["coverage"] = {{"share_of_cells", r.coverage.share}, {"counts", grid_json(r.coverage.counts)}};
    text["pixel_sigma_px"] = grid_json(r.pixel_sigma);
    for (const Effect& effect : r.effects)
        text["effect"].push_back(
            {{"depth_m", effect.depth_m}, {"rms_mm", effect.rms_mm}, {"worst_mm", effect.worst_mm}});
    text["notes"] = r.notes;
    return text;
}

std::string summary_of(const Refinement& r, double took_s) {
    std::string text = fmt::format("{}: {} ({:.1f} s)\n{}\n", status_of(r), r.source, took_s, verdict_of(r));
    for (const std::string& advice : advice_of(r))
        text += advice + "\n";
    text += "\n";
    text += fmt::format("  {:<14} {:>12} {:>12} {:>10}\n", "", "before", "after", "sigma");
    for (const NumberRow& row : numbers_of(r))
        text += fmt::format("  {:<14} {:>12.6g} {:>12.6g} {:>10}\n", row.name, row.before, row.after,
                            std::isnan(row.sigma) ? "kept" : fmt::format("{:.2g}", row.sigma));
    text += fmt::format("\n  {:<14} {:>12} {:>12}\n", fmt::format("error, {} rms", r.unit), "before", "after");
    text += fmt::format("  {:<14} {:>12.4g} {:>12.4g}\n", "fitted", r.selection.train_before_px, r.selection.train_px);
    text += fmt::format("  {:<14} {:>12.4g} {:>12.4g}\n", "held out", r.selection.held_out_before_px,
                        r.selection.held_out_px);
    if (r.full)
        text += fmt::format("  full model: fitted {:.4g}, held out {:.4g}\n", r.full->train_px, r.full->held_out_px);
    text += "\n";
    for (const Step& step : r.selection.steps)
        text += fmt::format("  {:<14} {} {}\n", step.name, step.freed ? "freed:" : "kept: ", step.why);
    text += fmt::format(
        "\n  {:.0f} % of the image's cells hold observations; the pixel's sigma is {:.2g} px on average, {:.2g} "
        "at most\n",
        100 * r.coverage.share, mean_pixel_sigma(r.selection.fit), largest(r.pixel_sigma));
    for (const Effect& effect : r.effects)
        text += fmt::format("  at {:.2f} m points move by {:.2f} mm rms, {:.2f} mm at most\n", effect.depth_m,
                            effect.rms_mm, effect.worst_mm);
    for (const std::string& note : r.notes)
        text += "  note: " + note + "\n";
    return text;
}

// ---------------------------------------------------------------------------------------------------- the page

namespace {

std::string number(double value, int digits = 4) {
    return std::isfinite(value) ? fmt::format("{:.{}g}", value, digits) : "";
}

/// White to blue, 0 to 1.
std::string shade_of(double share) {
    const int other = static_cast<int>(std::lround(255 - 175 * std::clamp(share, 0.0, 1.0)));
    return fmt::format("rgb({},{},255)", other, other);
}

/// Values of a grid as tinted cells with their numbers.
template <class Number>
std::string heat_map(const cv::Mat_<Number>& grid, const char* caption, const char* format) {
    constexpr int cell = 56;
    double most = 1e-12;
    for (const Number value : grid)
        most = std::isfinite(static_cast<double>(value)) ? std::max(most, static_cast<double>(value)) : most;
    std::string svg = fmt::format("<figure><svg class=\"cells\" viewBox=\"0 0 {} {}\" width=\"480\">", grid.cols * cell,
                                  grid.rows * cell);
    for (int row = 0; row < grid.rows; ++row)
        for (int column = 0; column < grid.cols; ++column) {
            const double value = grid(row, column);
            svg += fmt::format("<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"{}\"/>", column * cell,
                               row * cell, cell, cell, std::isfinite(value) ? shade_of(value / most) : "#ddd");
            if (std::isfinite(value))
                svg += fmt::format("<text x=\"{}\" y=\"{}\">{}</text>", column * cell + cell / 2,
                                   row * cell + cell / 2 + 5, fmt::format(fmt::runtime(format), value));
        }
    return svg + fmt::format("</svg><figcaption>{}</figcaption></figure>\n", caption);
}

/// Residuals as arrows from the observed pixels. They are exaggerated: a typical one is a fiftieth of the width.
std::string arrows(const Refinement& r) {
    const cv::Size size = r.before.pinhole.size;
    const double exaggeration = std::max(1.0, std::floor(size.width / 50.0 / std::max(r.selection.train_px, 1e-9)));
    constexpr std::size_t most = 4000;
    const std::size_t step = std::max<std::size_t>(1, r.residuals.size() / most);
    std::string svg =
        fmt::format("<figure><svg viewBox=\"0 0 {} {}\" width=\"640\" class=\"residuals\">", size.width, size.height);
    for (std::size_t i = 0; i < r.residuals.size(); i += step) {
        const auto& [at, error] = r.residuals[i];
        svg += fmt::format("<path d=\"M{:.1f} {:.1f}l{:.1f} {:.1f}\"/>", at.x, at.y, error.x() * exaggeration,
                           error.y() * exaggeration);
    }
    return svg +
           fmt::format("</svg><figcaption>Residuals (predicted - observed) over the image, {:.0f} times their length"
                       "</figcaption></figure>\n",
                       exaggeration);
}

/// The residuals as a scatter plot: round and centred where nothing is left to model.
std::string scatter(const Refinement& r) {
    const double reach = std::max(4 * r.selection.train_px, 1e-9), scale = 150 / reach;
    constexpr std::size_t most = 4000;
    const std::size_t step = std::max<std::size_t>(1, r.residuals.size() / most);
    std::string svg = "<figure><svg viewBox=\"-160 -160 320 320\" width=\"320\" class=\"residuals\">"
                      "<path class=\"axis\" d=\"M-150 0h300M0 -150v300\"/>";
    for (std::size_t i = 0; i < r.residuals.size(); i += step)
        svg += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"1.5\"/>",
                           std::clamp(r.residuals[i].second.x() * scale, -155.0, 155.0),
                           std::clamp(r.residuals[i].second.y() * scale, -155.0, 155.0));
    return svg + fmt::format("</svg><figcaption>Residuals, axes +-{:.2g} px</figcaption></figure>\n", reach);
}

std::string view_bars(const Refinement& r) {
    constexpr int line = 18;
    double most = 1e-12;
    for (const ViewRow& view : r.views)
        most = std::max(most, view.score.rms());
    std::string svg =
        fmt::format("<svg viewBox=\"0 0 640 {}\" width=\"640\" class=\"bars\">", line * r.views.size() + 4);
    for (std::size_t i = 0; i < r.views.size(); ++i) {
        const ViewRow& view = r.views[i];
        const double width = 380 * view.score.rms() / most;
        svg += fmt::format("<text class=\"name\" x=\"160\" y=\"{0}\">{1}</text>"
                           "<rect x=\"166\" y=\"{2}\" width=\"{3:.1f}\" height=\"12\" class=\"{4}\"/>"
                           "<text class=\"value\" x=\"{5:.1f}\" y=\"{0}\">{6:.3g} {8}{7}</text>",
                           line * i + 14, page::escaped(view.name), line * i + 4, width, view.outlying ? "bad" : "good",
                           172 + width, view.score.rms(), view.used ? "" : ", dropped", r.unit);
    }
    return svg + "</svg>\n";
}

} // namespace

std::string page_of(const Refinement& r, double took_s) {
    std::vector<std::vector<std::string>> numbers, steps, moves;
    std::vector<bool> freed;
    for (const NumberRow& row : numbers_of(r))
        numbers.push_back({row.name, number(row.before, 8), number(row.after, 8),
                           std::isnan(row.sigma) ? "kept" : number(row.sigma, 2)});
    for (const Step& step : r.selection.steps) {
        steps.push_back({step.name, step.freed ? "freed" : "kept", step.why});
        freed.push_back(step.freed);
    }
    for (const Effect& effect : r.effects)
        moves.push_back({number(effect.depth_m, 3), number(effect.rms_mm, 3), number(effect.worst_mm, 3)});
    std::vector<std::vector<std::string>> errors = {
        {"before", number(r.selection.train_before_px), number(r.selection.held_out_before_px)},
        {"after", number(r.selection.train_px), number(r.selection.held_out_px)}};
    if (r.full)
        errors.push_back({"full model, for comparison", number(r.full->train_px), number(r.full->held_out_px)});

    std::string found =
        page::paragraph(verdict_of(r)) + page::paragraph(fmt::format("From {}; {:.1f} s.", r.source, took_s));
    for (const std::vector<std::string>& sentences : {advice_of(r), r.notes})
        for (const std::string& sentence : sentences)
            found += page::paragraph(sentence);
    std::vector<page::Section> sections = {
        {"Found", found},
        {"Numbers", page::table({"number", "before", "after", "sigma"}, numbers)},
        {fmt::format("Error, {} rms", r.unit), page::table({"camera", "fitted views", "held-out views"}, errors)},
        {"Model selection", page::table({"parameters", "decision", "why"}, steps, freed)},
        {"Residuals", r.residuals.empty() ? page::paragraph("of depth, not of pixels") : arrows(r) + scatter(r)},
        {"Views", view_bars(r)},
        {"Image", heat_map(r.coverage.counts, "Observations", "{:.0f}") +
                      heat_map(r.pixel_sigma, "Sigma of a pixel, px", "{:.2g}")}};
    if (!moves.empty())
        sections.insert(sections.begin() + 4, {"Effect: how far surface points move",
                                               page::table({"depth, m", "rms, mm", "most, mm"}, moves)});
    return page::document("Camera: " + status_of(r), sections);
}

} // namespace scanshade
