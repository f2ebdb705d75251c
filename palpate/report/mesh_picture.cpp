// SPDX-License-Identifier: Apache-2.0
#include "palpate/report/mesh_picture.hpp"

#include <algorithm>

#include "palpate/report/axes.hpp"
#include "palpate/report/depth_buffer.hpp"

namespace palpate::report {
namespace {

struct Face {
  std::array<Index, 3> key, corner;
  bool cut = false;  ///< was inside before elements were taken away
};

/// Faces of the kept elements that belong to one of them only.
std::vector<Face> outer_faces(const TetMesh& mesh, const std::vector<char>& kept) {
  static constexpr std::array<std::array<int, 3>, 4> faces{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};
  struct Side {
    Face face;
    bool kept;
  };
  std::vector<Side> all;
  all.reserve(4 * static_cast<std::size_t>(mesh.tetrahedra.rows()));
  for (Index t = 0; t < mesh.tetrahedra.rows(); ++t)
    for (const auto& f : faces) {
      Face face;
      for (std::size_t k = 0; k < 3; ++k) face.corner[k] = mesh.tetrahedra(t, f[k]);
      face.key = face.corner;
      std::sort(face.key.begin(), face.key.end());
      all.push_back({face, kept[static_cast<std::size_t>(t)] != 0});
    }
  std::sort(all.begin(), all.end(), [](const Side& a, const Side& b) { return a.face.key < b.face.key; });
  std::vector<Face> out;
  for (std::size_t i = 0; i < all.size();) {
    std::size_t j = i;
    while (j < all.size() && all[j].face.key == all[i].face.key) ++j;
    const auto shown = std::count_if(all.begin() + static_cast<std::ptrdiff_t>(i),
                                     all.begin() + static_cast<std::ptrdiff_t>(j), [](const Side& s) { return s.kept; });
    if (shown == 1) {
      Face face = all[all[i].kept ? i : i + 1].face;
      face.cut = j - i == 2;
      out.push_back(face);
    }
    i = j;
  }
  return out;
}

const Vec3 outside(142, 188, 205);

Vec3 looking(const Vec3& up) {
  const Vec3 level = up.unitOrthogonal(), side = up.cross(level);
  return -(0.75 * level + 0.65 * side + 0.35 * up).normalized();
}

void facet(DepthBuffer& buffer, const std::array<Vec3, 3>& x, const Vec3& colour) {
  const Vec3 normal = (x[1] - x[0]).cross(x[2] - x[0]).normalized();
  buffer.facet({buffer.project(x[0]), buffer.project(x[1]), buffer.project(x[2])},
               (0.55 + 0.45 * std::max(0.0, normal.dot(buffer.light()))) * colour, 0.9);
}

}  // namespace

Picture draw_mesh(const TetMesh& mesh, int width, int height, const Vec3& up) {
  Picture out{width, height,
              std::vector<std::uint8_t>(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * 4, 0)};
  if (mesh.tetrahedra.rows() == 0) return out;
  const Vec3 level = up.unitOrthogonal(), towards = looking(up);
  const Vec3 middle = 0.5 * (mesh.nodes_m.colwise().minCoeff() + mesh.nodes_m.colwise().maxCoeff()).transpose();
  const int half = width / 2;
  for (const bool opened : {false, true}) {
    std::vector<char> kept(static_cast<std::size_t>(mesh.tetrahedra.rows()), 1);
    if (opened)
      for (Index t = 0; t < mesh.tetrahedra.rows(); ++t) {
        Vec3 centre = Vec3::Zero();
        for (int k = 0; k < 4; ++k) centre += 0.25 * mesh.nodes_m.row(mesh.tetrahedra(t, k)).transpose();
        kept[static_cast<std::size_t>(t)] = (centre - middle).dot(level) <= 0;
      }
    DepthBuffer buffer(2 * half, 2 * height);
    buffer.look(towards, up, mesh.nodes_m);
    for (const Face& f : outer_faces(mesh, kept))
      facet(buffer, {mesh.nodes_m.row(f.corner[0]), mesh.nodes_m.row(f.corner[1]), mesh.nodes_m.row(f.corner[2])},
            f.cut ? Vec3(236, 196, 120) : outside);
    const Picture drawn = buffer.halved();
    for (int y = 0; y < height; ++y)
      std::copy_n(drawn.rgba.begin() + std::ptrdiff_t(4) * y * drawn.width, 4 * drawn.width,
                  out.rgba.begin() + std::ptrdiff_t(4) * (y * width + (opened ? half : 0)));
  }
  return out;
}

Picture draw_surface(const TriMesh& surface, int width, int height, const Vec3& up) {
  DepthBuffer buffer(2 * width, 2 * height);
  if (surface.vertices_m.rows() == 0) return buffer.halved();
  buffer.look(looking(up), up, surface.vertices_m);
  for (Index t = 0; t < surface.triangles.rows(); ++t)
    facet(buffer, {surface.vertices_m.row(surface.triangles(t, 0)), surface.vertices_m.row(surface.triangles(t, 1)), surface.vertices_m.row(surface.triangles(t, 2))},
          outside);
  return buffer.halved();
}

Picture draw_clouds(std::span<const Points> clouds, const Points& around, int width, int height, const Vec3& up) {
  DepthBuffer buffer(2 * width, 2 * height);
  if (around.rows() == 0) return buffer.halved();
  buffer.look(looking(up), up, around);
  for (std::size_t k = 0; k < clouds.size(); ++k) {
    const Colour colour = category(k);
    for (Index i = 0; i < clouds[k].rows(); ++i) buffer.spot(buffer.project(clouds[k].row(i)), 2, Vec3(colour.r, colour.g, colour.b));
  }
  return buffer.halved();
}

}  // namespace palpate::report
