// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/statics.hpp"

#include <Eigen/QR>
#include <cmath>
#include <limits>

#include "palpate/core/error.hpp"
#include "palpate/fem/assembly.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/materials.hpp"
#include "palpate/fem/reduced_system.hpp"

namespace palpate::fem {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kStaleContraction = 0.2;  // of the residual, per step with an old factor
constexpr double kCompressible = 0.45;     // Poisson ratio by way of which hard cases are solved

}  // namespace

Boundary checked(const TetMesh& mesh, Boundary boundary) {
  const Index n = static_cast<Index>(mesh.nodes_m.rows());
  std::vector<char> used(n, 0), constrained(n, 0);
  for (Index e = 0; e < mesh.tetrahedra.rows(); ++e)
    for (int a = 0; a < mesh.tetrahedra.cols(); ++a) used[mesh.tetrahedra(e, a)] = 1;
  for (Constraint& c : boundary.constraints) {
    if (c.node < 0 || c.node >= n)
      throw Error("names node " + std::to_string(c.node) + ", the mesh has " + std::to_string(n), "boundary.constraints");
    if (c.count < 0 || c.count > 3) throw Error("count must be 0 to 3", "boundary.constraints");
    if (constrained[c.node]) throw Error("node " + std::to_string(c.node) + " is constrained twice", "boundary.constraints");
    constrained[c.node] = 1;
    const auto given = c.axes.leftCols(c.count);
    if (!(given.transpose() * given).isApprox(MatrixX::Identity(c.count, c.count), 1e-6) && c.count > 0)
      throw Error("axes of node " + std::to_string(c.node) + " are not orthonormal", "boundary.constraints");
    if (c.count > 0) {
      const Eigen::HouseholderQR<Eigen::Matrix<double, 3, Eigen::Dynamic>> qr(given);
      const Mat3 q = qr.householderQ();
      c.axes.rightCols(3 - c.count) = q.rightCols(3 - c.count);
      if (c.count == 3) c.axes.setIdentity();
    }
  }
  if (boundary.inertia_relief && !boundary.constraints.empty())
    throw Error("a free object (inertia relief) cannot have constraints as well", "boundary.inertia_relief");
  for (Index i = 0; i < n; ++i)
    if (!used[i] && !constrained[i]) boundary.constraints.push_back({i, Mat3::Identity(), 3});
  const auto sized = [n](Eigen::SparseMatrix<double>& columns, const char* name) {
    if (columns.cols() == 0) columns.resize(3 * n, 0);
    if (columns.rows() != 3 * n)
      throw Error("needs " + std::to_string(3 * n) + " rows, has " + std::to_string(columns.rows()), name);
  };
  sized(boundary.forces, "boundary.forces");
  sized(boundary.motions, "boundary.motions");
  for (Index k = 0; k < boundary.motions.outerSize(); ++k)
    for (Eigen::SparseMatrix<double>::InnerIterator it(boundary.motions, k); it; ++it)
      if (it.value() != 0 && !constrained[it.row() / 3])
        throw Error("moves node " + std::to_string(it.row() / 3) + ", which no constraint holds", "boundary.motions");
  return boundary;
}

namespace {

// Share of the boundary that a uniform pressure gives each node: a third of a face to its corners, or to its midpoints where
// it has some (the corners of a quadratic face then carry none of it).
VectorX surface_shares(const TetMesh& mesh) {
  VectorX area = VectorX::Zero(mesh.nodes_m.rows());
  const Tetrahedra faces = boundary_faces(mesh);
  for (Index f = 0; f < faces.rows(); ++f) {
    const Vec3 a = mesh.nodes_m.row(faces(f, 0)), b = mesh.nodes_m.row(faces(f, 1)), c = mesh.nodes_m.row(faces(f, 2));
    const double third = (b - a).cross(c - a).norm() / 6;
    for (int k = 0; k < 3; ++k) area(faces(f, faces.cols() == 6 ? 3 + k : k)) += third;
  }
  return area;
}

}  // namespace

struct Statics::Impl {
  Impl(const TetMesh& mesh_in, const std::string& material, Boundary boundary_in, StaticsOptions options_in)
      : mesh(mesh_in),
        law(material_law(material)),
        options(options_in),
        assembly(mesh_in, options_in.dilatation),
        boundary(checked(mesh_in, std::move(boundary_in))),
        free(boundary.inertia_relief),
        system(assembly.pattern(), boundary.constraints,
               free ? mass_times(mesh_in, rigid_motions(mesh_in.nodes_m)) : MatrixX::Zero(3 * mesh_in.nodes_m.rows(), 0),
               mesh_in.nodes_m, options_in.threads) {
    if (!free) check_supported(mesh, boundary.constraints);
    motions = MatrixX(boundary.motions);
    for (Index k = 0; k < motions.cols(); ++k) motions.col(k) = system.prescribed_part(motions.col(k));
    node_area_m2 = surface_shares(mesh);
    diameter_m = (mesh.nodes_m.colwise().maxCoeff() - mesh.nodes_m.colwise().minCoeff()).norm();
    if (law.is_linear() && !assembly.is_mixed()) {
      Moduli unit;
      const VectorX rest = VectorX::Zero(3 * assembly.node_count());
      unit.lambda = 1;
      assembly.tangent(law, unit, rest, blocks_lambda);
      unit.lambda = 0;
      unit.mu = 1;
      assembly.tangent(law, unit, rest, blocks_mu);
    }
  }

  // ---- the problem of one set of parameters and coefficients
  struct Problem {
    Moduli m;
    VectorX external;    // F a
    VectorX prescribed;  // P_c M b
  };

  struct State {
    VectorX u, internal;
    double energy = 0;    // strain energy minus work of the dead loads
    double residual = 0;  // relative
    VectorX unbalanced;   // free part of f_int - F a
    int inverted = 0;
  };

  // False where the law does not exist.
  bool evaluate(const Problem& p, State& s) const {
    const double strain_energy = assembly.energy_and_forces(law, p.m, s.u, s.internal, &s.inverted);
    if (!(strain_energy < kInfinity)) return false;
    s.energy = strain_energy - p.external.dot(s.u);
    s.unbalanced = system.free_part(s.internal - p.external);
    const double scale = std::max(p.external.norm(), s.internal.norm());
    s.residual = scale > 0 ? s.unbalanced.norm() / scale : 0;
    return std::isfinite(s.energy) && std::isfinite(s.residual);
  }

  bool factorise_tangent(const Problem& p, const VectorX& u, int& factorisations, bool* shifted = nullptr) {
    assembly.tangent(law, p.m, u, blocks);
    factored_u.resize(0);
    // The exact tangent first; a shifted one only where it is not positive definite (clamping every element would destroy
    // quadratic convergence). Under a limit load the shift keeps descent towards a stable equilibrium.
    for (double shift = 0; shift < 1e3; shift = shift == 0 ? 1e-3 : shift * 4) {
      ++factorisations;
      if (system.factorise(assembly.pattern(), blocks, shift, assembly.expected_negative_pivots())) {
        if (shifted) *shifted = shift > 0;
        if (shift == 0) {
          factored_u = u;
          factored_moduli = p.m;
        }
        return true;
      }
    }
    return false;
  }

  // A step with the last factor instead of the tangent at s (modified Newton). Taken only where it brings the residual down
  // by a good factor: it costs a tenth of a factorisation, and near a known solution it contracts nearly as well.
  bool stale_step(const Problem& p, const VectorX& jump, bool at_target, State& s, State& trial) const {
    const double scale = p.m.young_pa / factored_moduli.young_pa;  // every energy of the table is proportional to E
    VectorX rhs = p.external - s.internal;
    if (!at_target) rhs -= scale * assembly.multiply(blocks, jump);
    trial.u = s.u + system.solve(rhs) / scale;
    if (!at_target) trial.u += jump;
    if (!trial.u.allFinite() || !evaluate(p, trial)) return false;
    if (trial.residual > kStaleContraction * s.residual) return false;
    std::swap(s, trial);
    return true;
  }

  // Newton from s (evaluated) towards p. Returns an empty string when it converged, else the reason.
  // @param near  s is close to a state that the last factor belongs to
  std::string newton(const Problem& p, State& s, Equilibrium& out, int max_steps, bool near) {
    State trial;
    for (double effort = 0;;) {
      const VectorX jump = p.prescribed - system.prescribed_part(s.u);
      const bool at_target = jump.lpNorm<Eigen::Infinity>() <= 1e-14 * diameter_m;
      if (at_target && s.residual <= options.residual_tolerance) return {};
      if (near && factored_u.size() > 0 && factored_moduli.extra == p.m.extra) {
        near = stale_step(p, jump, at_target, s, trial);
        if (near) continue;
      }
      if (effort >= max_steps) return "Newton's method did not converge in " + std::to_string(max_steps) + " steps";
      bool shifted = false;
      const bool factorised = factorise_tangent(p, s.u, out.factorisations, &shifted);
      // Past a point of instability the energy falls slowly towards another state; that is progress all the same.
      effort += shifted ? 0.15 : 1;
      if (!factorised) return "the tangent could not be factorised";
      VectorX rhs = -(s.internal - p.external);
      if (!at_target) rhs -= assembly.multiply(blocks, jump);
      const VectorX d_free = system.solve(rhs);
      if (!d_free.allFinite()) return "the Newton step is not finite";
      ++out.newton_steps;
      const double slope = s.unbalanced.dot(d_free);  // negative for a descent direction
      bool accepted = false;
      for (double alpha = 1; alpha > 1e-6; alpha *= 0.5) {
        trial.u = s.u + alpha * d_free;
        if (!at_target) trial.u += alpha * jump;
        if (!evaluate(p, trial)) continue;
        const bool falls = trial.energy <= s.energy + 1e-4 * alpha * slope;
        const bool smaller = trial.residual <= (1 - 0.1 * alpha) * s.residual && !shifted;
        if (!at_target || falls || smaller) {
          accepted = true;
          near = at_target && !shifted && alpha == 1 && trial.residual < kStaleContraction * s.residual;
          break;
        }
        // Rounding: the energy can no longer tell, and the step is far below any length that matters.
        if (s.residual < 1e-6 && alpha * d_free.lpNorm<Eigen::Infinity>() < 1e-11 * diameter_m) return {};
      }
      if (!accepted) return "the line search found no admissible step";
      std::swap(s, trial);
    }
  }

  // Steps the loads from `from` (an equilibrium at fraction 0) to p, shrinking the step when Newton fails.
  std::string continuation(const Problem& p, State& s, Equilibrium& out) {
    Problem part = p;
    const Problem target = p;
    s.u.setZero(3 * assembly.node_count());
    part.external.setZero();
    part.prescribed.setZero();
    if (!evaluate(part, s)) return "the law does not exist at rest";
    State last = s;
    VectorX before_last = s.u;
    double t = 0, last_t = 0, dt = 0.25;
    std::string reason;
    for (int step = 0; step < options.max_load_steps; ++step) {
      const double next = std::min(1.0, t + dt);
      part.external = next * target.external;
      part.prescribed = next * target.prescribed;
      // Secant predictor, dropped where it leaves the law's domain.
      const double stretch = t > last_t ? (next - t) / (t - last_t) : 0;
      s.u = last.u + stretch * (last.u - before_last);
      bool usable = evaluate(part, s);
      if (!usable) {
        s.u = last.u;
        usable = evaluate(part, s);
      }
      const int before = out.newton_steps;
      reason = usable ? newton(part, s, out, std::min(40, options.max_newton_steps), false)
                      : "the law does not exist at the last state";
      if (reason.empty()) {
        before_last = last.u;
        last_t = t;
        last = s;
        t = next;
        if (t >= 1) return {};
        if (out.newton_steps - before < 8) dt *= 1.7;
      } else {
        dt *= 0.4;
        if (dt < 1e-5) break;
      }
    }
    s = last;
    return "no equilibrium was found beyond " + std::to_string(100 * t) + " % of the load (" + reason + ")";
  }

  // Near nu = 0.5 a large rotation costs hundreds of short steps, since every straight step of a turning element changes its
  // volume. The shape hardly depends on nu, so it is found where volume is cheap, and corrected.
  std::string by_way_of_compressible(const Problem& p, const VectorX* start, State& s, Equilibrium& out) {
    Problem soft = p;
    soft.m = moduli(p.m.young_pa, kCompressible, p.m.extra);
    std::string reason = "no start";
    if (start) {
      s.u = *start;
      if (evaluate(soft, s)) reason = newton(soft, s, out, options.max_newton_steps, true);
    }
    if (!reason.empty()) reason = continuation(soft, s, out);
    // The pressure is that of the bulk modulus: at the same shape it grows as 1 - 2 nu falls, so the last part goes in
    // steps.
    State last = s;
    double gap = 1 - 2 * kCompressible, factor = 4;
    while (reason.empty() && gap > 1 - 2 * p.m.poisson) {
      const double next = std::max(1 - 2 * p.m.poisson, gap / factor);
      soft.m = next > 1 - 2 * p.m.poisson ? moduli(p.m.young_pa, 0.5 * (1 - next), p.m.extra) : p.m;
      std::string failed = evaluate(soft, s) ? newton(soft, s, out, 12, false) : "the law does not exist at the last state";
      if (failed.empty()) {
        last = s;
        gap = next;
        factor = std::min(4.0, factor * factor);
      } else {
        s = last;
        factor = std::sqrt(factor);
        if (factor < 1.05) reason = failed;
      }
    }
    return reason;
  }

  Problem problem(double young, double poisson, const VectorX& a, const VectorX& b, const VectorX& extra) const {
    if (a.size() != boundary.forces.cols())
      throw Error("needs " + std::to_string(boundary.forces.cols()) + " values, has " + std::to_string(a.size()),
                  "force_coefficients");
    if (b.size() != motions.cols())
      throw Error("needs " + std::to_string(motions.cols()) + " values, has " + std::to_string(b.size()),
                  "motion_coefficients");
    if (!a.allFinite() || !b.allFinite()) throw Error("holds NaN or infinity", "coefficients");
    const auto further = law.extra_parameters();
    VectorX values = extra;
    if (values.size() == 0) {
      values.resize(static_cast<Index>(further.size()));
      for (std::size_t i = 0; i < further.size(); ++i) values(static_cast<Index>(i)) = further[i].initial;
    }
    if (values.size() != static_cast<Index>(further.size()))
      throw Error("needs " + std::to_string(further.size()) + " values, has " + std::to_string(values.size()), "extra");
    Problem p;
    p.m = moduli(young, poisson, values);
    p.external = boundary.forces * a;
    p.prescribed = motions * b;
    return p;
  }

  Equilibrium blank(double young, double poisson, const VectorX& a, const VectorX& b, const VectorX& extra) const {
    Equilibrium out;
    out.young_modulus_pa = young;
    out.poisson_ratio = poisson;
    out.force_coefficients = a;
    out.motion_coefficients = b;
    out.extra = extra;
    return out;
  }

  void finish(const Problem& p, State& s, Equilibrium& out) const {
    out.displacement_m = s.u;
    out.residual = s.residual;
    out.inverted_elements = s.inverted;
    out.motion_reaction = motions.transpose() * (s.internal - p.external);
    double forces = 0, squares = 0;
    for (Index i = 0; i < node_area_m2.size(); ++i) {
      const double force = p.external.segment<3>(3 * i).norm();
      if (force == 0 || node_area_m2(i) == 0) continue;
      forces += force;
      squares += force * force / node_area_m2(i);
    }
    out.pressure_over_young = forces > 0 ? squares / (forces * p.m.young_pa) : 0;
  }

  Equilibrium solve_stepwise(double young, double poisson, const VectorX& a, const VectorX& b, const VectorX& extra) {
    const Problem p = problem(young, poisson, a, b, extra);
    Equilibrium out = blank(young, poisson, a, b, p.m.extra);
    State s;
    out.reason = continuation(p, s, out);
    out.converged = out.reason.empty();
    finish(p, s, out);
    return out;
  }

  bool is_stable(const Equilibrium& at) {
    const Problem p =
        problem(at.young_modulus_pa, at.poisson_ratio, at.force_coefficients, at.motion_coefficients, at.extra);
    factored_u.resize(0);
    linear_poisson = std::numeric_limits<double>::quiet_NaN();
    assembly.tangent(law, p.m, at.displacement_m, blocks);
    return system.factorise(assembly.pattern(), blocks, 0, assembly.expected_negative_pivots());
  }

  Equilibrium solve(double young, double poisson, const VectorX& a, const VectorX& b, const VectorX* start,
                    const VectorX& extra) {
    const Problem p = problem(young, poisson, a, b, extra);
    Equilibrium out = blank(young, poisson, a, b, p.m.extra);
    State s;
    s.u = VectorX::Zero(3 * assembly.node_count());
    if (start) {
      if (start->size() != s.u.size()) throw Error("needs " + std::to_string(s.u.size()) + " values", "start");
      s.u = *start;
    }
    bool usable = evaluate(p, s);
    std::string reason =
        usable ? newton(p, s, out, options.max_newton_steps, start != nullptr) : "the start has inverted elements";
    if (!reason.empty() && poisson > kCompressible) reason = by_way_of_compressible(p, start, s, out);
    if (!reason.empty()) reason = continuation(p, s, out);
    out.converged = reason.empty();
    out.reason = reason;
    if (out.converged && s.inverted > 0)
      out.reason =
          std::to_string(s.inverted) + " elements are inside out: the equilibrium of the equations is not one of a body";
    finish(p, s, out);
    return out;
  }

  // ---- linear material: one factor a nu, at E = 1
  void factorise_linear(double poisson, int* factorisations) {
    if (linear_poisson == poisson) return;
    const Moduli unit = moduli(1.0, poisson);
    if (assembly.is_mixed()) {
      assembly.tangent(law, unit, VectorX::Zero(3 * assembly.node_count()), blocks);
    } else {
      blocks.resize(blocks_mu.size());
      for (std::size_t i = 0; i < blocks.size(); ++i) blocks[i] = unit.lambda * blocks_lambda[i] + unit.mu * blocks_mu[i];
    }
    linear_poisson = std::numeric_limits<double>::quiet_NaN();
    if (!system.factorise(assembly.pattern(), blocks, 0, assembly.expected_negative_pivots()))
      throw Error("the stiffness matrix is not positive definite: is the mesh degenerate?", "mesh");
    if (factorisations) ++*factorisations;
    linear_poisson = poisson;
  }

  std::vector<Equilibrium> solve_linear(double young, double poisson, const MatrixX& a, const MatrixX& b) {
    std::vector<Equilibrium> all;
    std::vector<Problem> problems;
    int factorisations = 0;
    for (Index c = 0; c < a.cols(); ++c) {
      problems.push_back(problem(young, poisson, a.col(c), b.col(c), {}));
      all.push_back(blank(young, poisson, a.col(c), b.col(c), {}));
    }
    if (all.empty()) return all;
    factorise_linear(poisson, &factorisations);
    MatrixX rhs(3 * assembly.node_count(), a.cols());
    for (Index c = 0; c < a.cols(); ++c) {
      rhs.col(c) = problems[c].external / young;
      if (motions.cols() > 0) rhs.col(c) -= assembly.multiply(blocks, problems[c].prescribed);
    }
    const MatrixX u = system.solve(rhs);
    for (Index c = 0; c < a.cols(); ++c) {
      State s;
      s.u = u.col(c) + problems[c].prescribed;
      evaluate(problems[c], s);
      all[c].converged = true;
      all[c].newton_steps = 1;
      all[c].factorisations = c == 0 ? factorisations : 0;
      finish(problems[c], s, all[c]);
    }
    return all;
  }

  UnitResponses unit_responses(double poisson, const Eigen::SparseMatrix<double>& watched) {
    const Index n = 3 * assembly.node_count();
    if (watched.cols() != n) throw Error("needs " + std::to_string(n) + " columns", "watched");
    const Index k = static_cast<Index>(boundary.forces.cols()), m = static_cast<Index>(motions.cols());
    const Moduli unit = moduli(1.0, poisson);
    factorise_linear(poisson, nullptr);
    MatrixX values(watched.rows(), k + m), slopes(watched.rows(), k + m), reactions(m, k + m), reaction_slopes(m, k + m);
    VectorX gradients(k + m);
    UnitResponses out;
    out.poisson_ratio = poisson;
    constexpr Index bundle = 32;  // fills the factor's bundles; more would only take memory
    for (Index first = 0; first < k + m; first += bundle) {
      const Index count = std::min(bundle, k + m - first);
      MatrixX rhs(n, count), imposed = MatrixX::Zero(n, count), external = MatrixX::Zero(n, count);
      for (Index c = 0; c < count; ++c) {
        const Index column = first + c;
        if (column < k) {
          external.col(c) = boundary.forces.col(column);
          rhs.col(c) = external.col(c);
        } else {
          imposed.col(c) = motions.col(column - k);
          rhs.col(c) = -assembly.multiply(blocks, imposed.col(c));
        }
      }
      const MatrixX u = system.solve(rhs) + imposed;
      values.middleCols(first, count) = watched * u;
      for (Index c = 0; c < count; ++c) {
        // K' u at E = 1; K u - F a is what supports carry, the rest of it what the solve left over.
        const VectorX internal = assembly.multiply(blocks, u.col(c));
        const VectorX left_over = system.free_part(internal - external.col(c));
        const double scale = std::max(internal.norm(), external.col(c).norm());
        if (scale > 0) out.residual = std::max(out.residual, left_over.norm() / scale);
        gradients(first + c) = assembly.largest_gradient(u.col(c));
        rhs.col(c) = -assembly.forces_d_poisson(law, unit, u.col(c));
        reactions.col(first + c) = motions.transpose() * (internal - external.col(c));
      }
      const MatrixX du = system.solve(rhs);
      slopes.middleCols(first, count) = watched * du;
      for (Index c = 0; m > 0 && c < count; ++c)
        reaction_slopes.col(first + c) = motions.transpose() * (assembly.multiply(blocks, du.col(c)) - rhs.col(c));
    }
    out.force = values.leftCols(k);
    out.motion = values.rightCols(m);
    out.force_d_poisson = slopes.leftCols(k);
    out.motion_d_poisson = slopes.rightCols(m);
    out.reaction_force = reactions.leftCols(k);
    out.reaction_motion = reactions.rightCols(m);
    out.reaction_force_d_poisson = reaction_slopes.leftCols(k);
    out.reaction_motion_d_poisson = reaction_slopes.rightCols(m);
    out.largest_gradient_force = gradients.head(k);
    out.largest_gradient_motion = gradients.tail(m);
    return out;
  }

  SensitivityAlong sensitivity(const Equilibrium& at, const MatrixX& along_force, const MatrixX& along_motion) {
    const Problem p =
        problem(at.young_modulus_pa, at.poisson_ratio, at.force_coefficients, at.motion_coefficients, at.extra);
    const VectorX& u = at.displacement_m;
    if (u.size() != 3 * assembly.node_count()) throw Error("is not a state of this mesh", "sensitivity.at");
    double scale = 1;
    if (law.is_linear()) {
      factorise_linear(at.poisson_ratio, nullptr);
      scale = at.young_modulus_pa;
    } else {
      const bool same = factored_u.size() == u.size() && factored_u == u && factored_moduli.young_pa == p.m.young_pa &&
                        factored_moduli.poisson == p.m.poisson && factored_moduli.extra == p.m.extra;
      if (!same) {
        factored_u.resize(0);
        assembly.tangent(law, p.m, u, blocks);
        if (system.factorise(assembly.pattern(), blocks, 0, assembly.expected_negative_pivots())) {
          factored_u = u;
          factored_moduli = p.m;
        } else if (!system.factorise_indefinite(assembly.pattern(), blocks)) {
          throw Error("the tangent is singular at this state: it has no derivatives", "sensitivity.at");
        }
      }
    }
    const Index m = static_cast<Index>(motions.cols()), x = static_cast<Index>(p.m.extra.size());
    const Index along = static_cast<Index>(along_force.cols());
    if (along_force.rows() != boundary.forces.cols() || along_motion.rows() != m || along_motion.cols() != along)
      throw Error("needs one row a coefficient, and as many columns for forces as for motions", "sensitivity_along");
    // K du = -df/dtheta (material), F a' - K M b' (a direction a', b')
    MatrixX rhs(3 * assembly.node_count(), 2 + x + along);
    VectorX internal;
    assembly.energy_and_forces(law, p.m, u, internal);
    rhs.col(0) = -internal;
    rhs.col(1) = -assembly.forces_d_poisson(law, p.m, u);
    for (Index i = 0; i < x; ++i) rhs.col(2 + i) = -assembly.forces_d_extra(law, p.m, u, static_cast<int>(i));
    rhs.rightCols(along) = boundary.forces * along_force;
    const MatrixX imposed = motions * along_motion;
    for (Index j = 0; j < along; ++j)
      if (!imposed.col(j).isZero(0)) rhs.col(2 + x + j) -= scale * assembly.multiply(blocks, imposed.col(j));
    MatrixX du = system.solve(rhs) / scale;
    // Reactions: M' (K du - rhs), with K du of the whole displacement.
    MatrixX reaction(m, du.cols());
    for (Index j = 0; m > 0 && j < du.cols(); ++j)
      reaction.col(j) = motions.transpose() * (scale * assembly.multiply(blocks, du.col(j)) - rhs.col(j));
    du.rightCols(along) += imposed;
    SensitivityAlong out;
    out.d_log_young = du.col(0);
    out.d_poisson = du.col(1);
    out.d_extra = du.middleCols(2, x);
    out.d_along = du.rightCols(along);
    out.reaction_d_log_young = reaction.col(0);
    out.reaction_d_poisson = reaction.col(1);
    out.reaction_d_extra = reaction.middleCols(2, x);
    out.reaction_d_along = reaction.rightCols(along);
    return out;
  }

  TetMesh mesh;
  const MaterialLaw& law;
  StaticsOptions options;
  Assembly assembly;
  Boundary boundary;
  bool free;
  ReducedSystem system;
  MatrixX motions;  // along prescribed directions only
  double diameter_m = 0;
  VectorX node_area_m2;  // of the boundary, 0 inside
  // Scratch that const calls share (a Statics is not thread-safe).
  BlockValues blocks, blocks_lambda, blocks_mu;
  VectorX factored_u;  // where the factor is the exact tangent; empty: nowhere
  Moduli factored_moduli;
  double linear_poisson = std::numeric_limits<double>::quiet_NaN();
};

Statics::Statics(const TetMesh& mesh, const std::string& material, Boundary boundary, StaticsOptions options)
    : impl_(std::make_unique<Impl>(mesh, material, std::move(boundary), options)) {}
Statics::~Statics() = default;
Statics::Statics(Statics&&) noexcept = default;
Statics& Statics::operator=(Statics&&) noexcept = default;

Equilibrium Statics::solve(double young_modulus_pa, double poisson_ratio, const VectorX& force_coefficients,
                           const VectorX& motion_coefficients, const VectorX* start, const VectorX& extra) const {
  if (is_linear())
    return impl_->solve_linear(young_modulus_pa, poisson_ratio, force_coefficients, motion_coefficients).front();
  return impl_->solve(young_modulus_pa, poisson_ratio, force_coefficients, motion_coefficients, start, extra);
}

std::vector<Equilibrium> Statics::solve_many(double young_modulus_pa, double poisson_ratio,
                                             const MatrixX& force_coefficients, const MatrixX& motion_coefficients) const {
  if (!is_linear()) throw Error("solves many cases with one factor only for a linear material", "Statics::solve_many");
  if (force_coefficients.cols() != motion_coefficients.cols())
    throw Error("force and motion coefficients need the same number of columns (cases)", "Statics::solve_many");
  return impl_->solve_linear(young_modulus_pa, poisson_ratio, force_coefficients, motion_coefficients);
}

Equilibrium Statics::solve_stepwise(double young_modulus_pa, double poisson_ratio, const VectorX& force_coefficients,
                                    const VectorX& motion_coefficients, const VectorX& extra) const {
  return impl_->solve_stepwise(young_modulus_pa, poisson_ratio, force_coefficients, motion_coefficients, extra);
}

bool Statics::is_stable(const Equilibrium& at) const { return impl_->is_stable(at); }

SensitivityAlong Statics::sensitivity_along(const Equilibrium& at, const MatrixX& force_directions,
                                            const MatrixX& motion_directions) const {
  return impl_->sensitivity(at, force_directions, motion_directions);
}

Sensitivity Statics::sensitivity(const Equilibrium& at) const {
  const Index k = static_cast<Index>(impl_->boundary.forces.cols()), m = static_cast<Index>(impl_->motions.cols());
  const MatrixX identity = MatrixX::Identity(k + m, k + m);
  SensitivityAlong along = impl_->sensitivity(at, identity.topRows(k), identity.bottomRows(m));
  Sensitivity out;
  out.d_log_young = std::move(along.d_log_young);
  out.d_poisson = std::move(along.d_poisson);
  out.d_extra = std::move(along.d_extra);
  out.d_force = along.d_along.leftCols(k);
  out.d_motion = along.d_along.rightCols(m);
  out.reaction_d_log_young = std::move(along.reaction_d_log_young);
  out.reaction_d_poisson = std::move(along.reaction_d_poisson);
  out.reaction_d_extra = std::move(along.reaction_d_extra);
  out.reaction_d_force = along.reaction_d_along.leftCols(k);
  out.reaction_d_motion = along.reaction_d_along.rightCols(m);
  return out;
}
UnitResponses Statics::unit_responses(double poisson_ratio, const Eigen::SparseMatrix<double>& watched) const {
  if (!is_linear()) throw Error("superposes loads only for a linear material", "Statics::unit_responses");
  return impl_->unit_responses(poisson_ratio, watched);
}

bool Statics::is_linear() const { return impl_->law.is_linear(); }
const TetMesh& Statics::mesh() const { return impl_->mesh; }
const Boundary& Statics::boundary() const { return impl_->boundary; }

}  // namespace palpate::fem
