// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/contact_statics.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/core/error.hpp"
#include "palpate/fem/contact/contact_path.hpp"

namespace palpate::fem {
namespace {

ContactLoads between(const ContactLoads& a, const ContactLoads& b, double t) {
  ContactLoads out = b;
  out.force_coefficients = (1 - t) * a.force_coefficients + t * b.force_coefficients;
  out.motion_coefficients = (1 - t) * a.motion_coefficients + t * b.motion_coefficients;
  for (std::size_t c = 0; c < b.motion.size(); ++c) {
    out.motion[c] = (1 - t) * a.motion[c] + t * b.motion[c];
    out.wrench[c] = (1 - t) * a.wrench[c] + t * b.wrench[c];
  }
  return out;
}

// Takes a tool's pose along from one prescribed motion to the next; what it has moved along its free axes stays.
Pose carried(const Pose& pose, const Vec6& from, const Vec6& to) {
  const Pose last = moved(Pose::Identity(), from), next = moved(Pose::Identity(), to);
  Pose out = pose;
  out.translation() += next.translation() - last.translation();
  out.linear() = next.linear() * last.linear().transpose() * pose.linear();
  return out;
}

}  // namespace

MatrixX along(const Vec3& direction) {
  MatrixX axis = MatrixX::Zero(6, 1);
  axis.col(0).head<3>() = direction.normalized();
  return axis;
}

MatrixX any_translation() { return MatrixX::Identity(6, 3); }

struct ContactStatics::Impl {
  ContactSystem system;

  double update_limits(const ContactProblem& p, std::vector<TouchMemory>& memory, const ContactState& s) const {
    double change = 0;
    for (std::size_t c = 0; c < system.contacts.size(); ++c)
      change += system.terms.update_limits(system.body(c, p.m, s.poses[c], memory), s.u,
                                           system.contacts[c].friction_coefficient, memory[c]);
    return change;
  }

  // Newton's method with friction limits that follow the pressures at once. There is no energy to watch, so it must win
  // fast, or it is left (false, nothing changed) to the fixed point.
  bool settle(const ContactProblem& p, std::vector<TouchMemory>& memory, ContactState& s, ContactEquilibrium& out) {
    // From sticking all over, what slides grows step by step before the residual falls.
    constexpr int most = 30, most_worse = 10;
    constexpr double krylov_tolerance = 1e-3;
    ContactState now = s;
    std::vector<TouchMemory> now_memory = memory;
    ContactTangent t;
    double best = std::numeric_limits<double>::infinity(), first = 0;
    for (int step = 0, worse = 0; step < most; ++step) {
      update_limits(p, now_memory, now);
      if (!system.evaluate(p, now_memory, now)) return false;
      if (is_settled(now, system.options.statics.residual_tolerance)) {
        s = std::move(now);
        memory = std::move(now_memory);
        return true;
      }
      if (step == 0) first = now.residual;
      if (now.residual > 3 * first || (now.residual > 0.5 * best && ++worse > most_worse)) return false;
      best = std::min(best, now.residual);
      system.tangent(p, now_memory, now, false, t);
      MatrixX du, dz;
      if (!SlidingLimits(system, p, now_memory, now)
               .solve(system, t, -now.unbalanced, -now.unbalanced_tool, du, dz, krylov_tolerance, &out.factorisations))
        return false;
      if (!du.allFinite() || !dz.allFinite()) return false;
      ++out.newton_steps;
      now.u += du.col(0);
      if (dz.size() > 0) system.move(now, dz.col(0));
    }
    return false;
  }

  // One increment from an equilibrium; `s` and `memory` are changed only when it converges.
  // @param guess  of its end; nullptr: none
  std::string increment(const ContactProblem& p, const ContactLoads& from, const ContactLoads& to, ContactState& s,
                        std::vector<TouchMemory>& memory, ContactEquilibrium& out, std::vector<ContactIncrement>& path,
                        const ContactIncrement* guess) {
    const auto count = system.contacts.size();
    ContactState next = s;
    std::vector<TouchMemory> next_memory = memory;
    bool remembers = false, rubs = false;
    for (std::size_t c = 0; c < count; ++c) {
      rubs = rubs || (system.contacts[c].law == Touch::friction && system.contacts[c].friction_coefficient > 0);
      remembers = remembers || system.contacts[c].law == Touch::friction || system.contacts[c].law == Touch::sticking;
      system.terms.begin_increment(system.body(c, p.m, s.poses[c], memory), s.u, next_memory[c]);
      next.poses[c] = carried(s.poses[c], from.motion[c], to.motion[c]);
    }
    std::string reason;
    constexpr double rough_tolerance = 1e-3;
    bool remembers_open = remembers, found = false, balanced = false;
    if (guess != nullptr && remembers) {
      ContactState near = next;
      near.u = guess->displacement_m + p.prescribed - system.system.prescribed_part(guess->displacement_m);
      for (std::size_t c = 0; c < count; ++c)
        if (system.contacts[c].free_axes.cols() > 0 && guess->loads.motion[c] == to.motion[c])
          near.poses[c] = guess->poses[c];
      std::vector<TouchMemory> near_memory = next_memory;
      if (settle(p, near_memory, near, out)) {
        next = std::move(near);
        next_memory = std::move(near_memory);
        remembers_open = false;
        found = true;
      }
    }
    if (!found) {
      if (!system.approach(p, next_memory, next)) return "a tool never meets the object along its wrench";
      if (!system.evaluate(p, next_memory, next)) return "the law does not exist at the start of the increment";
      // The pressures are not known yet, and with the last ones (or none) a body on a table may slide away: what touches
      // sticks at first.
      for (std::size_t c = 0; c < count; ++c)
        if (system.contacts[c].law == Touch::friction && system.contacts[c].friction_coefficient > 0)
          std::fill(next_memory[c].limit_pa.begin(), next_memory[c].limit_pa.end(), std::numeric_limits<double>::infinity());
      if (remembers && !system.evaluate(p, next_memory, next)) return "the law does not exist at the start of the increment";
      system.soften_start(p, next_memory, next, out);
      // Under friction this is a start. It may come to a halt: a point that comes to touch away from where it would stick
      // makes the energy jump.
      reason = system.newton(p, next_memory, next, out, rubs ? rough_tolerance : 0);
      balanced = !rubs;
      if (rubs) reason.clear();
      if (reason.empty() && remembers && settle(p, next_memory, next, out)) remembers_open = false;
    }
    // Friction limits follow the pressures: a fixed point around problems that each have an energy, solved roughly as long as
    // both together may still be found from where it leads.
    constexpr int rough_rounds = 4;
    for (int round = 0; reason.empty() && remembers_open; ++round) {
      const double change = update_limits(p, next_memory, next);
      double force = 0;
      for (const Vec6& wrench : next.gradients) force = std::max(force, wrench.head<3>().norm());
      // A sum over points against a norm over them.
      const double rounding_n = std::sqrt(static_cast<double>(system.terms.points().point_count())) * next.rounding_n;
      const double tolerance = std::max(system.options.friction_tolerance * force, rounding_n);
      if (change <= tolerance && balanced) break;
      if (round == system.options.max_friction_rounds) {
        reason = "pressures and friction did not settle in " + std::to_string(round) + " rounds";
        break;
      }
      if (!system.evaluate(p, next_memory, next)) return "the law does not exist at the start of a friction round";
      balanced = round >= rough_rounds || !rubs;
      if (!balanced) {
        system.newton(p, next_memory, next, out, rough_tolerance);
        if (settle(p, next_memory, next, out)) break;
      } else {
        reason = system.newton(p, next_memory, next, out);
      }
    }
    if (!reason.empty()) return reason;
    if (!remembers && path.size() > 1) path.pop_back();  // only the last one matters
    path.push_back({0, to, next.u, next.poses, next_memory});
    for (std::size_t c = 0; c < count; ++c)
      system.terms.end_increment(system.body(c, p.m, next.poses[c], next_memory), next.u, next_memory[c]);
    s = std::move(next);
    memory = std::move(next_memory);
    return {};
  }
};

ContactStatics::ContactStatics(const TetMesh& mesh, const std::string& material, Boundary boundary,
                               std::vector<RigidContact> contacts, ContactOptions options)
    : impl_(new Impl{ContactSystem(mesh, material, std::move(boundary), std::move(contacts), options)}) {}
ContactStatics::~ContactStatics() = default;
ContactStatics::ContactStatics(ContactStatics&&) noexcept = default;
ContactStatics& ContactStatics::operator=(ContactStatics&&) noexcept = default;

const std::vector<RigidContact>& ContactStatics::contacts() const { return impl_->system.contacts; }
const TetMesh& ContactStatics::mesh() const { return impl_->system.mesh; }
void ContactStatics::set_region_stiffness(const VectorX& stiffness) { impl_->system.set_region_stiffness(stiffness); }
void ContactStatics::set_region_poisson(const VectorX& poisson) { impl_->system.set_region_poisson(poisson); }

ContactLoads ContactStatics::no_loads() const {
  ContactLoads loads;
  loads.force_coefficients = VectorX::Zero(impl_->system.boundary.forces.cols());
  loads.motion_coefficients = VectorX::Zero(impl_->system.motions.cols());
  loads.motion.assign(impl_->system.contacts.size(), Vec6::Zero());
  loads.wrench = loads.motion;
  return loads;
}

ContactEquilibrium ContactStatics::solve(double young_modulus_pa, double poisson_ratio, const ContactLoads& loads,
                                         const ContactEquilibrium* from, const VectorX& extra,
                                         const ContactEquilibrium* guess) const {
  ContactSystem& system = impl_->system;
  const ContactProblem target = system.problem(young_modulus_pa, poisson_ratio, loads, extra);
  ContactEquilibrium out;
  out.young_modulus_pa = young_modulus_pa;
  out.poisson_ratio = poisson_ratio;
  out.extra = target.m.extra;
  out.loads = loads;

  const auto count = system.contacts.size();
  ContactState s;
  std::vector<TouchMemory> memory(count);
  const ContactLoads start = from ? from->loads : no_loads();
  s.travelled = VectorX::Zero(system.first_axis.back());
  if (from) {
    if (from->displacement_m.size() != 3 * system.mesh.nodes_m.rows() || from->touches.size() != count || !from->memory)
      throw Error("is not a state of this mesh and these contacts", "from");
    s.u = from->displacement_m;
    for (const TouchResult& touch : from->touches) s.poses.push_back(touch.T_base_tool);
    memory = *from->memory;
  } else {
    s.u = VectorX::Zero(3 * system.mesh.nodes_m.rows());
    for (std::size_t c = 0; c < count; ++c) {
      s.poses.push_back(system.contacts[c].T_base_tool);
      if (system.contacts[c].law != Touch::bonded) continue;
      memory[c] = system.terms.bond(system.body(c, target.m, s.poses[c], memory), s.u, system.contacts[c].bond_reach_m);
      if (std::count(memory[c].touching.begin(), memory[c].touching.end(), 1) == 0)
        throw Error("is bonded but touches nothing at the start: check its pose, or raise bond_reach_m",
                    "contacts[" + std::to_string(c) + "] '" + system.contacts[c].name + "'");
    }
  }

  std::vector<ContactIncrement> path{{0, start, s.u, s.poses, memory}};
  double done = 0, step = 1.0 / system.options.increments;
  const double smallest = step * std::pow(0.5, system.options.max_halvings);
  ContactLoads last = start;
  // The guess's own increments are taken, so that the path is the same.
  std::vector<ContactIncrement> way;
  if (guess != nullptr && guess->converged) {
    if (guess->displacement_m.size() != s.u.size() || guess->touches.size() != count || !guess->path)
      throw Error("is not a state of this mesh and these contacts", "guess");
    way.assign(guess->path->begin() + 1, guess->path->end());
    way.back().displacement_m = guess->displacement_m;
    for (std::size_t c = 0; c < count; ++c) way.back().poses[c] = guess->touches[c].T_base_tool;
  }
  std::size_t at_way = 0;
  while (done < 1 && out.reason.empty()) {
    const ContactIncrement* near = at_way < way.size() ? &way[at_way++] : nullptr;
    if (near != nullptr) step = near->share - done;
    const double next = done + step > 1 - 1e-9 ? 1 : done + step;
    const ContactLoads part = between(start, loads, next);
    const ContactProblem p = system.problem(young_modulus_pa, poisson_ratio, part, extra);
    const std::string reason = impl_->increment(p, last, part, s, memory, out, path, near);
    if (reason.empty()) {
      ++out.increments;
      path.back().share = next;
      done = next;
      last = part;
      step = std::min(2 * step, 1.0 / system.options.increments);
    } else {
      way.clear();
      step *= 0.5;
      if (step < smallest)
        out.reason =
            "no equilibrium was found beyond " + std::to_string(100 * done) + " % of the load step (" + reason + ")";
    }
  }
  out.converged = out.reason.empty();
  // What was reached, also when it is not the whole load.
  const ContactProblem reached = system.problem(young_modulus_pa, poisson_ratio, last, extra);
  // Anchors have moved on since the last increment; its forces are those of its own.
  if (out.increments == 0) {
    for (std::size_t c = 0; c < count; ++c)
      system.terms.begin_increment(system.body(c, reached.m, s.poses[c], memory), s.u, memory[c]);
    system.evaluate(reached, memory, s);
  }
  out.loads = last;
  out.displacement_m = s.u;
  out.residual = s.residual;
  out.rounding = s.scale_n > 0 ? s.rounding_n / s.scale_n : 0;
  out.inverted_elements = s.inverted;
  if (out.converged && s.inverted > 0)
    out.reason =
        std::to_string(s.inverted) + " elements are inside out: the equilibrium of the equations is not one of a body";
  out.motion_reaction = system.motions.transpose() * (s.internal + s.touching - reached.external);
  for (std::size_t c = 0; c < count; ++c) {
    const ContactTerms::Patch patch = system.terms.patch(system.body(c, reached.m, s.poses[c], memory), s.u);
    TouchResult touch;
    touch.T_base_tool = s.poses[c];
    touch.wrench = s.gradients[c];
    touch.area_m2 = patch.area_m2.sum();
    touch.penetration_m = patch.penetration_m;
    const double force = touch.wrench.head<3>().norm();
    touch.layer_m = force > 0 ? 2 * patch.layer_energy_j / force : 0;
    touch.active_points = static_cast<int>(patch.points_m.rows());
    touch.slipping_points = patch.slipping;
    touch.patch_m = patch.points_m;
    touch.patch_pressure_pa = patch.pressure_pa;
    out.touches.push_back(std::move(touch));
  }
  out.increments_from_rest = out.increments + (from ? from->increments_from_rest : 0);
  out.path = std::make_shared<const std::vector<ContactIncrement>>(std::move(path));
  out.memory = std::make_shared<const std::vector<TouchMemory>>(std::move(memory));
  return out;
}

void ContactStatics::forget() { impl_->system.forget_factor(); }

ContactSensitivity ContactStatics::sensitivity(const ContactEquilibrium& at) const {
  return sensitivity_of(impl_->system, *this, at);
}

VectorX ContactStatics::layer_travel_m(const ContactEquilibrium& at) const {
  return layer_travel_of(impl_->system, *this, at);
}

ContactLoadsAlong ContactStatics::no_loads_along(Index parameters) const {
  const ContactSystem& system = impl_->system;
  ContactLoadsAlong along;
  along.log_young = along.poisson = along.log_layer = VectorX::Zero(parameters);
  along.log_stiffness = MatrixX::Zero(system.assembly.region_count(), parameters);
  along.region_poisson = MatrixX::Zero(system.assembly.has_own_poisson() ? system.assembly.region_count() : 0, parameters);
  along.force_coefficients = MatrixX::Zero(static_cast<Index>(system.boundary.forces.cols()), parameters);
  along.motion_coefficients = MatrixX::Zero(static_cast<Index>(system.motions.cols()), parameters);
  along.motion.assign(system.contacts.size(), MatrixX::Zero(6, parameters));
  along.wrench = along.motion;
  along.radius.assign(system.contacts.size(), along.log_young);
  return along;
}

ContactPathSensitivity ContactStatics::rest_along(Index parameters) const {
  const ContactSystem& system = impl_->system;
  ContactPathSensitivity rest;
  rest.loads = no_loads_along(parameters);
  rest.displacement = MatrixX::Zero(3 * static_cast<Index>(system.mesh.nodes_m.rows()), parameters);
  rest.wrench = rest.motion = rest.loads.motion;
  rest.motion_reaction = rest.loads.motion_coefficients;
  rest.anchors.resize(system.contacts.size());
  return rest;
}

ContactPathSensitivity ContactStatics::sensitivity_along(const ContactEquilibrium& at, const ContactLoadsAlong& along,
                                                         const ContactPathSensitivity& from) const {
  return path_sensitivity(impl_->system, at, *at.path, along, from);
}

}  // namespace palpate::fem
