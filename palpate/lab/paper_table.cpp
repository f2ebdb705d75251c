// SPDX-License-Identifier: Apache-2.0
// The table of the paper's experiments, and that of what may go wrong in one.
#include <array>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/lab/opposed_ball.hpp"
#include "palpate/lab/paper_scenes.hpp"

namespace palpate::lab {
namespace {

constexpr double degree = 3.14159265358979323846 / 180;

constexpr std::array<PaperScene, 8> scene_table{{
    {.name = "cow",
     .title = "Simulated test on a four-legged animal",
     .figures = "3, 4",
     .paper_says = "E = 1000 N/m2 and nu = 0.3 are found again; the error over (E, nu) is convex around them.",
     .differs = "The animal is the lab's own; the pad is soft and 15 mm in radius, the paper pushed at a point. The stick weighs nothing.",
     .object = "animal",
     .depth_sensor = "realsense_l515",
     .force_sensor = "ideal",
     .young_modulus_pa = 1000,
     .poisson_ratio = 0.3,
     .sites = 1,
     .error_drawn = true,
     .unused = PaperPlace{{0.03, 0, 0.1}, {0, -0.5, -0.866}}},
    {.name = "cube",
     .title = "Foam cube of 15 cm, time-of-flight camera, small strains",
     .figures = "5, 6",
     .paper_says = "Force over travel is nearly straight; E varies little over the samples. No true E is known.",
     .differs = "The pad goes 12 mm deep in seven samples and does not slip: and both methods know the law. 9 cm of travel: cube9cm.",
     .object = "cube",
     .depth_sensor = "time_of_flight",
     .force_sensor = "schunk_ftcl_050",
     .sites = 1,
     .each_sample = true,
     .unused = PaperPlace{{0.03, 0, 0.15}, {0, 0, -1}}},
    {.name = "cube9cm",
     .title = "Foam cube of 15 cm, 9 cm of travel, a slip at the start",
     .figures = "5, 6",
     .paper_says = "The robot moved for 9 cm and took a sample a centimetre; the curve is nearly straight but for a slip of the probe "
                   "tip at the start; E varies little over the samples.",
     .differs = "The truth is Neo-Hookean and both methods fit that law. The force rises in nine equal steps, the pad is soft and 25 mm "
                "in radius; after the first sample it slides 5 mm aside and has to come 3 mm deeper, and nothing says so. From about 20 mm on "
                "the pad's even pressure, above 0.4 E, folds the surface, and the truth there depends on its mesh: both methods answer from "
                "the samples before.",
     .object = "cube",
     .depth_sensor = "time_of_flight",
     .force_sensor = "schunk_ftcl_050",
     .sites = 1,
     .true_law = "neo_hookean",
     .law = "neo_hookean",
     .tetrahedra = 1500,
     .edge_m = 0.0125,
     .samples = 9,
     .travel_m = 0.09,
     .slip_m = 0.005,
     .slip_deeper_m = 0.003,
     .unused = PaperPlace{{0.03, 0, 0.15}, {0, 0, -1}}},
    {.name = "foam9cm",
     .title = "The same cube of a stuff that softens",
     .figures = "5, 6",
     .paper_says = "One E is fitted whatever the foam does.",
     .differs = "The truth is the foam law (alpha = 4). One E is fitted with a law that does not soften so (Neo-Hookean); palpate then "
                "fits the foam law as well, with alpha known, and that answer counts. E is that of small strains throughout.",
     .object = "cube",
     .depth_sensor = "time_of_flight",
     .force_sensor = "schunk_ftcl_050",
     .sites = 1,
     .true_law = "foam",
     .law = "neo_hookean",
     .other_law = "foam",
     .tetrahedra = 1500,
     .edge_m = 0.0125,
     .samples = 9,
     .travel_m = 0.09,
     .slip_m = 0.005,
     .slip_deeper_m = 0.003,
     .unused = PaperPlace{{0.03, 0, 0.15}, {0, 0, -1}}},
    {.name = "balloon",
     .title = "Balloon seen once by a stereo camera, planar back side",
     .figures = "1, 7, 8",
     .paper_says = "Seven forces, 815 tetrahedra; the samples give similar E; 192.5 s and 7 iterations for a force-displacement sample.",
     .differs = "An inflated skin is no solid: what is found is an apparent modulus of this balloon at this pressure, so there is "
                "nothing to compare it with and it is left out of the errors.",
     .object = "balloon",
     .depth_sensor = "bumblebee",
     .force_sensor = "schunk_ftcl_050",
     .sites = 1,
     .shape = PaperShape::planar_back,
     .apparent = true,
     .tetrahedra = 815,
     .samples = 9,  // the skin yields under seven of them before the tool has gone as far as it may
     .each_sample = true},
    {.name = "ball",
     .title = "A solid ball in the balloon's place",
     .figures = "1, 7, 8",
     .paper_says = "As the balloon; the paper had no ball.",
     .differs = "Solid, so that its E is known; seen once from above and completed down to the table.",
     .object = "ball",
     .depth_sensor = "bumblebee",
     .force_sensor = "schunk_ftcl_050",
     .sites = 1,
     .shape = PaperShape::one_view,
     .unused = PaperPlace{{0, 0, 0.052}, {0.5, 0, -0.866}}},
    {.name = "teddy",
     .title = "Teddy bear at head, belly and back, stereo camera",
     .figures = "9, 10",
     .paper_says = "E differs more between the sites than within them: the bear is not homogeneous.",
     .differs = "Here its head is 1.4 times as stiff as its belly and its back 1.4 times as soft, and that is known.",
     .object = "bear",
     .depth_sensor = "bumblebee",
     .force_sensor = "schunk_ftcl_050",
     .region_ratio = 1.4,
     .samples = 11,  // of which the travel leaves seven or so
     .each_sample = true,
     .unused = PaperPlace{{0.014, 0.004, 0.15}, {-0.2, 0, -0.98}}},
    {.name = "between",
     .title = "A free ball between two opposed pushes",
     .paper_says = "Objects are fixed, because forces that move an object have no equilibrium.",
     .differs = "Nothing holds the ball: two opposed pads press it, and registration takes out how it moves.",
     .make = opposed_ball,
     .depth_sensor = "realsense_l515",
     .force_sensor = "schunk_ftcl_050"},
}};

constexpr std::array<PaperFault, 3> faults{{
    {.name = "slip",
     .title = "in the middle of the push the tip slides 5 mm aside and 1 mm deeper, unnoticed",
     .slip_m = 0.005,
     .slip_deeper_m = 0.001},
    {.name = "camera", .title = "the camera is tilted by half a degree against what is recorded", .camera_tilt_rad = 0.5 * degree},
    {.name = "patch", .title = "the recording states the pad's radius a quarter too small", .said_radius = 0.75},
}};

}  // namespace

std::span<const PaperScene> paper_scenes() { return scene_table; }
std::span<const PaperFault> paper_faults() { return faults; }

const PaperScene& paper_scene(std::string_view name) {
  std::string names;
  for (const PaperScene& scene : scene_table) {
    if (scene.name == name) return scene;
    names += (names.empty() ? "" : ", ") + std::string(scene.name);
  }
  throw Error("is no scene of the paper; there are: " + names, "scene " + std::string(name));
}

}  // namespace palpate::lab
