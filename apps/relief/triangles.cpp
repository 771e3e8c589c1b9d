#include "apps/relief/triangles.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace scanshade::relief {

namespace {

using Triangle = std::array<const Vertex*, 3>;

/// Writes the plane of a triangle, and that of its errors, to the centres that it holds, its edges included.
void draw(const Triangle& triangle, cv::Mat1f& z, cv::Mat1f* errors) {
    const auto& [a, b, c] = triangle;
    const double area = (b->x - a->x) * (c->y - a->y) - (c->x - a->x) * (b->y - a->y);
    if (area == 0)
        return;
    const auto [west, east] = std::minmax({a->x, b->x, c->x});
    const auto [north, south] = std::minmax({a->y, b->y, c->y});
    const int top = std::max(0, static_cast<int>(std::ceil(north - 0.5))),
              bottom = std::min(z.rows - 1, static_cast<int>(std::floor(south - 0.5)));
    const int left = std::max(0, static_cast<int>(std::ceil(west - 0.5))),
              right = std::min(z.cols - 1, static_cast<int>(std::floor(east - 0.5)));
    constexpr double slack = -1e-9;
    for (int row = top; row <= bottom; ++row)
        for (int column = left; column <= right; ++column) {
            const double x = column + 0.5, y = row + 0.5;
            const double u = ((x - a->x) * (c->y - a->y) - (c->x - a->x) * (y - a->y)) / area;
            const double v = ((b->x - a->x) * (y - a->y) - (x - a->x) * (b->y - a->y)) / area;
            if (u >= slack && v >= slack && u + v <= 1 - slack) {
                z(row, column) = static_cast<float>(a->z + u * (b->z - a->z) + v * (c->z - a->z));
                if (errors)
                    (*errors)(row, column) =
                        static_cast<float>(a->error + u * (b->error - a->error) + v * (c->error - a->error));
            }
        }
}

} // namespace

cv::Mat1f heights_at_centres(const std::vector<Vertex>& vertices, cv::Size size, cv::Mat1f* errors) {
    cv::Mat1f z(size, std::nanf(""));
    if (errors)
        *errors = cv::Mat1f(size, 0.0F);
    cv::Subdiv2D subdivision(cv::Rect(0, 0, size.width + 1, size.height + 1));
    std::vector<const Vertex*> vertex_of; // by OpenCV's number
    const auto insert = [&](const Vertex& vertex) {
        const auto id = static_cast<std::size_t>(
            subdivision.insert(cv::Point2f(static_cast<float>(std::clamp(vertex.x, 0.0, double(size.width))),
                                           static_cast<float>(std::clamp(vertex.y, 0.0, double(size.height))))));
        vertex_of.resize(std::max(vertex_of.size(), id + 1));
        vertex_of[id] = &vertex;
    };
    // Rows there and back: each point is near the one before it, from where it is looked for.
    for (std::size_t begin = 0; begin < vertices.size();) {
        const int row = vertices[begin].cell / size.width;
        std::size_t end = begin;
        while (end < vertices.size() && vertices[end].cell / size.width == row)
            ++end;
        for (std::size_t i = begin; i < end; ++i)
            insert(vertices[row % 2 == 0 ? i : begin + end - 1 - i]);
        begin = end;
    }
    std::vector<int> edges;
    subdivision.getLeadingEdgeList(edges);
    for (int edge : edges) {
        Triangle triangle{};
        bool ours = true; // corners of OpenCV's outer triangle are none of ours
        for (const Vertex*& corner : triangle) {
            const int id = subdivision.edgeOrg(edge);
            corner = id > 0 && static_cast<std::size_t>(id) < vertex_of.size() ? vertex_of[static_cast<std::size_t>(id)]
                                                                               : nullptr;
            ours = ours && corner != nullptr;
            edge = subdivision.getEdge(edge, cv::Subdiv2D::NEXT_AROUND_LEFT);
        }
        if (!ours)
            continue;
        std::ranges::sort(triangle, {}, &Vertex::cell); // the same numbers wherever its edges begin
        draw(triangle, z, errors);
    }
    return z;
}

} // namespace scanshade::relief
