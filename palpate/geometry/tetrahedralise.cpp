// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/tetrahedralise.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <utility>

#include "palpate/core/error.hpp"
#include "palpate/geometry/lattice_cut.hpp"
#include "palpate/geometry/sharp_edges.hpp"
#include "palpate/geometry/surface_distance.hpp"
#include "palpate/geometry/surface_fit.hpp"
#include "palpate/geometry/tet_coarsen.hpp"
#include "palpate/geometry/tet_improve.hpp"

namespace palpate::geometry {
namespace {

/// Volume within the winding number's one half, by counting points: to some five percent.
double counted_volume(const Solid& solid) {
  constexpr int enough = 400, most = 40000;
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> u;
  const Vec3 extent = solid.max_m() - solid.min_m();
  int inside = 0, count = 0;
  for (; count < most && inside < enough; ++count)
    inside += solid.inside(solid.min_m() + extent.cwiseProduct(Vec3(u(rng), u(rng), u(rng))));
  return extent.prod() * inside / count;
}

/// Is there an inside at all, right behind the surface? An open sheet has one behind its hollow sides only.
bool encloses_something(const Solid& solid, const SurfaceSamples& samples, int asked_for) {
  if (!solid.watertight() && double(samples.evenly) < 0.6 * asked_for) return false;
  std::size_t behind = 0, asked = 0;
  const double step = 1e-4 * solid.diagonal_m();
  for (std::size_t i = 0; i < samples.evenly; i += 7, ++asked)
    behind += solid.inside(samples.point[i] - step * samples.normal[i]);
  return double(behind) > 0.6 * double(asked);
}

struct Draft {
  TetEditor mesh;
  Index dropped = 0;
  double dropped_share = 0;
  double volume_m3 = 0;
  Vec3 dropped_at_m = Vec3::Zero();  // of the largest piece
  double dropped_size_m = 0;
};

/// Pieces of a mesh that hold less than a share of its volume.
struct SmallPieces {
  TetEditor::Pieces pieces;
  double all_m3 = 0, largest_m3 = 0, share = 0;

  SmallPieces(const TetEditor& mesh, double most_share) : pieces(mesh.pieces()), share(most_share) {
    const auto& v = pieces.volume_m3;
    all_m3 = std::accumulate(v.begin(), v.end(), 0.0);
    largest_m3 = *std::max_element(v.begin(), v.end());
  }
  bool contain(Index piece) const {
    return pieces.volume_m3[piece] < largest_m3 && pieces.volume_m3[piece] < share * all_m3;
  }
};

/// Corners of small pieces, with the edge length there. Specks are not worth being tied to the rest.
std::vector<std::pair<Vec3, double>> loose_points(const TetEditor& mesh, double share) {
  constexpr double speck = 1e-5;
  const SmallPieces small(mesh, share);
  std::vector<std::pair<Vec3, double>> out;
  std::vector<char> done(mesh.x.size(), 0);
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    if (mesh.alive[t] && small.contain(small.pieces.of[t]) &&
        small.pieces.volume_m3[small.pieces.of[t]] > speck * small.all_m3)
      for (const Index v : mesh.tets[t])
        if (!std::exchange(done[v], 1)) out.emplace_back(mesh.x[v], mesh.size_m[v]);
  return out;
}

void drop_small_pieces(Draft& draft, double share) {
  const SmallPieces small(draft.mesh, share);
  double lost = 0;
  Index largest = -1;
  for (Index id = 0; id < static_cast<Index>(small.pieces.volume_m3.size()); ++id) {
    if (!small.contain(id)) continue;
    ++draft.dropped, lost += small.pieces.volume_m3[id];
    if (largest < 0 || small.pieces.volume_m3[id] > small.pieces.volume_m3[largest]) largest = id;
  }
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (std::size_t t = 0; t < draft.mesh.tets.size(); ++t)
    if (draft.mesh.alive[t] && small.pieces.of[t] == largest)
      for (const Index v : draft.mesh.tets[t]) low = low.cwiseMin(draft.mesh.x[v]), high = high.cwiseMax(draft.mesh.x[v]);
  if (largest >= 0) draft.dropped_at_m = 0.5 * (low + high), draft.dropped_size_m = (high - low).norm();
  for (Index t = 0; t < static_cast<Index>(draft.mesh.tets.size()); ++t)
    if (draft.mesh.alive[t] && small.contain(small.pieces.of[t])) draft.mesh.remove_tet(t);
  draft.dropped_share = lost / small.all_m3;
  draft.volume_m3 = small.all_m3 - lost;
}

/// Longest edge that the caller wants at a place.
double finest_near(const TetrahedraliseOptions& o, const Vec3& p) {
  double edge = std::numeric_limits<double>::infinity();
  for (const FinerNear& f : o.finer)
    edge = std::min(edge, f.edge_m + 0.5 * std::max(0.0, (p - f.point_m).norm() - f.radius_m));
  return edge;
}

/// Empty where the lattice catches nothing of the solid, or takes too many tetrahedra to follow it: `unaffordable` then.
/// A lattice is laid over the whole box: one stray triangle far from the object would fill the memory with empty cubes.
bool mostly_empty(const Solid& solid, double volume_m3, double cell_m) {
  constexpr double many = 3e6, a_full_one = 20;
  const double cubes = ((solid.max_m() - solid.min_m()) / cell_m).array().max(1).prod();
  return cubes > std::max(many, a_full_one * volume_m3 / std::pow(cell_m, 3));
}

std::optional<Draft> draft(const Solid& solid, const SurfaceSamples& samples, const TetrahedraliseOptions& o, double volume_m3, double cell,
                           bool& unaffordable) {
  unaffordable = mostly_empty(solid, volume_m3, cell);
  if (unaffordable) return std::nullopt;
  Lattice lattice(solid, cell);
  const std::size_t affordable = o.edge_m > 0 ? 20000000 : 100000 + 30 * std::size_t(o.tetrahedra);
  unaffordable = !lattice.refine_to_surface(samples, o.detail * cell, cell / o.finest, affordable);
  if (unaffordable) return std::nullopt;
  if (!o.finer.empty()) lattice.refine_to_size([&](const Vec3& p) { return finest_near(o, p); });
  Draft out{cut_lattice(lattice, solid)};
  if (out.mesh.count() == 0) return std::nullopt;
  // thin parts that the lattice tears into pieces get a finer one around the pieces, as long as that brings them together
  constexpr double small = 0.01;
  for (int attempt = 0; attempt < 4; ++attempt) {
    const auto loose = loose_points(out.mesh, small);
    constexpr std::size_t most = 1500;  // more are the scraps of a noisy soup, not a few torn parts
    if (loose.empty() || loose.size() > most) break;
    lattice.refine_to_size([&](const Vec3& p) {
      double edge = std::numeric_limits<double>::infinity();
      for (const auto& [at, size] : loose)
        if ((p - at).squaredNorm() < 4 * size * size) edge = std::min(edge, std::max(0.75 * size, cell / (2 * o.finest)));
      return edge;
    });
    out.mesh = cut_lattice(lattice, solid);
  }
  drop_small_pieces(out, small);
  out.mesh.coarse_m = cell;
  if (o.improve) merge_short_edges(out.mesh, solid, 0.5, 0.05);
  return out;
}

/// Improvement may leave the surface by some share of an edge. Where the solid is thinner than an edge is long, its width
/// counts instead: walls would swell otherwise.
void mind_walls(TetEditor& mesh, const Solid& solid, double mean_wall_m) {
  mesh.coarse_m = std::min(mesh.coarse_m, 2 * mean_wall_m);
  for (std::size_t v = 0; v < mesh.x.size(); ++v) {
    if (!mesh.boundary[v] || mesh.star[v].empty()) continue;
    const ClosestPoint foot = solid.closest(mesh.x[v]);
    const Vec3 inward = -solid.normal(foot.triangle);
    const double skin = 1e-3 * mesh.size_m[v];
    if (const auto other = solid.tree().cast(foot.point_m + skin * inward, inward, mesh.size_m[v]))
      mesh.size_m[v] = std::max(0.5 * mesh.size_m[v], other->range_m + skin);
  }
}

double worst_quality(const TetEditor& mesh) {
  double q = 1;
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    if (mesh.alive[t]) q = std::min(q, mesh.quality[t]);
  return q;
}

/// Share of the boundary's area that lies far from every input triangle.
double share_over_holes(const TriMesh& boundary, const Solid& solid) {
  double far = 0, all = 0;
  Index hint = -1;
  for (Index i = 0; i < boundary.triangles.rows(); ++i) {
    const Vec3 a = boundary.vertices_m.row(boundary.triangles(i, 0)).transpose(),
               b = boundary.vertices_m.row(boundary.triangles(i, 1)).transpose(),
               c = boundary.vertices_m.row(boundary.triangles(i, 2)).transpose();
    const double area = (b - a).cross(c - a).norm();
    const ClosestPoint q = solid.closest((a + b + c) / 3, hint);
    hint = q.triangle;
    all += area;
    const double wide = 0.02 * solid.diagonal_m();
    if (4 * q.squared_distance_m2 > wide * wide || solid.hole_width_m(q.triangle) > wide) far += area;
  }
  return all > 0 ? far / all : 0;
}

constexpr Index most_tetrahedra = 2000000;

/// A lattice of cubes has 12 tetrahedra a cube; boundaries cost more.
double cell_for(double volume_m3, double tetrahedra) { return std::cbrt(12 * volume_m3 / tetrahedra) * 1.2; }
double tetrahedra_of(double volume_m3, double cell_m) { return 12 * volume_m3 * std::pow(1.2 / cell_m, 3); }
double cell_of_edge(double edge_m) { return edge_m / 0.93; }

void require(bool ok, const char* field, const std::string& what) {
  if (!ok) throw Error(what, std::string("TetrahedraliseOptions: ") + field);
}

}  // namespace

void check(const TetrahedraliseOptions& o) {
  require(o.tetrahedra >= 50 && o.tetrahedra <= most_tetrahedra, "tetrahedra",
          fmt::format("{} is not between 50 and {}", o.tetrahedra, most_tetrahedra));
  require(o.edge_m >= 0 && std::isfinite(o.edge_m), "edge_m",
          fmt::format("{} is no length (0 = from tetrahedra)", o.edge_m));
  require(o.detail >= 0.02 && o.detail <= 1, "detail", fmt::format("{} is not between 0.02 and 1", o.detail));
  require(o.finest >= 1 && o.finest <= 32, "finest", fmt::format("{} is not between 1 and 32", o.finest));
  for (const FinerNear& f : o.finer) {
    require(f.point_m.allFinite(), "finer.point_m", "is not finite");
    require(f.radius_m >= 0 && std::isfinite(f.radius_m), "finer.radius_m", fmt::format("{} is no length", f.radius_m));
    require(f.edge_m > 0 && std::isfinite(f.edge_m), "finer.edge_m", fmt::format("{} is not above 0", f.edge_m));
  }
}

Tetrahedralisation tetrahedralise(const TriMesh& surface, const TetrahedraliseOptions& o, const OnProgress& progress) {
  check(o);
  Tetrahedralisation out;
  out.surface = check_surface(surface);
  for (const Finding& f : out.surface.findings)
    if (f.fatal) throw Error(f.message, "surface");
  const Solid solid(surface);
  const bool known_volume = solid.watertight() && solid.orientation().cover_width_m.empty();
  out.flipped_triangles = solid.orientation().flipped;
  out.warnings = out.surface.findings;

  constexpr int sample_count = 10000;
  const SurfaceSamples samples = sample_surface(solid, sample_count);
  if (!encloses_something(solid, samples, sample_count))
    throw Error("the surface encloses nothing: there is no inside to fill. Close it, or complete it first", "surface");
  const double reference = solid.watertight() ? solid.signed_volume_m3() - samples.buried_m3 : counted_volume(solid);
  const double volume = std::max(reference, 1e-4 * (solid.max_m() - solid.min_m()).prod());
  const auto affordable = [&](const char* field, double edge_m, double filled_m3) {
    const double takes = tetrahedra_of(filled_m3, cell_of_edge(edge_m));
    require(takes <= most_tetrahedra, field,
            fmt::format("edges of {:.2g} m take some {:.1g} tetrahedra, at most {} are made; give longer ones", edge_m, takes, most_tetrahedra));
  };
  if (o.edge_m > 0) {
    require(o.edge_m < solid.diagonal_m(), "edge_m", fmt::format("edges of {:.2g} m are longer than the object, {:.2g} m", o.edge_m, solid.diagonal_m()));
    affordable("edge_m", o.edge_m, volume);
  }
  for (const FinerNear& f : o.finer)
    affordable("finer.edge_m", f.edge_m, std::min(volume, 4.2 * std::pow(std::max(f.radius_m, f.edge_m), 3)));
  // What thin parts cost is found by trying. What is too much is merged again where the surface loses least.
  const double first_cell = o.edge_m > 0 ? cell_of_edge(o.edge_m) : cell_for(volume, o.tetrahedra);
  double cell = first_cell;
  const double shrinks = 0.95;  // improvement merges some more
  constexpr int attempts = 5;
  const double wall = 2 * std::max(reference, 1e-9 * volume) / solid.area_m2();
  // walls that a lattice tears cost volume, which is known of closed surfaces and guessed of others; it cuts edges of
  // slender bars, too
  const auto torn = [&](double volume_m3, double share) {
    return reference > 0 && std::abs(volume_m3 / reference - 1) > (solid.watertight() ? share : share + 0.2);
  };
  const double takes = 0.4 * solid.area_m2() / (wall * wall);  // walls of this width
  const auto too_thin = [&] {
    if (!(wall < 0.4 * cell))
      return Error(fmt::format("{} tetrahedra cannot follow it: parts of it are too thin, or tiny and far from the rest; ask for more, or "
                               "leave those parts out",
                               o.tetrahedra),
                   "surface");
    if (takes > most_tetrahedra)
      return Error(fmt::format("its walls, {:.2g} m thick on average, are too thin to be filled: walls of that width and size take some "
                               "{:.0e} tetrahedra, at most {} are made",
                               wall, takes, most_tetrahedra),
                   "surface");
    return Error(
        fmt::format("its walls, {:.2g} m thick on average, are too thin for {} tetrahedra; walls of that width and size "
                    "take some {:.1g} or more",
                    wall, o.tetrahedra, std::max(3.0 * o.tetrahedra, takes)),
        "surface");
  };
  // Improved for long, walls come out with about as many as they take, and more than four times what was asked for is refused.
  constexpr double hopeless = 8;
  if (reference > 0 && solid.watertight() && o.improve && o.edge_m == 0 && o.finer.empty() && wall < 0.4 * cell &&
      takes > hopeless * o.tetrahedra)
    throw too_thin();
  std::optional<Draft> best;
  double best_ratio = 0, intact_cell = cell;
  for (int attempt = 0; attempt < attempts; ++attempt) {
    if (progress && !progress("lattice", double(attempt) / attempts)) out.cancelled = true;
    bool unaffordable = false;
    auto fresh = draft(solid, samples, o, volume, cell, unaffordable);
    if (o.edge_m > 0) {
      best = std::move(fresh);
      break;
    }
    if (fresh && torn(fresh->volume_m3, wall < 0.4 * cell ? 0.05 : 0.12)) fresh.reset();
    if (unaffordable || (!fresh && best)) break;  // nothing finer can be had, nothing coarser holds together
    const double ratio = fresh ? shrinks * fresh->mesh.count() / o.tetrahedra : 0.2;
    if (fresh && (best_ratio < 1 ? ratio > best_ratio : ratio >= 1))
      best = std::move(fresh), best_ratio = ratio, intact_cell = cell;
    if ((ratio > 0.95 && ratio < 5) || out.cancelled) break;
    cell *= std::pow(std::clamp(ratio / 1.25, 0.2, 3.0), 0.43);
  }
  constexpr double next_to_nothing = 3e-4;
  if (!best && reference < next_to_nothing * (solid.max_m() - solid.min_m()).prod())
    throw Error(fmt::format("the box around it, {:.2g} m from corner to corner, is next to empty: leave out stray triangles, and parts that are "
                            "tiny and far from the rest",
                            solid.diagonal_m()),
                "surface");
  if (!best) throw too_thin();
  const bool shell = reference > 0 && wall < 0.4 * intact_cell;
  if (best_ratio > 1.05 && o.edge_m == 0 && o.improve && !out.cancelled) {
    CoarsenOptions fewer{static_cast<Index>(o.tetrahedra / shrinks), 0.1 * intact_cell, {}, shell ? wall : 0};
    if (!o.finer.empty()) fewer.edge_m = [&](const Vec3& p) { return finest_near(o, p); };
    fit_to_surface(best->mesh, solid, samples, 0.1);  // sharp edges are cut off by the lattice: first find them again
    coarsen(best->mesh, solid, samples, fewer);
    if (best->mesh.count() > 4 * o.tetrahedra) throw too_thin();
  }
  if (o.improve && shell) mind_walls(best->mesh, solid, wall);
  if (o.improve && !out.cancelled) out.cancelled = !improve(best->mesh, solid, samples, {}, progress);

  constexpr double usable = 0.3;                                            // 17 to 134 degrees
  if (o.improve && !out.cancelled && worst_quality(best->mesh) < usable) {  // walls that swell are the lesser evil
    best->mesh.coarse_m = intact_cell;
    best->mesh.measure_sizes();
    ImproveOptions last;
    last.most_rounds = 0;
    out.cancelled = !improve(best->mesh, solid, samples, last, progress);
  }
  if (o.improve && !out.cancelled) {
    const SharpEdges edges(solid);
    if (edges.meet(best->mesh, usable)) {
      fit_to_surface(best->mesh, solid, samples, usable);  // faces had bulged in place of the edges
      edges.meet(best->mesh, usable);
    }
  }

  out.mesh = best->mesh.compact();
  out.check = check_volume(out.mesh);
  // Where `finer` asks for many small cells the others grow to make up for them: that makes no thin walls of a solid's.
  const bool thin = shell && (o.finer.empty() || wall < 0.4 * first_cell);
  const bool flat = out.check.min_dihedral_deg < 15 || out.check.max_dihedral_deg > 150;
  if (o.edge_m == 0 && o.improve && !out.cancelled &&
      (torn(out.check.volume_m3, 0.1) || out.check.tetrahedra > 4 * o.tetrahedra || (thin && flat)))
    throw too_thin();
  const TriMesh boundary = boundary_surface(out.mesh).surface;
  if (known_volume) out.volume_error = out.check.volume_m3 / reference - 1;
  const CountedPoints seen = not_buried(surface, solid);
  constexpr int points = 20000;
  const auto distance =
      known_volume ? surface_distance(surface, boundary, points, seen) : one_sided_distance(surface, boundary, points, seen);
  out.surface_rms_m = distance.rms_m;
  out.hausdorff_m = distance.hausdorff_m;
  if (!known_volume) out.unseen_share = share_over_holes(boundary, solid);

  const auto warn = [&](const char* code, std::string message) {
    out.warnings.push_back({code, std::move(message), false});
  };
  if (out.unseen_share > 0.5)
    throw Error(
        fmt::format("{:.0f} % of the surface is missing: what lies inside would be invented. Scan more of the object, "
                    "or complete it with its support plane",
                    100 * out.unseen_share),
        "surface");
  if (out.unseen_share > 0.05)
    warn("closed_holes", fmt::format("{:.0f} % of the boundary closes holes of the given surface", 100 * out.unseen_share));
  constexpr double crumbs = 1e-4;  // of the volume: scraps at edges that nobody misses
  if (best->dropped > 0 && best->dropped_share > crumbs)
    warn("dropped_pieces",
         fmt::format("{} small piece{} ({:.2g} % of the volume) {} left out: parts of their own, or cut off by thin or open parts; the "
                     "largest is {:.2g} m long, at ({:.3g}, {:.3g}, {:.3g}) m",
                     best->dropped, best->dropped == 1 ? "" : "s", 100 * best->dropped_share, best->dropped == 1 ? "was" : "were",
                     best->dropped_size_m, best->dropped_at_m.x(), best->dropped_at_m.y(), best->dropped_at_m.z()));
  if (o.edge_m == 0 && out.check.tetrahedra > 1.5 * o.tetrahedra)
    warn("more_than_asked", fmt::format("{} tetrahedra and not {}: with fewer the thin parts would lose their shape",
                                        out.check.tetrahedra, o.tetrahedra));
  for (const Finding& f : out.check.findings)
    if (f.code != "units") out.warnings.push_back(f);
  constexpr double near_rms = 0.0025, near_most = 0.02;  // of the diagonal: what a few thousand tetrahedra keep to
  if (known_volume && o.improve && (out.surface_rms_m > near_rms * solid.diagonal_m() || out.hausdorff_m > near_most * solid.diagonal_m()))
    warn("surface_distance", fmt::format("the surface is up to {:.2g} m away from the model's ({:.2g} m rms): thin or pointed parts are cut "
                                         "short; ask for more tetrahedra, or check the surface for stray vertices",
                                         out.hausdorff_m, out.surface_rms_m));
  if (out.volume_error && std::abs(*out.volume_error) > 0.03)
    warn("volume_error", fmt::format("the volume differs by {:+.1f} % from the surface's; ask for more tetrahedra",
                                     100 * *out.volume_error));
  return out;
}

}  // namespace palpate::geometry
