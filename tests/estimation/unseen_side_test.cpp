// label: unit
// SPDX-License-Identifier: Apache-2.0
// A block whose top alone was seen: rays of the flanks are left out, and so are those of the rim of the top.
#include "palpate/estimation/unseen_side.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "scenes.hpp"

namespace palpate::estimation::unseen_side_test {
namespace {

const Vec3 size_m(0.06, 0.04, 0.03);

TriMesh block_surface() { return simulated(kuhn_block(24, 16, 12, size_m), "linear").surface.rest(); }

std::vector<char> top_of(const TriMesh& surface) {
  std::vector<char> seen;
  for (Index v = 0; v < surface.vertices_m.rows(); ++v) seen.push_back(surface.vertices_m(v, 2) > 0.999 * size_m.z());
  return seen;
}

TEST(UnseenSide, ItsShareLeavesTheFootOut) {
  const TriMesh surface = block_surface();
  const double flanks_m2 = 2 * size_m.z() * (size_m.x() + size_m.y()), top_m2 = size_m.x() * size_m.y();
  // triangles of the flanks that reach the top count as seen: one row of twelve
  const double seen_m2 = top_m2 + flanks_m2 / 12;
  const Plane table{Vec3::Zero(), Vec3::UnitZ()};
  EXPECT_NEAR(unseen_share(surface, top_of(surface), table), 1 - seen_m2 / (flanks_m2 + top_m2), 0.01);
  EXPECT_NEAR(unseen_share(surface, top_of(surface), std::nullopt), 1 - seen_m2 / (flanks_m2 + 2 * top_m2), 0.01);
}

TEST(UnseenSide, RaysOfItAndOfItsRimAreLeftOut) {
  const TriMesh surface = block_surface();
  const double edge_m = 2.5e-3;
  RayObservation frame;
  std::vector<Vec3> ends;
  for (double x = 0.5e-3; x < size_m.x(); x += 1e-3)
    for (double y = 0.5e-3; y < size_m.y(); y += 1e-3) ends.emplace_back(x, y, size_m.z());
  const std::size_t on_top = ends.size();
  for (double z = 0.5e-3; z < size_m.z(); z += 1e-3) ends.emplace_back(0, 0.02, z);
  const auto count = static_cast<Index>(ends.size());
  frame.rays.origins_m.resize(count, 3), frame.rays.directions.resize(count, 3);
  frame.rays.range_m = VectorX::Constant(count, 0.5), frame.rays.sigma_m = VectorX::Constant(count, 1e-3);
  for (Index i = 0; i < count; ++i) {
    frame.rays.directions.row(i) = -Vec3::UnitZ().transpose();
    frame.rays.origins_m.row(i) = ends[static_cast<std::size_t>(i)].transpose() + 0.5 * Vec3::UnitZ().transpose();
  }
  Inputs inputs(1);
  inputs[0].push_back(frame);
  drop_unseen(surface, top_of(surface), Plane{Vec3::Zero(), Vec3::UnitZ()}, inputs);
  const RayCloud& kept = std::get<RayObservation>(inputs[0][0]).rays;
  EXPECT_GT(kept.range_m.size(), static_cast<Index>(on_top / 3));
  for (Index i = 0; i < kept.range_m.size(); ++i) {
    const Vec3 end = kept.origins_m.row(i) + kept.range_m(i) * kept.directions.row(i);
    EXPECT_NEAR(end.z(), size_m.z(), 1e-9);
    const double to_rim_m = std::min({end.x(), size_m.x() - end.x(), end.y(), size_m.y() - end.y()});
    EXPECT_GT(to_rim_m, 2 * edge_m);
  }
}

TEST(UnseenSide, WhereAllWasSeenNoRayIsLeftOut) {
  const TriMesh surface = block_surface();
  RayObservation frame;
  frame.rays.origins_m = Points::Constant(1, 3, 0.02);
  frame.rays.directions = -Vec3::UnitZ().transpose();
  frame.rays.range_m = VectorX::Constant(1, 0.02), frame.rays.sigma_m = VectorX::Constant(1, 1e-3);
  Inputs inputs(1);
  inputs[0].push_back(frame);
  drop_unseen(surface, std::vector<char>(static_cast<std::size_t>(surface.vertices_m.rows()), 1), std::nullopt, inputs);
  ASSERT_EQ(inputs[0].size(), 1U);
  EXPECT_EQ(std::get<RayObservation>(inputs[0][0]).rays.range_m.size(), 1);
}

}  // namespace
}  // namespace palpate::estimation::unseen_side_test
