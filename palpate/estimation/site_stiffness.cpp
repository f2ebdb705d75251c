// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/site_stiffness.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>

#include "palpate/estimation/homogeneity.hpp"

namespace palpate::estimation {
namespace {

constexpr std::size_t most_sites = 6;

struct Site {
  std::string name;
  Vec3 at_m = Vec3::Zero();
  double radius_m = 0;
};

/// Where each push first touched.
std::vector<Site> places_of(const Recording& recording) {
  std::vector<Site> places;
  for (const Push& push : recording.pushes) {
    const std::size_t known = places.size();
    for (const Step& step : push.steps) {
      for (const Load& load : step.loads) {
        const auto tool = std::find_if(recording.tools.begin(), recording.tools.end(), [&](const Tool& each) { return each.name == load.tool; });
        const bool round = tool != recording.tools.end() && (tool->shape == ToolShape::sphere || tool->shape == ToolShape::disc);
        if (!round || !load.force_n || load.force_n->norm() == 0 || places.size() > known) continue;
        places.push_back({push.site.empty() ? push.name : push.site, load.contact_m, tool->radius_m});
      }
    }
  }
  return places;
}

}  // namespace

std::vector<Region> sites_pushed(const Recording& recording) {
  const std::vector<Site> places = places_of(recording);
  if (recording.regions.size() > 1 || places.empty()) return {};
  std::vector<std::size_t> chosen{0};
  std::vector<double> away_m(places.size(), std::numeric_limits<double>::infinity());
  while (chosen.size() < most_sites) {
    std::size_t furthest = 0;
    for (std::size_t p = 0; p < places.size(); ++p) {
      away_m[p] = std::min(away_m[p], (places[p].at_m - places[chosen.back()].at_m).norm());
      if (away_m[p] > away_m[furthest]) furthest = p;
    }
    if (!(away_m[furthest] > std::max(places[furthest].radius_m, 1e-3))) break;
    chosen.push_back(furthest);
  }
  if (chosen.size() < 2) return {};
  std::sort(chosen.begin(), chosen.end());
  std::vector<Region> regions;
  for (const std::size_t p : chosen) {
    Region& region = regions.emplace_back();
    region.name = places[p].name;
    region.select = RegionSelection::points;
    region.points_m = places[p].at_m.transpose();
  }
  return regions;
}

SiteStiffness site_stiffness(std::vector<std::string> sites, double first_log_young, const VectorX& log_ratio, MatrixX covariance) {
  // What no site knows of its contact is in every ratio twice: the site's own, and the first one's.
  const double own = contact_model_std * contact_model_std;
  covariance.array() += own;
  covariance.diagonal().array() += own;
  SiteStiffness out;
  out.sites = std::move(sites);
  out.log_young.resize(log_ratio.size() + 1);
  out.log_young << first_log_young, first_log_young + log_ratio.array();
  out.p_value = chi_square_tail(log_ratio.dot(covariance.ldlt().solve(log_ratio)), static_cast<int>(log_ratio.size()));
  return out;
}

}  // namespace palpate::estimation
