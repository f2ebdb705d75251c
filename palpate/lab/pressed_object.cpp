// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/pressed_object.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/contact/rigid_shape.hpp"
#include "palpate/fem/contact_statics.hpp"
#include "palpate/fem/regions.hpp"
#include "palpate/fem/statics.hpp"
#include "palpate/geometry/box_rims.hpp"
#include "palpate/geometry/embedding.hpp"
#include "palpate/geometry/mesh_checks.hpp"
#include "palpate/geometry/stand_on.hpp"
#include "palpate/geometry/subdivide.hpp"
#include "palpate/geometry/tetrahedralise.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::lab {
namespace {

constexpr std::array<std::array<int, 2>, 6> edges{{{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}}};

// Smallest determinant of an element's map at its corners and middle, over that of the straight element.
double worst_bend(const TetMesh& mesh, Index e) {
  const auto node = [&](int k) { return Vec3(mesh.nodes_m.row(mesh.tetrahedra(e, k))); };
  const double straight = (node(1) - node(0)).cross(node(2) - node(0)).dot(node(3) - node(0));
  double worst = 1;
  for (int at = 0; at < 5; ++at) {
    Eigen::Vector4d l = Eigen::Vector4d::Constant(0.25);
    if (at < 4) l = Eigen::Vector4d::Unit(at);
    Eigen::Matrix<double, 3, 4> d = Eigen::Matrix<double, 3, 4>::Zero();  // dx / dl
    for (int k = 0; k < 4; ++k) d.col(k) += (4 * l(k) - 1) * node(k);
    for (int m = 0; m < 6; ++m) {
      const int a = edges[std::size_t(m)][0], b = edges[std::size_t(m)][1];
      d.col(a) += 4 * l(b) * node(4 + m);
      d.col(b) += 4 * l(a) * node(4 + m);
    }
    const Vec3 u = d.col(1) - d.col(0), v = d.col(2) - d.col(0), w = d.col(3) - d.col(0);
    worst = std::min(worst, u.cross(v).dot(w) / straight);
  }
  return worst;
}

// Boundary nodes go onto the surface, corners first, where that bends no element much: the truth is then the thing that the
// recording says it is. Elements that would be bent too much stay straight, alone.
void curve_boundary(TetMesh& mesh, const TriMesh& surface, const std::vector<char>& held) {
  const geometry::TriangleTree tree(surface);
  const Tetrahedra faces = fem::boundary_faces(mesh);
  std::map<Index, std::array<Index, 2>> midpoints;
  for (Index f = 0; f < faces.rows(); ++f)
    for (int k = 0; k < 3; ++k) midpoints[faces(f, 3 + k)] = {faces(f, k), faces(f, (k + 1) % 3)};
  const auto onto_surface = [&](Index node, double edge_m) {
    const Vec3 p = mesh.nodes_m.row(node);
    const Vec3 onto = tree.closest(p).point_m;
    if (held[std::size_t(node)] == 0 && (onto - p).norm() < 0.15 * edge_m) mesh.nodes_m.row(node) = onto;
  };
  std::map<Index, double> shortest_m;  // of the boundary edges at a corner
  for (const auto& [node, ends] : midpoints)
    for (const Index corner : ends) {
      const double edge_m = (mesh.nodes_m.row(ends[0]) - mesh.nodes_m.row(ends[1])).norm();
      const auto [at, fresh] = shortest_m.emplace(corner, edge_m);
      if (!fresh) at->second = std::min(at->second, edge_m);
    }
  const Points before = mesh.nodes_m;
  for (const auto& [corner, edge_m] : shortest_m) onto_surface(corner, edge_m);
  const auto volume = [&](const Points& nodes_m, Index e) {
    const auto node = [&](int k) { return Vec3(nodes_m.row(mesh.tetrahedra(e, k))); };
    return (node(1) - node(0)).cross(node(2) - node(0)).dot(node(3) - node(0));
  };
  for (bool again = true; again;) {
    again = false;
    for (Index e = 0; e < mesh.tetrahedra.rows(); ++e) {
      if (volume(mesh.nodes_m, e) > 0.4 * volume(before, e)) continue;
      for (int k = 0; k < 4; ++k) {
        const Index n = mesh.tetrahedra(e, k);
        again = again || mesh.nodes_m.row(n) != before.row(n);
        mesh.nodes_m.row(n) = before.row(n);
      }
    }
  }
  const auto middle = [&](Index e, int k) {
    const auto [a, b] = edges[std::size_t(k - 4)];
    return Eigen::RowVector3d(0.5 * (mesh.nodes_m.row(mesh.tetrahedra(e, a)) + mesh.nodes_m.row(mesh.tetrahedra(e, b))));
  };
  for (Index e = 0; e < mesh.tetrahedra.rows(); ++e)
    for (int k = 4; k < 10; ++k) mesh.nodes_m.row(mesh.tetrahedra(e, k)) = middle(e, k);
  for (const auto& [node, ends] : midpoints)
    onto_surface(node, (mesh.nodes_m.row(ends[0]) - mesh.nodes_m.row(ends[1])).norm());
  for (bool fine = false; !fine;) {  // every pass straightens an element that was not straight
    fine = true;
    for (Index e = 0; e < mesh.tetrahedra.rows(); ++e) {
      if (worst_bend(mesh, e) > 0.3) continue;
      for (int k = 4; k < 10; ++k) {
        const Eigen::RowVector3d straight = middle(e, k);
        fine = fine && mesh.nodes_m.row(mesh.tetrahedra(e, k)) == straight;
        mesh.nodes_m.row(mesh.tetrahedra(e, k)) = straight;
      }
    }
  }
}

// The surface bends within millimetres at a pad's rim, where facets of a quarter of its radius cut the corner: a fifteenth there.
TriMesh bends_at_rims(const TriMesh& surface, const std::vector<Vec3>& pads_m, double radius_m) {
  constexpr double finest = 1.0 / 15, growth = 0.3;  // of the radius; with the distance from where the rim is
  return geometry::subdivided(surface, [&](const Vec3& at_m) {
    double longest_m = std::numeric_limits<double>::infinity();
    for (const Vec3& pad_m : pads_m) {
      const double from_rim_m = std::max(0.0, std::abs((at_m - pad_m).norm() - radius_m) - 0.25 * radius_m);
      longest_m = std::min(longest_m, finest * radius_m + growth * from_rim_m);
    }
    return longest_m;
  });
}

bool flat(const Support& support) { return support.kind != SupportKind::box; }
bool pushes_only(const Support& support) { return support.kind == SupportKind::table || support.kind == SupportKind::wall; }

fem::RigidContact contact_of(const Support& support) {
  fem::RigidContact contact;
  contact.name = support.name;
  contact.shape = fem::plane_shape();
  contact.T_base_tool = fem::tool_pose(support.plane.point_m, support.plane.normal);
  contact.seat_m = 1e-4;
  contact.stiffness = 1000;  // of the layer: the foot has no rim that runs through faces
  const bool rough = support.contact == ContactLaw::friction;
  contact.law = rough ? fem::Touch::friction : fem::Touch::frictionless;
  contact.friction_coefficient = support.friction_coefficient;
  return contact;
}

// What stands on a plane was laid on it: a wider tolerance would hold what only comes near it, as a ball does around its foot.
bool holds(const Support& support, const TetMesh& mesh, const Tetrahedra& faces, Index f) {
  const auto corner = [&](int k) { return Vec3(mesh.nodes_m.row(faces(f, k))); };
  const Vec3 a = corner(0), b = corner(1), c = corner(2);
  const Vec3& normal = support.plane.normal;
  const double tolerance_m = 0.02 * std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
  for (const Vec3& p : {a, b, c})
    if (std::abs(normal.dot(p - support.plane.point_m)) > tolerance_m) return false;
  return (b - a).cross(c - a).normalized().dot(normal) < -0.9;
}

}  // namespace

struct PressedObject::Impl {
  explicit Impl(const PressedObjectOptions& given) : options(given) {
    if (std::abs(options.direction.norm() - 1) > 1e-6) throw Error("must have unit length", "PressedObjectOptions.direction");
    if (options.supports.empty() != options.opposed_m.has_value())
      throw Error("the object must be held, by supports or by an opposed pad", "PressedObjectOptions.supports");
    if (!(options.pad_radius_m > 0)) throw Error("must be positive", "PressedObjectOptions.pad_radius_m");
    if (options.cells_in_radius < 1) throw Error("must be at least 1", "PressedObjectOptions.cells_in_radius");
    geometry::TetrahedraliseOptions filling;
    filling.tetrahedra = options.tetrahedra;
    filling.finer.push_back(
        {options.contact_m, 1.5 * options.pad_radius_m, options.pad_radius_m / options.cells_in_radius});
    if (options.opposed_m) filling.finer.push_back({*options.opposed_m, filling.finer[0].radius_m, filling.finer[0].edge_m});
    for (const Support& support : options.supports)
      if (flat(support) && !pushes_only(support))  // what may slide has no rim where stress is singular
        for (auto near : geometry::finer_at_feet(support.plane, options.surface)) {
          near.edge_m *= 5.0 / 6;
          filling.finer.push_back(near);
        }
    for (const Support& support : options.supports)
      if (!flat(support))
        for (auto near : geometry::finer_at_rims(support.box_min_m, support.box_max_m, options.surface)) {
          near.edge_m *= 0.5;
          filling.finer.push_back(near);
        }
    TetMesh linear = geometry::tetrahedralise(options.surface, filling).mesh;
    for (const Support& support : options.supports)
      if (flat(support)) geometry::stand_on(support.plane, options.surface, linear);
    mesh = fem::to_quadratic(linear);

    std::vector<char> stays(std::size_t(mesh.nodes_m.rows()), 0), held = stays;
    fem::Boundary boundary;
    std::vector<fem::RigidContact> contacts;
    const Tetrahedra faces = fem::boundary_faces(mesh);
    for (const Support& support : options.supports) {
      if (!flat(support)) {
        for (const Index n : fem::support_nodes(mesh, support)) stays[std::size_t(n)] = held[std::size_t(n)] = 1;
        continue;
      }
      if (pushes_only(support)) contacts.push_back(contact_of(support));
      for (Index f = 0; f < faces.rows(); ++f) {
        if (!holds(support, mesh, faces, f)) continue;
        for (int k = 0; k < 6; ++k) {
          stays[std::size_t(faces(f, k))] = 1;
          if (!pushes_only(support)) held[std::size_t(faces(f, k))] = 1;
        }
      }
    }
    for (Index n = 0; n < Index(held.size()); ++n)
      if (held[std::size_t(n)]) boundary.constraints.push_back({n, Mat3::Identity(), 3});
    boundary.inertia_relief = options.opposed_m.has_value();
    if (boundary.constraints.empty() && contacts.empty() && !options.opposed_m)
      throw Error("no support touches the object", "PressedObjectOptions.supports");
    curve_boundary(mesh, options.surface, stays);

    if (options.punch) {
      if (options.opposed_m) throw Error("has no opposed one: two soft pads press a free object", "PressedObjectOptions.punch");
      fem::RigidContact face;
      face.name = "punch";
      face.shape = fem::disc_shape(options.pad_radius_m);
      face.T_base_tool = fem::tool_pose(options.contact_m, options.direction);
      face.free_axes = fem::along(options.direction);
      punch = contacts.size();
      contacts.push_back(face);
    }
    const Eigen::SparseMatrix<double> columns = fem::spread_over_patch(mesh, options.contact_m, options.pad_radius_m);
    VectorX along = columns * options.direction;  // per newton
    share = shares_of(columns);
    if (options.opposed_m) {
      const Eigen::SparseMatrix<double> back = fem::spread_over_patch(mesh, *options.opposed_m, options.pad_radius_m);
      along -= back * options.direction;
      opposed_share = shares_of(back);
    }
    boundary.forces = MatrixX(along).sparseView();

    fem::StaticsOptions statics_options;
    statics_options.residual_tolerance = 1e-7;  // far below the sensors' errors
    if (options.poisson_ratio > 0.45) statics_options.dilatation = fem::Dilatation::averaged;
    if (!options.regions.empty()) {
      std::vector<Region> regions;
      statics_options.region_stiffness.resize(Eigen::Index(options.regions.size()));
      for (const TrueRegion& one : options.regions) {
        statics_options.region_stiffness(Eigen::Index(regions.size())) = one.young_modulus_pa / options.young_modulus_pa;
        regions.push_back(one.region);
      }
      statics_options.region = fem::regions_of(mesh, regions);
    }
    if (contacts.empty()) {
      statics = std::make_unique<fem::Statics>(mesh, options.material, std::move(boundary), statics_options);
    } else {
      fem::ContactOptions contact_options;
      contact_options.statics = statics_options;
      contact_options.friction_tolerance = 1e-4;  // as the residual: far below the sensors' errors
      boundary.motions.resize(3 * Eigen::Index(mesh.nodes_m.rows()), 0);
      resting = std::make_unique<fem::ContactStatics>(mesh, options.material, std::move(boundary), std::move(contacts), contact_options);
    }
    TetMesh corners{mesh.nodes_m, mesh.tetrahedra.leftCols(4)};
    std::vector<Vec3> pads_m{options.contact_m};
    if (options.opposed_m) pads_m.push_back(*options.opposed_m);
    shown = bends_at_rims(options.surface, pads_m, options.pad_radius_m);
    embedding = geometry::embed(shown.vertices_m, corners);
  }

  // Of a patch's force, a node.
  static VectorX shares_of(const Eigen::SparseMatrix<double>& columns) {
    VectorX shares = VectorX::Zero(columns.rows() / 3);
    for (Eigen::SparseMatrix<double>::InnerIterator it(columns, 0); it; ++it)
      if (it.row() % 3 == 0) shares(it.row() / 3) = it.value();
    return shares;
  }

  void press(double force_n) {
    const VectorX extra = Eigen::Map<const VectorX>(options.extra.data(), Eigen::Index(options.extra.size()));
    const auto take = [&](const auto& state) {
      if (!state.converged)
        throw Error("the true object found no equilibrium under " + std::to_string(force_n) + " N (" + state.reason +
                        "): press less deep" + (resting ? ", or let more friction hold it" : ""),
                    "PressedObject");
      displacement_m = state.displacement_m;
      at_n = force_n;
    };
    if (resting) {
      fem::ContactLoads loads = resting->no_loads();
      if (punch)
        loads.wrench[*punch].head<3>() = force_n * options.direction;
      else
        loads.force_coefficients(0) = force_n;
      fem::ContactEquilibrium state =
          resting->solve(options.young_modulus_pa, options.poisson_ratio, loads, lies.converged ? &lies : nullptr, extra);
      take(state);
      // The layer that stands for contact gives way where a stiff face does not.
      if (punch)
        punch_travel_m = options.direction.dot(state.touches[*punch].T_base_tool.translation() - options.contact_m) -
                         resting->layer_travel_m(state)(Eigen::Index(*punch));
      lies = std::move(state);
      return;
    }
    const VectorX coefficient = VectorX::Constant(1, force_n), none(0);
    const VectorX start = displacement_m.size() ? VectorX(force_n / at_n * displacement_m) : VectorX();
    take(statics->solve(options.young_modulus_pa, options.poisson_ratio, coefficient, none, start.size() ? &start : nullptr, extra));
  }

  double moved_m(const VectorX& shares) const {
    double moved = 0;
    for (Eigen::Index n = 0; n < shares.size(); ++n)
      if (shares(n) != 0) moved += shares(n) * displacement_m.segment<3>(3 * n).dot(options.direction);
    return moved;
  }
  double travel_m() const { return punch ? punch_travel_m : moved_m(share) - moved_m(opposed_share); }

  TriMesh surface() const {
    TriMesh moved = shown;
    if (displacement_m.size() == 0) return moved;
    for (Eigen::Index v = 0; v < moved.vertices_m.rows(); ++v) {
      const Index e = embedding.element(v);
      const Eigen::Vector4d l = embedding.weights.row(v);
      Vec3 u = Vec3::Zero();
      const auto add = [&](int k, double weight) { u += weight * displacement_m.segment<3>(3 * mesh.tetrahedra(e, k)); };
      for (int k = 0; k < 4; ++k) add(k, l(k) * (2 * l(k) - 1));
      for (int m = 0; m < 6; ++m) add(4 + m, 4 * l(edges[std::size_t(m)][0]) * l(edges[std::size_t(m)][1]));
      moved.vertices_m.row(v) += u;
    }
    moved.vertices_m.rowwise() -= moved_m(opposed_share) * options.direction.transpose();  // that pad stands still
    return moved;
  }

  PressedObjectOptions options;
  TetMesh mesh;
  TriMesh shown;  // at rest
  VectorX share, opposed_share;  // of the pads' forces, a node; the second one empty: none
  VectorX displacement_m;  // empty = at rest
  double at_n = 0;
  SurfaceEmbedding embedding;
  std::unique_ptr<fem::Statics> statics;         // held ...
  std::unique_ptr<fem::ContactStatics> resting;  // ... or on what only pushes
  fem::ContactEquilibrium lies;                  // there, last
  std::optional<std::size_t> punch;              // which contact
  double punch_travel_m = 0;
};

PressedObject::PressedObject(const PressedObjectOptions& options) : impl_(std::make_unique<Impl>(options)) {}
PressedObject::~PressedObject() = default;
void PressedObject::press(double force_n) { impl_->press(force_n); }
double PressedObject::force_n() const { return impl_->at_n; }
double PressedObject::travel_m() const { return impl_->displacement_m.size() ? impl_->travel_m() : 0.0; }
TriMesh PressedObject::surface() const { return impl_->surface(); }
Index PressedObject::nodes() const { return Index(impl_->mesh.nodes_m.rows()); }
const TetMesh& PressedObject::mesh() const { return impl_->mesh; }

}  // namespace palpate::lab
