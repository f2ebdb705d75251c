// SPDX-License-Identifier: Apache-2.0
// Mean and scatter of torques that a robot may or may not tell. Inner header of the room.
#pragma once

#include <cmath>
#include <optional>
#include <vector>

#include "palpate/core/math.hpp"

namespace palpate::acquisition {

struct TorqueMean {
  Vec3 mean_nm = Vec3::Zero();
  double std_nm = 0;  ///< of one reading, per axis
  std::size_t count = 0;
  double mean_std_nm() const { return std_nm / std::sqrt(static_cast<double>(count)); }
};

/// Nothing where one of them was not measured.
inline std::optional<TorqueMean> torque_mean(const std::vector<std::optional<Vec3>>& torques_nm) {
  TorqueMean out;
  for (const auto& one : torques_nm) {
    if (!one) return std::nullopt;
    out.mean_nm += *one / static_cast<double>(torques_nm.size());
    ++out.count;
  }
  if (out.count < 2) return std::nullopt;
  double squares = 0;
  for (const auto& one : torques_nm) squares += (*one - out.mean_nm).squaredNorm() / 3;
  out.std_nm = std::sqrt(squares / static_cast<double>(out.count - 1));
  return out;
}

}  // namespace palpate::acquisition
