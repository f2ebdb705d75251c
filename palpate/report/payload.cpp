// SPDX-License-Identifier: Apache-2.0
#include "palpate/report/payload.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>

#include "palpate/core/version.hpp"
#include "palpate/report/thinning.hpp"
#include "palpate/report/words.hpp"

namespace palpate::report {
namespace {

using nlohmann::json;

constexpr std::size_t max_vertices_shown = 9'000;  // software rendering on two cores keeps 20 frames a second
constexpr std::size_t max_points_shown = 15'000;
constexpr std::size_t max_steps_shown = 100;
constexpr double raw_bytes_per_text_byte = 0.75;  // base64

json as_json(const Parameter& p) {
  const double resolution = (p.upper_95 - p.lower_95) / 30;
  return {{"name", p.name},
          {"title", parameter_title(p)},
          {"region", p.region},
          {"unit", p.unit},
          {"value", p.value},
          {"std", p.std},
          {"lower_95", p.lower_95},
          {"upper_95", p.upper_95},
          {"determined", p.determined},
          {"text", quantity(p.value, p.unit, std::isfinite(resolution) && resolution > 0 ? resolution : 0)},
          {"interval_text", interval(p.lower_95, p.upper_95, p.unit)}};
}

json as_json(const Nuisance& n) {
  return {{"name", n.name},         {"unit", n.unit},         {"value", n.value},         {"std", n.std},
          {"lower_95", n.lower_95}, {"upper_95", n.upper_95}, {"prior_std", n.prior_std}, {"pull", n.pull}};
}

json as_json(const Vec3& v) { return json::array({v.x(), v.y(), v.z()}); }

json as_json(const LawFit& fit) {
  return {{"law", fit.law},
          {"usable", fit.usable},
          {"message", fit.message},
          {"young_text", fit.usable ? quantity(fit.young_modulus_pa, "Pa") : ""},
          {"force_error", fit.held_out.force_error},
          {"held_out_chi2", fit.held_out_chi2}};
}

template <class Items>
json list_of(const Items& items) {
  json list = json::array();
  for (const auto& item : items) list.push_back(as_json(item));
  return list;
}

/// As `list_of`, the loads named with how far they deform the object.
json list_by_load(const std::vector<YoungAtLoad>& items) {
  json list = json::array();
  for (const YoungAtLoad& item : items) {
    Parameter young = item.young;
    if (std::isfinite(item.strain)) young.region += fmt::format(", to {:.2g} % strain", 100 * item.strain);
    list.push_back(as_json(young));
  }
  return list;
}

/// Its file's or folder's; of the folder that one stands in ("."), which says nothing, its own.
std::string name_of(const Recording& recording) {
  const std::string& path = recording.source;
  const std::size_t end = path.find_last_not_of('/');
  if (end == std::string::npos) return path.empty() ? recording.name : path;
  const std::size_t slash = path.find_last_of('/', end);
  const std::string last = path.substr(slash + 1, end - slash);
  return last == "." || last == ".." ? recording.name : last;
}

double root_mean_square(const VectorX& values) {
  double sum = 0;
  std::size_t count = 0;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    sum += value * value;
    ++count;
  }
  return count > 0 ? std::sqrt(sum / static_cast<double>(count)) : std::nan("");
}

/// The size of residual that colours and the histogram reach to: all but one in two hundred.
double residual_scale(const Identification& identification) {
  std::vector<double> sizes;
  for (const StepFit& step : identification.steps) {
    for (const double r : step.residual_m) {
      if (std::isfinite(r)) sizes.push_back(std::abs(r));
    }
  }
  if (sizes.empty()) return 0;
  const auto rank = sizes.begin() + static_cast<std::ptrdiff_t>(static_cast<double>(sizes.size() - 1) * 0.995);
  std::nth_element(sizes.begin(), rank, sizes.end());
  return *rank;
}

json histogram(const Identification& identification, double scale) {
  constexpr int bins = 41;
  std::vector<std::size_t> counts(bins, 0);
  std::size_t beyond = 0, total = 0;
  for (const StepFit& step : identification.steps) {
    for (const double r : step.residual_m) {
      if (!std::isfinite(r)) continue;
      ++total;
      const double place = (r / scale + 1) / 2 * bins;
      if (place < 0 || place >= bins) {
        ++beyond;
      } else {
        ++counts[static_cast<std::size_t>(place)];
      }
    }
  }
  return {{"from_m", -scale}, {"to_m", scale}, {"counts", counts}, {"beyond", beyond}, {"total", total}};
}

/// Around all surfaces, half a size wider for the clouds; outliers further away are left out of the page.
Box16 box_of(const Identification& identification) {
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  const auto include = [&](const Points& points) {
    for (Eigen::Index i = 0; i < points.rows(); ++i) {
      if (!points.row(i).allFinite()) continue;
      low = low.cwiseMin(points.row(i).transpose());
      high = high.cwiseMax(points.row(i).transpose());
    }
  };
  include(identification.surface.vertices_m);
  for (const StepFit& step : identification.steps) include(step.surface_m);
  if (!(low.array() <= high.array()).all()) {
    for (const StepFit& step : identification.steps) include(step.observed_m);
  }
  if (!(low.array() <= high.array()).all()) return {};
  const double size = std::max((high - low).maxCoeff(), 1e-9);
  return {(low + high) / 2 - Vec3::Constant(size), 2 * size};
}

bool inside(const Box16& box, const Eigen::Ref<const Eigen::RowVector3d>& point) {
  const Vec3 share = (point.transpose() - box.origin_m) / box.size_m;
  return share.allFinite() && share.minCoeff() >= 0 && share.maxCoeff() <= 1;
}

json budget_of(const std::vector<BudgetEntry>& budget) {
  json list = json::array();
  for (const BudgetEntry& entry : budget) {
    json one = {{"input", entry.input}, {"young_modulus_percent", entry.young_modulus_percent}, {"poisson_shift", entry.poisson_shift},
                {"off_by", entry.off_by}, {"field", entry.field}, {"regions", json::array()}};
    for (const RegionShare& share : entry.regions)
      one["regions"].push_back({{"region", share.region}, {"young_modulus_percent", share.young_modulus_percent}});
    list.push_back(one);
  }
  return list;
}

json posterior_of(const PosteriorGrid& grid) {
  if (grid.density.size() == 0 || grid.density.rows() != grid.young_modulus_pa.size() ||
      grid.density.cols() != grid.poisson_ratio.size()) {
    return nullptr;
  }
  const double peak = grid.density.maxCoeff();
  if (!(peak > 0)) return nullptr;
  json rows = json::array();
  for (Eigen::Index i = 0; i < grid.density.rows(); ++i) {
    json row = json::array();
    for (Eigen::Index j = 0; j < grid.density.cols(); ++j) {
      row.push_back(std::round(grid.density(i, j) / peak * 1e5) / 1e5);  // five digits draw every region
    }
    rows.push_back(std::move(row));
  }
  return {{"young_modulus_pa", std::vector<double>(grid.young_modulus_pa.begin(), grid.young_modulus_pa.end())},
          {"poisson_ratio", std::vector<double>(grid.poisson_ratio.begin(), grid.poisson_ratio.end())},
          {"density", rows}};
}

std::string words_of(ToolShape shape) {
  switch (shape) {
    case ToolShape::vertices:
      return "force on given vertices";
    case ToolShape::sphere:
      return "sphere";
    case ToolShape::disc:
      return "disc";
    case ToolShape::capsule:
      return "capsule";
    case ToolShape::edge:
      return "edge";
    case ToolShape::mesh:
      return "mesh";
    case ToolShape::platen:
      break;
  }
  return "platen";
}

std::string words_of(SupportKind kind) {
  switch (kind) {
    case SupportKind::vertices:
      return "given vertices";
    case SupportKind::plane:
      return "plane";
    case SupportKind::box:
      return "box";
    case SupportKind::table:
      return "table";
    case SupportKind::wall:
      return "wall";
    case SupportKind::clamp:
      break;
  }
  return "clamp";
}

std::string words_of(RestState state) {
  switch (state) {
    case RestState::stress_free:
      return "stress-free";
    case RestState::under_gravity:
      return "seen under gravity";
    case RestState::under_pressure:
      break;
  }
  return "under pressure";
}

json scene_of(const Recording& recording) {
  json tools = json::array(), supports = json::array();
  for (const Tool& tool : recording.tools) {
    std::string words = tool.name + ": " + words_of(tool.shape);
    if (tool.radius_m > 0) words += ", radius " + quantity(tool.radius_m, "m");
    tools.push_back(words);
  }
  for (const Support& support : recording.supports) {
    supports.push_back(support.name.empty() ? words_of(support.kind) : support.name + ": " + words_of(support.kind));
  }
  if (recording.free) supports.push_back("free");
  return {{"source", name_of(recording)},
          {"rest_state", words_of(recording.rest.state)},
          {"gravity_m_s2", as_json(recording.environment.gravity_m_s2)},
          {"tools", tools},
          {"supports", supports},
          {"warnings", recording.warnings}};
}

/// Meshes and clouds of the steps, within the budget of bytes.
void add_geometry(json& page, const Identification& identification, const PayloadOptions& options) {
  const auto& steps = identification.steps;
  json& thinned = page["thinned"];
  const Box16 box = box_of(identification);
  const double scale = residual_scale(identification);
  page["box"] = {{"origin_m", as_json(box.origin_m)}, {"size_m", box.size_m}};
  page["residual_scale_m"] = scale;

  const std::vector<std::size_t> shown = spread(steps.size(), max_steps_shown);
  const std::set<std::size_t> is_shown(shown.begin(), shown.end());
  if (shown.size() < steps.size()) {
    thinned.push_back(fmt::format("The 3D view shows {} of {} steps.", shown.size(), steps.size()));
  }
  double stress_scale = 0;
  for (const StepFit& step : steps) {
    if (step.von_mises_pa.size() > 0) stress_scale = std::max(stress_scale, step.von_mises_pa.maxCoeff());
  }
  page["stress_scale_pa"] = stress_scale;

  const double raw_bytes = static_cast<double>(options.max_bytes) * raw_bytes_per_text_byte;
  const double surface_bytes = 6.0 * static_cast<double>(shown.size() + 1) + 12.0 +
                               (stress_scale > 0 ? static_cast<double>(shown.size()) : 0.0);  // a vertex, in all steps
  const auto max_vertices =
      std::min(max_vertices_shown, static_cast<std::size_t>(std::max(4.0, 0.55 * raw_bytes / surface_bytes)));
  const double steps_shown = static_cast<double>(std::max<std::size_t>(1, shown.size()));
  const auto max_masked = static_cast<std::size_t>(std::max(1.0, 0.05 * raw_bytes / (6.0 * steps_shown)));
  const auto max_points = std::min(
      max_points_shown, static_cast<std::size_t>(std::max(
                            1.0, 0.4 * raw_bytes / (7.0 * steps_shown))));

  const TriMesh& surface = identification.surface;
  const ThinnedMesh mesh = thin(surface, max_vertices);
  if (mesh.triangles.rows() < surface.triangles.rows()) {
    thinned.push_back(
        fmt::format("The surface is drawn with {} of {} triangles.", mesh.triangles.rows(), surface.triangles.rows()));
  }
  page["mesh"] = {{"vertices", mesh.kept.size()},
                  {"triangles", encode_triangles(mesh.triangles, mesh.kept.size())},
                  {"rest", encode_points(surface.vertices_m, mesh.kept, box)}};

  std::size_t far_away = 0, points_shown = 0, points_total = 0;
  for (std::size_t s = 0; s < steps.size(); ++s) {
    const StepFit& step = steps[s];
    json& entry = page["steps"][s];
    if (!is_shown.contains(s)) continue;
    if (step.surface_m.rows() == surface.vertices_m.rows() && surface.vertices_m.rows() > 0) {
      entry["surface"] = encode_points(step.surface_m, mesh.kept, box);
    }
    if (step.von_mises_pa.size() == surface.vertices_m.rows() && stress_scale > 0) {
      std::vector<double> stress;
      for (const Index vertex : mesh.kept) stress.push_back(step.von_mises_pa(vertex));
      entry["stress"] = encode_unsigned(stress, stress_scale);
    }
    std::vector<Index> rows;
    std::vector<double> residuals;
    for (const std::size_t i : spread(static_cast<std::size_t>(step.observed_m.rows()), max_points)) {
      const auto row = static_cast<Eigen::Index>(i);
      if (!inside(box, step.observed_m.row(row))) {
        ++far_away;
        continue;
      }
      rows.push_back(static_cast<Index>(i));
      residuals.push_back(row < step.residual_m.size() ? step.residual_m(row) : std::nan(""));
    }
    points_total += static_cast<std::size_t>(step.observed_m.rows());
    points_shown += rows.size();
    entry["points"] = encode_points(step.observed_m, rows, box);
    entry["residual"] = encode_signed(residuals, scale);
    std::vector<Index> masked;
    for (const std::size_t i : spread(static_cast<std::size_t>(step.masked_m.rows()), max_masked)) {
      if (inside(box, step.masked_m.row(static_cast<Eigen::Index>(i)))) masked.push_back(static_cast<Index>(i));
    }
    if (!masked.empty()) entry["masked"] = encode_points(step.masked_m, masked, box);
  }
  if (points_shown < points_total) {
    thinned.push_back(fmt::format("The clouds are drawn with {} of {} points.", points_shown, points_total));
  }
  if (far_away > 0) thinned.push_back(fmt::format("{} points far from the object are not drawn.", far_away));
}

}  // namespace

json payload(const Identification& identification, const Recording* recording, const PayloadOptions& options) {
  std::string title = options.title;
  if (title.empty() && recording != nullptr) title = name_of(*recording);
  if (title.empty()) title = "palpate";

  json page;
  page["format"] = "palpate-report-1";
  page["version"] = version;
  page["title"] = title;
  page["answer"] = options.running ? answer_so_far(identification) : answer(identification);
  page["method"] = identification.method;
  page["material"] = identification.material;
  page["parameters"] = list_of(identification.parameters);
  page["per_push"] = list_of(identification.per_push);
  page["per_site"] = list_of(identification.per_site);
  page["per_load"] = list_by_load(identification.per_load);
  page["laws"] = list_of(identification.laws);
  page["nuisances"] = list_of(identification.nuisances);
  page["verdicts"] = json::array();
  for (const Verdict& v : identification.verdicts) page["verdicts"].push_back({{"code", v.code}, {"message", v.message}});
  const FitSummary& fit = identification.fit;
  page["fit"] = {{"rms_m", fit.rms_m},
                 {"chi2_per_dof", fit.chi2_per_dof},
                 {"points_used", fit.points_used},
                 {"pushes", fit.pushes},
                 {"steps", fit.steps},
                 {"iterations", fit.iterations},
                 {"solves", fit.solves}};
  page["termination"] = termination_words(identification.termination);
  page["running"] = options.running;
  page["converged"] = identification.termination == Termination::converged;
  page["message"] = identification.message;
  const HeldOut& held_out = identification.prediction;
  page["prediction"] = {{"available", held_out.available},
                        {"what", held_out.what},
                        {"force_error", held_out.force_error},
                        {"surface_rms_m", held_out.surface_rms_m},
                        {"baseline_no_deformation_rms_m", held_out.baseline_no_deformation_rms_m},
                        {"baseline_last_step_rms_m", held_out.baseline_last_step_rms_m},
                        {"fitted_rms_m", held_out.fitted_rms_m},
                        {"deformation_explained", held_out.deformation_explained}};
  page["budget"] = budget_of(identification.budget);
  page["budget_if"] = budget_of(identification.budget_if);
  page["provenance"] = identification.provenance;
  page["timing_s"] = identification.timing_s;
  page["trace"] = json::array();
  for (const FitIteration& iteration : identification.trace) {
    page["trace"].push_back({{"young_modulus_pa", iteration.young_modulus_pa},
                             {"poisson_ratio", iteration.poisson_ratio},
                             {"cost", iteration.cost},
                             {"round", iteration.round}});
  }
  page["posterior"] = posterior_of(identification.posterior);
  page["scene"] = recording != nullptr ? scene_of(*recording) : json(nullptr);
  page["input_hashes"] = recording != nullptr ? json(recording->input_hashes) : json::object();

  page["steps"] = json::array();
  for (const StepFit& step : identification.steps) {
    page["steps"].push_back({{"push", step.push},
                             {"step", step.step},
                             {"used", step.used},
                             {"force_n", as_json(step.force_n)},
                             {"contact_m", as_json(step.contact_m)},
                             {"tool_radius_m", step.tool_radius_m},
                             {"travel_m", step.travel_m},
                             {"travel_predicted_m", step.travel_predicted_m},
                             {"travel_predicted_std_m", step.travel_predicted_std_m},
                             {"force_measured_n", step.force_measured_n},
                             {"force_predicted_n", step.force_predicted_n},
                             {"force_predicted_std_n", step.force_predicted_std_n},
                             {"rms_m", root_mean_square(step.residual_m)},
                             {"points_total", step.observed_m.rows()}});
  }
  page["thinned"] = json::array();
  const double scale = residual_scale(identification);
  page["histogram"] = scale > 0 ? histogram(identification, scale) : json(nullptr);
  add_geometry(page, identification, options);
  return page;
}

}  // namespace palpate::report
