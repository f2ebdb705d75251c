# SPDX-License-Identifier: Apache-2.0
"""Elasticity of deformable objects from a robot's pushes: forces and depth images in; Young's modulus and Poisson ratio with
intervals, verdicts, predictions and a simulation-ready model out.

    import palpate
    recording = palpate.read_recording("recording")      # a folder, or a bag of ROS
    found = palpate.identify(recording)
    print(found.answer.young_modulus, found.answer.poisson_ratio)
    for verdict in found.answer.verdicts:
        print(verdict.code, verdict.message)
    palpate.write_result(found, recording, "out")        # what `palpate estimate -o out` leaves, with the report

Numbers are SI and have their unit in their names; `T_a_b` maps coordinates of frame b into frame a; arrays are numpy's, a row a
point. Data are plain objects (Recording, Push, Step, ...): lists are lists, and a call takes them as they are at that moment.
`help(palpate.Recording)` lists fields. Where no answer can exist, `palpate.Error` names the field and the cure; what did not work
out in numbers is a field of the result. The same input, seed and number of threads give the same digits.
"""
from __future__ import annotations as _annotations

import json as _json
import operator as _operator
from typing import TYPE_CHECKING as _TYPE_CHECKING

from palpate import _nouns, _palpate
from palpate._palpate import Error, __version__

if _TYPE_CHECKING:
    from collections.abc import Callable
    from os import PathLike
    from typing import Any

    from numpy.typing import ArrayLike, NDArray

_classes = _nouns.classes()
globals().update(_classes)

from palpate.robot import Robot, explore, look_around, push  # noqa: E402  (needs the classes)

__all__ = sorted(_classes) + ["Error", "OnlineEstimator", "Robot", "check", "check_recording", "demo", "depth_sensors", "explore", "export", "exporters",
                              "identify", "look_around", "materials", "pose", "predict", "push", "read_recording", "read_result", "read_robot",
                              "read_scene", "read_surface", "read_volume", "result_json", "suggest", "write_recording", "write_result"]


def read_recording(path: str | PathLike[str], mapping: str | PathLike[str] | None = None) -> Recording:
    """A recording from a folder (docs/recording-format.md) or a bag of ROS 1 or 2, checked.

    mapping: what a bag's topics mean (mapping.yaml beside it, if not given; `palpate info BAG` suggests one).
    What is odd about it, and what was left out of a bag, stands in its `warnings`. Raises Error naming file, line, field and cure.
    """
    return _palpate.read_recording(path, mapping)


def read_scene(folder: str | PathLike[str]) -> Recording:
    """What stands before a robot: a recording's object, supports, tools and priors, without its pushes, for `push` and `explore`."""
    return _palpate.read_scene(folder)


def write_recording(recording: Recording, folder: str | PathLike[str]) -> None:
    """Writes a folder that read_recording gives back; it must not be there yet, or be empty. Raises Error."""
    _palpate.write_recording(recording, folder)


def check_recording(recording: Recording) -> list[tuple[str, str]]:
    """[(where, what is wrong and the cure)]; empty: it can be used. `identify` asks the same."""
    return _palpate.problems(recording)


def read_surface(path: str | PathLike[str]) -> TriMesh:
    """TriMesh from a PLY, STL, OBJ, VTU, ... file, in metres."""
    return _palpate.read_surface(path)


def read_volume(path: str | PathLike[str]) -> TetMesh:
    """TetMesh from a VTU, VTK or MSH file, in metres."""
    return _palpate.read_volume(path)


def read_robot(path: str | PathLike[str]) -> RobotModel:
    """RobotModel from a URDF file."""
    return _palpate.read_robot(path)


def pose(position_m: ArrayLike, quaternion_xyzw: ArrayLike | None = None, rotation_vector_rad: ArrayLike | None = None,
         rotation: ArrayLike | None = None) -> NDArray[Any]:
    """A pose as T_base_tip, T_base_camera and the like want it: 4 x 4. Of frame b in frame a it is T_a_b: p_a = T_a_b @ [*p_b, 1].

    position_m: of b's origin, in a's coordinates, metres (drivers of arms often have millimetres)
    How b is turned against a, one of these, or none (b's axes are a's):
    quaternion_xyzw:     x, y, z, w, as ROS and files of recordings have it (driver.h: w first). Of any length but zero
    rotation_vector_rad: the axis times the angle in radians, at most a whole turn: the last three numbers of a UR controller's pose
    rotation:            3 x 3, its columns are b's axes in a. Of few digits the nearest rotation is taken

    The tip's z axis points along the tool, into the object; the camera's forward, x to the right, y down.
    Raises Error for NaN and infinity, for an array of another shape, a quaternion of length zero, more than a whole turn, what is no
    rotation (it says by how much), and where more than one rotation is given.
    """
    return _palpate.pose(position_m, quaternion_xyzw, rotation_vector_rad, rotation)


def check(recording: Recording, *, stiffness_n_per_m: float | None = None, rigid=False, stiffness_relative_std: float | None = None,
          placed_std_m=0.0, placed_std_rad=0.0, touch_std_m=5e-4) -> SelfCheck:
    """The rig before the object, as `palpate check`: a SelfCheck of what is wrong with force, arm and camera (docs/how-to-push.md).

    recording: of pushes on a body whose answer is known, with forces, travels and, of a camera, depth images; its rest surface is the body
               where it stands in the base frame
    stiffness_n_per_m, rigid: what was pushed, one of them: a spring, along every push (the surface is the plate on it), or rigid=True
    stiffness_relative_std:   how well the spring's stiffness is known (0.002)
    placed_std_m, placed_std_rad: of the body's place and orientation in the base frame; 0: exact
    touch_std_m:              of the tip at first contact, along the push

    Raises Error where no step has a force and a travel, for a body without a shape, and for numbers that cannot be.
    """
    return _palpate.check(recording, dict(stiffness_n_per_m=stiffness_n_per_m, rigid=rigid, stiffness_relative_std=stiffness_relative_std,
                                          placed_std_m=placed_std_m, placed_std_rad=placed_std_rad, touch_std_m=touch_std_m))


def identify(recording: Recording, *, method="palpate", material=None, element=None, refine=None, regions="recorded", poisson_range=None,
             poisson_ratio=None, poisson_by_region=False, mesh_tolerance=0.01, slips=True, all_loads=False, compare_laws=False,
             cross_checks=True, young_modulus_start_pa=None, max_iterations=60, threads=0, progress: Callable[[str, float], Any] | None = None) -> Identified:
    """Young's modulus and Poisson ratio of what was pushed: an Identified. The options are those of `palpate estimate`.

    method:            'palpate', or 'paper' (the algorithm of Frank et al. 2010, as a baseline)
    material, element, refine:  override recording.model; see materials()
    regions:           parts with an E of their own: 'recorded', 'by-site' (one around each site that was pushed) or 'none'
    poisson_range:     (lower, upper) of the uniform prior on nu
    poisson_ratio:     nu, where it is known
    poisson_by_region: every region has a nu of its own
    mesh_tolerance:    fit again on a finer mesh while the mesh's own share of E is above this
    slips:             fit again with a slip of the tool that was found
    all_loads:         also loads under which a patch of even pressure caves in
    compare_laws:      fit other laws to the same data, too
    cross_checks:      refit parts of the recording: by push, by load, held-out prediction
    threads:           0: as many as the machine has
    progress:          called with (stage, share done); where it returns False the work stops and `answer.termination` is 'cancelled'

    What is odd (nothing masks the arm, the shape had holes) and does not stand in the recording's `warnings` is said by `warnings.warn`.
    Raises Error where no answer can exist, KeyboardInterrupt on Ctrl-C. Other Python threads go on meanwhile.
    """
    options = dict(method=method, material=material, element=element, refine=refine, regions=regions, poisson_range=poisson_range,
                   poisson_ratio=poisson_ratio, poisson_by_region=poisson_by_region, mesh_tolerance=mesh_tolerance, slips=slips,
                   all_loads=all_loads, compare_laws=compare_laws, cross_checks=cross_checks,
                   young_modulus_start_pa=young_modulus_start_pa, max_iterations=max_iterations, threads=threads)
    return _palpate.identify(recording, options, progress)


class OnlineEstimator:
    """What is known while the robot pushes: one step after another in, E and nu so far out.

        estimator = palpate.OnlineEstimator(scene)        # object, supports, tools, priors: a Recording without pushes
        estimator.begin(palpate.Push(name="top"))
        so_far = estimator.add(step)                      # an Identification; without parameters until something presses
        found = estimator.answer()                        # what identify says of all so far

    Options are those of `identify`. Raises Error where identify would; a step that is refused is not taken in.
    """

    def __init__(self, scene: Recording, **options) -> None:
        self._estimator = _palpate.OnlineEstimator(scene, options)

    def begin(self, push: Push) -> None:
        """A new push: its name, site and priors; steps in it are taken in without an estimate in between."""
        self._estimator.begin(push)

    def add(self, step: Step, progress: Callable[[str, float], Any] | None = None) -> Identification:
        """One more step of the push; what is known by now. Until a load and an observation were seen there are no parameters."""
        return self._estimator.add(step, progress)

    @property
    def estimate(self) -> Identification:
        """After the last step."""
        return self._estimator.estimate()

    @property
    def recording(self) -> Recording:
        """All so far."""
        return self._estimator.recording()

    def answer(self, progress: Callable[[str, float], Any] | None = None) -> Identified:
        """An Identified: what `identify` says of all so far, with the mesh's error, checks of the parts and figures."""
        return self._estimator.answer(progress)


def write_result(found: Identified, recording: Recording, folder: str | PathLike[str]) -> None:
    """Leaves what `palpate estimate -o` leaves: result.json, fit/, model/ (mesh and material) and report.html.

    recording: that was identified, for the report.
    """
    _palpate.write_result(found, recording, folder)


def read_result(folder: str | PathLike[str]) -> Identified:
    """An Identified from a folder that write_result or `palpate estimate` wrote. Surfaces and points are in single precision."""
    return _palpate.read_result(folder)


def result_json(answer: Identification) -> dict[str, Any]:
    """The object of result.json (docs/result-format.md) as a dict."""
    return _json.loads(_palpate.result_json(answer))


def predict(found: Identified, *, contact_m=None, direction=(0, 0, -1), force_n=None, travel_m=None, radius_m=None, tool=None, threads=0) -> PushPrediction:
    """What a push that nobody has made does: a PushPrediction with bands of 95 %.

    contact_m:         on the surface at rest, base frame (3 numbers)
    direction:         of the push, into the object
    force_n, travel_m: one of them, along the direction
    radius_m:          of a patch that is pressed evenly; with tool: that tool's own (the tool's)
    tool:              a name of found.object.tools (its only one); one whose motion was imposed moves as a rigid body
    """
    return _palpate.predict(found, dict(contact_m=contact_m, direction=direction, force_n=force_n, travel_m=travel_m, radius_m=radius_m,
                                        tool=tool, threads=threads))


def export(found: Identified, to: str, folder: str | PathLike[str], *, density_kg_m3: float | None = None,
           gravity_m_s2: ArrayLike | None = None, elements="split") -> list[str]:
    """The learned object for a simulator, one of exporters(). Returns the names of the files, the one to open first.

    density_kg_m3: 5 to 30000 (the recording's); simulators of motion need one
    gravity_m_s2:  [0, 0, -9.81] on earth (the recording's; none where the shape was measured with its weight on)
    elements:  of simulators that take no quadratic tetrahedra: 'split' (each in eight, near to what was fitted) or 'corners' (an eighth of them, stiffer)
    What the files do not hold as it was learned (the law, supports, gravity) is said by `warnings.warn`. Raises Error
    for a density that cannot be, and where the folder cannot be made."""
    return _palpate.export(found, to, folder, density_kg_m3, gravity_m_s2, elements)


def suggest(recording: Recording, so_far: Identified | Identification | None = None, *, goal="both", tool=None, tip_link=None, contacts=24, tilts=2, views=0, young_modulus_pa=2e4,
            force_limit_n=50.0, travel_limit_m=0.10, seed=1, threads=0,
            progress: Callable[[str, float], Any] | None = None) -> list[SuggestedPush]:
    """Pushes that would tell the most, best first: a list of SuggestedPush. Empty: none that is possible is in view (`views` adds some).

    so_far:            what `identify` found of the pushes until now: they are planned on the object as it was fitted. With `found.answer`
                       alone the object is made anew of the recording; None: before the first touch
    goal:              whose interval is to shrink: 'young-modulus', 'poisson-ratio' or 'both'
    tip_link:          of the recording's robot, z along the push: only what its joints reach is compared
    contacts, tilts:   places that are compared, and slanted directions at each
    views:             further places of the camera that are compared
    young_modulus_pa:  guess before the first touch
    """
    answer, fitted = (so_far.answer, so_far.object) if isinstance(so_far, Identified) else (so_far, None)
    return _palpate.suggest(recording, answer, fitted, dict(goal=goal, tool=tool, tip_link=tip_link, contacts=contacts, tilts=tilts, views=views,
                                                    young_modulus_pa=young_modulus_pa, force_limit_n=force_limit_n,
                                                    travel_limit_m=travel_limit_m, seed=seed, threads=threads), progress)


def demo(seed=1, progress: Callable[[str, float], Any] | None = None) -> tuple[Recording, dict[str, float]]:
    """(recording, truth): the built-in recording of a foam cube, made by the lab, and E and nu of the truth."""
    return _palpate.demo(_operator.index(seed), progress)


def materials() -> list[str]:
    """Names of the laws."""
    return _palpate.materials()


def exporters() -> dict[str, str]:
    """{name: what is written}"""
    return _palpate.exporters()


def depth_sensors() -> dict[str, str]:
    """{name: source} of the noise models for DepthNoise.model; 'constant' with a sigma_m goes, too."""
    return _palpate.depth_sensors()
