// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/exact_inputs.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <set>

#include "palpate/estimation/error_budget.hpp"
#include "palpate/estimation/forward_model_parts.hpp"
#include "palpate/estimation/held_body.hpp"
#include "palpate/estimation/names_of_unknowns.hpp"
#include "palpate/estimation/slips.hpp"

namespace palpate::estimation {
namespace {

const std::vector<std::string> along_xyz{"_x", "_y", "_z"};

template <class T>
const T* any_of_type(const std::vector<TermInput>& seen, const std::string& tool) {
  for (const TermInput& observation : seen) {
    const T* one = std::get_if<T>(&observation);
    if (one != nullptr && (one->tool.empty() || one->tool == tool)) return one;
  }
  return nullptr;
}

/// What is exact, and the copy in which it is not.
class Exact {
 public:
  Exact(const Recording& stated, const Inputs& inputs, Recording& more, const TypicalErrors& errors)
      : stated_(stated), inputs_(inputs), more_(more), errors_(errors) {}

  std::vector<ExactInput> take() { return std::move(found_); }

  void of_forces() {
    bool any = false;
    std::size_t s = 0;
    for (std::size_t p = 0; p < stated_.pushes.size(); ++p) {
      const Push& push = stated_.pushes[p];
      double highest_n = 0;
      for (const Step& step : push.steps) {
        for (const Load& load : step.loads) {
          highest_n = std::max(highest_n, load.force_n.value_or(Vec3::Zero()).norm());
          if (const Wrench* read = any_of_type<Wrench>(inputs_[s], load.tool)) highest_n = std::max(highest_n, read->force_n.norm());
        }
        ++s;
      }
      any = any || highest_n > 0;
      if (push.force_tare_std_n > 0 || !(highest_n > 0)) continue;
      const double size_n = errors_.force_share * highest_n;
      more_.pushes[p].force_tare_std_n = size_n;
      for (const std::string& tool : tools_of(push))
        for (const std::string& axis : {std::string(), along_xyz[0], along_xyz[1], along_xyz[2]})
          add("force_tare", fmt::format("{:g} % of the push's highest force", 100 * errors_.force_share), "force_tare_std_n",
              {{"force_tare" + of_push(push, tool) + axis}, size_n});
    }
    if (stated_.force_cross_talk_std == 0 && any) {
      more_.force_cross_talk_std = errors_.force_share;
      for (const Push& push : stated_.pushes)
        for (const std::string& tool : tools_of(push))
          for (const char* axis : {"_1", "_2"})
            add("force_cross_talk", fmt::format("{:g} % of the force along the push", 100 * errors_.force_share), "force_cross_talk_std",
                {{"force_cross_talk" + of_push(push, tool) + axis}, errors_.force_share});
    }
    if (stated_.force_scale_std > 0 || !any) return;
    more_.force_scale_std = errors_.force_share;
    add("force_scale", fmt::format("{:g} %", 100 * errors_.force_share), "force_scale_std", {{"force_scale"}, errors_.force_share});
  }

  void of_contacts() {
    std::set<std::string> radii;
    for (std::size_t p = 0; p < stated_.pushes.size(); ++p) {
      const Push& push = stated_.pushes[p];
      std::set<std::string> contacts;
      for (std::size_t s = 0; s < stated_.pushes[p].steps.size(); ++s) {
        for (std::size_t l = 0; l < stated_.pushes[p].steps[s].loads.size(); ++l) {
          const Load& load = stated_.pushes[p].steps[s].loads[l];
          const bool driven = load.travel_m && *load.travel_m != 0;
          if (!has_columns(load) && !driven) continue;
          if (load.contact_std_m == 0 && has_place(stated_, load)) {
            Load& shifted = more_.pushes[p].steps[s].loads[l];
            if (shifted.contact_std_m == 0) shifted.contact_std_m = errors_.contact_m;
            if (contacts.insert(stretch_of(push, s) + key_of(load)).second)
              for (const char* axis : {"_1", "_2"})
                add("contact_shift", words_m(errors_.contact_m) + " across the push", "contact_std_m",
                    {{"contact_shift" + of_contact(push, s, load) + axis}, errors_.contact_m});
          }
          const std::size_t t = tool_of(load);
          const Tool& tool = stated_.tools[t];
          const bool round = tool.shape == ToolShape::sphere || tool.shape == ToolShape::disc;
          if (!round || driven || tool.radius_std_m > 0 || !radii.insert(tool.name).second) continue;
          const double size_m = errors_.radius_share * tool.radius_m;
          if (more_.tools[t].radius_std_m == 0) more_.tools[t].radius_std_m = size_m;
          add("tool_radius", fmt::format("{:g} % of the radius", 100 * errors_.radius_share), "radius_std_m",
              {{"tool_radius[" + tool.name + "]"}, size_m});
        }
      }
    }
  }

  void of_travels() {
    std::set<std::string> yielding;
    std::size_t s = 0;
    for (std::size_t p = 0; p < stated_.pushes.size(); ++p) {
      const Push& push = stated_.pushes[p];
      bool driven = false, read = false;
      for (const Step& step : push.steps) {
        for (const Load& load : step.loads) {
          const bool travels = load.travel_m || any_of_type<ToolTravel>(inputs_[s], load.tool) != nullptr;
          driven = driven || load.travel_m;
          read = read || (travels && !load.travel_m);
          const std::size_t t = tool_of(load);
          const Tool& tool = stated_.tools[t];
          if (!travels || tool.compliance_std_m_per_n > 0 || !yielding.insert(tool.name).second) continue;
          const double size = std::max(errors_.compliance_m_per_n, 0.1 * tool.compliance_m_per_n);
          more_.tools[t].compliance_std_m_per_n = size;
          add("compliance", fmt::format("{:.2g} mm/N", 1e3 * size), "compliance_std_m_per_n", {{"compliance[" + tool.name + "]"}, size});
        }
        ++s;
      }
      if (push.travel_offset_std_m > 0 || !(driven || read)) continue;
      more_.pushes[p].travel_offset_std_m = errors_.travel_m;
      for (const char* name : {"travel_offset", "travel_zero"})
        for (const std::string& tool : tools_of(push))
          add(name, words_m(errors_.travel_m), "travel_offset_std_m", {{name + of_push(push, tool)}, errors_.travel_m});
    }
  }

  void of_body(const TetMesh& mesh) {
    const bool weighs = stated_.rest.state == RestState::stress_free && stated_.environment.gravity_m_s2.norm() > 0;
    if (weighs && stated_.density_std_kg_m3 == 0) {
      more_.density_std_kg_m3 = errors_.density_share * stated_.density_kg_m3;
      add("density", fmt::format("{:g} %", 100 * errors_.density_share), "density_std_kg_m3",
          {{"density"}, more_.density_std_kg_m3});
    }
    if (stated_.time_offset_std_s == 0) {
      more_.time_offset_std_s = errors_.time_s;
      add("time_offset", fmt::format("{:g} ms", 1e3 * errors_.time_s), "time_offset_std_s", {{"time_offset"}, errors_.time_s});
    }
    if (stated_.supports.size() == 1 && !stated_.free && stated_.supports[0].compliance_std_m_per_n == 0) {
      const Support& support = stated_.supports[0];
      const double size = std::max(errors_.support_m_per_n, 0.1 * support.compliance_m_per_n);
      if (more_.supports[0].compliance_std_m_per_n == 0) more_.supports[0].compliance_std_m_per_n = size;
      add("support_compliance", fmt::format("{:.2g} mm/N", 1e3 * size), "compliance_std_m_per_n",
          {{"support_compliance[" + support.name + "]"}, size});
    }
    for (std::size_t k = 0; k < stated_.supports.size() && !stated_.free; ++k) {
      const Support& support = stated_.supports[k];
      if (support.contact != ContactLaw::bonded || support.spread_std_m > 0) continue;
      const double size_m = errors_.spread_share * rim_radius_m(mesh, support);
      if (!(size_m > 0)) continue;
      if (more_.supports[k].spread_std_m == 0) more_.supports[k].spread_std_m = size_m;
      add("support_spread", fmt::format("{:g} % of the rim's radius", 100 * errors_.spread_share), "spread_std_m",
          {{"support_spread[" + support.name + "]"}, size_m});
    }
  }

  /// What a camera errs by it errs by in all its images.
  void of_sensors(Inputs& more) {
    std::map<std::string, std::set<std::pair<std::string, std::string>>> offsets, turns;  // of a camera: how its unknowns' names begin and end
    std::set<std::string> biased, marked;
    std::size_t s = 0;
    for (const Push& push : stated_.pushes) {
      for (std::size_t k = 0; k < push.steps.size(); ++k, ++s) {
        const std::string in_step = "[" + push.name + ":" + std::to_string(k) + "]";
        int frames = 0;
        for (std::size_t i = 0; i < inputs_[s].size(); ++i) {
          const auto pose = [&](auto& seen, const std::string& camera) {
            const std::string begins = of_frame(frames++);
            const auto name = camera.empty() ? std::pair(begins, in_step) : std::pair(std::string("camera"), "[" + camera + "]");
            if (seen.pose_std_m == 0) offsets[camera].insert(name), seen.pose_std_m = errors_.camera_m;
            if (seen.pose_std_rad == 0) turns[camera].insert(name), seen.pose_std_rad = errors_.camera_rad;
          };
          if (auto* cloud = std::get_if<PointCloud>(&more[s][i])) pose(*cloud, cloud->camera);
          if (auto* rays = std::get_if<RayObservation>(&more[s][i])) {
            const int before = frames;
            pose(*rays, rays->camera);
            if (rays->bias_std_m == 0) {
              rays->bias_std_m = errors_.depth_m;
              biased.insert("depth_bias" + of_camera(push, rays->camera, before));
            }
          }
          if (auto* markers = std::get_if<Markers>(&more[s][i]); markers != nullptr && markers->rest_std_m == 0) {
            markers->rest_std_m = errors_.marker_m;
            for (Index m = 0; m < markers->rest_m.rows(); ++m) {
              const auto number = static_cast<std::size_t>(m);
              marked.insert("marker_" + (number < markers->names.size() ? markers->names[number] : std::to_string(m)));
            }
          }
        }
      }
    }
    const auto poses = [&](const auto& cameras, const std::string& what, double size, const std::string& words, const std::string& field) {
      for (const auto& [camera, names] : cameras) {
        for (const std::string& axis : along_xyz) {
          ExactInput::Way way{{}, size};
          for (const auto& [begins, ends] : names) way.unknowns.push_back(begins + (what == "camera" ? "" : "_rotation") + axis + ends);
          add(what, words, field, std::move(way));
        }
      }
    };
    poses(offsets, "camera", errors_.camera_m, words_m(errors_.camera_m) + ", alike in all frames", "pose_std_m");
    poses(turns, "camera_rotation", errors_.camera_rad, fmt::format("{:.2g} degrees, alike in all frames", errors_.camera_rad * 180 / M_PI),
          "pose_std_rad");
    for (const std::string& name : biased) add("depth_bias", words_m(errors_.depth_m), "bias_std_m", {{name}, errors_.depth_m});
    for (const std::string& name : marked)
      for (const std::string& axis : along_xyz)
        add("marker positions", words_m(errors_.marker_m) + " each", "rest_std_m", {{name + axis}, errors_.marker_m});
  }

 private:
  static std::string words_m(double size_m) { return fmt::format("{:g} mm", 1e3 * size_m); }

  std::size_t tool_of(const Load& load) const {
    const auto at = std::find_if(stated_.tools.begin(), stated_.tools.end(), [&](const Tool& tool) { return tool.name == load.tool; });
    return static_cast<std::size_t>(at - stated_.tools.begin());
  }

  void add(const std::string& input, const std::string& off_by, const std::string& field, ExactInput::Way way) {
    auto known = std::find_if(found_.begin(), found_.end(), [&](const ExactInput& one) { return one.input == input; });
    if (known == found_.end()) known = found_.insert(known, {input, off_by, field, {}});
    known->ways.push_back(std::move(way));
  }

  const Recording& stated_;
  const Inputs& inputs_;
  Recording& more_;
  const TypicalErrors& errors_;
  std::vector<ExactInput> found_;
};

}  // namespace

std::vector<ExactInput> free_exact_inputs(const Recording& recording, const Inputs& inputs, const TetMesh& mesh, Recording& more,
                                          Inputs& more_inputs, const TypicalErrors& errors) {
  Exact exact(recording, inputs, more, errors);
  exact.of_contacts();
  exact.of_forces();
  exact.of_travels();
  exact.of_body(mesh);
  exact.of_sensors(more_inputs);
  return exact.take();
}

std::vector<BudgetEntry> budget_if(const std::vector<ExactInput>& exact, const Unknowns& unknowns, const MatrixX& curvature,
                                   const std::vector<int>& moving, const std::vector<std::string>& regions) {
  const Eigen::LDLT<MatrixX> fitted(MatrixX(curvature(moving, moving)));
  // Places that are doubted to be of one stiffness have ratios here, too; they are no regions of the answer.
  const MatrixX young = log_young_of_regions(unknowns, moving).topRows(std::max<Index>(1, static_cast<Index>(regions.size())));
  const auto nu = std::find(moving.begin(), moving.end(), static_cast<int>(poisson));
  std::vector<BudgetEntry> out;
  for (const ExactInput& one : exact) {
    VectorX squares = VectorX::Zero(young.rows());
    double poisson_square = 0;
    bool any = false;
    for (const auto& way : one.ways) {
      VectorX column = VectorX::Zero(static_cast<Index>(moving.size()));
      for (const int k : unknowns.named(way.unknowns)) column += curvature(moving, k);
      any = any || column.norm() > 0;
      // The cost's slope where the input is off; what was fitted takes it back.
      const VectorX shift = way.size * fitted.solve(column);
      squares += (young * shift).cwiseAbs2();
      if (nu != moving.end()) poisson_square += std::pow(shift(nu - moving.begin()), 2);
    }
    if (!any || !squares.allFinite()) continue;
    BudgetEntry entry{one.input, 0, std::sqrt(poisson_square), {}, one.off_by, one.field};
    set_young(entry, 100 * squares.cwiseSqrt(), regions);
    out.push_back(entry);
  }
  sort_by_share(out);
  return out;
}

}  // namespace palpate::estimation
