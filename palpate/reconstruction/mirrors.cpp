// SPDX-License-Identifier: Apache-2.0
#include "palpate/reconstruction/mirrors.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/reconstruction/facets.hpp"

namespace palpate::reconstruction {
namespace {

constexpr double same_direction = 0.7;  // cosine between an image and the facet that it lies on
constexpr double price_of_free = 2;
constexpr double radian = M_PI / 180;

// Of a symmetry: looked for all around with few facets, and once more about the best plane.
constexpr int directions = 18;
constexpr Index few = 150, many = 800;
constexpr double promising = 0.2, believed = 0.5;  // scores
constexpr double finer_rad = 2 * radian;
constexpr int finer_turns = 3, finer_steps = 6;
constexpr double apart_rad = 29 * radian;  // of two that are found
constexpr double nearly_as_sure = 0.2;     // in score: a square seen askew is no symmetry of a bear
constexpr double margin = 0.2;  // of the seen part's width that lies beyond a plane of symmetry at least

// Of the way back.
constexpr int turns = 2;
constexpr double turn_rad = 15 * radian;
constexpr double price_of_turn = 0.2;
constexpr double price_of_depth = 0.05;  // prefers the nearer of two that are as good
constexpr double few_known = 0.3;        // share of images that fall on what is known: with fewer the score shrinks
constexpr double far_off = 5;            // a touch that is missed by more than so many near_m() counts as that
constexpr double most_free = 0.2;        // of the images

}  // namespace

MirrorSearch::MirrorSearch(const TriMesh& seen, const Vec3& up, double step_m, const std::function<bool(const Vec3&)>& free)
    : seen_(seen), tree_(seen), up_(up), step_m_(step_m), free_(free) {}

MirrorSearch::Facets MirrorSearch::some(Index count) const {
  const Index all = static_cast<Index>(seen_.triangles.rows()), stride = std::max<Index>(1, all / count);
  Facets out;
  for (Index t = 0; t < all; t += stride) out.emplace_back(middle_of(seen_, t), area_of(seen_, t).normalized());
  return out;
}

MirrorSearch::Judged MirrorSearch::judged(const Mirror& mirror, const Facets& facets) const {
  double good = 0, bad = 0, slope = 0, curvature = 0;
  for (const auto& [p, n] : facets) {
    const Vec3 image = mirror.of(p);
    const Vec3 turned = n - 2 * mirror.normal.dot(n) * mirror.normal;
    const auto c = tree_.closest(image);
    if (c.squared_distance_m2 < near_m() * near_m()) {
      const Vec3 normal = area_of(seen_, c.triangle).normalized();
      if (turned.dot(normal) < same_direction) continue;
      const double across = 2 * normal.dot(mirror.normal);
      ++good, slope += across * normal.dot(image - c.point_m), curvature += across * across;
    } else {
      bad += free_(image - step_m_ * turned);
    }
  }
  const double all = static_cast<double>(facets.size());
  return {good / all, bad / all, curvature > 0.01 * good ? std::abs(slope) / curvature / near_m() : 0};
}

std::vector<Mirror> MirrorSearch::symmetries() const {
  const Vec3 side = up_.unitOrthogonal(), middle = seen_.vertices_m.colwise().mean().transpose();
  using Scored = std::pair<double, Mirror>;
  const auto look = [&](const Mirror& mirror, const Facets& facets, Scored& best) {
    const Judged by = judged(mirror, facets);
    const double score = by.good - price_of_free * by.bad - by.off;
    if (score > best.first) best = {score, mirror};
  };
  const Facets coarse = some(few), fine = some(many);
  std::vector<Scored> rough;  // the best of each direction
  for (int k = 0; k < directions; ++k) {
    Mirror mirror;
    mirror.normal = Eigen::AngleAxisd(k * M_PI / directions, up_) * side;
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const auto& [p, n] : coarse) low = std::min(low, mirror.normal.dot(p)), high = std::max(high, mirror.normal.dot(p));
    const double least = low + margin * (high - low), furthest = high - margin * (high - low);
    Scored best{promising, mirror};
    for (mirror.offset_m = least; mirror.offset_m < furthest; mirror.offset_m += step_m_) look(mirror, coarse, best);
    if (best.first > promising) rough.push_back(best);
  }
  const auto surest_first = [](const Scored& a, const Scored& b) { return a.first > b.first; };
  std::stable_sort(rough.begin(), rough.end(), surest_first);
  std::vector<Scored> found;
  for (const auto& [score, about] : rough) {
    const auto is_near = [&](const Scored& other) { return std::abs(other.second.normal.dot(about.normal)) > std::cos(apart_rad); };
    if (std::any_of(found.begin(), found.end(), is_near)) continue;
    Scored best{believed, about};
    const Vec3 on_it = middle - (about.normal.dot(middle) - about.offset_m) * about.normal;  // where finer ones turn
    for (int turn = -finer_turns; turn <= finer_turns; ++turn) {
      Mirror mirror;
      mirror.normal = Eigen::AngleAxisd(turn * finer_rad, up_) * about.normal;
      for (int step = -finer_steps; step <= finer_steps; ++step) {
        mirror.offset_m = mirror.normal.dot(on_it) + 0.5 * step * step_m_;
        look(mirror, fine, best);
      }
    }
    if (best.first > believed) found.push_back(best);
  }
  std::stable_sort(found.begin(), found.end(), surest_first);
  std::vector<Mirror> out;
  for (const auto& [score, mirror] : found)
    if (score > found.front().first - nearly_as_sure) out.push_back(mirror);
  return out;
}

double MirrorSearch::missed(const Mirror& mirror, const std::vector<Vec3>& touched_m) const {
  double sum = 0;
  for (const Vec3& p : touched_m)
    sum += std::min(far_off, std::sqrt(tree_.closest(mirror.of(p)).squared_distance_m2) / near_m());
  return sum;
}

std::optional<Mirror> MirrorSearch::half_way_back(const Vec3& toward, double behind_m,
                                                  const std::vector<Vec3>& touched_m) const {
  const Facets facets = some(many);
  std::optional<Mirror> found;
  double most = -std::numeric_limits<double>::infinity();
  for (int turn = -turns; turn <= turns; ++turn) {
    Mirror mirror;
    mirror.normal = Eigen::AngleAxisd(turn * turn_rad, up_) * toward;
    double front = -std::numeric_limits<double>::infinity();
    for (const auto& [p, n] : facets) front = std::max(front, mirror.normal.dot(p));
    for (double depth_m = 0.5 * step_m_; depth_m < behind_m; depth_m += 0.5 * step_m_) {
      mirror.offset_m = front - depth_m;
      const Judged by = judged(mirror, facets);
      if (by.bad > most_free) continue;
      // Planes that turn towards what was seen find more images of either kind.
      const double score = (by.good - price_of_free * by.bad) / (by.good + by.bad + few_known) - by.off -
                           price_of_depth * depth_m / behind_m - price_of_turn * std::abs(turn) - missed(mirror, touched_m);
      if (score > most) most = score, found = mirror;
    }
  }
  return found;
}

}  // namespace palpate::reconstruction
