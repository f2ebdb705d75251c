// label: unit
// SPDX-License-Identifier: Apache-2.0
// How flanks go on below what was seen of them, and where they meet what the object stands on.
#include "palpate/reconstruction/flank.hpp"

#include <gtest/gtest.h>

#include <random>

#include "palpate/reconstruction/fused_surface.hpp"
#include "palpate/reconstruction/skirts.hpp"

namespace palpate::reconstruction::flank_test {
namespace {

constexpr double cell_m = 0.008, reach_cells = 4;

struct Noise {
  double off_m = 0, normal_rad = 0;
};

/// A body of revolution about z, seen above `from_m(azimuth)`: facets a cell apart, as noisy as is said.
/// @param shape  radius at a height, and its slope
template <class Shape, class From>
std::vector<Facet> seen_of(Shape shape, From from_m, double to_m, const Noise& noise = {}, unsigned seed = 1) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> g;
  std::vector<Facet> out;
  for (double z = 0.001; z < to_m; z += 0.9 * cell_m) {
    const auto [radius_m, slope] = shape(z);
    const int count = std::max(3, static_cast<int>(2 * M_PI * radius_m / cell_m));
    for (int k = 0; k < count; ++k) {
      const double azimuth = 2 * M_PI * (k + 0.4 * g(rng)) / count;
      if (z < from_m(azimuth)) continue;
      const Vec3 away(std::cos(azimuth), std::sin(azimuth), 0);
      const Vec3 normal = (away - slope * Vec3::UnitZ()).normalized();
      out.push_back({radius_m * away + z * Vec3::UnitZ() + noise.off_m * g(rng) * normal,
                     (normal + noise.normal_rad * Vec3(g(rng), g(rng), g(rng))).normalized(), cell_m * cell_m, 1e-4});
    }
  }
  return out;
}

Grid grid_of(const std::vector<Facet>& facets) {
  PointCloud middles;
  middles.points_m.resize(static_cast<Index>(facets.size()), 3), middles.normals.resize(static_cast<Index>(facets.size()), 3);
  for (std::size_t i = 0; i < facets.size(); ++i)
    middles.points_m.row(static_cast<Index>(i)) = facets[i].middle.transpose(), middles.normals.row(static_cast<Index>(i)) = facets[i].normal.transpose();
  return Grid({middles}, reach_cells * cell_m);
}

/// A ball of 120 mm that is cut off 52 mm below its middle.
std::pair<double, double> ball(double z) {
  const double r = std::sqrt(0.06 * 0.06 - std::pow(z - 0.052, 2));
  return {r, -(z - 0.052) / r};
}
std::pair<double, double> can(double) { return {0.04, 0.0}; }

/// Mean over the flanks that start within a cell above `from_m`, and their root mean square.
struct Turns {
  double mean_per_m = 0, rms_per_m = 0;
};
Turns turns_of(const std::vector<Facet>& seen, double from_m) {
  const Grid grid = grid_of(seen);
  Turns out;
  int count = 0;
  for (const Facet& f : seen) {
    if (f.middle.z() > from_m + cell_m) continue;
    const Flank flank = flank_below(f, Vec3::UnitZ(), grid, cell_m, reach_cells);
    EXPECT_NEAR(flank.normal.dot(flank.towards), 0, 1e-9);
    out.mean_per_m += std::copysign(flank.turn_per_m, -flank.towards.z()), out.rms_per_m += flank.turn_per_m * flank.turn_per_m, ++count;
  }
  EXPECT_GT(count, 10);
  out.mean_per_m /= count, out.rms_per_m = std::sqrt(out.rms_per_m / count);
  return out;
}

// A straight line through the normals, and a ridge of a twentieth of the spread, had lost a fifth of it.
TEST(Flank, OfABallBendsAsTheBall) {
  const auto seen = seen_of(ball, [](double) { return 0.012; }, 0.08);
  const Turns turns = turns_of(seen, 0.012);
  EXPECT_NEAR(turns.mean_per_m * 0.06, 1, 0.02);
}

TEST(Flank, OfANoisyBallBendsAsTheBallOnAverage) {
  double mean = 0;
  constexpr int draws = 8;
  for (unsigned seed = 1; seed <= draws; ++seed)
    mean += turns_of(seen_of(ball, [](double) { return 0.012; }, 0.08, {0.0002, 0.03}, seed), 0.012).mean_per_m * 0.06 / draws;
  EXPECT_NEAR(mean, 1, 0.06);
}

// One side was seen further down than the other: how normals change around the can is no bending on the way down.
TEST(Flank, OfACanIsStraightWhereItsLowerEndSlopes) {
  const auto seen = seen_of(can, [](double azimuth) { return 0.02 + 0.01 * std::cos(azimuth); }, 0.1);
  EXPECT_LT(turns_of(seen, 0.02).rms_per_m, 0.03 / 0.06);
}

TEST(Flank, ThatSaysLittleIsNotBentByNoise) {
  const Turns known = turns_of(seen_of(can, [](double) { return 0.012; }, 0.1, {0.0002, 0.02}), 0.012);
  const Turns vague = turns_of(seen_of(can, [](double) { return 0.012; }, 0.018, {0.0002, 0.3}), 0.012);
  EXPECT_LT(known.rms_per_m, 4);
  EXPECT_LT(vague.rms_per_m, 8);  // a quarter of a radian over the reach, where normals are off by more
  const Facet lone{Vec3(0.04, 0, 0.01), Vec3::UnitX(), 1e-4, 1e-4};
  const Flank flank = flank_below(lone, Vec3::UnitZ(), grid_of({lone}), cell_m, reach_cells);
  EXPECT_EQ(flank.turn_per_m, 0);
  EXPECT_LT((flank.normal_at(0.02) - Vec3::UnitX()).norm(), 1e-9);
}

TEST(Skirts, OfABallMeetThePlaneWhereTheBallDoes) {
  const auto seen = seen_of(ball, [](double) { return 0.012; }, 0.08);
  const auto strip = skirts(seen, {Vec3::Zero(), Vec3::UnitZ()}, 0.03, cell_m, {});
  ASSERT_GT(strip.size(), 20U);
  double off = 0;
  for (const Facet& f : strip) off += ((f.middle - Vec3(0, 0, 0.052)).norm() - 0.06) / static_cast<double>(strip.size());
  EXPECT_NEAR(off, 0, 0.0002);
}

// Marching cuts the edge off that flank and plane make, to a quarter of a cell above the plane.
TEST(FusedSurface, StandsOnItsFootWithoutAChamfer) {
  constexpr double radius_m = 0.04, height_m = 0.1;
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> side(-1, 1);
  PointCloud cloud;
  std::vector<Vec3> at, normal;
  for (int k = 0; k < 20000; ++k) {
    const double azimuth = M_PI * side(rng), z = 0.055 + 0.045 * side(rng);
    const Vec3 away(std::cos(azimuth), std::sin(azimuth), 0);
    at.push_back(radius_m * away + z * Vec3::UnitZ()), normal.push_back(away);
    const Vec3 top(radius_m * side(rng), radius_m * side(rng), height_m);
    if (top.head<2>().norm() < radius_m) at.push_back(top), normal.push_back(Vec3::UnitZ());
  }
  cloud.points_m.resize(static_cast<Index>(at.size()), 3), cloud.normals.resize(static_cast<Index>(at.size()), 3);
  for (std::size_t i = 0; i < at.size(); ++i)
    cloud.points_m.row(static_cast<Index>(i)) = at[i].transpose(), cloud.normals.row(static_cast<Index>(i)) = normal[i].transpose();
  cloud.sigma_m = VectorX::Constant(1, 3e-4);
  FuseOptions fuse;
  fuse.cell_m = 0.007;
  fuse.support = Plane{Vec3::Zero(), Vec3::UnitZ()};
  fuse.free = [](const Vec3& p) { return p.z() > 0.01 && (p.head<2>().norm() > radius_m + 0.003 || p.z() > height_m + 0.003); };
  const FusedViews fused = fuse_views({cloud}, fuse);
  ASSERT_TRUE(fused.around);
  SurfaceOptions options;
  options.support = fuse.support, options.free = fuse.free;
  const TriMesh skin = fused_surface(fused, options);
  double mean_m = 0;
  int count = 0;
  for (Index i = 0; i < skin.vertices_m.rows(); ++i) {
    const Vec3 p = skin.vertices_m.row(i);
    if (p.z() > 1e-6 && p.z() < 0.004) mean_m += p.head<2>().norm(), ++count;
  }
  ASSERT_GT(count, 10);
  EXPECT_NEAR(mean_m / count, radius_m, 0.0005);
}

}  // namespace
}  // namespace palpate::reconstruction::flank_test
