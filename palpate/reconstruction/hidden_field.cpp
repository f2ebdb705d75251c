// SPDX-License-Identifier: Apache-2.0
#include "palpate/reconstruction/hidden_field.hpp"

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>
#include <algorithm>
#include <limits>
#include <memory>

#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/geometry/winding_number.hpp"
#include "palpate/reconstruction/cubes.hpp"
#include "palpate/reconstruction/facets.hpp"

namespace palpate::reconstruction {
namespace {

constexpr int cubes_across = 64;   // of the seen part's diagonal
constexpr double known_cubes = 2.5;     // to a facet: its side is known there
constexpr double before_facet = 0.5;    // of the distance, along the normal: beside its rim nothing is known
constexpr double little = 0.3;          // of the field, either way from one half, is what other completions dare
constexpr double gently = 0.02;         // drawn to the planar completion, within the root of one over this, in cubes
constexpr double firmly = 1;            // the same where it is asked for

Cubes lay_cubes(const TriMesh& held, const FusedViews& fused, const FuseOptions& options) {
  const Vec3 up = options.support ? options.support->normal : Vec3(Vec3::UnitZ());
  const auto [u, v] = tangents(up);
  Cubes out;
  out.axes << u, v, up;
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (Index t = 0; t < held.triangles.rows(); ++t) {
    const Vec3 p = out.axes.transpose() * middle_of(held, t);
    low = low.cwiseMin(p), high = high.cwiseMax(p);
  }
  out.h = std::max(0.5 * fused.cell_m, (high - low).norm() / cubes_across);
  const Vec3 margin = Vec3::Constant(2 * out.h);
  low -= margin, high += margin;
  if (options.support) low.z() = up.dot(options.support->point_m);
  out.low = low;
  for (int k = 0; k < 3; ++k) out.n[std::size_t(k)] = std::max(1, int(std::ceil((high[k] - low[k]) / out.h)));
  return out;
}

/// Of a cube.
enum class Known : char { nothing, inside, outside };

/// Fills in what is not known.
VectorX relax(const Cubes& cubes, const std::vector<Known>& known, const VectorX& drawn_to, double drawn, bool level_below) {
  std::vector<Index> place(cubes.count(), -1);
  Index unknowns = 0;
  for (std::size_t k = 0; k < place.size(); ++k)
    if (known[k] == Known::nothing) place[k] = unknowns++;
  VectorX right = VectorX::Zero(unknowns);
  std::vector<Eigen::Triplet<double>> entries;
  cubes.each([&](int x, int y, int z) {
    const std::size_t k = cubes.at(x, y, z);
    const Index i = place[k];
    if (i < 0) return;
    double own = drawn;
    right[i] = drawn * drawn_to[static_cast<Index>(k)];
    for (const auto& s : Cubes::sides) {
      if (z + s[2] < 0 && level_below) continue;
      own += 1;
      if (!cubes.holds(x + s[0], y + s[1], z + s[2])) continue;
      const std::size_t n = cubes.at(x + s[0], y + s[1], z + s[2]);
      if (place[n] >= 0) entries.emplace_back(i, place[n], -1.0);
      else right[i] += known[n] == Known::inside ? 1 : 0;
    }
    entries.emplace_back(i, i, own);
  });
  Eigen::SparseMatrix<double> matrix(unknowns, unknowns);
  matrix.setFromTriplets(entries.begin(), entries.end());
  Eigen::ConjugateGradient<Eigen::SparseMatrix<double>, Eigen::Lower | Eigen::Upper> solver;
  solver.setTolerance(1e-4);
  const VectorX found = unknowns > 0 ? VectorX(solver.compute(matrix).solve(right)) : VectorX();
  VectorX out(static_cast<Index>(place.size()));
  for (std::size_t k = 0; k < place.size(); ++k)
    out[static_cast<Index>(k)] = place[k] >= 0 ? found[place[k]] : known[k] == Known::inside ? 1 : 0;
  return out;
}

/// Between the middles of cubes. What lies below all of them is as the lowest ones (`level_below`), else outside, as it is beside them.
double interpolated(const Cubes& cubes, const VectorX& values, const Vec3& p, bool level_below) {
  const Vec3 local = (cubes.axes.transpose() * p - cubes.low) / cubes.h - Vec3::Constant(0.5);
  const Vec3 low = local.array().floor(), share = local - low;
  double out = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const int x = int(low.x()) + (corner & 1), y = int(low.y()) + (corner >> 1 & 1), own = int(low.z()) + (corner >> 2), z = level_below ? std::max(0, own) : own;
    if (!cubes.holds(x, y, z)) continue;
    out += (corner & 1 ? share.x() : 1 - share.x()) * (corner & 2 ? share.y() : 1 - share.y()) * (corner & 4 ? share.z() : 1 - share.z()) *
           values[static_cast<Index>(cubes.at(x, y, z))];
  }
  return out;
}

}  // namespace

std::function<double(const Vec3&)> hidden_field(const FusedViews& fused, const FuseOptions& options) {
  TriMesh held = fused.facets;
  held.triangles.conservativeResize(fused.held, 3);
  const Cubes cubes = lay_cubes(held, fused, options);
  const geometry::WindingNumber planar(fused.facets);
  const geometry::TriangleTree to_held(held);
  std::vector<Known> known(cubes.count(), Known::nothing);
  VectorX drawn_to = VectorX::Zero(static_cast<Index>(cubes.count()));
  const double reach_m2 = std::pow(known_cubes * cubes.h, 2);
  cubes.each([&](int x, int y, int z) {
    const Vec3 p = cubes.middle(x, y, z);
    const std::size_t k = cubes.at(x, y, z);
    if (to_held.within(p, reach_m2)) {
      const auto c = to_held.closest(p);
      const Vec3 from = p - c.point_m;
      const double far = from.norm(), out = from.dot(area_of(held, c.triangle).normalized());
      if (out < -before_facet * far) known[k] = Known::inside;
      else if (out > before_facet * far) known[k] = Known::outside;
    }
    if (known[k] != Known::nothing) return;
    if (options.free(p)) known[k] = Known::outside;
    else drawn_to[static_cast<Index>(k)] = planar(p) > 0.5;
  });
  VectorX field = relax(cubes, known, drawn_to, options.completion == Completion::planar ? firmly : gently, options.support.has_value());
  std::vector<char> solid(cubes.count()), core(cubes.count());
  for (std::size_t k = 0; k < solid.size(); ++k) solid[k] = field[static_cast<Index>(k)] > 0.5, core[k] = known[k] == Known::inside;
  const std::vector<char> whole = cubes.connected(solid, core);
  for (std::size_t k = 0; k < solid.size(); ++k)
    if (solid[k] && !whole[k]) field[static_cast<Index>(k)] = 0;
  if (options.completion == Completion::tapered) field.array() -= little;
  if (options.completion == Completion::hidden) field.array() += little;
  return [cubes, values = std::make_shared<const VectorX>(std::move(field)), level_below = options.support.has_value()](const Vec3& p) {
    return interpolated(cubes, *values, p, level_below);
  };
}

}  // namespace palpate::reconstruction
