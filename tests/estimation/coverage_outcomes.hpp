// SPDX-License-Identifier: Apache-2.0
// What came of the recordings of the coverage table: counted, held to its limits, kept in files.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <tuple>
#include <utility>

#include "estimation/coverage_rows.hpp"

namespace palpate::coverage {

/// Errors of one number over many recordings.
struct Tally {
  int count = 0, in_68 = 0, in_95 = 0, foreseen = 0;
  double error = 0, squares = 0, bounds2 = 0, stated = 0, pulls = 0, normed = 0, normed_foreseen = 0;

  /// @param at_best  the Cramer-Rao bound of this recording
  /// @param nu_is_foreseen  the bound says that nu can be determined: only there the error is held to the bound
  static Tally of(double off, double std, double at_best, bool inside_68, bool inside_95, bool nu_is_foreseen) {
    const double share = off * off / (at_best * at_best);
    return {1, inside_68, inside_95, nu_is_foreseen, off, off * off, at_best * at_best, std, off / std, share, nu_is_foreseen ? share : 0};
  }
  void add(const Tally& other) {
    count += other.count, in_68 += other.in_68, in_95 += other.in_95, foreseen += other.foreseen;
    error += other.error, squares += other.squares, bounds2 += other.bounds2, stated += other.stated;
    pulls += other.pulls, normed += other.normed, normed_foreseen += other.normed_foreseen;
  }
  /// One line of a file, without its end.
  void write(std::ostream& out) const {
    out << count << ' ' << in_68 << ' ' << in_95 << ' ' << foreseen;
    for (double value : {error, squares, bounds2, stated, pulls, normed, normed_foreseen}) out << ' ' << value;
  }
  bool read(std::istream& in) {
    in >> count >> in_68 >> in_95 >> foreseen;
    for (double* value : {&error, &squares, &bounds2, &stated, &pulls, &normed, &normed_foreseen}) in >> *value;
    return bool(in);
  }
  double rms() const { return std::sqrt(squares / count); }
  double over_bound() const { return std::sqrt(normed / count); }
  double over_bound_foreseen() const { return std::sqrt(normed_foreseen / foreseen); }
  void print(const std::string& scene, const std::string& row, const char* what, double unit) const {
    const double n = count;
    std::printf("| %-11s | %-10s | %-2s | %4d | %5.1f | %5.1f | %+6.2f | %+8.4f | %7.4f | %7.4f | %7.4f | %4.2f |\n", scene.c_str(),
                row.c_str(), what, count, 100 * in_68 / n, 100 * in_95 / n, pulls / n, unit * error / n, unit * rms(),
                unit * std::sqrt(bounds2 / n), unit * stated / n, over_bound());
    std::fflush(stdout);
  }
};

/// As many hits as binomial chance gives.
inline bool fair(int hits, int count, double nominal, double deviations) {
  return std::abs(hits - nominal * count) <= deviations * std::sqrt(count * nominal * (1 - nominal)) + 0.5;
}

/// What a row must be, all its scenes together. Root mean squares and biases of few recordings scatter: three of their standard
/// deviations are allowed on top, a tenth of the limit at 1600.
inline void judge(const Row& row, const char* what, const Tally& all, double rms_limit) {
  const double deviations = all.count >= 1600 ? 3 : 4, n = all.count;
  const std::string name = row.name + " " + what;
  EXPECT_TRUE(fair(all.in_95, all.count, 0.95, deviations)) << name << ": " << all.in_95 << " of " << all.count;
  EXPECT_TRUE(fair(all.in_68, all.count, 0.68, deviations)) << name << ": " << all.in_68 << " of " << all.count;
  EXPECT_LT(std::abs(all.pulls / n), 0.3 + 3 / std::sqrt(n)) << name << ": bias in standard deviations";
  const double over_bound = row.outlier_share > 0 ? 1.25 : 1.1;
  if (all.foreseen > 0) {
    EXPECT_LT(all.over_bound_foreseen(), over_bound * (1 + 3 / std::sqrt(2.0 * all.foreseen))) << name << ": rms over the Cramer-Rao bound";
  }
  if (rms_limit > 0) {
    EXPECT_LT(all.rms(), rms_limit * (1 + 3 / std::sqrt(2 * n))) << name << ": rms";
  }
}

/// What came of one recording.
struct Outcome {
  Tally young, poisson;
  bool by_calculix = false;
};

/// Outcomes of earlier runs, a line each, so that a table of hours can be stopped and made in pieces. Of one version of the code: the
/// file does not know of which. docs/coverage keeps those that docs/uncertainty.md tells of.
class Outcomes {
 public:
  using Key = std::tuple<std::string, std::string, int>;  // scene, row, seed

  Outcomes() = default;
  /// @param file  need not exist, and is added to; "": nothing is kept
  explicit Outcomes(std::string file) : file_(std::move(file)) { read(file_); }

  void read(const std::filesystem::path& file) {
    std::ifstream in(file);
    for (std::string line; std::getline(in, line);) {
      std::istringstream words(line);
      std::string scene, row;
      int seed = 0;
      Outcome outcome;
      if (words >> scene >> row >> seed >> outcome.by_calculix && outcome.young.read(words) && outcome.poisson.read(words))
        known_[{scene, row, seed}] = outcome;
    }
  }
  const std::map<Key, Outcome>& all() const { return known_; }
  const Outcome* find(const std::string& scene, const std::string& row, int seed) const {
    const auto found = known_.find({scene, row, seed});
    return found == known_.end() ? nullptr : &found->second;
  }
  void keep(const std::string& scene, const std::string& row, int seed, const Outcome& outcome) const {
    if (file_.empty()) return;
    std::ostringstream line;
    line << scene << ' ' << row << ' ' << seed << ' ' << outcome.by_calculix << ' ';
    outcome.young.write(line);
    line << ' ';
    outcome.poisson.write(line);
    std::ofstream(file_, std::ios::app) << line.str() << '\n';
  }

 private:
  std::string file_;
  std::map<Key, Outcome> known_;
};

}  // namespace palpate::coverage
