// SPDX-License-Identifier: Apache-2.0
// solve_deck DECK RESULT [--tolerance T] [--method automatic|direct|mixed|iterative] [--threads N] [--passes N]
// One linear static analysis as a whole process, from a CalculiX input deck (NODE, ELEMENT C3D4 or C3D10, BOUNDARY by node,
// ELASTIC, CLOAD) to a table of displacements: what compare_solvers.py times against other programs. Prints seconds of CPU a
// stage as JSON. With more passes than one it assembles and solves as often, and the last pass counts: what an analysis takes in a
// process that has touched its memory before.
#include <sys/resource.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/core/process_heap.hpp"
#include "palpate/fem/assembly.hpp"
#include "palpate/fem/linear_solver.hpp"
#include "palpate/fem/linear_solver/large_array.hpp"

namespace palpate {
namespace {

double cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

struct Deck {
  TetMesh mesh;
  std::vector<char> held;  // of unknowns
  VectorX load;
  double young_pa = 0, poisson = 0;
};

Deck read_deck(const char* path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw Error("cannot be opened", path);
  file.seekg(0, std::ios::end);
  std::string text(static_cast<std::size_t>(std::max<std::streamoff>(0, file.tellg())), ' ');
  file.seekg(0);
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  std::vector<double> points, elastic;
  std::vector<Index> elements;
  std::vector<std::pair<Index, int>> held;
  std::vector<std::pair<Index, double>> load;
  int nodes_per_element = 4;
  std::string section;
  double field[16];
  const char* at = text.data();
  const char* const end = at + text.size();
  while (at < end) {
    const char* line_end = static_cast<const char*>(std::memchr(at, '\n', static_cast<std::size_t>(end - at)));
    if (line_end == nullptr) line_end = end;
    if (*at == '*') {
      if (at + 1 < end && at[1] != '*') {
        section.assign(at, line_end);
        for (char& c : section) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
        if (section.starts_with("*ELEMENT")) nodes_per_element = section.find("C3D10") != std::string::npos ? 10 : 4;
      }
    } else {
      int count = 0;
      for (const char* p = at; p < line_end && count < 16;) {
        while (p < line_end && (*p == ' ' || *p == ',')) ++p;
        const auto [next, error] = std::from_chars(p, line_end, field[count]);
        if (error != std::errc()) break;
        ++count;
        p = next;
      }
      if (section.starts_with("*NODE") && !section.starts_with("*NODE ") && count >= 4) {
        points.insert(points.end(), field + 1, field + 4);
      } else if (section.starts_with("*ELEMENT") && count == nodes_per_element + 1) {
        for (int i = 1; i < count; ++i) elements.push_back(static_cast<Index>(field[i]) - 1);
      } else if (section.starts_with("*BOUNDARY") && count >= 3) {
        for (int axis = static_cast<int>(field[1]); axis <= static_cast<int>(field[2]); ++axis) {
          held.emplace_back(static_cast<Index>(field[0]) - 1, axis - 1);
        }
      } else if (section.starts_with("*ELASTIC") && count >= 2) {
        elastic.assign(field, field + 2);
      } else if (section.starts_with("*CLOAD") && count >= 3) {
        load.emplace_back(3 * (static_cast<Index>(field[0]) - 1) + static_cast<Index>(field[1]) - 1, field[2]);
      }
    }
    at = line_end + 1;
  }
  if (points.empty() || elements.empty() || elastic.empty()) throw Error("needs NODE, ELEMENT and ELASTIC", path);
  Deck deck;
  deck.mesh.nodes_m = Eigen::Map<Points>(points.data(), static_cast<Eigen::Index>(points.size() / 3), 3);
  deck.mesh.tetrahedra = Eigen::Map<Tetrahedra>(
      elements.data(), static_cast<Eigen::Index>(elements.size()) / nodes_per_element, nodes_per_element);
  deck.held.assign(points.size(), 0);
  for (const auto& [node, axis] : held) deck.held[3 * static_cast<std::size_t>(node) + static_cast<std::size_t>(axis)] = 1;
  deck.load = VectorX::Zero(static_cast<Eigen::Index>(points.size()));
  for (const auto& [unknown, force] : load) deck.load[unknown] += force;
  deck.young_pa = elastic[0];
  deck.poisson = elastic[1];
  return deck;
}

/// Lower triangle of the unknowns that are not held.
Eigen::SparseMatrix<double> free_part(const fem::BlockPattern& pattern, const fem::BlockValues& blocks, const Deck& deck,
                                      std::vector<Index>& unknowns) {
  std::vector<Index> number(deck.held.size(), -1);
  for (std::size_t u = 0; u < number.size(); ++u) {
    if (deck.held[u]) continue;
    number[u] = static_cast<Index>(unknowns.size());
    unknowns.push_back(static_cast<Index>(u));
  }
  const auto free_of = [&](Index node) {
    const char* const held = &deck.held[3 * static_cast<std::size_t>(node)];
    return 3 - (held[0] + held[1] + held[2]);
  };
  const auto n = static_cast<Index>(unknowns.size());
  Eigen::SparseMatrix<double> lower(n, n);
  Index entries = 0;
  for (Index node = 0; node < pattern.nodes; ++node) {
    const Index columns = free_of(node);
    const Index *p = &pattern.row[static_cast<std::size_t>(pattern.column_start[static_cast<std::size_t>(node)])],
                *const last = pattern.row.data() + pattern.column_start[static_cast<std::size_t>(node) + 1];
    entries += columns * (columns + 1) / 2;
    for (++p; p < last; ++p) entries += columns * free_of(*p);
  }
  lower.resizeNonZeros(entries);
  fem::ask_for_large_pages(lower.valuePtr(), static_cast<std::size_t>(entries) * sizeof(double));
  fem::ask_for_large_pages(lower.innerIndexPtr(), static_cast<std::size_t>(entries) * sizeof(Index));
  Index* inner = lower.innerIndexPtr();
  double* value = lower.valuePtr();
  for (Index column = 0; column < n; ++column) {
    const Index node = unknowns[static_cast<std::size_t>(column)] / 3, c = unknowns[static_cast<std::size_t>(column)] % 3;
    for (Index p = pattern.column_start[static_cast<std::size_t>(node)];
         p < pattern.column_start[static_cast<std::size_t>(node) + 1]; ++p) {
      const Index row = pattern.row[static_cast<std::size_t>(p)];
      for (Index r = row == node ? c : 0; r < 3; ++r) {
        const Index reduced = number[static_cast<std::size_t>(3 * row + r)];
        if (reduced < 0) continue;
        *inner++ = reduced;
        *value++ = blocks[9 * static_cast<std::size_t>(p) + static_cast<std::size_t>(3 * c + r)];
      }
    }
    lower.outerIndexPtr()[column + 1] = static_cast<Index>(inner - lower.innerIndexPtr());
  }
  return lower;
}

int run(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: solve_deck DECK RESULT [--tolerance T] [--method NAME] [--threads N] [--passes N]\n");
    return 2;
  }
  fem::LinearSolver::Options options;
  options.tolerance = 1e-8;
  int passes = 1;
  for (int i = 3; i + 1 < argc; i += 2) {
    const std::string name = argv[i], value = argv[i + 1];
    if (name == "--tolerance") options.tolerance = std::stod(value);
    if (name == "--threads") options.threads = std::stoi(value);
    if (name == "--passes") passes = std::max(1, std::stoi(value));
    for (const auto method : {fem::LinearMethod::direct, fem::LinearMethod::mixed, fem::LinearMethod::iterative}) {
      if (name == "--method" && value == fem::name_of(method)) options.method = method;
    }
  }
  std::map<std::string, double> seconds;
  double last = cpu_seconds();
  const auto stage = [&](const char* name) {
    const double now = cpu_seconds();
    seconds[name] = now - last;
    last = now;
  };
  const Deck deck = read_deck(argv[1]);
  stage("read");
  const fem::Assembly assembly(deck.mesh);
  stage("pattern");
  std::vector<Index> unknowns;
  MatrixX x;
  fem::LinearSolver::Outcome outcome;
  for (int pass = 0; pass < passes; ++pass) {
    unknowns.clear();
    fem::BlockValues blocks;
    assembly.tangent(fem::material_law("linear"), fem::moduli(deck.young_pa, deck.poisson), VectorX::Zero(deck.load.size()),
                     blocks);
    const Eigen::SparseMatrix<double> lower = free_part(assembly.pattern(), blocks, deck, unknowns);
    fem::BlockValues().swap(blocks);
    stage("assemble");
    const auto n = static_cast<Eigen::Index>(unknowns.size());
    fem::UnknownPlacement placement{Points(n, 3), Points::Zero(n, 3)};
    x.resize(n, 1);
    for (Eigen::Index u = 0; u < n; ++u) {
      const Index unknown = unknowns[static_cast<std::size_t>(u)];
      placement.point_m.row(u) = deck.mesh.nodes_m.row(unknown / 3);
      placement.direction(u, unknown % 3) = 1;
      x(u, 0) = deck.load[unknown];
    }
    fem::LinearSolver solver(options);
    solver.analyse(lower, std::move(placement));
    solver.set_matrix(lower);
    outcome = solver.solve_in_place(x);
    stage("solve");
  }
  const auto n = static_cast<Eigen::Index>(unknowns.size());
  if (!outcome.solved) throw Error(outcome.reason, argv[1]);
  VectorX displacement = VectorX::Zero(deck.load.size());
  for (Eigen::Index u = 0; u < n; ++u) displacement[unknowns[static_cast<std::size_t>(u)]] = x(u, 0);
  std::FILE* const result = std::fopen(argv[2], "w");
  if (result == nullptr) throw Error("cannot be written", argv[2]);
  for (Eigen::Index node = 0; node < deck.mesh.nodes_m.rows(); ++node) {
    std::fprintf(result, "%ld %.9e %.9e %.9e\n", static_cast<long>(node + 1), displacement[3 * node],
                 displacement[3 * node + 1], displacement[3 * node + 2]);
  }
  std::fclose(result);
  stage("write");
  std::printf("{\"unknowns\": %ld, \"method\": \"%s\", \"steps\": %d", static_cast<long>(n), fem::name_of(outcome.used),
              outcome.iterations);
  for (const auto& [name, value] : seconds) std::printf(", \"%s_s\": %.4f", name.c_str(), value);
  std::printf("}\n");
  return 0;
}

}  // namespace
}  // namespace palpate

int main(int argc, char** argv) {
  palpate::keep_heap_in_large_pages();
  try {
    return palpate::run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
