// SPDX-License-Identifier: Apache-2.0
// Sums over cells of neighbours (TermRows::cell).
#pragma once

#include <algorithm>
#include <map>
#include <vector>

namespace palpate::estimation {

/// Sum and number of what is added to each cell. A table where the cells' numbers lie close, as those of a picture do: a tree asks ten
/// times as long.
class CellSums {
 public:
  struct Cell {
    double sum = 0;
    double count = 0;
  };
  explicit CellSums(const std::vector<int>& cells) {
    if (cells.empty()) return;
    const auto [low, high] = std::minmax_element(cells.begin(), cells.end());
    const long long range = 1LL + *high - *low;
    if (range > 8LL * static_cast<long long>(cells.size()) + 65536) return;
    first_ = *low;
    table_.resize(static_cast<std::size_t>(range));
  }
  void add(int cell, double value) {
    Cell& at = table_.empty() ? tree_[cell] : table_[static_cast<std::size_t>(cell - first_)];
    at.sum += value;
    at.count += 1;
  }
  /// Those to which something was added, by their numbers.
  template <class Visit>
  void for_each(const Visit& visit) const {
    for (const Cell& at : table_)
      if (at.count > 0) visit(at);
    for (const auto& [cell, at] : tree_) visit(at);
  }

 private:
  int first_ = 0;
  std::vector<Cell> table_;
  std::map<int, Cell> tree_;
};

}  // namespace palpate::estimation
