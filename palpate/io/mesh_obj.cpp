// SPDX-License-Identifier: Apache-2.0
// Wavefront OBJ: vertices and faces; texture, normals, groups and materials are skipped. A backslash at its end goes on with
// the next line.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "palpate/io/mesh_builder.hpp"
#include "palpate/io/mesh_formats.hpp"
#include "palpate/io/scanner.hpp"

namespace palpate::io {

MeshData read_obj(std::string_view bytes, const std::string& name) {
  MeshBuilder builder;
  Scanner file(bytes, name);
  std::vector<Index> corners;
  while (file.remaining() > 0) {
    const std::size_t start = file.position();
    std::string_view text = file.line();
    std::string joined;
    while (text.ends_with('\\') && file.remaining() > 0) {
      joined.append(text.substr(0, text.size() - 1)) += ' ';
      text = file.line();
    }
    if (!joined.empty()) text = joined.append(text);
    const std::size_t next = file.position();
    text = trimmed(text.substr(0, text.find('#')));
    Scanner line(text, name);
    const auto fail = [&](const std::string& what) {
      file.seek(start);
      file.fail(what);
    };
    if (line.at_end()) continue;
    const std::string_view key = line.word("a key");
    if (key == "v") {
      double x[3];
      for (double& one : x) {
        const auto value = parse_number(line.peek_word());
        if (!value || !std::isfinite(*value)) fail("a vertex needs three finite numbers");
        one = *value;
        line.word("a coordinate");
      }
      builder.point(x[0], x[1], x[2]);
    } else if (key == "f") {
      corners.clear();
      while (!line.at_end()) {
        const std::string_view corner = line.word("a corner");
        const auto index = parse_whole(corner.substr(0, corner.find('/')));
        const auto count = static_cast<std::int64_t>(builder.points());
        const std::int64_t row = !index ? -1 : *index > 0 ? *index - 1 : *index < 0 ? count + *index : -1;
        if (row < 0 || row >= count)
          fail("a face refers to vertex '" + std::string(corner.substr(0, 20)) + "', which is not there");
        corners.push_back(static_cast<Index>(row));
      }
      if (corners.size() < 3) fail("a face needs three corners; the line is cut off");
      builder.polygon(corners);
    }
    file.seek(next);
  }
  return builder.build(name);
}

std::string write_obj(const MeshData& mesh) {
  std::string out = "# metres\n";
  for (Eigen::Index i = 0; i < mesh.points_m.rows(); ++i) {
    fmt::format_to(std::back_inserter(out), "v {} {} {}\n", mesh.points_m(i, 0), mesh.points_m(i, 1), mesh.points_m(i, 2));
  }
  for (Eigen::Index i = 0; i < mesh.triangles.rows(); ++i) {
    fmt::format_to(std::back_inserter(out), "f {} {} {}\n", mesh.triangles(i, 0) + 1, mesh.triangles(i, 1) + 1,
                   mesh.triangles(i, 2) + 1);
  }
  return out;
}

}  // namespace palpate::io
