// SPDX-License-Identifier: Apache-2.0
#include "cli/lab_setup.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <fstream>

#include "cli/number_checks.hpp"
#include "palpate/core/error.hpp"
#include "palpate/fem/materials.hpp"
#include "palpate/io/mesh_file.hpp"

namespace palpate::cli {

void add_mesh_file_options(CLI::App& app, MeshFileArguments& arguments) {
  app.add_option("--object-up", arguments.up, "which axis of a mesh file points upwards")
      ->check(CLI::IsMember({"x", "y", "z"}))
      ->capture_default_str();
  app.add_option("--object-size", arguments.size_m, "scale a mesh file to this longest extent, m (default: it is in metres)")
      ->check(CLI::Range(0.02, 0.5));
}

TriMesh read_object(const std::string& file, const MeshFileArguments& arguments) {
  return lab::turned_and_scaled(io::read_tri_mesh(file), arguments.up.front() - 'x', arguments.size_m);
}

void add_lab_options(CLI::App& app, LabArguments& arguments) {
  std::string objects;
  for (const auto& row : lab::built_in_objects()) objects += fmt::format("\n{}: {}", row.name, row.summary);
  std::string laws;
  for (const auto* law : fem::material_table()) laws += (laws.empty() ? "" : ", ") + std::string(law->name());
  app.add_option("--object", arguments.object,
                 "what the lab's robot pushes: a mesh file (closed, metres), or one of" + objects)
      ->capture_default_str();
  add_mesh_file_options(app, arguments.file);
  app.add_option("--material", arguments.material, "law of the true object: " + laws + " (default neo_hookean)");
  const auto rows = [](const auto& table) {
    std::string text;
    for (const auto& row : table) text += fmt::format("\n{}: {}", row.name, row.source);
    return text;
  };
  app.add_option("--depth-sensor", arguments.depth_sensor, "one of (the source of every number: docs/lab.md)" + rows(lab::depth_sensors()))->capture_default_str();
  app.add_option("--force-sensor", arguments.force_sensor, "one of (the source of every number: docs/lab.md)" + rows(lab::force_sensors()))->capture_default_str();
  app.add_option("--young-modulus", arguments.young_modulus_pa,
                 "of the true object, Pa (default: drawn from the seed, 10 to 40 kPa; bar: ten times that)")
      ->check(positive_number());
  app.add_option("--region-ratio", arguments.region_ratio,
                 "of the bear: its head is stiffer and its back softer by this factor; of the bar: its upper half is stiffer")
      ->check(positive_number());
  app.add_option("--poisson-ratio", arguments.poisson_ratio, "of the true object (drawn from the seed: 0.1 to 0.45)")
      ->check(CLI::Range(0.0, 0.4998));
  app.add_option("--stands", arguments.stands,
                 "how the object stands on the table (and at the wall); what is not glued can lift off and slide")
      ->check(CLI::IsMember({"glued", "rough"}))
      ->capture_default_str();
  app.add_option("--friction", arguments.friction_coefficient, "Coulomb's coefficient of a rough table and wall")
      ->check(positive_number())
      ->capture_default_str();
  app.add_flag("--wall", arguments.wall, "an upright wall behind the object, and a push towards it");
  app.add_option("--tip", arguments.tip, "what presses: a round soft pad, or a stiff flat face of that size (punch; smooth, its contact is solved for)")
      ->check(CLI::IsMember({"pad", "punch"}))
      ->capture_default_str();
  app.add_option("--albedo", arguments.albedo, "of the true object, 0 to 1: dark things are noisy to time of flight (default: of the object)")
      ->check(CLI::Range(0.01, 1.0));
  app.add_option("--texture", arguments.texture,
                 "of the true object, 0 (uniform) to 1: passive stereo loses patches of what has little (default: of the object)")
      ->check(CLI::Range(0.0, 1.0));
  lab::LabOptions& lab = arguments.lab;
  app.add_option("--ambient-light", arguments.ambient_light, "over what the time-of-flight camera's noise model assumes")
      ->check(number_from_zero())
      ->capture_default_str();
  app.add_option("--camera", arguments.camera, "where the depth camera is: it stands and looks on, or the hand carries it")
      ->check(CLI::IsMember({"stands", "hand"}))
      ->capture_default_str();
  app.add_option("--arm-at", arguments.arm_at, "where the arm stands: x and y in m, and its turn about z in rad (the object stays at 0.6 0 m)")
      ->expected(3);
  app.add_option("--compliance", lab.compliance_m_per_n, "of the lab's stick and arm, m/N (0.0001: a tenth of a millimetre a newton)")
      ->check(number_from_zero());
  app.add_option("--stated-compliance", lab.stated_compliance_m_per_n, "what the recording says of it, m/N (default: the truth)")
      ->check(number_from_zero());
  app.add_option("--stated-compliance-std", lab.stated_compliance_std_m_per_n, "how well the recording says that it is known, m/N (default: exactly)")
      ->check(number_from_zero());
  app.add_option("--relaxation", lab.relaxation, "share of each rise of the force that fades after the motion")
      ->check(CLI::Range(0.0, 0.95))
      ->capture_default_str();
  app.add_option("--relaxation-time", lab.relaxation_s, "with this time constant, s")->check(positive_number())->capture_default_str();
  app.add_option("--slip-at", lab.slip_at_m, "travel at which the tip slides off sideways, m (default: it holds)")->check(positive_number());
  app.add_option("--slides-at", lab.slides_at_n, "sideways force at which the object slides on the table, N (default: it holds)")
      ->check(positive_number());
}

lab::LabObject lab_object(const LabArguments& arguments, std::uint64_t seed) {
  lab::ObjectOptions options;
  options.seed = seed;
  if (!arguments.material.empty()) options.material = arguments.material;
  if (arguments.young_modulus_pa != 0) options.young_modulus_pa = arguments.young_modulus_pa;
  if (arguments.poisson_ratio >= 0) options.poisson_ratio = arguments.poisson_ratio;
  options.region_ratio = arguments.region_ratio;
  options.stands = arguments.stands == "rough" ? ContactLaw::friction : ContactLaw::bonded;
  options.friction_coefficient = arguments.friction_coefficient;
  options.wall = arguments.wall;
  options.punch = arguments.tip == "punch";
  if (arguments.albedo > 0) options.albedo = arguments.albedo;
  if (arguments.texture >= 0) options.texture = arguments.texture;
  const bool built_in = std::any_of(lab::built_in_objects().begin(), lab::built_in_objects().end(),
                                    [&](const lab::BuiltInObject& row) { return row.name == arguments.object; });
  if (built_in || !std::filesystem::exists(arguments.object)) return lab::make_object(arguments.object, options);
  return lab::object_from_surface(read_object(arguments.object, arguments.file),
                                  std::filesystem::path(arguments.object).filename().string(), options);
}

lab::LabOptions lab_options(const LabArguments& arguments, std::uint64_t seed) {
  lab::LabOptions options = arguments.lab;
  options.seed = seed;
  options.depth = lab::depth_sensor(arguments.depth_sensor);
  options.depth.ambient_light = arguments.ambient_light;
  options.camera_on_hand = arguments.camera == "hand";
  if (arguments.arm_at.size() == 3) {
    options.T_base_arm.translation() = Vec3(arguments.arm_at[0], arguments.arm_at[1], 0);
    options.T_base_arm.rotate(Eigen::AngleAxisd(arguments.arm_at[2], Vec3::UnitZ()));
  }
  options.force = lab::force_sensor(arguments.force_sensor);
  return options;
}

nlohmann::json truth_json(const lab::LabRobot& robot) {
  const lab::LabObject& object = robot.object();
  nlohmann::json json = {{"object", object.name},
                         {"young_modulus_pa", object.young_modulus_pa},
                         {"poisson_ratio", object.poisson_ratio},
                         {"material", object.material},
                         {"description", object.description},
                         {"extra", object.extra},
                         {"albedo", object.look.albedo},
                         {"texture", object.look.texture},
                         {"force_scale", robot.true_force_scale()},
                         {"steps", nlohmann::json::array()}};
  for (const lab::TrueRegion& region : object.regions)
    json["regions"].push_back({{"name", region.region.name}, {"young_modulus_pa", region.young_modulus_pa}});
  return json;
}

nlohmann::json truth_json(const Push& push, const Step& step, const lab::LabRobot& robot) {
  return {
      {"push", push.name}, {"time_s", step.time_s}, {"force_n", robot.true_force_n()}, {"travel_m", robot.true_travel_m()}};
}

void write_json(const nlohmann::json& json, const std::filesystem::path& path) {
  std::ofstream file(path);
  file << json.dump(2) << '\n';
  if (!file) throw Error("cannot be written", path.string());
}

}  // namespace palpate::cli
