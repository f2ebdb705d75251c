# SPDX-License-Identifier: Apache-2.0
"""A robot in Python that gives what cannot be, and what went wrong with a push. Run by ctest like module_test.py."""
import os
import tempfile
import unittest
import warnings

import numpy as np

import palpate
from soft_block import Gantry, block_on_a_table

NAN, INF = float("nan"), float("inf")


class Faulty(Gantry):
    """Gives what `state` makes of a reading once it presses, what `frame` makes of an image, and looks around."""

    def __init__(self, state=None, frame=None):
        super().__init__()
        self.state, self.frame, self.stopped = state, frame, 0

    def read(self):
        state = super().read()
        if self.state and self.pressed_m() > 0.001:
            self.state(state)
        return state

    def take_depth_image(self):
        frame = super().take_depth_image()
        if self.frame:
            self.frame(frame)
        return frame

    def look(self, view, views):
        return self.take_depth_image()

    def stop(self):
        self.stopped += 1


def put(field, value):
    """field: 'camera.fx_px'"""
    def change(of):
        *before, last = field.split(".")
        for name in before:
            of = getattr(of, name)
        setattr(of, last, value)
    return change


def push(robot, scene=None, contact_m=(0.5, 0, 0.5), **options):
    return palpate.push(robot, scene or block_on_a_table(), contact_m, name="top", **{**dict(force_limit_n=1, force_step_n=0.25), **options})


STATES = (("force_n", [0, NAN, 0], "is not finite; is the sensor connected?"),
          ("torque_nm", [0, INF, 0], "is not finite; give None where none is measured"),
          ("joints_rad", [0.1, NAN], "is not finite"),
          ("time_s", NAN, "must be finite"),
          ("time_s", 1.7e18, "which cannot be; is it in milliseconds or nanoseconds?"),
          ("time_s", -1.0, "the clock must not go back"),
          ("T_base_tip", 2 * np.eye(4), "must be a rigid transform"))

FRAMES = (("depth_m", np.ones((3, 4)), "is 4 x 3 pixels, its camera has 160 x 120"),
          ("depth_m", np.full((120, 160), -0.4), "holds a negative depth; depth is positive along the optical axis"),
          ("mask", np.zeros((4, 4), np.uint8), "is 4 x 4 pixels, the image 160 x 120"),
          ("camera.width_px", 0, "must be from 1 to 16384"),
          ("camera.height_px", 20000, "must be from 1 to 16384"),
          ("camera.fx_px", 0, "must be positive"),
          ("camera.fy_px", NAN, "must be positive"),
          ("camera.cy_px", INF, "must be finite"),
          ("camera.distortion_coefficients", [0.1], "has 1 numbers, the model needs none"),
          ("time_s", INF, "must be finite"),
          ("pose_std_m", -0.001, "must not be negative"),
          ("pose_std_rad", NAN, "must not be negative"),
          ("pose_std_m", 5, "is 5 m, which cannot be"),
          ("noise.sigma_m", NAN, "needs a positive standard deviation in metres"),
          ("noise.model", "kinect", "unknown depth noise model 'kinect'; there are: constant, "),
          ("noise.bias_std_m", -1, "is negative, -1"),
          ("T_base_camera", np.zeros((4, 4)), "must be a rigid transform"))


class Refused(unittest.TestCase):
    def refused(self, use, call, field, words):
        with self.assertRaises(palpate.Error, msg=field) as raised:
            use()
        self.assertTrue(raised.exception.where.startswith(f"robot.{call}()."), raised.exception.where)
        self.assertIn(field.split(".")[-1], raised.exception.where)
        self.assertIn(words, raised.exception.message)

    def test_readings(self):
        for field, value, words in STATES:
            robot = Faulty(state=put(field, value))
            self.refused(lambda: push(robot), "read", field, words)
            self.assertGreater(robot.stopped, 0)
            self.assertEqual(robot.pressed_m(), 0, "the tip is away from the object")

    def test_images(self):
        for field, value, words in FRAMES:
            self.refused(lambda: push(Faulty(frame=put(field, value))), "take_depth_image", field, words)
            self.refused(lambda: palpate.look_around(Faulty(frame=put(field, value)), 2), "look", field, words)

    def test_limits(self):
        for field in ("force_n", "travel_m", "speed_m_s"):
            robot = Gantry()
            robot.limits = palpate.RobotLimits(**{field: 0})
            with self.assertRaises(palpate.Error) as raised:
                push(robot)
            self.assertEqual((raised.exception.where, raised.exception.message),
                             (f"robot.limits.{field}", "must be positive; leave it infinite where there is no limit"))

    def test_before_they_make_a_recording_unreadable(self):
        robot, steps = Faulty(), []

        def spoil(name, step):
            steps.append(step)
            if len(steps) == 3:
                robot.frame = put("depth_m", np.ones((3, 4)))
        with tempfile.TemporaryDirectory() as folder:
            out = folder + "/recording"
            self.refused(lambda: palpate.explore(robot, block_on_a_table(), out, poisson_ratio=0.3, max_pushes=1, contacts=6, tilts=0, travel_limit_m=0.004,
                                                 on_step=spoil), "take_depth_image", "depth_m", "is 4 x 3 pixels")
            self.assertEqual(len(palpate.read_recording(out).pushes[0].steps), 3)


class Taken(unittest.TestCase):
    def test_what_is_no_number_in_an_image_is_no_data(self):
        def holes(frame):
            frame.depth_m[:2], frame.depth_m[2, :5], frame.mask = NAN, INF, np.full(frame.depth_m.shape, 255, np.uint8) * (np.arange(160) < 3)
        made, report = push(Faulty(frame=holes))
        self.assertTrue(report.whole)
        frame = next(one for one in made.steps[1].observations if isinstance(one, palpate.DepthFrame))
        self.assertEqual(np.count_nonzero(frame.depth_m == 0), 2 * 160 + 5)
        self.assertEqual((frame.mask.max(), frame.mask.sum()), (1, 3 * 120))

    def test_what_a_driver_may_give(self):
        def more(state):
            state.joints_rad, state.torque_nm = [0.1, 0.2], [0, 0, 0.001]
        frame = put("noise", palpate.DepthNoise(model="realsense_d435"))
        self.assertTrue(push(Faulty(state=more, frame=frame))[1].whole)


def roll(state):
    """The tip is turned about the tool by less than two degrees."""
    turned = palpate.pose([0, 0, 0], rotation_vector_rad=[0, 0, 0.03])
    state.T_base_tip = state.T_base_tip @ turned


class Warnings(unittest.TestCase):
    def warned(self, words, robot, *given, **options):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            _, report = push(robot, *given, **options)
        self.assertEqual([words in str(one.message) for one in caught], [True], [str(one.message) for one in caught])
        self.assertEqual(caught[0].filename, __file__)
        return report, str(caught[0].message)

    def test_say_what_went_wrong_with_a_push(self):
        report, _ = self.warned("top: the tip was turned by up to 1.7 degrees", Faulty(state=roll))
        self.assertAlmostEqual(report.turned_rad, 0.03, 6)
        unknown = palpate.Recording(tools=block_on_a_table().tools)
        report, words = self.warned("top: how large the object is nobody said", Gantry(), unknown, [0.52, 0.01, 0.5])
        self.assertEqual(report.blind_retreat_m, 0.15)
        self.assertIn("`blind_retreat_m`", words)  # and not the program's option
        def blank(frame):
            frame.depth_m[:] = 0
        report, _ = self.warned("of the camera's images held no depth at all", Faulty(frame=blank))
        self.assertGreaterEqual(report.blank_images, report.steps)
        report, words = self.warned("top: the force passed its limit by", Gantry(young_pa=2e8))
        self.assertGreater(report.overshoot_n, 1)
        self.assertIn("set a smaller increment_m or push_speed_m_s", words)

    def test_say_nothing_of_a_good_one(self):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            _, report = push(Gantry())
        self.assertEqual((report.overshoot_n, report.turned_rad, report.blind_retreat_m), (0, 0, None))

    def test_come_after_each_push_of_a_loop(self):
        explore = lambda **more: palpate.explore(Faulty(state=roll), block_on_a_table(), goal="young-modulus", poisson_ratio=0.3, max_pushes=1, contacts=6,
                                                 tilts=0, travel_limit_m=0.004, **more)
        warned = []

        def until_the_estimate(stage, share):
            if stage == "fit":
                warned.append(len(caught))
            return stage != "fit"
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            explore(progress=until_the_estimate)
        turned = [one for one in caught if "push 1: the tip was turned" in str(one.message)]
        self.assertEqual([one.filename for one in turned], [__file__])
        self.assertEqual(warned, [len(caught)], "before the estimate, not after the run")
        with warnings.catch_warnings(), tempfile.TemporaryDirectory() as folder:
            warnings.simplefilter("error")
            with self.assertRaisesRegex(UserWarning, "push 1: the tip was turned"):  # who asks for it gets it as what a call raises
                explore(folder=folder + "/recording")
            self.assertEqual(os.listdir(folder), ["recording"])


if __name__ == "__main__":
    unittest.main()
