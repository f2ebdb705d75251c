// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/rest_shape.hpp"

#include <Eigen/QR>
#include <cmath>
#include <memory>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/fem/assembly.hpp"
#include "palpate/fem/materials.hpp"
#include "palpate/fem/reduced_system.hpp"

namespace palpate::fem {
namespace {

VectorX flat(const Points& points) { return Eigen::Map<const VectorX>(points.data(), points.size()); }

double largest(const VectorX& field) {
  double most = 0;
  for (Index i = 0; i < field.size(); i += 3) most = std::max(most, field.segment<3>(i).norm());
  return most;
}

// Solves A y = b with the Krylov space of b, to a relative residual (GMRES, Saad and Schultz 1986).
template <typename Product>
VectorX krylov(Product&& product, const VectorX& b, double tolerance, int max_size) {
  std::vector<VectorX> basis{b / b.norm()};
  MatrixX h = MatrixX::Zero(max_size + 1, max_size);
  VectorX y;
  for (int k = 0; k < max_size; ++k) {
    VectorX w = product(basis[k]);
    if (w.size() == 0) return {};
    for (int i = 0; i <= k; ++i) {
      h(i, k) = basis[i].dot(w);
      w -= h(i, k) * basis[i];
    }
    h(k + 1, k) = w.norm();
    const MatrixX part = h.topLeftCorner(k + 2, k + 1);
    const VectorX rhs = b.norm() * VectorX::Unit(k + 2, 0);
    y = Eigen::HouseholderQR<MatrixX>(part).solve(rhs);
    if ((part * y - rhs).norm() <= tolerance * b.norm() || h(k + 1, k) < 1e-14) break;
    basis.push_back(w / h(k + 1, k));
  }
  VectorX x = VectorX::Zero(b.size());
  for (Index i = 0; i < y.size(); ++i) x += y(i) * basis[i];
  return x;
}

// The mesh X whose displacement x - X is asked to balance the loads.
class InverseProblem {
 public:
  InverseProblem(const TetMesh& seen, const MaterialLaw& law, const Moduli& m, const VectorX& load,
                 const std::function<Boundary(const TetMesh&)>& boundary_on, const StaticsOptions& options)
      : mesh_(seen), x_(flat(seen.nodes_m)), law_(law), m_(m), load_(load), boundary_on_(boundary_on), options_(options) {}

  // Unbalanced forces f_int(X; x - X) - share F(X) on all nodes; empty where X is no mesh or the law does not exist.
  VectorX unbalanced(const VectorX& rest, double share) {
    try {
      const Boundary boundary = put(rest);
      const Assembly assembly(mesh_, options_.dilatation);
      VectorX forces;
      if (!std::isfinite(assembly.energy_and_forces(law_, m_, x_ - rest, forces))) return {};
      return forces - share * (boundary.forces * load_);
    } catch (const Error&) {
      return {};
    }
  }

  // Factor of the forward problem's tangent, which the inverse one's is but for the geometric stiffness. Throws what is
  // wrong with the mesh or its supports.
  bool factorise(const VectorX& rest) {
    const Boundary boundary = checked(mesh_, put(rest));
    if (boundary.inertia_relief) throw Error("must be held: a free object has no shape under its weight", "boundary_on");
    check_supported(mesh_, boundary.constraints);
    const Assembly assembly(mesh_, options_.dilatation);
    BlockValues blocks;
    assembly.tangent(law_, m_, x_ - rest, blocks);
    system_ = std::make_unique<ReducedSystem>(assembly.pattern(), boundary.constraints, MatrixX::Zero(x_.size(), 0),
                                              mesh_.nodes_m, options_.threads);
    for (double shift = 0; shift < 1; shift = shift == 0 ? 1e-3 : 4 * shift)
      if (system_->factorise(assembly.pattern(), blocks, shift, assembly.expected_negative_pivots())) return true;
    return false;
  }
  VectorX solve(const VectorX& force) const { return system_->solve(force); }

 private:
  Boundary put(const VectorX& rest) {
    mesh_.nodes_m = Eigen::Map<const Points>(rest.data(), rest.size() / 3, 3);
    return boundary_on_(mesh_);
  }
  TetMesh mesh_;
  VectorX x_;
  const MaterialLaw& law_;
  Moduli m_;
  VectorX load_;
  const std::function<Boundary(const TetMesh&)>& boundary_on_;
  StaticsOptions options_;
  std::unique_ptr<ReducedSystem> system_;
};

}  // namespace

RestShape rest_shape(const TetMesh& seen, const std::string& material,
                     const std::function<Boundary(const TetMesh&)>& boundary_on, double young_modulus_pa,
                     double poisson_ratio, const VectorX& force_coefficients, const RestShapeOptions& options,
                     const VectorX& extra) {
  const VectorX x = flat(seen.nodes_m);
  const double diagonal = (seen.nodes_m.colwise().maxCoeff() - seen.nodes_m.colwise().minCoeff()).norm();
  RestShape out;
  out.mesh = seen;
  const auto put = [&out](const VectorX& nodes) {
    out.mesh.nodes_m = Eigen::Map<const Points>(nodes.data(), nodes.size() / 3, 3);
  };
  const MaterialLaw& law = material_law(material);
  VectorX values = extra;
  if (values.size() == 0) {
    const auto further = law.extra_parameters();
    values.resize(static_cast<Index>(further.size()));
    for (std::size_t i = 0; i < further.size(); ++i) values(static_cast<Index>(i)) = further[i].initial;
  }
  const Moduli m = moduli(young_modulus_pa, poisson_ratio, values);
  InverseProblem inverse(seen, law, m, force_coefficients, boundary_on, options.statics);
  // Newton's method under a share of the loads; true when it settled.
  const auto settle = [&](VectorX& rest, double share) {
    std::vector<double> lengths;
    for (int round = 0; round < 25 && out.iterations < options.max_iterations; ++round) {
      const VectorX force = inverse.unbalanced(rest, share);
      if (force.size() == 0 || !inverse.factorise(rest)) return false;
      ++out.iterations;
      const VectorX step = inverse.solve(force);
      const double length = largest(step);
      if (length <= options.tolerance * diagonal) return true;
      lengths.push_back(length);
      if (round >= 5 && length > 0.5 * lengths[lengths.size() - 6]) return length < 100 * options.tolerance * diagonal;
      const auto product = [&](const VectorX& v) -> VectorX {
        const double h = 1e-6 * diagonal / largest(v);
        const VectorX ahead = inverse.unbalanced(rest + h * v, share);
        return ahead.size() == 0 ? VectorX() : inverse.solve((force - ahead) / h);
      };
      const VectorX change = krylov(product, step, 1e-2, 40);
      if (change.size() == 0) return false;
      double alpha = 1;
      for (; alpha > 1e-2; alpha *= 0.5) {
        const VectorX ahead = inverse.unbalanced(rest + alpha * change, share);
        if (ahead.size() > 0 && largest(inverse.solve(ahead)) < (1 - 0.1 * alpha) * length) break;
      }
      if (alpha <= 1e-2) return length < 100 * options.tolerance * diagonal;  // rounding
      rest += alpha * change;
    }
    return false;
  };

  // Loads in steps where all of them at once do not settle.
  VectorX last_rest = x, before_last = x;
  double done = 0, stride = 1, last_stride = 0;
  inverse.factorise(x);
  while (done < 1 && stride > 1e-3 && out.iterations < options.max_iterations) {
    const double share = std::min(1.0, done + stride);
    VectorX rest = last_rest + (last_stride > 0 ? (share - done) / last_stride : 0.0) * (last_rest - before_last);
    if (settle(rest, share)) {
      before_last = last_rest;
      last_rest = rest;
      last_stride = share - done;
      done = share;
      stride *= 1.5;
    } else {
      stride *= 0.5;
    }
  }
  put(last_rest);
  out.displacement_m = x - last_rest;
  out.largest_shift_m = largest(out.displacement_m);
  if (done < 1) {
    out.reason = "no stress-free shape was found beyond " + std::to_string(100 * done) +
                 " % of the loads: is the object that soft, or does it rest on more than the supports named?";
    return out;
  }
  // The proof: the loads take the stress-free shape to the seen one.
  const Boundary boundary = boundary_on(out.mesh);
  const Equilibrium e = Statics(out.mesh, material, boundary, options.statics)
                            .solve(young_modulus_pa, poisson_ratio, force_coefficients,
                                   VectorX::Zero(static_cast<Index>(boundary.motions.cols())), &out.displacement_m, values);
  out.mismatch_m = largest(e.displacement_m - out.displacement_m);
  out.converged = e.converged && out.mismatch_m <= 10 * options.tolerance * diagonal;
  if (!out.converged)
    out.reason = e.converged ? "the loads take the stress-free shape to another equilibrium than the seen one" : e.reason;
  return out;
}

}  // namespace palpate::fem
