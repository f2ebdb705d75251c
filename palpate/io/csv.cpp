// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/csv.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/core/error.hpp"
#include "palpate/io/scanner.hpp"

namespace palpate::io {
namespace {

std::vector<std::string> split(std::string_view line) {
  std::vector<std::string> cells;
  for (std::size_t at = 0;;) {
    const std::size_t comma = std::min(line.find(',', at), line.size());
    std::string_view cell = trimmed(line.substr(at, comma - at));
    if (cell.size() >= 2 && cell.front() == '"' && cell.back() == '"') cell = cell.substr(1, cell.size() - 2);
    cells.emplace_back(cell);
    if (comma == line.size()) return cells;
    at = comma + 1;
  }
}

}  // namespace

CsvTable CsvTable::parse(std::string_view bytes, std::string name) {
  CsvTable table;
  table.name_ = name;
  if (bytes.substr(0, 3) == "\xEF\xBB\xBF") bytes.remove_prefix(3);  // the byte order mark that spreadsheets write
  Scanner scanner(bytes, std::move(name));
  for (std::size_t line_number = 1; scanner.remaining() > 0; ++line_number) {
    const std::string_view line = trimmed(scanner.line());
    if (line.empty() || line.front() == '#') continue;
    const std::string where = table.name_ + ":" + std::to_string(line_number);
    std::vector<std::string> cells = split(line);
    if (table.columns_.empty()) {
      for (std::size_t i = 0; i < cells.size(); ++i) {
        if (cells[i].empty()) throw Error("column " + std::to_string(i + 1) + " of the header has no name", where);
        if (parse_number(cells[i])) throw Error("the first line must name the columns, it holds numbers", where);
        if (std::find(cells.begin(), cells.begin() + static_cast<std::ptrdiff_t>(i), cells[i]) !=
            cells.begin() + static_cast<std::ptrdiff_t>(i)) {
          throw Error("column '" + cells[i] + "' is there twice; remove one", where);
        }
      }
      table.columns_ = std::move(cells);
    } else {
      if (cells.size() != table.columns_.size()) {
        throw Error("has " + std::to_string(cells.size()) + " cells, the header names " +
                        std::to_string(table.columns_.size()) + "; the row is cut off or has a comma too many",
                    where);
      }
      table.cells_.push_back(std::move(cells));
      table.lines_.push_back(line_number);
    }
  }
  if (table.columns_.empty()) throw Error("is empty; a header line that names the columns is expected", table.name_);
  if (table.cells_.empty()) throw Error("has a header but no row", table.name_);
  return table;
}

std::optional<std::size_t> CsvTable::find(std::string_view column) const {
  const auto found = std::find(columns_.begin(), columns_.end(), column);
  if (found == columns_.end()) return std::nullopt;
  return static_cast<std::size_t>(found - columns_.begin());
}

double CsvTable::number(std::size_t row, std::size_t column) const {
  const std::string& text = cells_[row][column];
  const auto value = parse_number(text);
  if (text.empty()) throw Error("the cell is empty, a number is needed", where(row, column));
  if (!value)
    throw Error("'" + text.substr(0, 40) + "' is not a number; write the number only, the unit is in the column's name",
                where(row, column));
  if (!std::isfinite(*value))
    throw Error("is " + text + ", not a finite number; measure it or remove the row", where(row, column));
  return *value;
}

std::string CsvTable::where(std::size_t row) const { return name_ + ":" + std::to_string(lines_[row]); }
std::string CsvTable::where(std::size_t row, std::size_t column) const { return where(row) + ": " + columns_[column]; }

std::vector<Index> parse_indices(std::string_view bytes, const std::string& name) {
  std::vector<Index> result;
  Scanner scanner(bytes, name);
  bool header_allowed = true;
  for (std::size_t line_number = 1; scanner.remaining() > 0; ++line_number) {
    std::string_view line = scanner.line();
    line = trimmed(line.substr(0, line.find('#')));
    if (line.empty()) continue;
    const std::size_t before = result.size();
    bool words_only = true;
    std::string_view wrong;
    while (!line.empty()) {
      const std::size_t end = std::min(line.find_first_of(", \t;"), line.size());
      const std::string_view text = line.substr(0, end);
      line.remove_prefix(std::min(end + 1, line.size()));
      if (text.empty()) continue;
      const auto value = parse_whole(text);
      if (parse_number(text)) words_only = false;
      if (value && *value >= 0 && *value <= std::numeric_limits<Index>::max()) {
        result.push_back(static_cast<Index>(*value));
      } else {
        wrong = text;
      }
    }
    if (!wrong.empty() && !(header_allowed && words_only)) {
      throw Error("'" + std::string(wrong.substr(0, 40)) + "' is not a 0-based index (a whole number, not negative)",
                  name + ":" + std::to_string(line_number));
    }
    if (!wrong.empty()) result.resize(before);
    header_allowed = false;
  }
  if (result.empty()) throw Error("holds no index", name);
  return result;
}

}  // namespace palpate::io
