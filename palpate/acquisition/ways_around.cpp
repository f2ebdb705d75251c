// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/ways_around.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "palpate/acquisition/push_protocol.hpp"

namespace palpate::acquisition {
namespace {

constexpr double via_beside_m = 1e-3;  // via points lie this far outside

Pose posed(const Mat3& rotation, const Vec3& at_m) {
  Pose pose = Pose::Identity();
  pose.linear() = rotation;
  pose.translation() = at_m;
  return pose;
}

// Between the two, places to go through: none; over the top; around the upright edges, one or two of them.
std::vector<std::vector<Vec3>> places_between(const KeepOut& box, const Vec3& from_m, const Vec3& to_m) {
  const double top_m = std::max({box.max_m.z() + via_beside_m, from_m.z(), to_m.z()});
  std::vector<std::vector<Vec3>> out{{}, {{from_m.x(), from_m.y(), top_m}, {to_m.x(), to_m.y(), top_m}}};
  std::array<Vec3, 4> edges;
  for (int k = 0; k < 4; ++k)
    edges[std::size_t(k)] = {k == 1 || k == 2 ? box.max_m.x() + via_beside_m : box.min_m.x() - via_beside_m,
                             k >= 2 ? box.max_m.y() + via_beside_m : box.min_m.y() - via_beside_m, 0};
  const auto at_height = [](Vec3 edge_m, double height_m) {
    edge_m.z() = height_m;
    return edge_m;
  };
  for (std::size_t k = 0; k < 4; ++k) {
    out.push_back({at_height(edges[k], from_m.z()), at_height(edges[k], to_m.z())});
    for (const std::size_t next : {(k + 1) % 4, (k + 3) % 4})
      out.push_back({at_height(edges[k], from_m.z()), at_height(edges[next], to_m.z())});
  }
  return out;
}

bool is_before(const std::vector<Plane>& planes, const Vec3& at_m) {
  return std::all_of(planes.begin(), planes.end(), [&](const Plane& one) { return one.normal.dot(at_m - one.point_m) > 0; });
}

bool is_free(const KeepOut& box, const Pose& from, const std::vector<Pose>& way, double tool_length_m) {
  Pose at = from;
  for (const Pose& next : way) {
    for (const Pose& there : in_pieces(at, next, 0.01, 0.1)) {
      const Vec3 tip_m = there.translation(), end_m = tip_m - tool_length_m * there.linear().col(2);
      if (passes_through(box, tip_m, end_m)) return false;
    }
    if (passes_through(box, at.translation(), next.translation())) return false;
    at = next;
  }
  return true;
}

double length_of(const Pose& from, const std::vector<Pose>& way) {
  double length_m = 0;
  Vec3 at_m = from.translation();
  for (const Pose& next : way) {
    length_m += (next.translation() - at_m).norm();
    at_m = next.translation();
  }
  return length_m;
}

// The tool turns at the `turns_at`-th place (0: where it stands), straight or, as for the way to the other side, through pointing down.
std::vector<Pose> way_through(const std::vector<Vec3>& places, const Pose& from, const Pose& to, std::size_t turns_at, bool down) {
  std::vector<Pose> way;
  const auto turn = [&](const Vec3& at_m) {
    if (down) way.push_back(posed(tip_along(-Vec3::UnitZ()), at_m));
    way.push_back(posed(to.linear(), at_m));
  };
  if (turns_at == 0) turn(from.translation());
  for (std::size_t k = 0; k < places.size(); ++k) {
    way.push_back(posed(turns_at > k ? from.linear() : to.linear(), places[k]));
    if (turns_at == k + 1) turn(places[k]);
  }
  if (turns_at == places.size() + 1) {
    way.push_back(posed(from.linear(), to.translation()));
    if (down) way.push_back(posed(tip_along(-Vec3::UnitZ()), to.translation()));
  }
  way.push_back(to);
  return way;
}

}  // namespace

std::vector<Pose> in_pieces(const Pose& from, const Pose& to, double length_m, double angle_rad) {
  const Eigen::Quaterniond begins(from.linear()), ends(to.linear());
  const Vec3 along_m = to.translation() - from.translation();
  const double count = std::max({1.0, std::ceil(along_m.norm() / length_m - 1e-9), std::ceil(begins.angularDistance(ends) / angle_rad - 1e-9)});
  std::vector<Pose> out;
  for (double k = 1; k < count; ++k)
    out.push_back(posed(begins.slerp(k / count, ends).toRotationMatrix(), from.translation() + k / count * along_m));
  out.push_back(to);
  return out;
}

std::vector<std::vector<Pose>> ways_around(const KeepOut& box, const Pose& from, const Pose& to, double tool_length_m) {
  std::vector<std::pair<double, std::vector<Pose>>> found;
  for (const std::vector<Vec3>& places : places_between(box, from.translation(), to.translation())) {
    if (!std::all_of(places.begin(), places.end(), [&](const Vec3& at_m) { return is_before(box.planes, at_m); })) continue;
    for (std::size_t turns_at = 0; turns_at <= places.size() + 1; ++turns_at)
      for (const bool down : {false, true}) {
        std::vector<Pose> way = way_through(places, from, to, turns_at, down);
        if (is_free(box, from, way, tool_length_m)) found.emplace_back(length_of(from, way), std::move(way));
      }
  }
  std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first < b.first - 1e-9; });
  std::vector<std::vector<Pose>> out;
  for (auto& [length_m, way] : found) out.push_back(std::move(way));
  return out;
}

}  // namespace palpate::acquisition
