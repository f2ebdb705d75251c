// SPDX-License-Identifier: Apache-2.0
// STL, text and binary. It stores each triangle's corners anew: corners with equal coordinates become one vertex.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <map>

#include "palpate/io/bytes.hpp"
#include "palpate/io/mesh_builder.hpp"
#include "palpate/io/mesh_formats.hpp"
#include "palpate/io/scanner.hpp"

namespace palpate::io {
namespace {

constexpr std::size_t header_size = 80;
constexpr std::size_t record_size = 50;

class CornerMerger {
 public:
  explicit CornerMerger(MeshBuilder& builder) : builder_(builder) {}
  Index operator()(const std::array<double, 3>& corner) {
    const std::array<double, 3> key = {corner[0] + 0.0, corner[1] + 0.0, corner[2] + 0.0};  // -0 and 0 are one place
    const auto [place, is_new] = seen_.try_emplace(key, static_cast<Index>(builder_.points()));
    if (is_new) builder_.point(key[0], key[1], key[2]);
    return place->second;
  }

 private:
  MeshBuilder& builder_;
  std::map<std::array<double, 3>, Index> seen_;
};

MeshData read_text(Scanner& file) {
  MeshBuilder builder;
  CornerMerger merged(builder);
  file.line();  // solid and its name
  while (true) {
    const std::string_view word = file.word("'facet' or 'endsolid'");
    if (word == "endsolid") {
      file.line();
      if (file.at_end()) break;
      file.expect("solid");
      file.line();
      continue;
    }
    if (word != "facet") file.fail("expected 'facet' or 'endsolid'");
    file.expect("normal");
    for (int i = 0; i < 3; ++i) file.word("the normal");  // may be nan on slivers and is not used
    file.expect("outer");
    file.expect("loop");
    std::array<Index, 3> corner{};
    for (Index& one : corner) {
      file.expect("vertex");
      const double x = file.number("x"), y = file.number("y"), z = file.number("z");
      one = merged({x, y, z});
    }
    file.expect("endloop");
    file.expect("endfacet");
    builder.triangle(corner[0], corner[1], corner[2]);
  }
  return builder.build(file.name());
}

MeshData read_binary(Scanner& file) {
  file.take(header_size, "the header");
  const std::size_t count = load<std::uint32_t>(file.take(4, "the number of triangles").data());
  if (count * record_size != file.remaining()) {
    file.fail("announces " + std::to_string(count) + " triangles (" + std::to_string(count * record_size) +
              " bytes) but has " + std::to_string(file.remaining()) + " bytes for them; it is cut off or damaged");
  }
  MeshBuilder builder;
  CornerMerger merged(builder);
  for (std::size_t i = 0; i < count; ++i) {
    const char* record = file.take(record_size, "a triangle").data();
    std::array<Index, 3> corner{};
    for (std::size_t k = 0; k < 3; ++k) {
      std::array<double, 3> x{};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        x[axis] = static_cast<double>(load<float>(record + 12 + 12 * k + 4 * axis));
        if (!std::isfinite(x[axis])) file.fail("triangle " + std::to_string(i) + " has a corner that is not finite");
      }
      corner[k] = merged(x);
    }
    builder.triangle(corner[0], corner[1], corner[2]);
  }
  return builder.build(file.name());
}

Vec3 normal_of(const MeshData& mesh, Eigen::Index triangle) {
  const Vec3 a = mesh.points_m.row(mesh.triangles(triangle, 0)), b = mesh.points_m.row(mesh.triangles(triangle, 1)),
             c = mesh.points_m.row(mesh.triangles(triangle, 2));
  const Vec3 normal = (b - a).cross(c - a);
  return normal.norm() > 0 ? Vec3(normal.normalized()) : Vec3(Vec3::Zero());
}

}  // namespace

MeshData read_stl(std::string_view bytes, const std::string& name) {
  Scanner file(bytes, name);
  // Some binary files start with "solid" too: a binary file is one whose size its own count explains.
  const bool size_fits =
      bytes.size() >= header_size + 4 &&
      header_size + 4 + record_size * std::size_t{load<std::uint32_t>(bytes.data() + header_size)} == bytes.size();
  if (!size_fits && trimmed(bytes.substr(0, header_size)).substr(0, 5) == "solid") return read_text(file);
  return read_binary(file);
}

std::string write_stl(const MeshData& mesh) {
  std::string out = "palpate, metres";
  out.resize(header_size, ' ');
  store(out, static_cast<std::uint32_t>(mesh.triangles.rows()));
  for (Eigen::Index i = 0; i < mesh.triangles.rows(); ++i) {
    const Vec3 normal = normal_of(mesh, i);
    for (int axis = 0; axis < 3; ++axis) store(out, static_cast<float>(normal[axis]));
    for (int corner = 0; corner < 3; ++corner) {
      for (int axis = 0; axis < 3; ++axis) store(out, static_cast<float>(mesh.points_m(mesh.triangles(i, corner), axis)));
    }
    store(out, std::uint16_t{0});
  }
  return out;
}

std::string write_stl_ascii(const MeshData& mesh) {
  std::string out = "solid palpate_metres\n";
  for (Eigen::Index i = 0; i < mesh.triangles.rows(); ++i) {
    const Vec3 normal = normal_of(mesh, i);
    fmt::format_to(std::back_inserter(out), " facet normal {} {} {}\n  outer loop\n", normal.x(), normal.y(), normal.z());
    for (int corner = 0; corner < 3; ++corner) {
      const auto x = mesh.points_m.row(mesh.triangles(i, corner));
      fmt::format_to(std::back_inserter(out), "   vertex {} {} {}\n", x[0], x[1], x[2]);
    }
    out += "  endloop\n endfacet\n";
  }
  return out + "endsolid palpate_metres\n";
}

}  // namespace palpate::io
