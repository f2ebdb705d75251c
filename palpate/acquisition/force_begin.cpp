// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/force_begin.hpp"

#include <algorithm>
#include <limits>

namespace palpate::acquisition {

double force_began_before_m(std::span<const sensing::ContactSample> samples, const Vec3& noticed_m, const Vec3& direction,
                            const ForceBeginSearch& search) {
  double best_m = 0, least_squares = std::numeric_limits<double>::infinity();
  const auto look = [&](double least_m, double most_m, double step_m) {
    for (double late_m = least_m; late_m < most_m; late_m += step_m) {
      double products = 0, squares = 0, total = 0;
      for (const auto& s : samples) {
        const double force = direction.dot(s.force_n), beyond = std::max(0.0, direction.dot(s.tip_m - noticed_m) + late_m);
        products += force * beyond;
        squares += beyond * beyond;
        total += force * force;
      }
      const double left = squares > 0 ? total - products * products / squares : total;
      if (left >= least_squares) continue;
      least_squares = left;
      best_m = late_m;
    }
  };
  const double step_m = 0.1 * search.increment_m;
  look(-2 * step_m, search.farthest_m, step_m);
  // What is left up to a limit may be a motion of next to nothing.
  const double finer_m = std::max(0.1 * search.finest_m, 0.02 * step_m);
  if (finer_m < step_m) look(best_m - 2 * step_m, best_m + 2 * step_m, finer_m);
  return best_m;
}

}  // namespace palpate::acquisition
