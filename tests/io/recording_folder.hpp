// SPDX-License-Identifier: Apache-2.0
// A small recording on disk that tests bend and break: a box of tetrahedra on a table, pushed by vertices, seen as clouds.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include "palpate/io/cloud_file.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/mesh_file.hpp"
#include "temporary_folder.hpp"

namespace palpate::io::test {

/// A temporary folder that tests put files into.
class TemporaryFolder : public palpate::test::TemporaryFolder {
 public:
  using palpate::test::TemporaryFolder::TemporaryFolder;
  void put(const std::string& file, const std::string& bytes) const {
    std::filesystem::create_directories((path() / file).parent_path());
    write_file(path() / file, bytes);
  }
  std::string get(const std::string& file) const { return read_file(path() / file); }
};

/// A cube of 10 cm in five tetrahedra.
inline MeshData cube() {
  MeshData mesh;
  mesh.points_m.resize(8, 3);
  mesh.points_m << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1;
  mesh.points_m *= 0.1;
  mesh.tetrahedra.resize(5, 4);
  mesh.tetrahedra << 0, 1, 3, 4, 1, 2, 3, 6, 1, 4, 5, 6, 3, 4, 6, 7, 1, 3, 4, 6;
  return mesh;
}

inline std::string cloud_text(double scale = 1) {
  std::string text;
  for (int i = 0; i < 5; ++i) {
    for (int k = 0; k < 5; ++k)
      text += std::to_string(0.02 * i * scale) + " " + std::to_string(0.02 * k * scale) + " " +
              std::to_string(0.099 * scale) + "\n";
  }
  return text;
}

inline const std::string index_text = R"(format: palpate-recording/1
name: cube
rest:
  volume_mesh: rest.msh
  state: stress_free
supports:
  - {kind: vertices, file: fixed.csv}
tools:
  - {name: tip, shape: vertices, vertices: [6, 7]}
model: {mesh: as_given, element: tet4, material: linear}
pushes:
  - name: first
    table: frames.csv
    every_step:
      loads: [{tool: tip, force_relative_std: 0.02}]
      observations: [{kind: cloud, sigma_m: 0.0005}]
)";

inline void put_cube_recording(const TemporaryFolder& folder) {
  folder.put("rest.msh", mesh_format_named("msh22").write(cube()));
  folder.put("fixed.csv", "0\n1\n2\n3\n");
  folder.put("clouds/a.xyz", cloud_text());
  folder.put("clouds/b.xyz", cloud_text(0.99));
  folder.put("frames.csv", "time_s,force_x_n,force_y_n,force_z_n,cloud\n0,0,0,0,clouds/a.xyz\n1,0.5,0,-2,clouds/b.xyz\n");
  folder.put("recording.yaml", index_text);
}

inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  if (at == std::string::npos) throw std::logic_error("the test's text has no '" + from + "'");
  return text.replace(at, from.size(), to);
}

}  // namespace palpate::io::test
