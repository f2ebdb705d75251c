// SPDX-License-Identifier: Apache-2.0
// The vector that the fit moves: log E, nu, log ratios of regions and Poisson ratios of their own, then every nuisance with its prior.
// One entry a scalar.
#pragma once

#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "palpate/core/math.hpp"

namespace palpate::estimation {

struct Unknown {
  std::string name;
  std::string unit;
  double prior_mean = 0;
  double prior_std = std::numeric_limits<double>::infinity();  ///< infinity: flat
  double lower = -std::numeric_limits<double>::infinity();
  double upper = std::numeric_limits<double>::infinity();
  bool fixed = false;
};

/// Indices of the parameters that everything is about. With regions log E is that of the first one, and those from
/// `first_ratio` on are log (E of a further region / E of the first).
inline constexpr int log_young = 0;
inline constexpr int poisson = 1;
inline constexpr int first_ratio = 2;

class Unknowns {
 public:
  int add(Unknown unknown) {
    entries_.push_back(std::move(unknown));
    return static_cast<int>(entries_.size()) - 1;
  }
  /// Adds `count` entries that share a prior; suffixes name them. Returns the first index, or -1 when prior_std is 0.
  int add_block(const std::string& name, const std::string& unit, double prior_std, const std::vector<std::string>& suffixes) {
    if (!(prior_std > 0)) return -1;
    const int first = size();
    for (const auto& suffix : suffixes) add({name + suffix, unit, 0, prior_std});
    return first;
  }
  /// The ratios of `count` further regions; right after log E and nu. Their prior is wide, and keeps a region that no push
  /// reaches from drifting off.
  static constexpr double ratio_prior_std = 2.3;  ///< a factor of ten
  void add_ratios(const std::vector<std::string>& regions) {
    for (const auto& region : regions) add({"log_young_ratio[" + region + "]", "1", 0, ratio_prior_std});
    ratios_ = static_cast<int>(regions.size());
  }
  int ratio_count() const { return ratios_; }
  /// Poisson ratios of the same further regions, where they have their own; right after the ratios. A normal prior with the mean and
  /// the standard deviation of the uniform one between these bounds, which are kept.
  void add_own_poisson(const std::vector<std::string>& regions, double lower, double upper) {
    for (const auto& region : regions)
      add({"poisson_ratio[" + region + "]", "1", 0.5 * (lower + upper), (upper - lower) / std::sqrt(12.0), lower, upper});
    own_poisson_ = static_cast<int>(regions.size());
  }
  int own_poisson_count() const { return own_poisson_; }
  int first_own_poisson() const { return first_ratio + ratios_; }
  std::vector<int> ratios() const {
    std::vector<int> all(static_cast<std::size_t>(ratios_));
    std::iota(all.begin(), all.end(), first_ratio);
    return all;
  }
  /// Indices of those of these names that there are.
  std::vector<int> named(const std::vector<std::string>& names) const {
    std::vector<int> found;
    for (const auto& name : names) {
      for (int k = 0; k < size(); ++k)
        if ((*this)[k].name == name) found.push_back(k);
    }
    return found;
  }
  /// log E, nu, the ratios and the regions' own nu: what is asked for; everything from here on is a nuisance.
  int parameter_count() const { return first_ratio + ratios_ + own_poisson_; }
  int size() const { return static_cast<int>(entries_.size()); }
  const Unknown& operator[](int i) const { return entries_[static_cast<std::size_t>(i)]; }
  Unknown& operator[](int i) { return entries_[static_cast<std::size_t>(i)]; }
  VectorX prior_mean() const {
    VectorX mean(size());
    for (int i = 0; i < size(); ++i) mean(i) = (*this)[i].prior_mean;
    return mean;
  }

 private:
  std::vector<Unknown> entries_;
  int ratios_ = 0, own_poisson_ = 0;
};

}  // namespace palpate::estimation
