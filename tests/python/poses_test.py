# SPDX-License-Identifier: Apache-2.0
"""Poses in the Python module: matrices of few digits as files take them, and `palpate.pose`. Run by ctest like module_test.py."""
import pathlib
import re
import tempfile
import unittest

import numpy as np

import palpate
from arguments_test import pushed_block

TURN_Z = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])


def turned(axis, angle):
    """By Rodrigues."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


class FewDigits(unittest.TestCase):
    def test_are_what_they_are_in_a_file(self):
        rounded = np.eye(4)
        rounded[:3, :3] = np.round(turned([1, 2, 3], 0.8), 3)
        rounded[:3, 3] = 0.5, 0, 0.6
        u, _, v = np.linalg.svd(rounded[:3, :3])
        self.assertGreater(np.abs(u @ v - rounded[:3, :3]).max(), 1e-5)
        recording = pushed_block()
        recording.pushes[0].steps[0].T_base_tip = rounded
        with tempfile.TemporaryDirectory() as folder:
            palpate.write_recording(recording, folder + "/recording")
            ours = palpate.read_recording(folder + "/recording").pushes[0].steps[0].T_base_tip
            index = pathlib.Path(folder, "recording", "recording.yaml")
            text, found = re.subn(r"T_base_tip: .*", f"T_base_tip: {rounded.tolist()}", index.read_text())
            self.assertEqual(found, 1)
            index.write_text(text)
            theirs = palpate.read_recording(folder + "/recording").pushes[0].steps[0].T_base_tip
        np.testing.assert_allclose(ours[:3, :3], u @ v, atol=1e-12)
        np.testing.assert_allclose(ours, theirs, atol=1e-12)
        np.testing.assert_array_equal(ours[3], [0, 0, 0, 1])

    def test_what_is_further_off_is_refused_by_how_much(self):
        def refused(change, words):
            recording = pushed_block()
            pose = np.eye(4)
            change(pose)
            recording.pushes[0].steps[0].T_base_tip = pose
            with self.assertRaises(palpate.Error) as raised:
                palpate.identify(recording)
            self.assertEqual(raised.exception.where, "recording.pushes[0].steps[0].T_base_tip")
            self.assertIn("must be a rigid transform", raised.exception.message)
            self.assertIn(words, raised.exception.message)

        refused(lambda pose: pose.__setitem__((0, 1), 0.02), "is off from the unit matrix by 0.028; up to 0.01 passes")
        refused(lambda pose: pose.__setitem__((2, 2), -1), "mirrors")
        refused(lambda pose: pose.__setitem__((3, 0), 0.5), "its last row is 0.5 0 0 1; the translation is the last column")
        refused(lambda pose: pose.__setitem__((0, 0), float("nan")), "holds NaN or infinity")


class Pose(unittest.TestCase):
    def test_says_a_rotation_in_three_ways(self):
        self.assertEqual(palpate.pose([1, 2, 3]).tolist(), [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]])
        half = np.sqrt(0.5)
        for rotation in (dict(quaternion_xyzw=[0, 0, half, half]), dict(quaternion_xyzw=[0, 0, -5, -5]),  # -q is q, and any length will do
                         dict(rotation_vector_rad=[0, 0, np.pi / 2]), dict(rotation=TURN_Z), dict(rotation=TURN_Z + 1e-3)):
            pose = palpate.pose((0.1, 0.2, 0.3), **rotation)
            np.testing.assert_allclose(pose[:3, :3], TURN_Z, atol=2e-3 if "rotation" in rotation else 1e-15)
            np.testing.assert_allclose(pose[:3, :3].T @ pose[:3, :3], np.eye(3), atol=1e-14)
            np.testing.assert_array_equal(pose[:3, 3], [0.1, 0.2, 0.3])
        axis, angle = np.array([1, -2, 0.5]), 2.2
        unit = axis / np.linalg.norm(axis)
        by_vector, by_quaternion = palpate.pose([0, 0, 0], rotation_vector_rad=angle * unit), palpate.pose([0, 0, 0], [*(np.sin(angle / 2) * unit), np.cos(angle / 2)])
        np.testing.assert_allclose(by_vector[:3, :3], turned(axis, angle), atol=1e-14)
        np.testing.assert_allclose(by_quaternion, by_vector, atol=1e-14)
        np.testing.assert_array_equal(palpate.pose([0, 0, 0], rotation_vector_rad=[0, 0, 0]), np.eye(4))
        # A UR controller's "straight down": x stays, y and z are turned round.
        np.testing.assert_allclose(palpate.pose([0, 0, 0], rotation_vector_rad=[np.pi, 0, 0])[:3, :3], np.diag([1, -1, -1]), atol=1e-15)

    def test_is_taken_where_poses_are(self):
        recording = pushed_block()
        recording.pushes[0].steps[0].T_base_tip = palpate.pose([0.5, 0, 0.6], rotation_vector_rad=[np.pi, 0, 0])
        self.assertEqual(palpate.check_recording(recording), [])

    def test_refuses_what_is_none(self):
        nan, here = float("nan"), [0, 0, 0]
        for given, where, words in (
                (dict(position_m=[0, nan, 0]), "position_m", "holds NaN or infinity"),
                (dict(position_m=[0, 0]), "position_m", "must be an array of 3 numbers, is 2"),
                (dict(position_m=None), "position_m", "an array of numbers"),
                (dict(position_m=here, quaternion_xyzw=[0, 0, 0, 0]), "quaternion_xyzw", "has no length, which is no rotation"),
                (dict(position_m=here, quaternion_xyzw=[0, 0, nan, 1]), "quaternion_xyzw", "holds NaN or infinity"),
                (dict(position_m=here, quaternion_xyzw=[0, 0, 1]), "quaternion_xyzw", "must be an array of 4 numbers, is 3"),
                (dict(position_m=here, rotation_vector_rad=[180, 0, 0]), "rotation_vector_rad", "more than a whole turn; is it in degrees?"),
                (dict(position_m=here, rotation_vector_rad=[nan, 0, 0]), "rotation_vector_rad", "holds NaN or infinity"),
                (dict(position_m=here, rotation=2 * np.eye(3)), "rotation", "must be a rotation: R^T R of its 3 x 3 part R is off"),
                (dict(position_m=here, rotation=np.diag([1, 1, -1])), "rotation", "mirrors"),
                (dict(position_m=here, rotation=np.full((3, 3), nan)), "rotation", "holds NaN or infinity"),
                (dict(position_m=here, rotation=np.eye(4)), "rotation", "must be an array of 3 x 3 numbers, is 4 x 4"),
                (dict(position_m=here, quaternion_xyzw=[0, 0, 0, 1], rotation=np.eye(3)), "pose", "say the rotation once")):
            with self.assertRaises(palpate.Error) as raised:
                palpate.pose(**given)
            self.assertEqual(raised.exception.where, where)
            self.assertIn(words, raised.exception.message)


if __name__ == "__main__":
    unittest.main()
