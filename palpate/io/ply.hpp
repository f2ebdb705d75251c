// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/core/math.hpp"

namespace palpate::io {

/// One element kind of a PLY file ("vertex", "face"): scalar properties as columns, list properties as lists.
struct PlyElement {
  std::string name;
  std::vector<std::string> scalars;
  MatrixX values;  ///< rows x scalars
  std::vector<std::string> lists;
  std::vector<std::vector<std::vector<Index>>> list_values;  ///< [list][row]
  std::size_t rows = 0;
  std::optional<Eigen::Index> column(std::string_view property) const;
};

/// PLY 1.0: ascii, binary_little_endian, binary_big_endian. Throws Error naming file and line.
std::vector<PlyElement> parse_ply(std::string_view bytes, const std::string& name);

}  // namespace palpate::io
