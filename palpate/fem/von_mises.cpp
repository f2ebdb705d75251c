// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/von_mises.hpp"

#include <Eigen/LU>
#include <cmath>
#include <vector>

#include "palpate/fem/materials.hpp"
#include "palpate/fem/tetrahedron.hpp"

namespace palpate::fem {
namespace {

/// At most ten rows, on the stack: one an element's node.
template <int Columns>
using NodeRows = Eigen::Matrix<double, Eigen::Dynamic, Columns, Eigen::ColMajor, 10, Columns>;

/// Derivatives of the shape functions to the barycentric coordinates: nodes x 4.
Eigen::Matrix<double, Eigen::Dynamic, 4> shape_derivatives(Index nodes, const Eigen::Vector4d& at) {
  Eigen::Matrix<double, Eigen::Dynamic, 4> d = Eigen::Matrix<double, Eigen::Dynamic, 4>::Zero(nodes, 4);
  if (nodes == 4) {
    d.setIdentity();
    return d;
  }
  for (int k = 0; k < 4; ++k) d(k, k) = 4 * at(k) - 1;
  for (int e = 0; e < 6; ++e) {
    const int a = kTetEdges[e][0], b = kTetEdges[e][1];
    d(4 + e, a) = 4 * at(b);
    d(4 + e, b) = 4 * at(a);
  }
  return d;
}

double von_mises_of(const Mat3& cauchy) {
  const Mat3 deviator = cauchy - cauchy.trace() / 3 * Mat3::Identity();
  return std::sqrt(1.5) * deviator.norm();
}

}  // namespace

VectorX von_mises(const TetMesh& mesh, const std::string& material, double young_modulus_pa, double poisson_ratio,
                  const VectorX& extra, const VectorX& displacement_m, const VectorX& stiffness, const VectorX& poisson) {
  const MaterialLaw& law = material_law(material);
  VectorX further = extra;
  if (further.size() == 0) {  // as the solvers take them, too
    const auto parameters = law.extra_parameters();
    further.resize(static_cast<Index>(parameters.size()));
    for (std::size_t i = 0; i < parameters.size(); ++i) further(static_cast<Index>(i)) = parameters[i].initial;
  }
  const Moduli constants = moduli(young_modulus_pa, poisson_ratio, further);
  const Index nodes = Index(mesh.tetrahedra.cols());
  const auto points = nodes == 10 ? tet_quadrature_4() : tet_quadrature_1();
  VectorX sum = VectorX::Zero(mesh.nodes_m.rows()), weight = sum;
  std::vector<NodeRows<3>> d_reference;  // a point; reference coordinates are the last three barycentric ones
  for (const auto& point : points) {
    const auto d = shape_derivatives(nodes, point.barycentric);
    NodeRows<3>& to = d_reference.emplace_back(nodes, 3);
    for (int k = 0; k < 3; ++k) to.col(k) = d.col(k + 1) - d.col(0);
  }
  NodeRows<3> x(nodes, 3), u(nodes, 3);
  Moduli here = constants;
  for (Index t = 0; t < mesh.tetrahedra.rows(); ++t) {
    if (poisson.size() > 0 && poisson(t) != here.poisson) here = moduli(young_modulus_pa, poisson(t), further);
    for (Index k = 0; k < nodes; ++k) {
      const Index node = mesh.tetrahedra(t, k);
      x.row(k) = mesh.nodes_m.row(node);
      u.row(k) = displacement_m.segment<3>(3 * node);
    }
    double stress = 0, volume = 0;
    for (std::size_t p = 0; p < points.size(); ++p) {
      const Mat3 jacobian = x.transpose().lazyProduct(d_reference[p]);  // dx / d reference
      const Mat3 by_reference = u.transpose().lazyProduct(d_reference[p]);
      const Mat3 gradient = by_reference * jacobian.inverse();
      Mat3 first = Mat3::Zero();
      if (!std::isfinite(law.energy_and_stress(here, gradient, first))) continue;
      const Mat3 f = Mat3::Identity() + gradient;
      // A law of small strains knows no difference between the stresses.
      const Mat3 cauchy = law.is_linear() ? first : Mat3(first * f.transpose() / f.determinant());
      const double w = points[p].weight * std::abs(jacobian.determinant());
      stress += w * von_mises_of(cauchy);
      volume += w;
    }
    if (stiffness.size() > 0) stress *= stiffness(t);  // every energy of the table is proportional to E
    for (Index k = 0; k < nodes; ++k) {
      sum(mesh.tetrahedra(t, k)) += stress;
      weight(mesh.tetrahedra(t, k)) += volume;
    }
  }
  return (weight.array() > 0).select(sum.array() / weight.array().max(1e-300), 0.0);
}

}  // namespace palpate::fem
