// SPDX-License-Identifier: Apache-2.0
// Prints the geometry section's tables of docs/benchmarks.md; exit code 1 when a bar is missed.
//   geometry_bars MESH_FOLDER [TABLE ...]     tables: tetrahedra damaged unseen closest icp views (default: all)
#include <fmt/core.h>

#include <algorithm>
#include <exception>

#include "bars.hpp"

int main(int argc, char** argv) {
  if (argc < 2) {
    fmt::print(stderr, "usage: geometry_bars MESH_FOLDER [tetrahedra|damaged|unseen|closest|icp|views ...]\n");
    return 2;
  }
  const std::filesystem::path meshes = argv[1];
  const std::vector<std::string> asked(argv + 2, argv + argc);
  const auto wanted = [&](const char* name) {
    return asked.empty() || std::find(asked.begin(), asked.end(), name) != asked.end();
  };
  try {
    bool holds = true;
    if (wanted("tetrahedra")) holds = bars::tetrahedra(meshes) && holds;
    if (wanted("damaged")) holds = bars::damaged(meshes) && holds;
    if (wanted("unseen")) holds = bars::unseen() && holds;
    if (wanted("closest")) holds = bars::closest(meshes) && holds;
    if (wanted("icp")) holds = bars::icp(meshes, 50) && holds;
    if (wanted("views")) holds = bars::views(meshes) && holds;
    return holds ? 0 : 1;
  } catch (const std::exception& e) {
    fmt::print(stderr, "{}\n", e.what());
    return 3;
  }
}
