// SPDX-License-Identifier: Apache-2.0
#include "palpate/reconstruction/flank.hpp"

#include <algorithm>
#include <cmath>

namespace palpate::reconstruction {
namespace {

constexpr double same_side = 0.3;   // of the facet's normal along another's
constexpr double shared_facets = 7;  // one and a half cells are drawn upon by each: so many facets err as one
constexpr double start_scatter = 0.01, least_scatter = 0.001;  // rad
constexpr int passes = 3;            // over which scatter and bending settle

/// What is asked for: how far off the surface lies (in cells), how it leans, down and aside (rad), and how that changes (rad a
/// cell): down the flank, its twist, and aside.
using Shape = Eigen::Matrix<double, 6, 1>;
constexpr std::array<int, 3> bendings{3, 4, 5};

/// One thing that a facet says of it. Middles are known to about 0.02 of a cell and normals to about 0.02 rad, so both count alike.
struct Said {
  Shape of;
  double value, weight;
};

}  // namespace

Vec3 Flank::normal_at(double below_m) const {
  return std::cos(turn_per_m * below_m) * normal + std::sin(turn_per_m * below_m) * towards;
}

Flank flank_below(const Facet& from, const Vec3& up, const Grid& facets, double cell_m, double reach_cells) {
  const Vec3 down = (up.dot(from.normal) * from.normal - up).normalized(), across = from.normal.cross(down);
  std::vector<Said> all;
  facets.around(from.middle, 1, [&](Index i) {
    const Vec3 d = (facets.point(i) - from.middle) / cell_m, n = facets.normal(i);
    const double r2 = d.squaredNorm() / (reach_cells * reach_cells);
    if (r2 > 1 || n.dot(from.normal) < same_side) return;
    const double weight = (1 - r2) * (1 - r2), x = d.dot(down), y = d.dot(across), z = d.dot(from.normal);
    // So that both are exact on a ball, however far aside: there x^2 + y^2 + z^2 = 2 r |z|, and the normal is (x, y) / r along the tangents.
    const double round = 0.5 * (1 + z * z / std::max(x * x + y * y, 1e-9));
    all.push_back({(Shape() << 1, -x, -y, -round * x * x, -2 * round * x * y, -round * y * y).finished(), z, weight});
    all.push_back({(Shape() << 0, 1, 0, x, y, 0).finished(), n.dot(down), weight});
    all.push_back({(Shape() << 0, 0, 1, 0, x, y).finished(), n.dot(across), weight});
  });
  Eigen::Matrix<double, 6, 6> a = Eigen::Matrix<double, 6, 6>::Zero();
  Shape b = Shape::Zero(), found = b;
  double weights = 0;
  for (const Said& s : all) a += s.weight * s.of * s.of.transpose(), b += s.weight * s.value * s.of, weights += s.weight;
  double scatter2 = start_scatter * start_scatter;
  for (int pass = 0; pass < passes; ++pass) {
    // The prior of a bending: about none, give or take one radian over the reach. In units of what one facet says.
    Eigen::Matrix<double, 6, 6> with_prior = a;
    for (const int k : bendings) with_prior(k, k) += shared_facets * scatter2 * reach_cells * reach_cells;
    found = with_prior.ldlt().solve(b);
    double sum = 0;
    for (const Said& s : all) sum += s.weight * std::pow(s.of.dot(found) - s.value, 2);
    scatter2 = std::max(least_scatter * least_scatter, sum / weights);
  }
  Flank out;
  out.at_m = from.middle + found[0] * cell_m * from.normal;
  const Vec3 lean = found[1] * down + found[2] * across;
  out.normal = (std::sqrt(std::max(0.0, 1 - lean.squaredNorm())) * from.normal + lean).normalized();
  const Vec3 change = (found[3] * down + found[4] * across) / cell_m;
  const Vec3 turn = change - out.normal.dot(change) * out.normal;
  out.turn_per_m = turn.norm();
  if (out.turn_per_m > 0) out.towards = turn / out.turn_per_m;
  return out;
}

}  // namespace palpate::reconstruction
