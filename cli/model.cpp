// SPDX-License-Identifier: Apache-2.0
// `palpate model`: a mesh file, however broken, or a recording's object at rest becomes tetrahedra that can be simulated.
#include <fmt/core.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

#include "cli/number_checks.hpp"
#include "cli/paths.hpp"
#include "cli/verbs.hpp"
#include "palpate/core/error.hpp"
#include "palpate/identify.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/mesh_file.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/reconstruction/build_object.hpp"
#include "palpate/report/mesh_picture.hpp"

namespace palpate::cli {
namespace {

struct ModelArguments {
  std::string input, output, unit = "m";
  Index tetrahedra = 10000;
  double edge_m = 0;
  std::vector<double> finer;
};

double metres_per(const std::string& unit) {
  if (unit == "mm") return 1e-3;
  if (unit == "cm") return 1e-2;
  if (unit == "in") return 0.0254;
  return 1;
}

/// The object at rest as a recording gives it: a volume, a surface, or views to be fused.
reconstruction::BuiltObject build_from_recording(const ModelArguments& o, const reconstruction::BuildOptions& options,
                                                 Session& session) {
  const Recording recording = io::read_recording_unchecked(o.input);
  const Rest& rest = recording.rest;
  if (rest.volume) return reconstruction::build_object(*rest.volume, recording.supports);
  if (rest.surface) return reconstruction::build_object(*rest.surface, recording.supports, options, session.progress());
  return build_from_views(recording, options, reconstruction::Completion::mirrored, session.progress());
}

reconstruction::BuiltObject build(const ModelArguments& o, Session& session) {
  reconstruction::BuildOptions options;
  if (o.tetrahedra != 0) options.mesh.tetrahedra = o.tetrahedra;
  options.mesh.edge_m = o.edge_m;
  options.fine_surface = true;
  if (!o.finer.empty()) options.mesh.finer = {{Vec3(o.finer[0], o.finer[1], o.finer[2]), o.finer[3], o.finer[4]}};
  if (std::filesystem::is_directory(o.input)) return build_from_recording(o, options, session);
  io::MeshData data = io::read_mesh(o.input);
  data.points_m *= metres_per(o.unit);
  const bool keep = data.tetrahedra.rows() > 0 && o.tetrahedra == 0;
  if (keep) return reconstruction::build_object(io::tet_mesh_of(std::move(data), o.input), {});
  TriMesh surface;
  if (data.tetrahedra.rows() > 0)
    surface = geometry::boundary_surface(io::tet_mesh_of(std::move(data), o.input)).surface;
  else
    surface = io::tri_mesh_of(std::move(data), o.input);
  if (o.tetrahedra == 0 && o.edge_m == 0)
    throw Error("0 keeps the tetrahedra of a volume, but the file holds a surface: give how many are wished", "--tetrahedra");
  try {
    return reconstruction::build_object(surface, {}, options, session.progress());
  } catch (const Error& error) {
    if (error.where() != "surface") throw;
    throw Error(error.message(), o.input);
  }
}

int run(const ModelArguments& o, Session& session) {
  must_exist(o.input, "give a mesh file, or the folder of a recording");
  must_take_files(o.output);
  const auto start = std::chrono::steady_clock::now();
  const auto built = build(o, session);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (Session::interrupted()) return exit_numbers;

  const std::filesystem::path folder = o.output;
  std::filesystem::create_directories(folder);
  for (const char* name : {"model.vtu", "model.msh", "model.vtk"}) io::write_mesh(folder / name, built.model.volume);
  const TriMesh& surface = built.fine_surface.triangles.rows() > 0 ? built.fine_surface : built.model.surface;
  io::write_mesh(folder / "surface.ply", surface);
  io::write_file(folder / "model.png", report::encode_png(report::draw_mesh(built.model.volume, 1200, 600)));

  const auto& c = built.check;
  for (const std::string& w : built.model.warnings) session.warn(w);
  session.say(
      fmt::format("{} tetrahedra, {} nodes, volume {:.4g} m3{}", c.tetrahedra, c.nodes, c.volume_m3,
                  built.volume_error ? fmt::format(" ({:+.2f} % of the surface's)", 100 * *built.volume_error) : ""));
  session.say(fmt::format("dihedral angles {:.1f} to {:.1f} degrees; surface within {:.3g} m rms, {:.3g} m at most",
                          c.min_dihedral_deg, c.max_dihedral_deg, built.surface_rms_m, built.hausdorff_m));
  session.say(fmt::format("written to {} in {}", o.output, duration(seconds)));
  nlohmann::json volume_error;
  if (built.volume_error) volume_error = *built.volume_error;
  session.result({{"tetrahedra", c.tetrahedra},
                  {"nodes", c.nodes},
                  {"inverted", c.inverted + c.degenerate},
                  {"components", c.components},
                  {"non_manifold_edges", c.non_manifold_boundary_edges},
                  {"min_dihedral_deg", c.min_dihedral_deg},
                  {"max_dihedral_deg", c.max_dihedral_deg},
                  {"volume_m3", c.volume_m3},
                  {"volume_error", volume_error},
                  {"surface_rms_m", built.surface_rms_m},
                  {"hausdorff_m", built.hausdorff_m},
                  {"unseen_share", built.model.unseen_share},
                  {"seconds", seconds},
                  {"files", {"model.vtu", "model.msh", "model.vtk", "model.png", "surface.ply"}},
                  {"warnings", built.model.warnings}});
  return exit_done;
}

}  // namespace

Run verbs::model(CLI::App& app) {
  auto o = std::make_shared<ModelArguments>();
  app.add_option("INPUT", o->input,
                 "mesh file: a surface (OBJ, STL, PLY, ...), however broken, or a volume (MSH, VTK, VTU); or a recording")
      ->required();
  app.add_option("-o,--out,--output", o->output,
                 "folder for model.vtu, model.msh, model.vtk, model.png (a picture) and surface.ply (of views: fused, watertight and "
                 "finer than the tetrahedra)")
      ->required();
  app.add_option("--tetrahedra", o->tetrahedra, "wished number of tetrahedra; 0 keeps those of a volume as they are")
      ->check(CLI::Range(0, 2000000))
      ->type_name("N")
      ->capture_default_str();
  app.add_option("--edge", o->edge_m, "wished edge length in metres instead of a number")->check(positive_number())->type_name("METRES");
  app.add_option("--finer", o->finer, "shorter edges near a point: X Y Z RADIUS EDGE, in metres")
      ->expected(5)
      ->type_name("");
  app.add_option("--unit", o->unit, "unit of the file's coordinates")
      ->check(CLI::IsMember({"m", "cm", "mm", "in"}))
      ->capture_default_str();
  return [o](Session& session) { return run(*o, session); };
}

}  // namespace palpate::cli
