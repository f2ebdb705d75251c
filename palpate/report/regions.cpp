// SPDX-License-Identifier: Apache-2.0
#include "palpate/report/regions.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace palpate::report {
namespace {

double cell_width(const std::vector<double>& axis, std::size_t i) {
  const double next = axis[std::min(i + 1, axis.size() - 1)], before = axis[i == 0 ? 0 : i - 1];
  return std::abs(next - before) / 2;
}

}  // namespace

double density_threshold(const Grid& density, const std::vector<double>& u, const std::vector<double>& v, double share) {
  std::vector<std::pair<double, double>> cells;  // density, mass
  double total = 0;
  for (std::size_t i = 0; i < density.size(); ++i) {
    for (std::size_t j = 0; j < density[i].size(); ++j) {
      cells.emplace_back(density[i][j], density[i][j] * cell_width(u, i) * cell_width(v, j));
      total += cells.back().second;
    }
  }
  std::sort(cells.rbegin(), cells.rend());
  double sum = 0;
  for (const auto& [level, mass] : cells) {
    sum += mass;
    if (sum >= share * total) return level;
  }
  return 0;
}

std::vector<std::vector<Spot>> region_outlines(const Grid& density, double level) {
  const int rows = static_cast<int>(density.size()), columns = rows > 0 ? static_cast<int>(density[0].size()) : 0;
  // A frame of zeros closes every outline.
  const auto value = [&](std::array<int, 2> c) {
    const bool outside = c[0] < 0 || c[1] < 0 || c[0] >= rows || c[1] >= columns;
    return outside ? 0.0 : density[static_cast<std::size_t>(c[0])][static_cast<std::size_t>(c[1])];
  };
  using Edge = std::array<int, 4>;
  struct Link {
    Edge next;
    Spot from;
  };
  std::map<Edge, Link> links;
  for (int i = -1; i < rows; ++i) {
    for (int j = -1; j < columns; ++j) {
      const std::array<std::array<int, 2>, 4> corners = {{{i, j}, {i, j + 1}, {i + 1, j + 1}, {i + 1, j}}};
      std::vector<std::pair<Edge, Spot>> entering, leaving;  // as met going round the cell
      bool leaving_first = false;
      for (std::size_t k = 0; k < 4; ++k) {
        const auto a = corners[k], b = corners[(k + 1) % 4];
        const double va = value(a), vb = value(b);
        if ((va > level) == (vb > level)) continue;
        const double t = (level - va) / (vb - va);
        const Spot spot{a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])};
        const Edge edge = a < b ? Edge{a[0], a[1], b[0], b[1]} : Edge{b[0], b[1], a[0], a[1]};
        if (entering.empty() && vb <= level) leaving_first = true;
        (vb > level ? entering : leaving).emplace_back(edge, spot);
      }
      // Each entrance goes to the exit that follows it: at a saddle (two of each) this keeps the corners apart.
      for (std::size_t k = 0; k < entering.size(); ++k) {
        links[entering[k].first] = {leaving[(k + (leaving_first ? 1 : 0)) % leaving.size()].first, entering[k].second};
      }
    }
  }
  std::vector<std::vector<Spot>> outlines;
  while (!links.empty()) {
    std::vector<Spot> outline;
    for (auto link = links.begin(); link != links.end();) {
      const Spot spot = link->second.from;
      outline.push_back({std::clamp(spot.x, 0.0, rows - 1.0), std::clamp(spot.y, 0.0, columns - 1.0)});
      const Edge next = link->second.next;
      links.erase(link);
      link = links.find(next);
    }
    if (outline.size() > 2) outlines.push_back(std::move(outline));
  }
  return outlines;
}

double along(const std::vector<double>& axis, double place) {
  const auto i = std::min(static_cast<std::size_t>(std::max(place, 0.0)), axis.size() - 2);
  return axis[i] + (axis[i + 1] - axis[i]) * (place - static_cast<double>(i));
}

}  // namespace palpate::report
