// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/static_scatter.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "palpate/sensing/observe.hpp"

namespace palpate::sensing {
namespace {

bool is_unloaded(const Step& step) {
  return std::none_of(step.loads.begin(), step.loads.end(), [](const Load& load) {
    return (load.force_n && load.force_n->norm() > 0) || (load.travel_m && *load.travel_m != 0);
  });
}

/// Standard deviation of what does not belong to the few that something has moved at.
/// @param values  in stated standard deviations
double spread_of_most(const std::vector<double>& values) {
  constexpr double cut = 4;  // standard deviations: of Gaussian ones it leaves all but one in ten thousand
  std::vector<double> size;
  for (const double value : values) size.push_back(std::abs(value));
  const auto middle = size.begin() + static_cast<std::ptrdiff_t>(size.size() * 68 / 100);
  std::nth_element(size.begin(), middle, size.end());
  double spread = *middle;
  for (int round = 0; round < 20; ++round) {
    double squares = 0;
    std::size_t count = 0;
    for (const double one : size)
      if (one <= cut * spread || spread == 0) squares += one * one, ++count;
    const double next = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(count, 1)));
    if (std::abs(next - spread) <= 1e-6 * spread) return next;
    spread = next;
  }
  return spread;
}

bool same_place(const DepthFrame& a, const DepthFrame& b) {
  constexpr double same = 1e-6;  // m, and of a rotation's entries
  return a.camera.width_px == b.camera.width_px && a.camera.height_px == b.camera.height_px && a.camera.fx_px == b.camera.fx_px &&
         (a.T_base_camera.matrix() - b.T_base_camera.matrix()).cwiseAbs().maxCoeff() < same;
}

std::map<std::pair<Index, Index>, Index> by_pixel(const RayCloud& rays) {
  std::map<std::pair<Index, Index>, Index> places;
  for (Index i = 0; i < rays.pixel.rows(); ++i) places[{rays.pixel(i, 0), rays.pixel(i, 1)}] = i;
  return places;
}

void add_depth(const Recording& recording, std::vector<StaticScatter>& out) {
  std::vector<std::vector<const DepthFrame*>> places;
  for (const Push& push : recording.pushes)
    for (const Step& step : push.steps) {
      if (!is_unloaded(step)) continue;
      for (const Observation& observation : step.observations) {
        const auto* frame = std::get_if<DepthFrame>(&observation);
        if (frame == nullptr) continue;
        const auto place = std::find_if(places.begin(), places.end(), [&](const auto& all) { return same_place(*all[0], *frame); });
        place == places.end() ? places.push_back({frame}) : place->push_back(frame);
      }
    }
  StaticScatter depth{"depth", "m"};
  std::vector<double> off;
  double stated_squares = 0;
  for (const auto& frames : places) {
    if (frames.size() < 2) continue;
    depth.repeats += frames.size();
    RayCloud before = observe(*frames[0], recording.environment);
    for (std::size_t f = 1; f < frames.size(); ++f) {
      RayCloud now = observe(*frames[f], recording.environment);
      const auto known = by_pixel(before);
      for (Index i = 0; i < now.range_m.size(); ++i) {
        const auto other = known.find({now.pixel(i, 0), now.pixel(i, 1)});
        if (other == known.end()) continue;
        const double variance = std::pow(now.sigma_m(i), 2) + std::pow(before.sigma_m(other->second), 2);
        if (!(variance > 0)) continue;
        off.push_back((now.range_m(i) - before.range_m(other->second)) / std::sqrt(variance));
        stated_squares += variance / 2;
      }
      before = std::move(now);
    }
  }
  if (off.empty()) return;
  depth.differences = off.size();
  depth.ratio = spread_of_most(off);
  depth.stated = std::sqrt(stated_squares / static_cast<double>(off.size()));
  depth.measured = depth.ratio * depth.stated;
  out.push_back(depth);
}

void add_force(const Recording& recording, std::vector<StaticScatter>& out) {
  StaticScatter force{"wrench force", "N"};
  double squares = 0, stated_squares = 0;
  std::size_t readings = 0;
  for (const Push& push : recording.pushes) {
    std::map<std::string, std::vector<const Wrench*>> of_tool;
    for (const Step& step : push.steps) {
      if (!is_unloaded(step)) continue;
      for (const Observation& observation : step.observations)
        if (const auto* wrench = std::get_if<Wrench>(&observation); wrench != nullptr && wrench->force_sigma_n > 0)
          of_tool[wrench->tool].push_back(wrench);
    }
    // The zero is each push's own.
    for (const auto& [tool, all] : of_tool) {
      if (all.size() < 2) continue;
      force.repeats += all.size();
      const bool one_axis = all[0]->along.norm() > 0;
      Vec3 mean = Vec3::Zero();
      for (const Wrench* one : all) mean += one->force_n / static_cast<double>(all.size());
      for (const Wrench* one : all) {
        const Vec3 off = (one->force_n - mean) / one->force_sigma_n;
        squares += one_axis ? std::pow(off.dot(one->along), 2) : off.squaredNorm();
        stated_squares += std::pow(one->force_sigma_n, 2);
        ++readings;
      }
      force.differences += (all.size() - 1) * (one_axis ? 1 : 3);
    }
  }
  if (force.differences == 0) return;
  force.ratio = std::sqrt(squares / static_cast<double>(force.differences));
  force.stated = std::sqrt(stated_squares / static_cast<double>(readings));
  force.measured = force.ratio * force.stated;
  out.push_back(force);
}

}  // namespace

bool StaticScatter::doubtful() const {
  constexpr double matters = 1.25, by_chance = 3;  // standard deviations of a standard deviation: 1 / sqrt(2 n)
  const double chance = by_chance / std::sqrt(2 * static_cast<double>(differences));
  return ratio > std::max(matters, 1 + chance) || ratio < std::min(1 / matters, 1 - chance);
}

std::vector<StaticScatter> static_scatter(const Recording& recording) {
  std::vector<StaticScatter> out;
  add_depth(recording, out);
  add_force(recording, out);
  return out;
}

}  // namespace palpate::sensing
