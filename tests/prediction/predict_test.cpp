// label: oracle
// SPDX-License-Identifier: Apache-2.0
// Predictions against closed forms, and bands against draws that are each solved anew.
#include "palpate/prediction/predict.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "fem/fem_meshes.hpp"
#include "palpate/core/error.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/regions.hpp"

namespace palpate::prediction::predict_test {
namespace {

constexpr double edge_m = 0.1;

/// A block on a frictionless table (a corner and an edge hold it in the plane), pressed on its whole top.
struct Scene {
  TetMesh mesh;
  fem::Boundary boundary;
};

Scene block(bool bonded, int cells = 2) {
  Scene scene;
  scene.mesh = fem::to_quadratic(fem::block_mesh(cells, cells, cells, Vec3::Constant(edge_m)));
  std::vector<Index> top;
  for (Index i = 0; i < scene.mesh.nodes_m.rows(); ++i) {
    const Vec3 x = scene.mesh.nodes_m.row(i);
    if (x.z() > edge_m - 1e-9) top.push_back(i);
    if (x.z() > 1e-9) continue;
    fem::Constraint held{i, Mat3::Identity(), 3};
    if (!bonded) {
      // z everywhere; x on the plane x = 0, y on y = 0.
      held.axes.col(0) = Vec3::UnitZ();
      held.axes.col(1) = x.x() < 1e-9 ? Vec3::UnitX() : Vec3::UnitY();
      held.axes.col(2) = x.x() < 1e-9 ? Vec3::UnitY() : Vec3::UnitX();
      held.count = 1 + (x.x() < 1e-9) + (x.y() < 1e-9);
      if (x.x() >= 1e-9) held.count = 1 + (x.y() < 1e-9);
    }
    scene.boundary.constraints.push_back(held);
  }
  // Uniform traction over the top: consistent forces of its faces.
  const Tetrahedra faces = fem::boundary_faces(scene.mesh);
  std::vector<Eigen::Triplet<double>> entries;
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    bool on_top = true;
    for (int k = 0; k < 3; ++k) on_top &= scene.mesh.nodes_m(faces(f, k), 2) > edge_m - 1e-9;
    if (!on_top) continue;
    const Vec3 a = scene.mesh.nodes_m.row(faces(f, 0)), b = scene.mesh.nodes_m.row(faces(f, 1)),
               c = scene.mesh.nodes_m.row(faces(f, 2));
    const double share = 0.5 * (b - a).cross(c - a).norm() / (edge_m * edge_m);
    for (int k = 3; k < 6; ++k)
      for (int d = 0; d < 3; ++d) entries.emplace_back(3 * faces(f, k) + d, d, share / 3);
  }
  scene.boundary.forces.resize(3 * scene.mesh.nodes_m.rows(), 3);
  scene.boundary.forces.setFromTriplets(entries.begin(), entries.end());
  scene.boundary.motions.resize(3 * scene.mesh.nodes_m.rows(), 0);
  return scene;
}

Elasticity foam(const std::string& material, double log_std = 0.05, double nu_std = 0.03, double correlation = -0.4) {
  Elasticity e;
  e.material = material;
  e.young_modulus_pa = 2e4;
  e.poisson_ratio = 0.3;
  e.covariance << log_std * log_std, correlation * log_std * nu_std, correlation * log_std * nu_std, nu_std * nu_std;
  return e;
}

/// Uniaxial compression: travel = F L / (E A), stress F / A, both exactly; their logarithms vary as that of E.
TEST(Predict, ABlockOnAFrictionlessTableFollowsHooke) {
  const Scene scene = block(false);
  NewPush push;
  push.force_n = 5;
  const Prediction found = predict(scene.mesh, foam("linear"), scene.boundary, push);
  ASSERT_TRUE(found.converged) << found.reason;
  const double travel_m = 5 / (2e4 * edge_m);
  EXPECT_NEAR(found.travel_m.value, travel_m, 1e-9);
  EXPECT_NEAR(found.travel_m.std / travel_m, 0.05, 1e-6);
  EXPECT_NEAR(found.travel_m.lower_95, travel_m * std::exp(-1.96 * 0.05), 1e-6);
  EXPECT_NEAR(found.travel_m.upper_95, travel_m * std::exp(1.96 * 0.05), 1e-6);
  EXPECT_EQ(found.force_n.std, 0);
  EXPECT_NEAR(found.stiffness_n_m, 2e4 * edge_m, 1e-3);
  for (Index i = 0; i < found.von_mises_pa.size(); ++i) {
    EXPECT_NEAR(found.von_mises_pa(i), 500, 1e-4);
    EXPECT_NEAR(found.von_mises_std_pa(i), 0, 1e-3) << "of a given force, the stress does not depend on E or nu";
  }
  // Sideways: nu F x / (E A), so its relative standard deviation is that of nu / E.
  Index corner = 0;
  for (Index i = 0; i < scene.mesh.nodes_m.rows(); ++i)
    if ((Vec3(scene.mesh.nodes_m.row(i)) - Vec3::Constant(edge_m)).norm() < 1e-9) corner = i;
  EXPECT_NEAR(found.displacement_m(3 * corner), 0.3 * travel_m, 1e-9);
  const double relative = std::sqrt(std::pow(0.03 / 0.3, 2) + 0.05 * 0.05 - 2 * (-0.4) * 0.1 * 0.05);
  EXPECT_NEAR(found.displacement_std_m(3 * corner), 0.3 * travel_m * relative, 1e-7);
}

TEST(Predict, AGivenTravelIsReachedAndTheForceHasTheBand) {
  const Scene scene = block(false);
  NewPush push;
  push.travel_m = 0.002;
  const Prediction found = predict(scene.mesh, foam("linear"), scene.boundary, push);
  ASSERT_TRUE(found.converged) << found.reason;
  EXPECT_NEAR(found.force_n.value, 2e4 * edge_m * 0.002, 1e-5);
  EXPECT_NEAR(found.force_n.std, 0.05 * found.force_n.value, 1e-6);
  EXPECT_NEAR(found.travel_m.value, 0.002, 1e-10);
  EXPECT_NEAR(found.travel_m.std, 0, 1e-12);
  // Stress follows the force.
  EXPECT_NEAR(found.largest_von_mises_pa.std / found.largest_von_mises_pa.value, 0.05, 1e-4);
}

class Bands : public testing::TestWithParam<const char*> {};

/// The covariance is small here, so that what is tested is the propagation and not how linear the object is.
TEST_P(Bands, AgreeWithDrawsThatAreSolvedAnew) {
  const Scene scene = block(true, 2);
  for (const bool travel_given : {false, true}) {
    NewPush push;
    if (travel_given)
      push.travel_m = 0.01;
    else
      push.force_n = 20;
    const Elasticity centre = foam(GetParam(), 0.02, 0.01);
    const Prediction found = predict(scene.mesh, centre, scene.boundary, push);
    ASSERT_TRUE(found.converged) << found.reason;
    std::mt19937 random(11);
    std::normal_distribution<double> normal;
    const Eigen::LLT<Eigen::Matrix2d> factor(centre.covariance);
    constexpr int draws = 60;
    double force = 0, travel = 0, stress = 0, force2 = 0, travel2 = 0, stress2 = 0;
    for (int i = 0; i < draws; ++i) {
      const Eigen::Vector2d z = factor.matrixL() * Eigen::Vector2d(normal(random), normal(random));
      Elasticity drawn = centre;
      drawn.young_modulus_pa *= std::exp(z(0));
      drawn.poisson_ratio += z(1);
      const Prediction one = predict(scene.mesh, drawn, scene.boundary, push);
      ASSERT_TRUE(one.converged);
      const double values[] = {one.force_n.value - found.force_n.value, one.travel_m.value - found.travel_m.value,
                               one.largest_von_mises_pa.value - found.largest_von_mises_pa.value};
      force += values[0], travel += values[1], stress += values[2];
      force2 += values[0] * values[0], travel2 += values[1] * values[1], stress2 += values[2] * values[2];
    }
    // 60 draws know a standard deviation to 9 %: within three of those.
    const double tolerance = 3 / std::sqrt(2.0 * (draws - 1));
    const auto spread = [&](double sum, double squares) { return std::sqrt((squares - sum * sum / draws) / (draws - 1)); };
    if (travel_given) {
      EXPECT_NEAR(found.force_n.std / spread(force, force2), 1, tolerance);
    } else {
      EXPECT_NEAR(found.travel_m.std / spread(travel, travel2), 1, tolerance);
    }
    EXPECT_NEAR(found.largest_von_mises_pa.std / spread(stress, stress2), 1, tolerance + 0.05);
  }
}

INSTANTIATE_TEST_SUITE_P(Laws, Bands, testing::Values("linear", "neo_hookean"));

/// The lower half twice as soft as the upper one.
Elasticity in_halves(const Scene& scene, const std::string& material, bool own) {
  Elasticity e = foam(material);
  e.regions = {"upper", "lower"};
  e.region_stiffness = Eigen::Vector2d(1, 0.5);
  if (own) e.region_poisson = Eigen::Vector2d(std::nan(""), 0.15);
  for (Index t = 0; t < scene.mesh.tetrahedra.rows(); ++t)
    e.region.push_back(fem::element_centre(scene.mesh, t).z() > edge_m / 2 ? 0 : 1);
  e.covariance = MatrixX::Zero(own ? 4 : 3, own ? 4 : 3);
  e.covariance.diagonal().head<3>() << 4e-4, 1e-4, 9e-4;
  e.covariance(0, 2) = e.covariance(2, 0) = -3e-4;
  if (own) e.covariance(3, 3) = 4e-4;
  return e;
}

/// nu / E is the same in both halves, so that they widen alike: springs in a row.
TEST(Predict, HalvesAreSpringsInARow) {
  const Scene scene = block(false);
  NewPush push;
  push.force_n = 5;
  const Prediction found = predict(scene.mesh, in_halves(scene, "linear", true), scene.boundary, push);
  ASSERT_TRUE(found.converged) << found.reason;
  EXPECT_NEAR(found.travel_m.value, 5 / (edge_m * edge_m) * (0.5 * edge_m / 2e4 + 0.5 * edge_m / 1e4), 1e-9);
  for (Index i = 0; i < found.von_mises_pa.size(); ++i) EXPECT_NEAR(found.von_mises_pa(i), 500, 1e-4);
}

TEST(Predict, BandsOfRegionsAgreeWithDrawsThatAreSolvedAnew) {
  const Scene scene = block(true, 2);
  for (const bool own : {false, true}) {
    const Elasticity centre = in_halves(scene, "neo_hookean", own);
    for (const bool travel_given : {false, true}) {
      NewPush push;
      if (travel_given)
        push.travel_m = 0.008;
      else
        push.force_n = 12;
      const Prediction found = predict(scene.mesh, centre, scene.boundary, push);
      ASSERT_TRUE(found.converged) << found.reason;
      Eigen::Index most = 0;
      found.von_mises_pa.maxCoeff(&most);
      std::mt19937 random(5);
      std::normal_distribution<double> normal;
      const Eigen::LLT<MatrixX> factor(centre.covariance);
      constexpr int draws = 150;
      double first = 0, first2 = 0, stress = 0, stress2 = 0;
      for (int i = 0; i < draws; ++i) {
        VectorX z(centre.covariance.rows());
        for (double& value : z) value = normal(random);
        z = factor.matrixL() * z;
        Elasticity drawn = centre;
        drawn.young_modulus_pa *= std::exp(z(0));
        drawn.poisson_ratio += z(1);
        drawn.region_stiffness(1) *= std::exp(z(2));
        if (own) drawn.region_poisson(1) += z(3);
        const Prediction one = predict(scene.mesh, drawn, scene.boundary, push);
        ASSERT_TRUE(one.converged);
        const double off = travel_given ? one.force_n.value - found.force_n.value : one.travel_m.value - found.travel_m.value;
        const double stress_off = one.von_mises_pa(most) - found.von_mises_pa(most);
        first += off, first2 += off * off, stress += stress_off, stress2 += stress_off * stress_off;
      }
      const double tolerance = 3 / std::sqrt(2.0 * (draws - 1));
      const auto spread = [&](double sum, double squares) { return std::sqrt((squares - sum * sum / draws) / (draws - 1)); };
      EXPECT_NEAR((travel_given ? found.force_n.std : found.travel_m.std) / spread(first, first2), 1, tolerance) << own;
      EXPECT_NEAR(found.von_mises_std_pa(most) / spread(stress, stress2), 1, tolerance + 0.05) << own;
    }
  }
}

TEST(Predict, ElasticityOfRegionsHasTheCovarianceOfTheirRatios) {
  Identification answer;
  answer.material = "linear";
  const auto parameter = [](const char* name, const char* region, double value) {
    Parameter one{name, region, "1"};
    one.value = value;
    return one;
  };
  answer.parameters = {parameter("young_modulus", "a", 1e4), parameter("poisson_ratio", "a", 0.2), parameter("young_modulus", "b", 3e4),
                       parameter("poisson_ratio", "b", 0.4)};
  answer.covariance = Eigen::Vector4d(4, 1, 9, 2).asDiagonal();
  answer.covariance(0, 2) = answer.covariance(2, 0) = 1;
  const Elasticity e = elasticity_of(answer);
  EXPECT_EQ(e.regions, (std::vector<std::string>{"a", "b"}));
  EXPECT_NEAR(e.region_stiffness(1), 3, 1e-12);
  EXPECT_TRUE(std::isnan(e.region_poisson(0)));
  EXPECT_EQ(e.region_poisson(1), 0.4);
  EXPECT_EQ(e.highest_young_modulus_pa(), 3e4);
  EXPECT_EQ(e.highest_poisson_ratio(), 0.4);
  EXPECT_NEAR(e.covariance(2, 2), 4 + 9 - 2, 1e-12);  // of log E_b - log E_a
  EXPECT_NEAR(e.covariance(0, 2), 1 - 4, 1e-12);
  EXPECT_NEAR(e.covariance(3, 3), 2, 1e-12);
}

TEST(Predict, AWeightBeforeThePushIsNoTravel) {
  Scene scene = block(true);
  const Eigen::SparseMatrix<double> weight = fem::body_force(scene.mesh);
  Eigen::SparseMatrix<double> all(scene.boundary.forces.rows(), 6);
  all.leftCols(3) = scene.boundary.forces;
  all.rightCols(3) = weight;
  const Prediction without = predict(scene.mesh, foam("linear"), scene.boundary, {-Vec3::UnitZ(), 5.0, {}, {}});
  scene.boundary.forces = all;
  NewPush push{-Vec3::UnitZ(), 5.0, {}, 100 * Vec3(0, 0, -9.81)};
  const Prediction with = predict(scene.mesh, foam("linear"), scene.boundary, push);
  ASSERT_TRUE(with.converged);
  EXPECT_NEAR(with.travel_m.value, without.travel_m.value, 1e-10) << "a linear body superposes";
  EXPECT_NEAR(with.travel_m.std, without.travel_m.std, 1e-10);
}

TEST(Predict, RefusesWhatIsNoPush) {
  const Scene scene = block(true);
  EXPECT_THROW(predict(scene.mesh, foam("linear"), scene.boundary, {}), Error);
  EXPECT_THROW(predict(scene.mesh, foam("linear"), scene.boundary, {-Vec3::UnitZ(), 1.0, 0.01, {}}), Error);
  EXPECT_THROW(predict(scene.mesh, foam("linear"), scene.boundary, {Vec3(0, 0, 2), 1.0, {}, {}}), Error);
  EXPECT_THROW(elasticity_of(Identification{}), Error);
}

TEST(Predict, ElasticityTakesTheCovarianceOfTheTwo) {
  Identification answer;
  answer.material = "neo_hookean";
  answer.parameters = {{"poisson_ratio", "", "1", 0.3, 0, 0, 0, true}, {"young_modulus", "", "Pa", 1e4, 0, 0, 0, true}};
  answer.covariance = MatrixX::Zero(2, 2);
  answer.covariance << 1, 2, 2, 3;
  const Elasticity e = elasticity_of(answer);
  EXPECT_EQ(e.young_modulus_pa, 1e4);
  EXPECT_EQ(e.covariance(0, 0), 3);
  EXPECT_EQ(e.covariance(1, 1), 1);
}

}  // namespace
}  // namespace palpate::prediction::predict_test
