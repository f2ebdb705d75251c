// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/contact/contact_path.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/core/cross_matrix.hpp"
#include "palpate/core/error.hpp"

namespace palpate::fem {
namespace {

/// d exp(w) = [J dw]x exp(w).
Mat3 rotation_slope(const Vec3& w) {
  const double angle = w.norm();
  const Mat3 cross = cross_matrix(w);
  if (angle < 1e-6) return Mat3::Identity() + 0.5 * cross;
  return Mat3::Identity() + (1 - std::cos(angle)) / (angle * angle) * cross +
         (angle - std::sin(angle)) / (angle * angle * angle) * cross * cross;
}

MatrixX at_point(const SurfacePoints& points, Index face, int point, const MatrixX& field) {
  MatrixX x = MatrixX::Zero(3, field.cols());
  for (int a = 0; a < points.nodes_per_face(); ++a)
    x += points.shape(point)(a) * field.middleRows<3>(3 * points.node(face, a));
  return x;
}

void add_at_point(const SurfacePoints& points, Index face, int point, const MatrixX& force, MatrixX& forces) {
  for (int a = 0; a < points.nodes_per_face(); ++a)
    forces.middleRows<3>(3 * points.node(face, a)) += points.shape(point)(a) * force;
}

/// How a point of the body moves as seen by a tool that moves by `twist`, base axes.
MatrixX seen_by_tool(const MatrixX& dx, const MatrixX& twist, const Vec3& arm) {
  return dx - twist.topRows<3>() + cross_matrix(arm) * twist.bottomRows<3>();
}

/// d of the tangential offset at fixed y as its anchor and the normal there move.
MatrixX offset_change(const ContactTerms::Held& h, const MatrixX& anchor, const MatrixX& normal) {
  const Vec3 d = h.y_m - h.anchor_m;
  return -(anchor - h.normal * (h.normal.transpose() * anchor)) - h.normal * (d.transpose() * normal) -
         h.normal.dot(d) * normal;
}

}  // namespace

SlidingLimits::SlidingLimits(const ContactSystem& system, const ContactProblem& p, const std::vector<TouchMemory>& memory,
                             const ContactState& s)
    : system_(system) {
  for (std::size_t c = 0; c < system.contacts.size(); ++c) {
    const RigidContact& contact = system.contacts[c];
    if (contact.law != Touch::friction) continue;
    const Mat3& r = s.poses[c].linear();
    for (const auto& h : system.terms.held(system.body(c, p.m, s.poses[c], memory), s.u)) {
      if (!h.slips) continue;
      points_.push_back(
          {c, h.face, h.point, h.arm_m, h.weight_m2 * contact.friction_coefficient * (r * h.across), r * h.pressure_slope});
    }
  }
}

void SlidingLimits::add(const MatrixX& du, const std::vector<MatrixX>& twist, MatrixX& forces,
                        std::vector<MatrixX>& gradients) const {
  const SurfacePoints& points = system_.terms.points();
  for (const Point& each : points_) {
    const MatrixX dx = at_point(points, each.face, each.point, du);
    const MatrixX force = each.along * (each.slope.transpose() * seen_by_tool(dx, twist[each.contact], each.arm));
    add_at_point(points, each.face, each.point, force, forces);
    gradients[each.contact].topRows<3>() -= force;
    gradients[each.contact].bottomRows<3>() -= cross_matrix(each.arm) * force;
  }
}

bool SlidingLimits::solve(ContactSystem& system, const ContactTangent& t, const MatrixX& ru, const MatrixX& rz, MatrixX& du,
                          MatrixX& dz, double tolerance, int* factorisations) const {
  // A factorisation costs as much as some tens of back-substitutions and products.
  const int few = static_cast<int>(std::min<Eigen::Index>(14, 40 / std::max<Eigen::Index>(1, ru.cols())));
  if (system.has_factor() && few > 4 && solve_by_krylov(system, t, ru, rz, du, dz, tolerance, false, few)) return true;
  if (factorisations != nullptr) ++*factorisations;
  if (!system.factorise(t, 0, 1e-9)) return false;
  solve_by_krylov(system, t, ru, rz, du, dz, tolerance, true, 80);
  return true;
}

// @param fresh  the factor is that of S itself; else it is of a state nearby, and products with S are needed
bool SlidingLimits::solve_by_krylov(ContactSystem& system, const ContactTangent& t, const MatrixX& ru, const MatrixX& rz,
                                    MatrixX& du, MatrixX& dz, double tolerance, bool fresh, int most) const {
  system.solve(t, ru, rz, !fresh, du, dz);
  if (fresh && empty()) return true;
  const Index n = static_cast<Index>(du.rows()), z = static_cast<Index>(dz.rows()), q = static_cast<Index>(du.cols());
  const auto count = system.contacts.size();
  const auto stacked = [&](const MatrixX& u, const MatrixX& tools) {
    MatrixX all(n + z, q);
    all << u, tools;
    return all;
  };
  const auto apply = [&](const MatrixX& v) {  // P^-1 (S + B) v, with P the factor's matrix
    MatrixX forces = MatrixX::Zero(n, q), tool_forces = MatrixX::Zero(z, q), u, tools;
    std::vector<MatrixX> twist, gradients(count, MatrixX::Zero(6, q));
    for (std::size_t c = 0; c < count; ++c) {
      const MatrixX& axes = system.contacts[c].free_axes;
      twist.push_back(axes * v.middleRows(n + system.first_axis[c], axes.cols()));
    }
    add(v.topRows(n), twist, forces, gradients);
    for (std::size_t c = 0; c < count; ++c) {
      const MatrixX& axes = system.contacts[c].free_axes;
      tool_forces.middleRows(system.first_axis[c], axes.cols()) = axes.transpose() * gradients[c];
    }
    if (!fresh) {
      for (Index k = 0; k < q; ++k) forces.col(k) += system.assembly.multiply(t.blocks, v.col(k).head(n));
      if (z > 0) {
        forces += t.coupling * v.bottomRows(z);
        tool_forces += t.coupling.transpose() * v.topRows(n) + t.tool * v.bottomRows(z);
      }
    }
    system.solve(t, forces, tool_forces, !fresh, u, tools);
    return fresh ? MatrixX(v + stacked(u, tools)) : stacked(u, tools);
  };
  // One Krylov space a column; products of all columns share the back-substitutions.
  const MatrixX right = stacked(du, dz);
  const VectorX size = right.colwise().norm();
  std::vector<MatrixX> basis{right * size.unaryExpr([](double s) { return s > 0 ? 1 / s : 0.0; }).asDiagonal()};
  std::vector<MatrixX> hessenberg(static_cast<std::size_t>(q), MatrixX::Zero(most + 1, most));
  std::vector<VectorX> weights(static_cast<std::size_t>(q));
  double first_left = 1;
  for (int k = 0; k < most; ++k) {
    MatrixX next = apply(basis.back());
    if (!next.allFinite()) return false;
    VectorX length(q);
    for (Index c = 0; c < q; ++c) {
      MatrixX& h = hessenberg[static_cast<std::size_t>(c)];
      for (int pass = 0; pass < 2; ++pass) {
        for (int j = 0; j <= k; ++j) {
          const double part = basis[static_cast<std::size_t>(j)].col(c).dot(next.col(c));
          h(j, k) += part;
          next.col(c) -= part * basis[static_cast<std::size_t>(j)].col(c);
        }
      }
      length(c) = next.col(c).norm();
      h(k + 1, k) = length(c);
      if (length(c) > 0) next.col(c) /= length(c);
    }
    double left = 0;
    for (Index c = 0; c < q; ++c) {
      if (!(size(c) > 0)) continue;
      const MatrixX h = hessenberg[static_cast<std::size_t>(c)].topLeftCorner(k + 2, k + 1);
      VectorX first = VectorX::Zero(k + 2);
      first(0) = size(c);
      weights[static_cast<std::size_t>(c)] = h.colPivHouseholderQr().solve(first);
      left = std::max(left, (h * weights[static_cast<std::size_t>(c)] - first).norm() / size(c));
    }
    if (k == 2) first_left = left;
    // Too slow to get there in time: a new factor is cheaper.
    const bool hopeless = !fresh && k >= 4 && left > tolerance &&
                          std::log(left / tolerance) > (most - k - 1) * std::log(std::max(first_left / left, 1.0)) / (k - 2);
    if (hopeless) return false;
    if (left < tolerance || (k + 1 == most && fresh)) {
      MatrixX x = MatrixX::Zero(n + z, q);
      for (Index c = 0; c < q; ++c) {
        if (!(size(c) > 0)) continue;
        for (int j = 0; j <= k; ++j)
          x.col(c) += weights[static_cast<std::size_t>(c)](j) * basis[static_cast<std::size_t>(j)].col(c);
      }
      du = x.topRows(n);
      dz = x.bottomRows(z);
      return true;
    }
    basis.push_back(std::move(next));
  }
  return false;
}

void advance(ContactSystem& system, const ContactEquilibrium& at, const ContactIncrement& before,
             const ContactIncrement& after, const ContactLoadsAlong& from, const ContactLoadsAlong& to,
             ContactPathSensitivity& d) {
  const auto count = system.contacts.size();
  const Index q = static_cast<Index>(to.log_young.size());
  const ContactProblem p = system.problem(at.young_modulus_pa, at.poisson_ratio, after.loads, at.extra);
  ContactState s;
  s.u = after.displacement_m;
  s.poses = after.poses;
  s.travelled = VectorX::Zero(system.first_axis.back());
  if (!system.evaluate(p, after.memory, s)) throw Error("holds inverted elements", "sensitivity.at");
  ContactTangent t;
  system.tangent(p, after.memory, s, false, t);
  const SlidingLimits limits(system, p, after.memory, s);
  const SurfacePoints& points = system.terms.points();

  // Change of every force at fixed u and z: on nodes, and on the tools along all axes.
  const MatrixX imposed = system.motions * to.motion_coefficients;
  MatrixX change = (s.internal + s.touching) * to.log_young.transpose();  // all of it is proportional to E
  change += s.touching * to.log_layer.transpose();  // and this to the layers' stiffness, friction limits included
  change += system.assembly.forces_d_poisson(system.law, p.m, s.u) * to.poisson.transpose();
  change -= system.boundary.forces * to.force_coefficients;
  if (system.motions.cols() > 0)
    for (Index k = 0; k < q; ++k)
      if (imposed.col(k).cwiseAbs().maxCoeff() > 0) change.col(k) += system.assembly.multiply(t.blocks, imposed.col(k));
  const Index regions = static_cast<Index>(to.log_stiffness.rows());
  const bool by_region = regions > 0 && !to.log_stiffness.isZero(0);
  if (by_region)
    for (Index k = 0; k < regions; ++k)
      change += system.assembly.forces_d_log_stiffness(system.law, p.m, s.u, static_cast<int>(k)) * to.log_stiffness.row(k);
  for (Index k = 0; k < to.region_poisson.rows(); ++k)
    if (!to.region_poisson.row(k).isZero(0))
      change += system.assembly.forces_d_region_poisson(system.law, p.m, s.u, static_cast<int>(k)) * to.region_poisson.row(k);
  std::vector<MatrixX> gradient, twist;
  std::vector<std::vector<ContactTerms::Held>> held;
  std::vector<AnchorSensitivity> anchors(count);
  for (std::size_t c = 0; c < count; ++c) {
    const TouchingBody body = system.body(c, p.m, s.poses[c], after.memory);
    const Mat3& r = s.poses[c].linear();
    // The tool is taken along by its prescribed motion.
    const Mat3 turn = moved(Pose::Identity(), after.loads.motion[c]).linear() *
                      moved(Pose::Identity(), before.loads.motion[c]).linear().transpose();
    MatrixX carried(6, q);
    carried.topRows<3>() = d.motion[c].topRows<3>() + to.motion[c].topRows<3>() - from.motion[c].topRows<3>();
    carried.bottomRows<3>() = turn * d.motion[c].bottomRows<3>() +
                              rotation_slope(after.loads.motion[c].tail<3>()) * to.motion[c].bottomRows<3>() -
                              turn * rotation_slope(before.loads.motion[c].tail<3>()) * from.motion[c].bottomRows<3>();
    gradient.push_back(s.gradients[c] * (to.log_young + to.log_layer).transpose() +
                       t.tools[c].coupling.transpose() * imposed + t.tools[c].hessian * carried);
    change += t.tools[c].coupling * carried;
    if (by_region) {
      MatrixX touching = MatrixX::Zero(s.u.size(), regions), on_tool = MatrixX::Zero(6, regions);
      system.terms.forces_by_region(body, s.u, touching, on_tool);
      change += touching * to.log_stiffness;
      gradient[c] += on_tool * to.log_stiffness;
    }
    if (to.radius[c].cwiseAbs().maxCoeff() > 0 && system.contacts[c].shape->has_radius()) {
      VectorX by_radius = VectorX::Zero(s.u.size());
      Vec6 gradient_by_radius = Vec6::Zero();
      system.terms.d_radius(body, s.u, by_radius, gradient_by_radius);
      change += by_radius * to.radius[c].transpose();
      gradient[c] += gradient_by_radius * to.radius[c].transpose();
    }
    twist.push_back(carried);

    held.push_back(system.terms.held(body, s.u));
    AnchorSensitivity& now = anchors[c];
    now.anchor.resize(3 * static_cast<Index>(held[c].size()), q);
    now.normal.resize(now.anchor.rows(), q);
    for (std::size_t i = 0; i < held[c].size(); ++i) {
      const ContactTerms::Held& h = held[c][i];
      now.row_of.emplace(h.index, 3 * static_cast<Index>(i));
      auto anchor = now.anchor.middleRows<3>(3 * static_cast<Index>(i));
      auto normal = now.normal.middleRows<3>(3 * static_cast<Index>(i));
      const auto known = d.anchors[c].row_of.find(h.index);
      if (after.memory[c].touching[h.index] != 0 && known != d.anchors[c].row_of.end()) {
        anchor = d.anchors[c].anchor.middleRows<3>(known->second);
        normal = d.anchors[c].normal.middleRows<3>(known->second);
      } else {  // it sticks where it was when the increment began
        const Pose& pose = before.poses[c];
        const Vec3 arm = system.terms.position(before.displacement_m, h.face, h.point) - pose.translation();
        anchor =
            pose.linear().transpose() * seen_by_tool(at_point(points, h.face, h.point, d.displacement), d.motion[c], arm);
        normal = system.terms.normal_slope(body, h.face, h.anchor_m) * anchor +
                 system.terms.normal_d_radius(body, h.face, h.anchor_m) * to.radius[c].transpose();
      }
      MatrixX traction;  // d(tangential traction) at fixed y, tool frame
      if (body.law == Touch::bonded) {
        traction = -h.stiffness_pa_m * anchor;
      } else if (!h.slips) {
        traction = h.stiffness_pa_m * offset_change(h, anchor, normal);
      } else {
        const MatrixX offset = offset_change(h, anchor, normal);
        traction = h.limit_pa / h.length_m * (offset - h.across * (h.across.transpose() * offset));
        if (body.law == Touch::friction)
          traction += h.across * (system.contacts[c].friction_coefficient * h.pressure_d_radius * to.radius[c].transpose());
      }
      const MatrixX force = h.weight_m2 * (r * traction);
      add_at_point(points, h.face, h.point, force, change);
      gradient[c].topRows<3>() -= force;
      gradient[c].bottomRows<3>() -= cross_matrix(h.arm_m) * force;
    }
  }
  limits.add(imposed, twist, change, gradient);

  MatrixX tool_rhs(system.first_axis.back(), q), du, dz;
  for (std::size_t c = 0; c < count; ++c) {
    const MatrixX& axes = system.contacts[c].free_axes;
    tool_rhs.middleRows(system.first_axis[c], axes.cols()) = axes.transpose() * (to.wrench[c] - gradient[c]);
  }
  if (!limits.solve(system, t, -change, tool_rhs, du, dz, 1e-11))
    throw Error("the equilibrium is not stable: it has no derivative", "sensitivity.at");
  if (!du.allFinite() || !dz.allFinite()) throw Error("a tool touches nothing: it has no derivative", "sensitivity.at");

  std::vector<MatrixX> moves;
  for (std::size_t c = 0; c < count; ++c) {
    const MatrixX& axes = system.contacts[c].free_axes;
    moves.push_back(axes * dz.middleRows(system.first_axis[c], axes.cols()));
    gradient[c] += t.tools[c].coupling.transpose() * du + t.tools[c].hessian * moves[c];
    twist[c] += moves[c];
  }
  if (system.motions.cols() > 0) {
    MatrixX force = change;
    std::vector<MatrixX> unused = gradient;
    for (Index k = 0; k < q; ++k) force.col(k) += system.assembly.multiply(t.blocks, du.col(k));
    if (dz.rows() > 0) force += t.coupling * dz;
    limits.add(du, moves, force, unused);
    d.motion_reaction = system.motions.transpose() * force;
  }
  limits.add(du, moves, change, gradient);

  d.displacement = du + imposed;
  d.motion = twist;
  d.wrench = gradient;
  for (std::size_t c = 0; c < count; ++c) {
    if (system.contacts[c].law == Touch::friction) {
      const TouchingBody body = system.body(c, p.m, s.poses[c], after.memory);
      const Mat3& r = s.poses[c].linear();
      for (std::size_t i = 0; i < held[c].size(); ++i) {  // the anchor follows what has slipped
        const ContactTerms::Held& h = held[c][i];
        if (!h.slips) continue;
        auto anchor = anchors[c].anchor.middleRows<3>(3 * static_cast<Index>(i));
        auto normal = anchors[c].normal.middleRows<3>(3 * static_cast<Index>(i));
        const MatrixX dy =
            r.transpose() * seen_by_tool(at_point(points, h.face, h.point, d.displacement), twist[c], h.arm_m);
        const MatrixX offset = offset_change(h, anchor, normal) + dy - h.normal * (h.normal.transpose() * dy);
        const Eigen::RowVectorXd limit =
            system.contacts[c].friction_coefficient *
            (h.pressure_slope.transpose() * dy + h.pressure_d_radius * to.radius[c].transpose());
        anchor = dy - (h.across * limit + h.limit_pa / h.length_m * (offset - h.across * (h.across.transpose() * offset))) /
                          h.stiffness_pa_m;
        normal = system.terms.normal_slope(body, h.face, h.y_m) * dy +
                 system.terms.normal_d_radius(body, h.face, h.y_m) * to.radius[c].transpose();
      }
    }
    d.anchors[c] = std::move(anchors[c]);
  }
}

}  // namespace palpate::fem
