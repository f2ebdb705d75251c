# SPDX-License-Identifier: Apache-2.0
"""A robot that pushes: what it must be able to do, one push of the protocol, and the loop that chooses the next best push."""
from __future__ import annotations

import time
from typing import TYPE_CHECKING

from palpate import _palpate

if TYPE_CHECKING:
    from collections.abc import Callable
    from os import PathLike
    from typing import Any

    from numpy.typing import ArrayLike, NDArray

    from palpate import DepthFrame, Explored, Parameter, Push, PushReport, Recording, RobotState, Step


class Robot:
    """Derive from it and drive your arm. Poses are 4 x 4, base frame, metres; the tip's z axis points along the tool, into the object.

    What a call raises ends the push: the robot is stopped, its tip goes away from the object, and the caller of `push` or `explore` gets it.
    So does what cannot be in what it gives (a joint that is NaN, an image of another size than its camera's): an Error that names call and field.
    After KeyboardInterrupt (Ctrl-C) and SystemExit it stands where it was stopped.

    travel_sigma_m: standard deviation of the encoders' tip position along a push; positive
    limits:         a RobotLimits, what the arm itself bears (force, travel, speed); may be left out. The lower of these and the options bounds a push
    """

    travel_sigma_m = 0.0005

    def read(self) -> RobotState:
        """A RobotState. force_n is of the tool on the object, base frame; a constant bias is allowed. Its clock must not go back."""
        raise NotImplementedError(f"{type(self).__name__}.read: say how your arm does it")

    def move(self, T_base_tip: NDArray[Any], speed_m_s: float) -> bool | None:
        """Moves the tip on a straight line and returns when it stands. False: refused (a limit, a collision), and it did not move."""
        raise NotImplementedError(f"{type(self).__name__}.move: say how your arm does it")

    def stop(self) -> None:
        """Brings the arm to rest where it is."""
        raise NotImplementedError(f"{type(self).__name__}.stop: say how your arm does it")

    def take_depth_image(self) -> DepthFrame:
        """A DepthFrame, with camera, pose of the camera, noise and, where the robot is in view, its mask. 0, NaN and infinity are no data."""
        raise NotImplementedError(f"{type(self).__name__}.take_depth_image: say how your arm does it")

    def wait(self, duration_s: float) -> None:
        """Lets time pass."""
        time.sleep(duration_s)

    def reaches(self, T_base_tip: NDArray[Any]) -> bool:
        """False: no push is planned whose tip would have to stand there."""
        return True

    def look(self, view: int, views: int) -> DepthFrame | None:
        """Carries the camera to the `view`-th (from 0) of `views` places around the untouched object: a DepthFrame. None: it does not."""
        return None


_protocol = """
    force_limit_n, travel_limit_m: where a push ends (50 N, 0.1 m, or what the robot's `limits`, a RobotLimits, say)
    force_step_n:        between recorded steps
    unloading_steps:     recorded on the way back
    start_distance_m, search_distance_m: before the expected contact, where the approach starts; beyond it, how far to look
    increment_m:         of the tip between two looks at the force
    clearance_m, tool_length_m: of the way around the object between pushes
    look_every_m, blind_retreat_m, obstacle_threshold_n: of that way: looks at the force, where nobody knows the object's size, what is hit
    approach_speed_m_s, push_speed_m_s, sample_period_s, free_air_samples
    settling_rate_n_s, settling_relative_rate_s, settling_window_s, settling_timeout_s: when a step is recorded
    contact_std_m:       prior on the contact point that the recording will state
    contact_threshold_n, contact_noise_factor, contact_samples: change of the force that means contact
    slip_sideways_m, slip_friction, slip_force_drop, slip_deeper_m, slip_least_force_n: what means that the tool slid
    changed_share:       of the picture's pixels after a push, beyond which the object did not come back
    As the options of `palpate record --help`.
"""


def push(robot: Robot, scene: Recording, contact_m: ArrayLike, direction: ArrayLike = (0, 0, -1), *, tool=None, name="", site="",
         on_step: Callable[[str, Step], Any] | None = None, progress: Callable[[str, float], Any] | None = None,
         **options) -> tuple[Push, PushReport]:
    """One push by the protocol: look, approach until contact, raise the force step by step, let it settle, record; go back and look.

    Returns (Push, PushReport); `recording.pushes.append(push)` makes it part of a recording. What went wrong with it (the force drifted,
    the tip was turned, the object did not come back, ...) is said by `warnings.warn`, too.

    scene:    a Recording with the object, what holds it, and tools
    tool:     a name of scene.tools (its first)
    on_step:  called with (name of the push, Step) after each
    progress: called with ("push", 0) between motions; where it returns False the robot stops where it is, as after KeyboardInterrupt
    """
    options.update(contact_m=contact_m, direction=direction, tool=tool, name=name, site=site)
    return _palpate.push(robot, scene, options, on_step, progress)


def explore(robot: Robot, scene: Recording, folder: str | PathLike[str] | None = None, *, young_modulus_within=0.05, poisson_ratio_within=0.03, max_pushes=8, levels=4, goal="both", tool=None,
            young_modulus_pa=2e4, contacts=24, tilts=2, seed=1, on_step: Callable[[str, Step], Any] | None = None,
            on_push: Callable[[str, list[Parameter], Parameter], Any] | None = None, progress: Callable[[str, float], Any] | None = None,
            **options) -> Explored:
    """Push, estimate, take the next best push, until the intervals are narrow enough: an Explored. Warns after each push, as `push`.

    scene:    a Recording with the object, what holds it, tools and priors
    folder:   the recording is written there while it is made; a crash loses at most the step in flight. It must not be there yet, or be
              empty, and is left so where nothing was recorded. Pushes of the scene are not looked at
    young_modulus_within, poisson_ratio_within: half of the 95 % interval, over E; of nu
    levels:   force steps of a push
    goal:     'young-modulus', 'poisson-ratio' or 'both'
    young_modulus_pa: guess before the first touch
    on_step:  called with (name of the push, Step);  on_push: with (name, [E of every region], nu) after each estimate
    progress: as of `identify`, and of `push` meanwhile; an estimate that it stops leaves the one from before it, and `message` says so

    Further options: those of `push` and of `identify`.
    """
    options.update(young_modulus_within=young_modulus_within, poisson_ratio_within=poisson_ratio_within, max_pushes=max_pushes, levels=levels,
                   goal=goal, tool=tool, young_modulus_pa=young_modulus_pa, contacts=contacts, tilts=tilts, seed=seed)
    return _palpate.explore(robot, scene, folder, options, on_step, on_push, progress)


def look_around(robot: Robot, views: int) -> list[DepthFrame]:
    """One DepthFrame from each of so many places around the untouched object, for `scene.rest.views`."""
    return _palpate.look_around(robot, views)


push.__doc__ += _protocol
