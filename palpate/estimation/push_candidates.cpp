// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/push_candidates.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <utility>

#include "palpate/core/error.hpp"
#include "palpate/estimation/load_columns.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::estimation {
namespace {

constexpr int rim_points = 8;
constexpr int draws_a_contact = 40;  // of which the farthest apart are kept
constexpr const char* out_of_reach = "out of the robot's reach";
constexpr double hand_length_m = 0.15;

/// Uniform in [0, 1), the same with every standard library.
double uniform(std::mt19937_64& random) { return static_cast<double>(random() >> 11) * 0x1.0p-53; }

}  // namespace

void check(const CandidateOptions& o) {
  const auto need = [](bool good, const char* field, const char* rule) {
    if (!good) throw Error(rule, std::string("CandidateOptions.") + field);
  };
  need(o.contacts >= 1, "contacts", "must be at least 1");
  need(o.tilts >= 0, "tilts", "must not be negative");
  need(o.limits.force_n > 0, "limits.force_n", "must be positive");
  need(o.limits.travel_m > 0, "limits.travel_m", "must be positive");
  need(o.limits.pressure_over_young > 0, "limits.pressure_over_young", "must be positive");
  need(o.limits.thickness_share > 0 && o.limits.thickness_share <= 1, "limits.thickness_share", "must be in (0, 1]");
  need(o.limits.tilt_rad >= 0 && o.limits.tilt_rad < 1.4, "limits.tilt_rad", "must be in [0, 1.4)");
  need(o.limits.stick_length_m >= 0 && o.limits.hand_radius_m >= 0, "limits.stick_length_m", "must not be negative");
  need(o.limits.flatness > 0, "limits.flatness", "must be positive");
}

struct PushSpace::Impl {
  geometry::TriangleTree tree;
  std::vector<Plane> planes;
  Points held_m;
  double radius_m;
  CandidateOptions options;
};

PushSpace::PushSpace(const TriMesh& surface, const Recording& scene, Points held_m, const Tool& tool,
                     CandidateOptions options) {
  check(options);
  if ((tool.shape != ToolShape::sphere && tool.shape != ToolShape::disc) || !(tool.radius_m > 0)) {
    throw Error("pushes can be planned for a round tool (sphere or disc) with a radius", "tools." + tool.name);
  }
  std::vector<Plane> planes = scene.environment.planes;
  for (const auto& support : scene.supports) {
    if (support.kind == SupportKind::table || support.kind == SupportKind::wall || support.kind == SupportKind::plane)
      planes.push_back(support.plane);
  }
  impl_ = std::make_unique<Impl>(
      Impl{geometry::TriangleTree(surface), std::move(planes), std::move(held_m), tool.radius_m, std::move(options)});
}
PushSpace::~PushSpace() = default;

/// Of the patch under the tool: noise of single triangles does not matter.
Vec3 PushSpace::mean_normal(const Vec3& contact_m) const {
  const auto normal_at = [&](const Vec3& point) {
    const auto hit = impl_->tree.closest(point);
    const auto corner = [&](int k) {
      return Vec3(impl_->tree.mesh().vertices_m.row(impl_->tree.mesh().triangles(hit.triangle, k)));
    };
    return Vec3((corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized());
  };
  const Vec3 first = normal_at(contact_m);
  const auto across = tangents(first);
  Vec3 sum = first;
  for (int k = 0; k < rim_points; ++k) {
    const double angle = 2 * EIGEN_PI * k / rim_points;
    sum += normal_at(contact_m + 0.7 * impl_->radius_m * (std::cos(angle) * across[0] + std::sin(angle) * across[1]));
  }
  return sum.norm() > 0 ? Vec3(sum.normalized()) : first;
}

bool PushSpace::in_reach(const PushCandidate& candidate) const {
  return !impl_->options.reachable || impl_->options.reachable(candidate.contact_m, candidate.direction);
}

std::string PushSpace::refusal(PushCandidate& candidate) const {
  const std::string word = geometric_refusal(candidate);
  return word.empty() && !in_reach(candidate) ? out_of_reach : word;
}

std::string PushSpace::geometric_refusal(PushCandidate& candidate) const {
  const Impl& space = *impl_;
  const PushLimits& limits = space.options.limits;
  const Vec3 &contact_m = candidate.contact_m, &direction = candidate.direction;
  if (std::abs(direction.norm() - 1) > 1e-6) throw Error("must have unit length", "PushCandidate.direction");
  const Vec3 normal = mean_normal(contact_m);
  if (-direction.dot(normal) < std::cos(limits.tilt_rad + 1e-9)) return "slips";
  for (Index i = 0; i < space.held_m.rows(); ++i)
    if ((space.held_m.row(i).transpose() - contact_m).norm() < space.radius_m) return "held";

  const auto across = tangents(normal);
  const auto rim = [&](int k) {
    const double angle = 2 * EIGEN_PI * k / rim_points;
    return Vec3(contact_m + space.radius_m * (std::cos(angle) * across[0] + std::sin(angle) * across[1]));
  };
  for (int k = 0; k < rim_points; ++k)
    if (std::sqrt(space.tree.closest(rim(k)).squared_distance_m2) > limits.flatness * space.radius_m) return "uneven";

  // The stick behind the tip, and the hand behind the stick, stay in front of every plane.
  for (const Plane& plane : space.planes) {
    const double sine = std::sqrt(std::max(0.0, 1 - std::pow(plane.normal.dot(direction), 2)));
    const auto clear = [&](double behind_m, double radius_m) {
      return plane.normal.dot(contact_m - behind_m * direction - plane.point_m) >= radius_m * sine;
    };
    const double hand_m = limits.stick_length_m;
    if (!clear(0, space.radius_m) || !clear(hand_m, limits.hand_radius_m) ||
        !clear(hand_m + hand_length_m, limits.hand_radius_m))
      return "behind a plane";
  }
  // Nor does the object stand in the stick's way.
  const double lift_m = limits.flatness * space.radius_m + 1e-3;
  for (int k = -1; k < rim_points; ++k) {
    const Vec3 from = (k < 0 ? contact_m : rim(k)) - lift_m * direction;
    if (space.tree.cast(from, -direction, limits.stick_length_m)) return "in the object's shade";
  }
  const auto exit = space.tree.cast(contact_m + 1e-3 * space.radius_m * direction, direction);
  candidate.thickness_m = exit ? exit->range_m : 0;
  if (candidate.thickness_m < space.radius_m) return "thin";
  return {};
}

std::vector<PushCandidate> PushSpace::sample(std::map<std::string, int>* refused) const {
  const CandidateOptions& options = impl_->options;
  const TriMesh& surface = impl_->tree.mesh();
  std::vector<double> area_up_to;
  double area = 0;
  for (Index t = 0; t < surface.triangles.rows(); ++t) {
    const auto corner = [&](int k) { return Vec3(surface.vertices_m.row(surface.triangles(t, k))); };
    area += (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
    area_up_to.push_back(area);
  }
  std::mt19937_64 random(options.seed);
  std::vector<PushCandidate> possible;
  const auto refuse = [&](const std::string& word) {
    if (refused != nullptr) ++(*refused)[word];
  };
  for (int draw = 0; draw < draws_a_contact * options.contacts; ++draw) {
    const auto triangle = std::min<std::ptrdiff_t>(
        std::upper_bound(area_up_to.begin(), area_up_to.end(), area * uniform(random)) - area_up_to.begin(),
        static_cast<std::ptrdiff_t>(area_up_to.size()) - 1);
    double u = uniform(random), v = uniform(random);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const auto corner = [&](int k) {
      return Vec3(surface.vertices_m.row(surface.triangles(static_cast<Index>(triangle), k)));
    };
    PushCandidate candidate;
    candidate.contact_m = (1 - u - v) * corner(0) + u * corner(1) + v * corner(2);
    candidate.direction = -mean_normal(candidate.contact_m);
    const std::string word = geometric_refusal(candidate);
    if (word.empty())
      possible.push_back(candidate);
    else
      refuse(word);
  }

  // The farthest from all that were chosen, again and again.
  std::vector<PushCandidate> chosen;
  VectorX distance_m = VectorX::Constant(static_cast<Index>(possible.size()), 1e300);
  const double tilt = 0.9 * options.limits.tilt_rad;
  for (int c = 0; c < options.contacts && !possible.empty();) {
    Index next = 0;
    if (distance_m.maxCoeff(&next) <= 0) break;
    const PushCandidate& at = possible[static_cast<std::size_t>(next)];
    if (!in_reach(at)) {
      distance_m(next) = 0;
      refuse(out_of_reach);
      continue;
    }
    for (std::size_t i = 0; i < possible.size(); ++i) {
      double& far = distance_m(static_cast<Index>(i));
      far = std::min(far, (possible[i].contact_m - at.contact_m).norm());
    }
    chosen.push_back(at);
    const auto across = tangents(at.direction);
    for (int k = 0; k < options.tilts && tilt > 0; ++k) {
      // Turned by the golden angle from place to place, so that few tilts still point everywhere.
      const double azimuth = 2.399963229728653 * c + 2 * EIGEN_PI * k / options.tilts;
      PushCandidate slanted = at;
      slanted.direction =
          (std::cos(tilt) * at.direction + std::sin(tilt) * (std::cos(azimuth) * across[0] + std::sin(azimuth) * across[1]))
              .normalized();
      const std::string word = refusal(slanted);
      if (word.empty())
        chosen.push_back(slanted);
      else
        refuse(word);
    }
    ++c;
  }
  return chosen;
}

}  // namespace palpate::estimation
