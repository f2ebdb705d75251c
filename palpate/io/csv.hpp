// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/core/math.hpp"

namespace palpate::io {

/// A CSV file with one header line. Cells stay text until somebody asks for them by column.
class CsvTable {
 public:
  /// Comma separated; `#` lines and empty lines are skipped. Throws Error on no header, no row, a doubled column, a row of
  /// another length.
  static CsvTable parse(std::string_view bytes, std::string name);

  std::size_t rows() const { return cells_.size(); }
  const std::vector<std::string>& columns() const { return columns_; }
  bool has(std::string_view column) const { return find(column).has_value(); }
  std::optional<std::size_t> find(std::string_view column) const;
  const std::string& cell(std::size_t row, std::size_t column) const { return cells_[row][column]; }
  /// A finite number; throws Error naming file, line and column.
  double number(std::size_t row, std::size_t column) const;
  std::string where(std::size_t row) const;                      ///< "file:line"
  std::string where(std::size_t row, std::size_t column) const;  ///< "file:line: column"
  const std::string& name() const { return name_; }

 private:
  std::string name_;
  std::vector<std::string> columns_;
  std::vector<std::vector<std::string>> cells_;
  std::vector<std::size_t> lines_;
};

/// Whole numbers separated by commas, blanks or new lines; `#` starts a comment; one header line of words is skipped.
std::vector<Index> parse_indices(std::string_view bytes, const std::string& name);

}  // namespace palpate::io
