// SPDX-License-Identifier: Apache-2.0
// Pieces of YAML text. Numbers come back bit by bit; words are quoted, so that no name can break the file.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/core/math.hpp"
#include "palpate/core/recording.hpp"

namespace palpate::io {

inline std::string yaml_word(std::string_view text) {
  std::string out = "\"";
  for (const char letter : text) {
    if (letter == '"' || letter == '\\') out += '\\';
    if (static_cast<unsigned char>(letter) < 32 || letter == 127) {
      out += fmt::format("\\x{:02x}", static_cast<unsigned char>(letter));
    } else {
      out += letter;
    }
  }
  return out + '"';
}

inline std::string yaml_list(const double* values, std::size_t count) {
  return fmt::format("[{}]", fmt::join(values, values + count, ", "));
}
inline std::string yaml_vector(const Vec3& value) { return yaml_list(value.data(), 3); }

inline std::string yaml_pose(const Pose& pose) {
  std::string out = "[";
  for (int row = 0; row < 4; ++row) {
    const Eigen::RowVector4d values = pose.matrix().row(row);
    out += (row > 0 ? ", " : "") + yaml_list(values.data(), 4);
  }
  return out + "]";
}

/// A map on one line: {key: value, ...}; values are YAML already.
class YamlLine {
 public:
  YamlLine& put(std::string_view key, std::string_view value) {
    if (!text_.empty()) text_ += ", ";
    text_.append(key).append(": ").append(value);
    return *this;
  }
  YamlLine& number(std::string_view key, double value) { return put(key, fmt::format("{}", value)); }
  YamlLine& number_unless(double otherwise, std::string_view key, double value) {
    return value == otherwise ? *this : number(key, value);
  }
  YamlLine& word(std::string_view key, std::string_view value) { return put(key, yaml_word(value)); }
  YamlLine& vector(std::string_view key, const Vec3& value) { return put(key, yaml_vector(value)); }
  std::string str() const { return "{" + text_ + "}"; }

 private:
  std::string text_;
};

/// As read_depth_noise reads it.
inline std::string depth_noise_yaml(const DepthNoise& noise) {
  YamlLine line;
  line.word("model", noise.model);
  if (noise.model == "constant") line.number("sigma_m", noise.sigma_m);
  line.number_unless(0, "bias_std_m", noise.bias_std_m).number_unless(0, "shared_std_m", noise.shared_std_m);
  if (!std::isnan(noise.lens_scatter_std)) line.number("lens_scatter_std", noise.lens_scatter_std);
  return line.str();
}

}  // namespace palpate::io
