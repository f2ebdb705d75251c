// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/self_check.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>

#include "palpate/core/error.hpp"
#include "palpate/estimation/grazing.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::estimation {
namespace {

constexpr double quantile_975 = 1.959963984540054;
constexpr double alarm = 3;  // standard deviations: a dozen errors are judged at once
constexpr double tukey_cut = 4.685;
constexpr Index most_rays = 3000;  // a frame

/// Entries of the vector that is solved for.
enum Fixed {
  scale = 0,
  compliance = 1,
  spring = 2,
  camera = 3,  // translation, then rotation
  camera_turn = 6,
  body = 9,  // likewise
  body_turn = 12,
  bias = 15,  // of depths, along the ray
  pushes_from = 16  // tare and zero of each
};

struct Reading {  // of one loaded step
  std::size_t push = 0;
  double force_n = 0, force_std_n = 0, travel_m = 0, travel_sigma_m = 0;
};

struct Touch {
  std::size_t push = 0;
  Vec3 tip_m = Vec3::Zero(), direction = Vec3::Zero();
  double std_m = 0;
};

struct View {
  std::size_t push = 0;
  bool pressed = false;  ///< else nothing moves the body, whatever the sensor's zero
  double force_n = 0;
  Vec3 direction = Vec3::Zero();
  RayCloud rays;
};

struct Problem {
  const Recording& recording;
  SelfCheckOptions options;
  geometry::TriangleTree tree;
  Vec3 pivot_m;
  std::vector<Reading> readings;
  std::vector<Touch> touches;
  std::vector<View> views;
  VectorX prior_std;  // infinite: flat; zero: known
  double give = 0;    // 1 / k

  int tare(std::size_t push) const { return pushes_from + 2 * static_cast<int>(push); }
  int zero(std::size_t push) const { return tare(push) + 1; }
  int size() const { return pushes_from + 2 * static_cast<int>(recording.pushes.size()); }

  double force_n(const VectorX& x, std::size_t push, double reading_n) const {
    return (reading_n - x(tare(push))) / (1 + x(scale));
  }
  double give_of(const VectorX& x) const { return give * (1 - x(spring)); }
};

struct Rows {
  std::vector<double> travel, touch, ray;  // in standard deviations; a ray that misses: infinite
  std::vector<Vec3> normal;                // of the plane that each ray met, in the body's frame
  double travel_squares = 0, ray_squares = 0;
  std::size_t rays_hit = 0, touches_missed = 0;
};

/// From a ray as it is stated to the body's own frame: origin' = turn origin + shift, direction' = turn direction.
struct RayMap {
  Mat3 turn;
  Vec3 shift;
};

RayMap map_of(const Problem& p, const VectorX& x, const View& view) {
  const RigidOffset moved{x.segment<3>(body), x.segment<3>(body_turn), p.pivot_m};
  const RigidOffset seen{x.segment<3>(camera), x.segment<3>(camera_turn), p.pivot_m};
  const Vec3 given_way = view.pressed ? Vec3(p.force_n(x, view.push, view.force_n) * p.give_of(x) * view.direction) : Vec3::Zero();
  const Mat3 back = moved.rotation().transpose();
  return {back * seen.rotation(), moved.apply_inverse(seen.apply(Vec3::Zero()) - given_way)};
}

/// Residuals of everything at x. The body stands still and rays move, so that its tree is built once.
Rows residuals(const Problem& p, const VectorX& x, bool with_rays = true) {
  Rows rows;
  for (const Reading& r : p.readings) {
    const double force = p.force_n(x, r.push, r.force_n);
    const double sigma = std::hypot(r.travel_sigma_m, (p.give + std::abs(x(compliance))) * r.force_std_n);
    const double off = r.travel_m - force * (p.give_of(x) + x(compliance)) - x(p.zero(r.push));
    rows.travel.push_back(off / sigma);
    rows.travel_squares += off * off;
  }
  const RigidOffset moved{x.segment<3>(body), x.segment<3>(body_turn), p.pivot_m};
  for (const Touch& t : p.touches) {
    // Along the push: where the tip's line meets the body.
    const Vec3 tip = moved.apply_inverse(t.tip_m), along = moved.rotation().transpose() * t.direction;
    const double back_m = 0.1;
    const auto hit = p.tree.cast(tip - back_m * along, along);
    rows.touch.push_back(hit ? (back_m - hit->range_m) / t.std_m : 0);
    rows.touches_missed += hit ? 0 : 1;
  }
  if (!with_rays) return rows;
  for (const View& view : p.views) {
    const RayMap map = map_of(p, x, view);
    for (Index i = 0; i < view.rays.range_m.size(); ++i) {
      const Vec3 direction = map.turn * view.rays.directions.row(i).transpose();
      const auto hit = p.tree.cast(map.turn * view.rays.origins_m.row(i).transpose() + map.shift, direction);
      rows.normal.push_back(Vec3::Zero());
      if (hit) {
        const auto corner = [&](int k) {
          return Vec3(p.tree.mesh().vertices_m.row(p.tree.mesh().triangles(hit->triangle, k)));
        };
        rows.normal.back() = (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
      }
      if (!hit || std::abs(rows.normal.back().dot(direction)) < grazing_cosine) {
        rows.ray.push_back(std::numeric_limits<double>::infinity());
        continue;
      }
      const double off = view.rays.range_m(i) - x(bias) - hit->range_m;
      rows.ray.push_back(off / view.rays.sigma_m(i));
      if (std::abs(rows.ray.back()) < tukey_cut) rows.ray_squares += off * off, ++rows.rays_hit;
    }
  }
  return rows;
}

struct Normal {
  double cost = 0;
  MatrixX hessian;
  VectorX gradient;
};

double step_of(int k) { return k == scale || k == spring ? 1e-5 : k == compliance ? 1e-9 : k < pushes_from ? 1e-6 : 1e-7; }

/// Rows of travels and touches.
VectorX few_rows(const Problem& p, const VectorX& x) {
  const Rows rows = residuals(p, x, false);
  VectorX all(static_cast<Index>(rows.travel.size() + rows.touch.size()));
  Index at = 0;
  for (const auto* part : {&rows.travel, &rows.touch})
    for (const double value : *part) all(at++) = value;
  return all;
}

/// Tukey's biweight on rays, widened while annealing. How a ray moves with the unknowns is a difference, what that does to
/// its range is the plane that it meets: range = n . (q - o) / (n . d).
Normal normal_equations(const Problem& p, const VectorX& x, const std::vector<int>& moving, double widening) {
  const Rows here = residuals(p, x);
  const double cut = tukey_cut * widening;
  const Index columns = static_cast<Index>(moving.size());
  const auto both = [&](std::size_t c, const auto& compute) {
    VectorX ahead = x, behind = x;
    const double h = step_of(moving[c]);
    ahead(moving[c]) += h;
    behind(moving[c]) -= h;
    return std::make_tuple(compute(ahead), compute(behind), 2 * h);
  };

  Normal out;
  VectorX few = few_rows(p, x);
  MatrixX jacobian(few.size(), columns);
  for (std::size_t c = 0; c < moving.size(); ++c) {
    const auto [ahead, behind, width] = both(c, [&](const VectorX& at) { return few_rows(p, at); });
    jacobian.col(static_cast<Index>(c)) = (ahead - behind) / width;
  }
  out.cost = 0.5 * few.squaredNorm();
  out.hessian = jacobian.transpose() * jacobian;
  out.gradient = jacobian.transpose() * few;

  std::size_t ray = 0;
  for (const View& view : p.views) {
    const RayMap map = map_of(p, x, view);
    std::vector<RayMap> slopes;
    for (std::size_t c = 0; c < moving.size(); ++c) {
      const auto [ahead, behind, width] = both(c, [&](const VectorX& at) { return map_of(p, at, view); });
      slopes.push_back({(ahead.turn - behind.turn) / width, (ahead.shift - behind.shift) / width});
    }
    VectorX row(columns);
    for (Index i = 0; i < view.rays.range_m.size(); ++i, ++ray) {
      const double r = here.ray[ray];
      out.cost += std::isfinite(r) ? tukey_rho(r, cut) : cut * cut / 6;
      const double weight = std::isfinite(r) ? tukey_weight(r, cut) : 0;
      if (weight == 0) continue;
      const Vec3 origin = view.rays.origins_m.row(i), direction = view.rays.directions.row(i);
      const double range_m = view.rays.range_m(i) - x(bias) - r * view.rays.sigma_m(i);
      const Vec3 gradient = here.normal[ray] / (here.normal[ray].dot(map.turn * direction) * view.rays.sigma_m(i));
      for (Index c = 0; c < columns; ++c) {
        const RayMap& slope = slopes[static_cast<std::size_t>(c)];
        row(c) = moving[static_cast<std::size_t>(c)] == bias ? -1 / view.rays.sigma_m(i)
                                                             : gradient.dot(slope.turn * (origin + range_m * direction) + slope.shift);
      }
      out.hessian.selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
      out.gradient += weight * r * row;
    }
  }
  out.hessian = MatrixX(out.hessian.selfadjointView<Eigen::Lower>());
  for (std::size_t c = 0; c < moving.size(); ++c) {
    const double std = p.prior_std(moving[c]);
    const auto k = static_cast<Index>(c);
    out.cost += 0.5 * std::pow(x(moving[c]) / std, 2);
    out.hessian(k, k) += 1 / (std * std);
    out.gradient(k) += x(moving[c]) / (std * std);
  }
  return out;
}

const TermInput* rays_in(const std::vector<TermInput>& inputs) {
  for (const auto& input : inputs)
    if (std::holds_alternative<RayObservation>(input)) return &input;
  return nullptr;
}

RayCloud most_of(const RayCloud& rays) {
  const Index every = std::max<Index>(1, (static_cast<Index>(rays.range_m.size()) + most_rays - 1) / most_rays);
  std::vector<Index> keep;
  for (Index i = 0; i < rays.range_m.size(); i += every) keep.push_back(i);
  RayCloud out;
  out.origins_m = rays.origins_m(keep, Eigen::all);
  out.directions = rays.directions(keep, Eigen::all);
  out.range_m = rays.range_m(keep);
  out.sigma_m = rays.sigma_m(keep);
  return out;
}

/// Where the tip was at first contact: where the arm says it is now, less what it has travelled since; else the contact point, which
/// is as uncertain as it is stated to be (one that was only planned is not where the tip was).
std::optional<Touch> first_touch(std::size_t push, const Step& step, const Vec3& direction, double touch_std_m) {
  if (step.T_base_tip)
    for (const auto& observation : step.observations)
      if (const auto* travel = std::get_if<ToolTravel>(&observation))
        return Touch{push, step.T_base_tip->translation() - travel->travel_m * direction, direction, touch_std_m};
  const Load& load = step.loads[0];
  if (!load.contact_m.allFinite()) return std::nullopt;
  return Touch{push, load.contact_m, direction, std::hypot(touch_std_m, load.contact_std_m)};
}

Problem problem_of(const Recording& recording, const TriMesh& surface, const Inputs& inputs,
                   const SelfCheckOptions& options) {
  const auto need = [](bool good, const char* field, const char* rule) {
    if (!good) throw Error(rule, std::string("SelfCheckOptions.") + field);
  };
  need(!options.stiffness_n_per_m || *options.stiffness_n_per_m > 0, "stiffness_n_per_m", "must be positive");
  need(options.stiffness_relative_std >= 0, "stiffness_relative_std", "must not be negative");
  need(options.placed_std_m >= 0 && options.placed_std_rad >= 0, "placed_std_m", "must not be negative");
  need(options.touch_std_m > 0, "touch_std_m", "must be positive");
  Problem p{
      recording, options, geometry::TriangleTree(surface), Vec3(surface.vertices_m.colwise().mean().transpose()), {}, {}, {},
      {},        0};
  if (options.stiffness_n_per_m) p.give = 1 / *options.stiffness_n_per_m;
  std::size_t s = 0;
  for (std::size_t k = 0; k < recording.pushes.size(); ++k) {
    bool touched = false;
    Vec3 direction = Vec3::Zero();
    for (const auto& step : recording.pushes[k].steps)
      if (!step.loads.empty()) direction = step.loads[0].direction.normalized();
    for (const auto& step : recording.pushes[k].steps) {
      const Load* load = step.loads.empty() ? nullptr : &step.loads[0];
      const double force_n = load != nullptr && load->force_n ? load->force_n->dot(direction) : 0;
      if (load != nullptr && load->force_n) {
        if (!touched)
          if (const auto touch = first_touch(k, step, direction, options.touch_std_m)) p.touches.push_back(*touch);
        touched = true;
        for (const auto& observation : step.observations)
          if (const auto* travel = std::get_if<ToolTravel>(&observation))
            p.readings.push_back({k, force_n, std::hypot(load->force_std_n, load->force_relative_std * force_n),
                                  travel->travel_m, travel->sigma_m});
      }
      // How far a spring gives under a force that nobody measured is not known.
      const bool tells = p.give == 0 || load == nullptr || load->force_n;
      if (s < inputs.size() && tells)
        if (const TermInput* rays = rays_in(inputs[s]))
          p.views.push_back({k, force_n != 0, force_n, direction, most_of(std::get<RayObservation>(*rays).rays)});
      ++s;
    }
  }
  if (p.readings.empty()) throw Error("no step has a measured force and a read travel: there is nothing to check", "pushes");
  p.prior_std = VectorX::Zero(p.size());
  // A rigid block says nothing of the scale: what is stated of it stands, so that compliance is not blurred by it.
  p.prior_std(scale) = options.stiffness_n_per_m ? options.force_scale_std : recording.force_scale_std;
  p.prior_std(compliance) = options.compliance_std_m_per_n;
  p.prior_std(spring) = options.stiffness_n_per_m ? options.stiffness_relative_std : 0;
  for (const auto& step : inputs)
    if (const TermInput* rays = rays_in(step)) p.prior_std(bias) = std::max(p.prior_std(bias), std::get<RayObservation>(*rays).bias_std_m);
  if (!p.views.empty()) {
    p.prior_std.segment<3>(camera).setConstant(options.hand_eye_std_m);
    p.prior_std.segment<3>(camera_turn).setConstant(options.hand_eye_std_rad);
  }
  p.prior_std.segment<3>(body).setConstant(options.placed_std_m);
  p.prior_std.segment<3>(body_turn).setConstant(options.placed_std_rad);
  for (std::size_t k = 0; k < recording.pushes.size(); ++k) {
    p.prior_std(p.tare(k)) = recording.pushes[k].force_tare_std_n;
    p.prior_std(p.zero(k)) = recording.pushes[k].travel_offset_std_m;
  }
  return p;
}

/// Whose compliance is stated: the first tool that touches (all are taken to agree).
Tool touching_tool(const Recording& recording) {
  for (const auto& push : recording.pushes)
    for (const auto& step : push.steps)
      for (const auto& load : step.loads)
        for (const auto& tool : recording.tools)
          if (tool.name == load.tool) return tool;
  return {};
}

void judge(const Problem& p, double dof, SelfCheck& check) {
  std::map<std::string, std::string> said;
  for (const auto& error : check.errors) {
    if (error.consistent) continue;
    const std::string group = error.name.substr(0, error.name.find('['));
    if (group == "force_scale")
      said["force_scale_off"] =
          fmt::format("the force sensor reads {:.1f} % too {}", 100 * std::abs(error.value), error.value > 0 ? "much" : "little") +
          ", which is as much error in Young's modulus: calibrate it, or state force_scale_std";
    else if (group == "compliance")
      said["compliance_off"] = fmt::format("stick and arm give way by {:.3g} mm per newton {}", 1e3 * std::abs(error.value),
                                           error.value > 0 ? "more" : "less") +
                               " than tools.compliance_m_per_n says: add it there, and how well it is known as compliance_std_m_per_n";
    else if (group == "force_tare")
      said["force_tare_off"] =
          "the force's zero is off by more than force_tare_std_n allows: tare just before each push, away from the object";
    else if (group == "depth_bias")
      said["depth_bias_off"] = fmt::format("depths are {:.3g} mm too {}, by more than noise.bias_std_m allows: correct them, or state how far they may be off",
                                           1e3 * std::abs(error.value), error.value > 0 ? "far" : "near");
    else
      said["hand_eye_off"] =
          "the camera does not stand where T_base_camera says, by more than pose_std_m and pose_std_rad allow: "
          "calibrate it against the robot, or put hand_eye_correction before T_base_camera";
  }
  constexpr double some = 0.2;  // of the rays: tables, clutter and grazed faces take theirs of a good rig's, too
  const bool sees_it = static_cast<double>(check.rays) > some * static_cast<double>(check.rays_given);
  if (!sees_it && check.rays_given > 0)
    said["camera_sees_something_else"] =
        fmt::format("only {} of {} rays end on the body: is rest its shape where it stands in the base frame, and T_base_camera the camera's pose there, "
                    "in metres?", check.rays, check.rays_given);
  if (check.touches_missed > 0)
    said["touch_misses_body"] = fmt::format("the tip's way meets the body in {} of {} first touches: do contact_m (or T_base_tip), direction and rest share the base frame?",
                                            check.touches, check.touches + check.touches_missed);
  bool scale_known = false, camera_known = !p.views.empty();
  for (const auto& error : check.errors) {
    if (error.name == "force_scale") scale_known = error.determined;
    if (error.name.starts_with("hand_eye")) camera_known = camera_known && error.determined;
  }
  if (!scale_known)
    said["force_scale_not_determined"] =
        p.options.stiffness_n_per_m
            ? "this spring tells scale and compliance apart only where the camera sees it give way: record depth images "
              "of the loaded spring, or check compliance on a rigid block first"
            : "a rigid block says nothing of the force's scale: push a spring of known stiffness as well";
  if (!camera_known && (sees_it || p.views.empty()))
    said["hand_eye_not_determined"] =
        p.views.empty() ? "no depth images: the camera's place cannot be checked"
                        : "the surface that is seen can slide along itself: show the camera three faces of the body";
  if (check.chi2_per_dof > 1.5 + 4 * std::sqrt(2 / dof))  // few rows scatter
    said["does_not_fit"] =
        "what is left is larger than the stated sigmas allow: the body gives way elsewhere, it is not where the recording "
        "says, or a sigma is too small";
  for (const auto& [code, message] : said) check.verdicts.push_back({code, message});
}

}  // namespace

SelfCheck self_check(const Recording& recording, const TriMesh& surface, const Inputs& inputs,
                     const SelfCheckOptions& options) {
  const Problem p = problem_of(recording, surface, inputs, options);
  std::vector<int> moving;
  for (int k = 0; k < p.size(); ++k)
    if (p.prior_std(k) > 0) moving.push_back(k);
  VectorX x = VectorX::Zero(p.size());
  SelfCheck check;
  Normal at;
  for (const double widening : {16.0, 4.0, 1.0}) {
    double damping = 1e-6;
    check.converged = false;
    at = normal_equations(p, x, moving, widening);
    for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
      MatrixX damped = at.hessian;
      damped.diagonal() *= 1 + damping;
      const VectorX step = damped.ldlt().solve(-at.gradient);
      VectorX next = x;
      for (std::size_t c = 0; c < moving.size(); ++c) next(moving[c]) += step(static_cast<Index>(c));
      const Normal there = normal_equations(p, next, moving, widening);
      if (there.cost <= at.cost * (1 + 1e-12)) {
        const double decrement = -at.gradient.dot(step);
        x = next;
        at = there;
        damping = std::max(1e-9, damping / 5);
        if (decrement < 1e-6) {
          check.converged = true;
          break;
        }
      } else {
        damping *= 10;
        if (damping > 1e8) {
          check.converged = std::isfinite(at.cost);  // rounding of triangle edges
          break;
        }
      }
    }
  }
  if (!check.converged) check.message = "the errors were not found: start from a better calibration";
  const MatrixX covariance = at.hessian.ldlt().solve(MatrixX::Identity(at.hessian.rows(), at.hessian.cols()));

  const Rows left = residuals(p, x);
  double chi2 = 0;
  for (const double r : left.travel) chi2 += r * r;
  for (const double r : left.touch) chi2 += r * r;
  for (const double r : left.ray) chi2 += std::abs(r) < tukey_cut ? r * r : 0;  // as they are counted
  // A prior is a row, too: what moves under one costs no degree of freedom, and its pull counts.
  double dof = static_cast<double>(left.travel.size() + left.touch.size() - left.touches_missed + left.rays_hit);
  for (const int k : moving) {
    if (std::isfinite(p.prior_std(k))) chi2 += std::pow(x(k) / p.prior_std(k), 2);
    else --dof;
  }
  dof = std::max(1.0, dof);
  check.chi2_per_dof = chi2 / dof;
  check.travels = left.travel.size();
  check.touches_missed = left.touches_missed;
  check.touches = left.touch.size() - left.touches_missed;
  check.rays = left.rays_hit;
  check.rays_given = left.ray.size();
  const RigidOffset seen{x.segment<3>(camera), x.segment<3>(camera_turn), p.pivot_m};
  check.pivot_m = p.pivot_m;
  check.hand_eye_correction.linear() = seen.rotation();
  check.hand_eye_correction.translation() = seen.apply(Vec3::Zero());
  check.travel_rms_m = std::sqrt(left.travel_squares / std::max<double>(1, static_cast<double>(check.travels)));
  check.depth_rms_m = std::sqrt(left.ray_squares / std::max<double>(1, static_cast<double>(check.rays)));

  double pose_std_m = 0, pose_std_rad = 0;
  for (const auto& step : inputs)
    if (const TermInput* rays = rays_in(step)) {
      pose_std_m = std::max(pose_std_m, std::get<RayObservation>(*rays).pose_std_m);
      pose_std_rad = std::max(pose_std_rad, std::get<RayObservation>(*rays).pose_std_rad);
    }
  const auto add = [&](const std::string& name, const std::string& unit, int k, double stated, double offset = 0) -> CheckedError* {
    const auto column = std::find(moving.begin(), moving.end(), k);
    if (column == moving.end()) return nullptr;  // exactly known
    const auto c = static_cast<Index>(column - moving.begin());
    CheckedError error{name, unit};
    error.value = x(k) - offset;
    error.std = std::sqrt(std::max(covariance(c, c), 0.0));
    error.lower_95 = error.value - quantile_975 * error.std;
    error.upper_95 = error.value + quantile_975 * error.std;
    error.stated_std = stated;
    error.determined = error.std < 0.3 * p.prior_std(k);
    error.consistent = !error.determined || std::abs(error.value) <= alarm * std::hypot(error.std, stated);
    return &check.errors.emplace_back(error);
  };
  add("force_scale", "1", scale, recording.force_scale_std);
  const Tool tool = touching_tool(recording);
  add("compliance", "m/N", compliance, tool.compliance_std_m_per_n, tool.compliance_m_per_n);
  const char* axes[] = {"x", "y", "z"};
  for (int d = 0; d < 3; ++d) add(std::string("hand_eye_") + axes[d], "m", camera + d, pose_std_m);
  for (int d = 0; d < 3; ++d) add(std::string("hand_eye_rotation_") + axes[d], "rad", camera_turn + d, pose_std_rad);
  add("depth_bias", "m", bias, p.prior_std(bias));
  for (std::size_t k = 0; k < recording.pushes.size(); ++k) {
    // Its prior is what the recording states: it is told by its pull.
    const double stated = recording.pushes[k].force_tare_std_n;
    CheckedError* const tare = add("force_tare[" + recording.pushes[k].name + "]", "N", p.tare(k), stated);
    if (tare != nullptr) tare->consistent = std::abs(tare->value) <= alarm * stated;
  }
  judge(p, dof, check);
  return check;
}

}  // namespace palpate::estimation
