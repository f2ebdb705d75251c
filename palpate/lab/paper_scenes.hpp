// SPDX-License-Identifier: Apache-2.0
// The experiments of Frank et al. (IROS 2010, section VII) remade in the lab, where the truth is known.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/core/progress.hpp"
#include "palpate/core/recording.hpp"
#include "palpate/lab/object.hpp"
#include "palpate/lab/pressed_memory.hpp"

namespace palpate::lab {

struct PaperTrial {
  Recording recording;
  double young_modulus_pa = 0, poisson_ratio = 0;  ///< of the whole object; of one with regions: of its first site's
  std::vector<double> site_young_pa;               ///< where each push acts
  Push unused;                                     ///< a push that is not in the recording, to be predicted; may have no steps
  std::string unused_stop;                         ///< why it never pressed, in plain words; empty: it did
  std::vector<double> unused_force_n;              ///< what truly acted, a step
  std::vector<TriMesh> unused_surface;             ///< how the object truly was, a step; none of one that is free
};

/// What is known of the object's shape.
enum class PaperShape {
  given,
  one_view,    ///< one image; completed as the program completes it
  planar_back, ///< the same, with the paper's planar back side
  four_views   ///< three around and one from above, joined: the paper's fig. 2
};

/// From the object's foot.
struct PaperPlace {
  std::array<double, 3> aim_m{}, direction{};
};

/// A row of the table: what stands in the lab and what looks at it.
struct PaperScene {
  std::string_view name, title;
  std::string_view figures = {};     ///< of the paper; empty: it has none of it
  std::string_view paper_says;  ///< what the paper reports, in a sentence
  std::string_view differs;     ///< where the lab's scene is not the paper's
  std::string_view object = {};      ///< of the lab's table, unless `make` is given
  LabObject (*make)(const ObjectOptions&) = nullptr;
  const TriMesh* surface = nullptr;  ///< a user's, in place of `object`, which then is its name
  std::string_view depth_sensor, force_sensor;
  double young_modulus_pa = 0, poisson_ratio = 0;  ///< 0: drawn from the seed, nu in steps of 0.05
  double region_ratio = 1;                         ///< 1: one stiffness everywhere
  int sites = 0;                                   ///< of the object that are pushed; 0 = all
  PaperShape shape = PaperShape::given;
  double view_azimuth_rad = 0, view_elevation_rad = 1.52;  ///< of the one view: from above
  std::string_view true_law = "linear";   ///< the paper's, at small strains; not that of an object that is no solid
  std::string_view law = "linear";        ///< that both methods fit
  std::string_view other_law = {};             ///< that palpate fits as well; empty: none
  bool coarse_truth = false;  ///< for a look: solved on a quarter of the mesh
  bool apparent = false;   ///< no solid: a modulus that is found has no truth to compare with
  Index tetrahedra = 0;    ///< of the model; 0: as many as the program takes by itself, fine under the pad
  double edge_m = 0;       ///< where these are given: of those under the pad; 0: like all others
  int samples = 7;         ///< a push, as with the balloon and the teddy bear
  double travel_m = 0;     ///< 0: the object's own limit
  bool error_drawn = false;   ///< the paper draws its error over (E, nu) here; quick mode asks other starts where it does
  bool each_sample = false;   ///< the paper has E of every sample here; quick mode fits them alone where it does
  double slip_m = 0;       ///< after the first sample: sideways, nobody notices
  double slip_deeper_m = 0;             ///< how much further the tip then has to come before it presses again
  std::optional<PaperPlace> unused = {};     ///< of the push that is predicted; nothing: at the last site again, at other forces
};

/// Something that goes wrong and that a recording does not tell.
struct PaperFault {
  std::string_view name, title;
  double slip_m = 0, slip_deeper_m = 0;  ///< in the middle of every push
  double camera_tilt_rad = 0;            ///< about its own x axis: where it truly looks, against what is recorded
  double said_radius = 1;                ///< of the pad, over the true one
};

/// Makes one seed of it. Where nu is drawn, it is a multiple of 0.05: seeds of the same nu then share their true states.
/// Stopped by its progress, the recording holds the pushes so far.
/// @param memory  of true states, used and filled; nullptr: nothing is kept. The digits are the same
PaperTrial make_paper_trial(const PaperScene& scene, std::uint64_t seed, const OnProgress& progress = {}, const PaperFault& fault = {},
                            PressedMemory* memory = nullptr);

/// The tables that --help, the page and the tests loop over.
std::span<const PaperScene> paper_scenes();
std::span<const PaperFault> paper_faults();

/// @throws Error listing the names when there is none of that name.
const PaperScene& paper_scene(std::string_view name);

}  // namespace palpate::lab
