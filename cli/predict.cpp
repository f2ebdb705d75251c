// SPDX-License-Identifier: Apache-2.0
// `palpate predict OUT --contact X Y Z --force F`: what the learned object does under a new push, with bands.
#include "palpate/prediction/predict.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>

#include "cli/learned_object.hpp"
#include "cli/number_checks.hpp"
#include "cli/paths.hpp"
#include "cli/verbs.hpp"
#include "palpate/core/error.hpp"
#include "palpate/estimation/held_body.hpp"
#include "palpate/estimation/load_columns.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/geometry/mesh_checks.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/mesh_file.hpp"
#include "palpate/report/words.hpp"

namespace palpate::cli {
namespace {

struct Options {
  std::filesystem::path result, out;
  std::vector<double> contact, direction;
  std::optional<double> force_n, travel_m;
  double radius_m = 0;
  std::string tool;
};

Tool tool_of(const Options& given, const Recording& object) {
  Tool tool;
  const auto found =
      std::find_if(object.tools.begin(), object.tools.end(), [&](const Tool& one) { return one.name == given.tool; });
  if (!given.tool.empty()) {
    if (found == object.tools.end()) throw Error("the recording had no tool of this name", "--tool " + given.tool);
    tool = *found;
  } else if (given.radius_m > 0) {
    tool.name = "disc";
    tool.shape = ToolShape::disc;
  } else if (object.tools.size() == 1) {
    tool = object.tools.front();
  } else {
    throw Error("say what pushes: --tool NAME (one of the recording's) or --radius METRES", "predict");
  }
  if (given.radius_m > 0) tool.radius_m = given.radius_m;
  return tool;
}

fem::Boundary boundary_of(const Recording& object, const Tool& tool, const Load& load, VectorX& background) {
  const TetMesh& mesh = *object.rest.volume;
  fem::Boundary boundary;
  const auto patch = estimation::load_columns(mesh, tool, load);
  // Of a shape that was seen while it sagged, the weight is in the shape.
  const bool heavy = object.rest.state == RestState::stress_free && object.environment.gravity_m_s2.norm() > 0;
  std::vector<Eigen::Triplet<double>> entries;
  const auto put = [&](const Eigen::SparseMatrix<double>& columns, int first) {
    for (int c = 0; c < 3; ++c)
      for (Eigen::SparseMatrix<double>::InnerIterator it(columns, c); it; ++it)
        entries.emplace_back(int(it.row()), first + c, it.value());
  };
  put(patch, 0);
  if (heavy) {
    if (!(object.density_kg_m3 > 0))
      throw Error("gravity acts, so the density is needed", "model/recording.yaml: density_kg_m3");
    put(fem::body_force(mesh), 3);
    background = object.density_kg_m3 * object.environment.gravity_m_s2;
  }
  boundary.forces.resize(3 * mesh.nodes_m.rows(), heavy ? 6 : 3);
  boundary.forces.setFromTriplets(entries.begin(), entries.end());
  boundary.inertia_relief = object.free;
  if (object.free) {
    boundary.motions.resize(3 * mesh.nodes_m.rows(), 0);
  } else {
    estimation::HeldBody held = estimation::hold(mesh, object.supports, {});
    boundary.constraints = std::move(held.constraints);
    boundary.motions = std::move(held.motions);
  }
  return boundary;
}

nlohmann::json json_of(const prediction::Band& band) {
  return {{"value", band.value}, {"std", band.std}, {"lower_95", band.lower_95}, {"upper_95", band.upper_95}};
}

nlohmann::json regions_json(const prediction::Elasticity& elasticity) {
  nlohmann::json list = nlohmann::json::array();
  for (std::size_t r = 0; r < elasticity.regions.size(); ++r) {
    const Index at = static_cast<Index>(r);
    list.push_back({{"region", elasticity.regions[r]},
                    {"young_modulus_pa", elasticity.young_modulus_of(at)},
                    {"poisson_ratio", elasticity.poisson_ratio_of(at)}});
  }
  return list;
}

MatrixX by_rows(const VectorX& field) { return Eigen::Map<const Points>(field.data(), field.size() / 3, 3); }

double mesh_size_m(const TetMesh& mesh) { return (mesh.nodes_m.colwise().maxCoeff() - mesh.nodes_m.colwise().minCoeff()).norm(); }

std::string words(const Vec3& at) { return fmt::format("{:.4g} {:.4g} {:.4g}", at.x(), at.y(), at.z()); }

/// A place beside the surface would be pressed by the part of the patch that reaches it: it is moved there, or refused.
void put_on_surface(const TetMesh& mesh, const Tool& tool, Load& load, Session& session) {
  const TriMesh surface = geometry::boundary_surface(mesh).surface;
  const auto foot = geometry::TriangleTree(surface).closest(load.contact_m);
  const double off_m = std::sqrt(foot.squared_distance_m2), near_m = 0.01 * mesh_size_m(mesh);
  if (off_m > std::max(near_m, 0.5 * tool.radius_m))
    throw Error(fmt::format("lies {} away from the object's surface; the nearest place on it is {}", report::quantity(off_m, "m"), words(foot.point_m)),
                "--contact " + words(load.contact_m));
  if (off_m > near_m) session.warn(fmt::format("the contact is moved by {} onto the surface, to {}", report::quantity(off_m, "m"), words(foot.point_m)));
  load.contact_m = foot.point_m;
  const auto corner = [&](int k) { return Vec3(surface.vertices_m.row(surface.triangles(foot.triangle, k))); };
  const Vec3 outwards = (corner(1) - corner(0)).cross(corner(2) - corner(0));
  if (load.direction.dot(outwards) > 0)
    throw Error("points out of the object there, and a tool can only push; into it is about " + words(-outwards.normalized()),
                "--direction " + words(load.direction));
}

/// A solver looks long for an equilibrium that no material has.
void must_be_bearable(const prediction::NewPush& push, const Tool& tool, const TetMesh& mesh, double young_modulus_pa) {
  const double size_m = mesh_size_m(mesh);
  if (push.travel_m && *push.travel_m > size_m)
    throw Error(fmt::format("is further than the object is large ({}); it is in metres", report::quantity(size_m, "m")),
                fmt::format("--travel {:g}", *push.travel_m));
  const bool round = tool.shape == ToolShape::sphere || tool.shape == ToolShape::disc;
  const double area_m2 = round && tool.radius_m > 0 ? EIGEN_PI * tool.radius_m * tool.radius_m : size_m * size_m;
  constexpr double most_over_young = 10;
  if (push.force_n && *push.force_n > most_over_young * young_modulus_pa * area_m2)
    throw Error(fmt::format("is {:.2g} times what E ({}) bears on the pressed patch; no such object stands that. It is in newtons",
                            *push.force_n / (young_modulus_pa * area_m2), report::quantity(young_modulus_pa, "Pa")),
                fmt::format("--force {:g}", *push.force_n));
}

int run(const Options& given, Session& session) {
  end_at_first_interrupt();
  const LearnedObject learned = load_learned_object(given.result);
  const Recording& object = learned.object;
  const TetMesh& mesh = *object.rest.volume;
  const Tool tool = tool_of(given, object);
  Load load;
  load.tool = tool.name;
  if (given.contact.size() == 3)
    load.contact_m = Vec3(given.contact[0], given.contact[1], given.contact[2]);
  else if (tool.shape != ToolShape::vertices)
    throw Error("say where: --contact X Y Z, in metres", "predict");
  if (given.direction.size() == 3) load.direction = Vec3(given.direction[0], given.direction[1], given.direction[2]);
  if (!(load.direction.norm() > 0)) throw Error("must not be zero", "--direction");
  load.direction.normalize();
  if (tool.shape != ToolShape::vertices) put_on_surface(mesh, tool, load, session);
  prediction::NewPush push;
  push.direction = load.direction;
  push.force_n = given.force_n;
  push.travel_m = given.travel_m;
  if (push.force_n.has_value() == push.travel_m.has_value()) throw Error("give either --force or --travel", "predict");
  if (!given.out.empty()) must_take_files(given.out);
  fem::Boundary boundary = boundary_of(object, tool, load, push.background);
  const prediction::Elasticity elasticity = elasticity_of(learned);
  must_be_bearable(push, tool, mesh, elasticity.highest_young_modulus_pa());
  fem::StaticsOptions options;
  options.threads = session.thread_count();
  if (mesh.tetrahedra.cols() == 10 && elasticity.highest_poisson_ratio() > 0.45) options.dilatation = fem::Dilatation::averaged;
  const prediction::Prediction found = prediction::predict(mesh, elasticity, std::move(boundary), push, options);
  if (!found.converged) {
    session.warn("no equilibrium was found: " + found.reason);
    session.result({{"format", "palpate-prediction/1"}, {"converged", false}, {"reason", found.reason}});
    return exit_numbers;
  }
  if (!found.reason.empty()) session.warn(found.reason);
  if (!(std::abs(found.travel_m.value) > 1e-9 * mesh_size_m(mesh)))
    throw Error("a support holds the object at this place: nothing moves there", "--contact " + words(load.contact_m));
  const auto tell = [&](const char* what, const prediction::Band& band, const char* unit) {
    session.say(
        fmt::format("{:<20} {}{}", what, report::quantity(band.value, unit),
                    band.std > 0 ? "   95 % band " + report::interval(band.lower_95, band.upper_95, unit) : "   (given)"));
  };
  tell("force", found.force_n, "N");
  tell("travel", found.travel_m, "m");
  tell("largest motion", found.largest_displacement_m, "m");
  tell("largest stress", found.largest_von_mises_pa, "Pa");
  session.say(fmt::format("stiffness            {:.4g} N/m (of the force to the travel there)", found.stiffness_n_m));
  if (elasticity.covariance.norm() == 0) session.warn("the result holds no covariance: the bands have no width");
  nlohmann::json json = {{"format", "palpate-prediction/1"},
                         {"converged", true},
                         {"material", elasticity.material},
                         {"young_modulus_pa", elasticity.young_modulus_pa},
                         {"poisson_ratio", elasticity.poisson_ratio},
                         {"regions", regions_json(elasticity)},
                         {"tool", tool.name},
                         {"contact_m", {load.contact_m.x(), load.contact_m.y(), load.contact_m.z()}},
                         {"direction", {load.direction.x(), load.direction.y(), load.direction.z()}},
                         {"force_n", json_of(found.force_n)},
                         {"travel_m", json_of(found.travel_m)},
                         {"stiffness_n_m", found.stiffness_n_m},
                         {"largest_displacement_m", json_of(found.largest_displacement_m)},
                         {"largest_von_mises_pa", json_of(found.largest_von_mises_pa)},
                         {"inverted_elements", found.inverted_elements}};
  if (!given.out.empty()) {
    std::error_code code;
    std::filesystem::create_directories(given.out, code);
    io::MeshData data;
    data.points_m = mesh.nodes_m;
    data.tetrahedra = mesh.tetrahedra;
    data.point_fields["displacement_m"] = by_rows(found.displacement_m);
    data.point_fields["displacement_std_m"] = by_rows(found.displacement_std_m);
    data.point_fields["von_mises_pa"] = found.von_mises_pa;
    data.point_fields["von_mises_std_pa"] = found.von_mises_std_pa;
    io::write_mesh(given.out / "prediction.vtu", data);
    io::write_file(given.out / "prediction.json", json.dump(1) + "\n");
    session.say(fmt::format("written              {}", (given.out / "prediction.vtu").string()));
  }
  session.result(json);
  return exit_done;
}

}  // namespace

Run verbs::predict(CLI::App& app) {
  auto given = std::make_shared<Options>();
  app.add_option("result", given->result, "folder that `palpate estimate` wrote")->required();
  app.add_option("--contact", given->contact, "where the push acts, X Y Z in metres, base frame")
      ->check(finite_number())
      ->expected(3)
      ->type_name("");
  app.add_option("--direction", given->direction, "of the push, into the object (0 0 -1)")->check(finite_number())->expected(3)->type_name("");
  app.add_option("--force", given->force_n, "along the direction, N")->check(positive_number());
  app.add_option("--travel", given->travel_m, "of the pressed patch along the direction, m, instead of a force")->check(positive_number());
  app.add_option("--tool", given->tool, "tool of the recording (its only one)");
  app.add_option("--radius", given->radius_m, "radius of the pressed patch, m (that of the tool)")
      ->check(positive_number());
  app.add_option("-o,--out", given->out,
                 "folder for prediction.json and prediction.vtu (displacement and stress with bands)");
  return [given](Session& session) { return run(*given, session); };
}

}  // namespace palpate::cli
