# SPDX-License-Identifier: Apache-2.0
"""`palpate.check`: a rig that pushed a known body. Run by ctest like module_test.py."""
import json
import os
import subprocess
import tempfile
import unittest

import numpy as np

import palpate
from soft_block import Gantry, block_on_a_table


def pushed_body(give_m_per_n, scale=1.0, camera_low_m=0.0, seed=5):
    """A body that goes down as a whole under three pushes from above, seen by a camera that looks straight down.

    give_m_per_n: of (body, stick and arm);  scale: of the force as it is read;  camera_low_m: by so much under where it is said to be
    """
    rng = np.random.default_rng(seed)
    body, stick = give_m_per_n
    recording = block_on_a_table()
    top_m = recording.rest.surface.vertices_m[:, 2].max()
    look = Gantry(seed=seed)
    for push in range(3):
        made = palpate.Push(name=f"push {push + 1}", force_tare_std_n=0.02, travel_offset_std_m=2e-4)
        for step, force_n in enumerate([0, 4, 8, 12]):
            frame = look.take_depth_image()
            frame.depth_m = frame.depth_m + body * force_n - camera_low_m
            one = palpate.Step(time_s=step + 1, observations=[frame])
            if force_n > 0:
                one.loads = [palpate.Load(tool="stick", force_n=[0, 0, -(force_n * scale + rng.normal(0, 0.01))], force_std_n=0.01,
                                          contact_m=[0.45 + 0.05 * push, 0, top_m])]
                one.observations.append(palpate.ToolTravel(tool="stick", travel_m=(body + stick) * force_n + rng.normal(0, 1e-4), sigma_m=1e-4))
            made.steps.append(one)
        recording.pushes.append(made)
    return recording


def named(check, name):
    return next(one for one in check.errors if one.name == name)


class Check(unittest.TestCase):
    def test_a_good_rig_agrees(self):
        check = palpate.check(pushed_body((0, 0)), rigid=True)
        self.assertTrue(check.consistent and check.converged, check)
        self.assertEqual((check.travels, check.touches, check.touches_missed), (9, 3, 0))
        self.assertFalse(named(check, "force_scale").determined, "a rigid block says nothing of it")
        self.assertIn("force_scale_not_determined", [verdict.code for verdict in check.verdicts])

    def test_finds_what_is_off(self):
        check = palpate.check(pushed_body((1 / 800, 0), scale=1.06), stiffness_n_per_m=800, stiffness_relative_std=0.001)
        scale = named(check, "force_scale")
        self.assertAlmostEqual(scale.value, 0.06, delta=0.01)
        self.assertTrue(scale.lower_95 < 0.06 < scale.upper_95, scale)
        self.assertEqual((scale.stated_std, scale.determined, scale.consistent, check.consistent), (0.01, True, False, False))
        self.assertIn("force_scale_off", [verdict.code for verdict in check.verdicts])
        check = palpate.check(pushed_body((0, 2e-4), camera_low_m=0.006), rigid=True)
        self.assertAlmostEqual(named(check, "compliance").value, 2e-4, delta=2e-5)
        self.assertFalse(named(check, "compliance").consistent)
        self.assertAlmostEqual(check.hand_eye_correction[2, 3], -0.006, delta=1e-3)

    def test_the_programs_digits(self):
        recording = pushed_body((1 / 800, 1e-4), scale=1.02)
        with tempfile.TemporaryDirectory() as folder:
            palpate.write_recording(recording, folder + "/spring")
            ours = palpate.check(palpate.read_recording(folder + "/spring"), stiffness_n_per_m=800, placed_std_m=0.001)
            theirs = json.loads(subprocess.run([os.environ["PALPATE_CLI"], "--quiet", "--json", "check", folder + "/spring", "--stiffness", "800",
                                                "--placed-within", "0.001"], capture_output=True).stdout)
        for error, their in zip(ours.errors, theirs["errors"], strict=True):
            self.assertEqual((error.name, error.value, error.std, error.consistent), tuple(their[key] for key in ("name", "value", "std", "consistent")))
        self.assertEqual([verdict.code for verdict in ours.verdicts], [verdict["code"] for verdict in theirs["verdicts"]])
        self.assertEqual((ours.consistent, ours.chi2_per_dof), (theirs["consistent"], theirs["chi2_per_dof"]))
        np.testing.assert_array_equal(ours.hand_eye_correction, theirs["hand_eye_correction"])
        np.testing.assert_array_equal(ours.pivot_m, theirs["hand_eye_pivot_m"])

    def test_refuses(self):
        recording = pushed_body((0, 0))
        nan = float("nan")
        for options, where, words in (
                ({}, "stiffness_n_per_m", "say what was pushed: stiffness_n_per_m of a spring, or rigid=True"),
                (dict(rigid=True, stiffness_n_per_m=800), "stiffness_n_per_m", "say what was pushed"),
                (dict(stiffness_n_per_m=-800), "stiffness_n_per_m", "must be a number above 0, in N/m"),
                (dict(rigid=True, stiffness_relative_std=0.01), "stiffness_relative_std", "is of a spring"),
                (dict(rigid=True, placed_std_m=-1), "placed_std_m", "must be 0 or a number above it, in metres"),
                (dict(rigid=True, placed_std_rad=nan), "placed_std_rad", "must be 0 or a number above it, in radians"),
                (dict(rigid=True, touch_std_m=0), "touch_std_m", "must be a number above 0, in metres")):
            with self.assertRaises(palpate.Error) as raised:
                palpate.check(recording, **options)
            self.assertEqual(raised.exception.where, where)
            self.assertIn(words, raised.exception.message)
        recording.rest = palpate.Rest(views=[Gantry().take_depth_image()])
        with self.assertRaisesRegex(palpate.Error, "recording.rest: has neither surface nor volume"):
            palpate.check(recording, rigid=True)
        recording = pushed_body((0, 0))
        recording.pushes[0].steps[1].loads[0].force_n = [0, nan, -1]
        with self.assertRaisesRegex(palpate.Error, r"pushes\[0\].steps\[1\].loads\[0\].force_n"):
            palpate.check(recording, rigid=True)
        recording.pushes = []
        with self.assertRaisesRegex(palpate.Error, "there is nothing to check"):
            palpate.check(recording, rigid=True)


if __name__ == "__main__":
    unittest.main()
