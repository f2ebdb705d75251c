// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/result.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/geometry/mesh_checks.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/mesh_file.hpp"
#include "palpate/io/npy.hpp"
#include "palpate/io/part_folder.hpp"
#include "palpate/io/result_parts.hpp"

namespace palpate::io {
namespace {

namespace fs = std::filesystem;

void make_folder(const fs::path& folder) {
  std::error_code code;
  fs::create_directories(folder, code);
  if (!fs::is_directory(folder, code)) throw Error("cannot be made; check the name and the permissions", folder.string());
}

fs::path step_file(const fs::path& folder, std::size_t step, const char* what) {
  return folder / "fit" / fmt::format("step_{:04}_{}.npy", step + 1, what);
}

/// What simulators take from an answer; NaN where it has no such parameter.
double value_of(const Identification& answer, const char* name) {
  for (const Parameter& one : answer.parameters) {
    if (one.name == name && one.region.empty()) return one.value;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

/// A parameter of every region, in their order.
std::vector<double> of_regions(const Identification& answer, const char* name) {
  std::vector<double> out;
  for (const Parameter& one : answer.parameters)
    if (one.name == name) out.push_back(one.value);
  return out;
}

MatrixX by_element(const std::vector<double>& of_region, const std::vector<int>& region) {
  MatrixX out(static_cast<Index>(region.size()), 1);
  for (std::size_t e = 0; e < region.size(); ++e) out(static_cast<Index>(e)) = of_region.at(static_cast<std::size_t>(region[e]));
  return out;
}

/// Files of a folder, its own folders' too.
std::vector<fs::path> files_in(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code code;
  for (fs::recursive_directory_iterator at(folder, code), end; !code && at != end; at.increment(code))
    if (at->is_regular_file(code)) files.push_back(at->path().lexically_relative(folder));
  if (code) throw Error("cannot be read: " + code.message(), folder.string());
  return files;
}

bool ties_to_the_result(const fs::path& file) {
  for (const char* one : {"recording.yaml", "object.vtu", "object.msh", "surface.obj"})
    if (file == one) return false;
  return true;
}

}  // namespace

void write_result(const Identification& answer, const fs::path& folder, const fs::path& model) {
  make_folder(folder);
  PartFolder part(folder / "result");
  if (answer.surface.triangles.rows() > 0) {
    make_folder(part.path() / "fit");
    write_mesh(part.path() / "fit" / "surface.ply", answer.surface);
    for (std::size_t i = 0; i < answer.steps.size(); ++i) {
      const StepFit& step = answer.steps[i];
      const auto put = [&](const char* what, const MatrixX& values) {
        if (values.size() > 0) write_file(step_file(part.path(), i, what), npy_bytes(values));
      };
      put("surface_m", step.surface_m);
      put("observed_m", step.observed_m);
      put("residual_m", step.residual_m);
      put("von_mises_pa", step.von_mises_pa);
      put("masked_m", step.masked_m);
    }
  }
  nlohmann::json object = result_json(answer);
  std::vector<fs::path> of_model;
  if (!model.empty()) {
    of_model = files_in(model);
    nlohmann::json& digests = object["model_sha256"] = nlohmann::json::object();
    for (const fs::path& file : of_model)
      if (ties_to_the_result(file)) digests[file.generic_string()] = sha256_hex(read_file(model / file));
  }
  write_file(part.path() / "result.json", object.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");

  // From here on only names change. An earlier result.json goes first: it must not stand beside another's model.
  std::error_code code;
  fs::remove(folder / "result.json", code);
  for (const fs::path& file : of_model) {
    fs::create_directories((folder / "model" / file).parent_path(), code);
    put_in_place(model / file, folder / "model" / file);
  }
  fs::remove_all(folder / "fit", code);
  if (fs::exists(part.path() / "fit", code)) put_in_place(part.path() / "fit", folder / "fit");
  // Last: who finds a result.json finds all that belongs to it.
  put_in_place(part.path() / "result.json", folder / "result.json");
}

void check_model(const fs::path& folder) {
  const fs::path index = folder / "result.json";
  const nlohmann::json object = nlohmann::json::parse(read_file(index), nullptr, false);
  if (!object.is_object() || !object.contains("model_sha256")) return;
  const nlohmann::json& digests = object["model_sha256"];
  if (!digests.is_object()) throw Error("must be an object of file names; run `palpate estimate` again", index.string() + ": model_sha256");
  std::error_code code;
  for (const auto& [name, digest] : digests.items()) {
    const fs::path file = folder / "model" / name;
    if (!fs::is_regular_file(file, code) || digest != sha256_hex(read_file(file)))
      throw Error("is not the file that " + index.string() +
                      " was written with: a model of another estimate, or changed since; run `palpate estimate` again",
                  file.string());
  }
}

Identification read_result(const fs::path& given) {
  std::error_code code;
  const bool is_file = fs::is_regular_file(given, code);
  const fs::path folder = is_file ? given.parent_path() : given;
  const fs::path index = is_file ? given : folder / "result.json";
  Identification answer = parse_result(read_file(index), index.string());
  if (!fs::exists(folder / "fit" / "surface.ply", code)) return answer;
  answer.surface = read_tri_mesh(folder / "fit" / "surface.ply");
  for (std::size_t i = 0; i < answer.steps.size(); ++i) {
    const auto get = [&](const char* what, Eigen::Index columns) -> MatrixX {
      const fs::path file = step_file(folder, i, what);
      if (!fs::exists(file, code)) return MatrixX(0, columns);
      MatrixX values = parse_npy(read_file(file), file.string());
      if (values.cols() != columns)
        throw Error("has " + std::to_string(values.cols()) + " columns, " + std::to_string(columns) + " are expected",
                    file.string());
      return values;
    };
    StepFit& step = answer.steps[i];
    step.surface_m = get("surface_m", 3);
    step.observed_m = get("observed_m", 3);
    step.residual_m = get("residual_m", 1);
    step.von_mises_pa = get("von_mises_pa", 1);
    step.masked_m = get("masked_m", 3);
  }
  return answer;
}

void write_model(const Identification& answer, const TetMesh& volume, const fs::path& folder, const std::vector<int>& region) {
  make_folder(folder);
  const double young = value_of(answer, "young_modulus"), poisson = value_of(answer, "poisson_ratio");
  MeshData mesh;
  mesh.points_m = volume.nodes_m;
  mesh.tetrahedra = volume.tetrahedra;
  if (std::isfinite(young)) mesh.cell_fields["young_modulus_pa"] = MatrixX::Constant(volume.tetrahedra.rows(), 1, young);
  if (!region.empty()) mesh.cell_fields["young_modulus_pa"] = by_element(of_regions(answer, "young_modulus"), region);
  if (std::isfinite(poisson)) mesh.cell_fields["poisson_ratio"] = MatrixX::Constant(volume.tetrahedra.rows(), 1, poisson);
  if (const auto own = of_regions(answer, "poisson_ratio"); !std::isfinite(poisson) && !region.empty() && own.size() > 1)
    mesh.cell_fields["poisson_ratio"] = by_element(own, region);
  write_mesh(folder / "object.vtu", mesh);
  write_mesh(folder / "object.msh", mesh);
  write_mesh(folder / "surface.obj", geometry::boundary_surface(volume).surface);

  const nlohmann::json whole = result_json(answer);
  nlohmann::json material;
  material["format"] = "palpate-material/1";
  material["law"] = answer.material;
  material["parameters"] = whole["parameters"];
  if (std::isfinite(young) && std::isfinite(poisson) && poisson < 0.5) {
    material["young_modulus_pa"] = young;
    material["poisson_ratio"] = poisson;
    material["shear_modulus_pa"] = young / (2 * (1 + poisson));
    material["lame_lambda_pa"] = young * poisson / ((1 + poisson) * (1 - 2 * poisson));
    material["bulk_modulus_pa"] = young / (3 * (1 - 2 * poisson));
  }
  for (const Nuisance& one : answer.nuisances) {
    if (one.name == "density") material["density_kg_m3"] = one.value;
  }
  material["verdicts"] = whole["verdicts"];
  material["mesh"] = {{"file", "object.vtu"},
                      {"nodes", volume.nodes_m.rows()},
                      {"tetrahedra", volume.tetrahedra.rows()},
                      {"element", volume.tetrahedra.cols() == 10 ? "tet10" : "tet4"},
                      {"unit", "m"}};
  write_file(folder / "material.json", material.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
}

}  // namespace palpate::io
