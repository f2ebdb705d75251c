// SPDX-License-Identifier: Apache-2.0
// The rules of docs/architecture.md as functions of text, so that they can be tested on made-up files too.
#pragma once

#include <cctype>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace architecture {

struct Room {
  std::set<std::string> may_include;  ///< "*" = everything
  bool may_open_files = false;
};
using Table = std::map<std::string, Room>;

inline std::string trimmed(const std::string& text) {
  const std::size_t first = text.find_first_not_of(" \t");
  if (first == std::string::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

inline std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, separator);) parts.push_back(trimmed(part));
  return parts;
}

/// The table between the marks `<!-- arrows -->` and `<!-- /arrows -->`.
inline Table read_table(const std::string& page) {
  Table table;
  const std::size_t begin = page.find("<!-- arrows -->"), end = page.find("<!-- /arrows -->");
  if (begin == std::string::npos || end == std::string::npos) return table;
  std::istringstream lines(page.substr(begin, end - begin));
  for (std::string line; std::getline(lines, line);) {
    const std::vector<std::string> cells = split(line, '|');
    if (cells.size() < 4 || cells[1] == "room" || cells[1].starts_with("---")) continue;
    Room room;
    for (const std::string& target : split(cells[2], ',')) {
      if (target != "-") room.may_include.insert(target);
    }
    room.may_open_files = cells[3] == "yes";
    table[cells[1]] = room;
  }
  return table;
}

/// "palpate/fem/statics.hpp" -> "fem"; "palpate/identify.hpp" -> "identify" (a door); "cli/session.hpp" -> "cli".
inline std::string room_of(const std::string& path) {
  const std::vector<std::string> parts = split(path, '/');
  if (parts.size() >= 2 && parts[0] == "palpate") {
    return parts.size() == 2 ? parts[1].substr(0, parts[1].find('.')) : parts[1];
  }
  return parts.empty() ? std::string() : parts[0];
}

/// Comments and string literals blanked out (their words are not code); include lines are kept as they are.
inline std::string code_only(const std::string& text) {
  std::string code;
  enum class In { plain, line_comment, block_comment, string, character } in = In::plain;
  bool include_line = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i], next = i + 1 < text.size() ? text[i + 1] : '\0';
    if (c == '\n') {
      if (in == In::line_comment) in = In::plain;
      include_line = text.compare(i + 1, 8, "#include") == 0;
      code += c;
    } else if (in == In::plain) {
      if (c == '/' && next == '/') {
        in = In::line_comment;
      } else if (c == '/' && next == '*') {
        in = In::block_comment;
      } else if (c == '"' && !include_line) {
        in = In::string;
      } else if (c == '\'' && (i == 0 || !std::isalnum(static_cast<unsigned char>(text[i - 1])))) {
        in = In::character;
      } else {
        code += c;
      }
    } else if (in == In::block_comment) {
      if (c == '*' && next == '/') in = In::plain, ++i;
    } else if (in == In::string || in == In::character) {
      if (c == '\\') ++i;
      if (c == (in == In::string ? '"' : '\'')) in = In::plain, code += ' ';
    }
  }
  return code;
}

inline std::vector<std::string> violations(const std::string& path, const std::string& text, const Table& table) {
  std::vector<std::string> found;
  const std::string room = room_of(path);
  const auto row = table.find(room);
  if (row == table.end()) return {path + ": room `" + room + "` is not in the table of docs/architecture.md"};
  const Room& rules = row->second;
  const bool front = rules.may_include.contains("*");
  if (text.substr(0, 400).find("SPDX-License-Identifier: Apache-2.0") == std::string::npos) {
    found.push_back(path + ": no SPDX line on top");
  }
  const std::string code = code_only("\n" + text);

  static const std::regex own_include(R"re(#include\s*"([^"]+)")re");
  for (std::sregex_iterator it(code.begin(), code.end(), own_include), end; it != end; ++it) {
    const std::string target_path = (*it)[1], target = room_of(target_path);
    if (target == room || front) continue;
    if (!rules.may_include.contains(target))
      found.push_back(path + ": arrow " + room + " -> " + target + " (" + target_path + ")");
  }

  struct Rule {
    const char* pattern;
    const char* why;
    bool files_only;  ///< allowed in rooms that may open files
  };
  static const std::vector<Rule> forbidden = {
      // sys/mman.h also says what pages memory should have; what maps files is found by name.
      {R"(#include\s*<(fstream|cstdio|stdio\.h|filesystem|unistd\.h|fcntl\.h|sys/(?!mman\.h)[a-z]+\.h)>)", "opens files", true},
      {R"(\b(fopen|ofstream|ifstream|fprintf|fwrite|mmap|shm_open)\b)", "opens files", true},
      {R"(#include\s*<(iostream|print)>)", "prints", false},
      {R"(\bstd::(cout|cerr|clog)\b|\b(printf|puts|putchar|perror)\s*\(|\bfmt::print\b)", "prints", false},
      {R"(\b(abort|_exit|quick_exit)\s*\(|\bstd::(exit|terminate)\b|\bassert\s*\()", "ends the program", false},
      {R"(\b[a-z_]+_clock::now\b|\btime\s*\(\s*(NULL|nullptr|0)\s*\))", "reads a clock", false},
      {R"(\b(getenv|setenv|setlocale)\b)", "reads the environment", false},
      {R"(\brandom_device\b|\b(srand|rand)\s*\()", "draws unseeded random numbers", false},
  };
  // The lab's truths are no answer to be believed by its own solver's promises; whoever estimates, predicts or plans asks a Response.
  static const std::regex solver(R"(\bfem::(Statics|ContactStatics|LinearResponse|LoadingBranch)\b)");
  if (std::smatch match; room != "lab" && room != "fem" && std::regex_search(code, match, solver))
    found.push_back(path + ": sees more of the solver than fem::Response (`" + match.str() + "`)");
  if (!front) {
    for (const Rule& rule : forbidden) {
      if (rule.files_only && rules.may_open_files) continue;
      std::smatch match;
      if (std::regex_search(code, match, std::regex(rule.pattern))) {
        found.push_back(path + ": " + rule.why + " (`" + match.str() + "`) in room `" + room + "`");
      }
    }
  }
  return found;
}

/// Rooms on a cycle of the table, if any ("fronts" with * do not count as targets of anything).
inline std::vector<std::string> rooms_on_a_cycle(const Table& table) {
  std::set<std::string> left;
  for (const auto& [name, room] : table) left.insert(name);
  for (bool removed = true; removed;) {  // peel off rooms whose targets are all gone
    removed = false;
    for (auto it = left.begin(); it != left.end();) {
      bool free = true;
      for (const std::string& target : table.at(*it).may_include) free = free && !left.contains(target);
      it = free ? (removed = true, left.erase(it)) : std::next(it);
    }
  }
  return {left.begin(), left.end()};
}

}  // namespace architecture
