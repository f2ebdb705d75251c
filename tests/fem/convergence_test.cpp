// label: oracle
// SPDX-License-Identifier: Apache-2.0
// Orders of convergence on a manufactured solution: a smooth displacement is chosen, its body force follows from the law,
// -div P, its values are held on the whole boundary, and the errors of three meshes are integrated with another rule than
// the elements use. Linear tetrahedra: first order in the energy norm, second in the displacement; quadratic: second and
// third.
#include <gtest/gtest.h>

#include <cmath>

#include "fem_meshes.hpp"
#include "palpate/fem/materials.hpp"
#include "palpate/fem/statics.hpp"
#include "palpate/fem/tetrahedron.hpp"

namespace palpate::fem::convergence_test {
namespace {

constexpr double kSize = 0.1, kYoung = 20e3;

struct Case {
  const char* name;
  const char* law;
  int nodes;
  double poisson, amplitude;
  double bulging;  // share of a field with a change of volume
  Dilatation dilatation;
};

/// Component k is amplitude * (sin(2 s[k+1]) cos(1.5 s[k+2]) + bulging sin(1.3 s[k] + 0.2)) with s = x / size: without the
/// last term free of divergence.
struct Field {
  double amplitude, bulging;
  Vec3 value(const Vec3& x) const {
    Vec3 u;
    for (int k = 0; k < 3; ++k) {
      const double a = x((k + 1) % 3) / kSize, b = x((k + 2) % 3) / kSize;
      u(k) = std::sin(2 * a) * std::cos(1.5 * b) + bulging * std::sin(1.3 * x(k) / kSize + 0.2);
    }
    return amplitude * kSize * u;
  }
  Mat3 gradient(const Vec3& x) const {
    Mat3 h = Mat3::Zero();
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      const double a = x(i) / kSize, b = x(j) / kSize;
      h(k, i) = 2 * std::cos(2 * a) * std::cos(1.5 * b);
      h(k, j) = -1.5 * std::sin(2 * a) * std::sin(1.5 * b);
      h(k, k) = 1.3 * bulging * std::cos(1.3 * x(k) / kSize + 0.2);
    }
    return amplitude * h;
  }
  /// d gradient / dx[j].
  Mat3 second(const Vec3& x, int along) const {
    Mat3 h = Mat3::Zero();
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      const double a = x(i) / kSize, b = x(j) / kSize;
      const double cross = -3 * std::cos(2 * a) * std::sin(1.5 * b);
      if (along == i) {
        h(k, i) = -4 * std::sin(2 * a) * std::cos(1.5 * b);
        h(k, j) = cross;
      } else if (along == j) {
        h(k, i) = cross;
        h(k, j) = -2.25 * std::sin(2 * a) * std::cos(1.5 * b);
      } else {
        h(k, k) = -1.69 * bulging * std::sin(1.3 * x(k) / kSize + 0.2);
      }
    }
    return amplitude / kSize * h;
  }
};

struct Errors {
  double energy = 0, displacement = 0;  // relative
};

Errors solve(const Case& c, int cells) {
  TetMesh mesh = block_mesh(cells, cells, cells, {kSize, kSize, kSize});
  for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {  // one smooth map for all meshes: nothing is regular, all are alike
    const Vec3 s = node_position(mesh, i) / kSize;
    const double bump = 0.05 * std::sin(M_PI * s.x()) * std::sin(M_PI * s.y()) * std::sin(M_PI * s.z());
    mesh.nodes_m.row(i) += kSize * bump * Vec3(1, -0.7, 1.6).transpose();
  }
  if (c.nodes == 10) mesh = to_quadratic(mesh);
  const Field field{c.amplitude, c.bulging};
  const MaterialLaw& law = material_law(c.law);
  const Moduli m = moduli(kYoung, c.poisson);
  const auto rule = tet_quadrature_64();
  const auto for_each_point = [&](auto&& visit) {
    for (Index e = 0; e < mesh.tetrahedra.rows(); ++e) {
      Eigen::Matrix<double, Eigen::Dynamic, 3> x(c.nodes, 3);
      for (int a = 0; a < c.nodes; ++a) x.row(a) = mesh.nodes_m.row(mesh.tetrahedra(e, a));
      for (const auto& q : rule) {
        const auto d = tet_shape_gradient(c.nodes, q.barycentric);
        const Mat3 jacobian = x.transpose() * d;
        const VectorX n = tet_shape(c.nodes, q.barycentric);
        visit(e, n, Eigen::Matrix<double, Eigen::Dynamic, 3>(d * jacobian.inverse()), Vec3(x.transpose() * n),
              q.weight * jacobian.determinant());
      }
    }
  };
  VectorX load = VectorX::Zero(3 * mesh.nodes_m.rows());
  Mat9 tangent;
  for_each_point([&](Index e, const VectorX& n, const auto&, const Vec3& x, double weight) {
    law.tangent(m, field.gradient(x), tangent);
    Vec3 force = Vec3::Zero();
    for (int j = 0; j < 3; ++j) {
      const Mat3 change = field.second(x, j);
      const Eigen::Matrix<double, 9, 1> stress = tangent * as_vector(change);
      force -= stress.segment<3>(3 * j);
    }
    for (int a = 0; a < c.nodes; ++a) load.segment<3>(3 * mesh.tetrahedra(e, a)) += weight * n(a) * force;
  });
  Boundary b;
  b.forces = load.sparseView();
  const auto outside =
      nodes_where(mesh, [](const Vec3& x) { return (x.array() < 1e-9).any() || (x.array() > kSize - 1e-9).any(); });
  b.constraints = clamp(outside);
  VectorX motion = VectorX::Zero(load.size());
  for (Index i : outside) motion.segment<3>(3 * i) = field.value(node_position(mesh, i));
  b.motions = motion.sparseView();
  StaticsOptions options;
  options.dilatation = c.dilatation;
  const Equilibrium equilibrium =
      Statics(mesh, c.law, b, options).solve(kYoung, c.poisson, VectorX::Constant(1, 1), VectorX::Constant(1, 1));
  EXPECT_TRUE(equilibrium.converged) << equilibrium.reason;
  // Norms of small strains about the exact state, the volume's part measured by E where nu is near 0.5 (the displacement's
  // own energy would be that of the pressure).
  law.tangent(moduli(kYoung, std::min(c.poisson, 0.3)), Mat3::Zero(), tangent);
  double energy = 0, energy_error = 0, square = 0, square_error = 0;
  for_each_point([&](Index e, const VectorX& n, const auto& g, const Vec3& x, double weight) {
    Mat3 h = Mat3::Zero();
    Vec3 u = Vec3::Zero();
    for (int a = 0; a < c.nodes; ++a) {
      const Vec3 ua = equilibrium.displacement_m.segment<3>(3 * mesh.tetrahedra(e, a));
      h += ua * g.row(a);
      u += n(a) * ua;
    }
    const Mat3 exact = field.gradient(x), error = h - exact;
    energy += weight * as_vector(exact).dot(tangent * as_vector(exact));
    energy_error += weight * as_vector(error).dot(tangent * as_vector(error));
    square += weight * field.value(x).squaredNorm();
    square_error += weight * (u - field.value(x)).squaredNorm();
  });
  return {std::sqrt(energy_error / energy), std::sqrt(square_error / square)};
}

class Convergence : public testing::TestWithParam<Case> {};

TEST_P(Convergence, HasTheOrderOfItsElement) {
  const Case& c = GetParam();
  const int order = c.nodes == 4 ? 1 : 2, coarsest = c.nodes == 4 ? 4 : 2;
  Errors last{};
  for (int level = 0; level < 3; ++level) {
    const int cells = coarsest << level;
    const Errors now = solve(c, cells);
    const std::string key = std::to_string(cells) + "_cells";
    RecordProperty(key, std::to_string(100 * now.energy) + " " + std::to_string(100 * now.displacement));
    if (level == 2) {
      EXPECT_NEAR(std::log2(last.energy / now.energy), order, 0.15);
      EXPECT_NEAR(std::log2(last.displacement / now.displacement), order + 1, 0.25);
    }
    last = now;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Elements, Convergence,
    testing::Values(Case{"tet4_linear", "linear", 4, 0.3, 0.01, 0.5, Dilatation::pointwise},
                    Case{"tet10_linear", "linear", 10, 0.3, 0.01, 0.5, Dilatation::pointwise},
                    Case{"tet4_neo_hookean", "neo_hookean", 4, 0.3, 0.1, 0.5, Dilatation::pointwise},
                    Case{"tet10_neo_hookean", "neo_hookean", 10, 0.3, 0.1, 0.5, Dilatation::pointwise},
                    Case{"tet10_averaged_linear_499", "linear", 10, 0.499, 0.01, 0, Dilatation::averaged},
                    Case{"tet10_averaged_isochoric_450", "neo_hookean_isochoric", 10, 0.45, 0.05, 0, Dilatation::averaged}),
    [](const auto& each) { return std::string(each.param.name); });

}  // namespace
}  // namespace palpate::fem::convergence_test
