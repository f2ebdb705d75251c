# SPDX-License-Identifier: Apache-2.0
"""What the Python module is given: what is left out, mistyped or cannot be. Run by ctest like module_test.py."""
import os
import pathlib
import tempfile
import unittest
import warnings

import numpy as np

import palpate
from soft_block import Gantry, block_on_a_table


class LoadDirection(unittest.TestCase):
    def test_is_that_of_the_force_where_it_is_not_given(self):
        np.testing.assert_allclose(palpate.Load(tool="stick", force_n=[2, 0, 0]).direction, [1, 0, 0])
        np.testing.assert_allclose(palpate.Load(tool="stick", force_n=[0, 0, 0]).direction, [0, 0, -1])
        np.testing.assert_allclose(palpate.Load(tool="stick", travel_m=0.001).direction, [0, 0, -1])
        np.testing.assert_allclose(palpate.Load(tool="stick", force_n=[2, 0, 0], direction=[0, 1, 0]).direction, [0, 1, 0])


class Options(unittest.TestCase):
    def test_of_the_protocol_are_those_of_the_command_line(self):
        for option in ("settling_rate_n_s", "settling_window_s", "look_every_m", "blind_retreat_m", "obstacle_threshold_n", "contact_samples",
                       "contact_noise_factor", "slip_sideways_m", "slip_friction", "slip_force_drop", "slip_least_force_n"):
            with self.assertRaises(palpate.Error) as raised:  # taken, and refused for its value
                palpate.push(Gantry(), block_on_a_table(), [0.5, 0, 0.05], **{option: -1})
            self.assertNotIn("is no option", str(raised.exception), option)

    def test_mistyped_ones_name_the_nearest(self):
        for wrong, right in (("force_limit", "force_limit_n"), ("push_sped_m_s", "push_speed_m_s")):
            with self.assertRaisesRegex(palpate.Error, f"{wrong}: is no option; did you mean '{right}'"):
                palpate.push(Gantry(), block_on_a_table(), [0.5, 0, 0.05], **{wrong: 1})


def pushed_block():
    """A step of one push, seen by a marker."""
    scene = block_on_a_table()
    seen = palpate.Markers(names=["m"], rest_m=[[0.54, 0, 0.5]], observed_m=[[0.54, 0, 0.499]], sigma_m=1e-4)
    load = palpate.Load(tool="stick", force_n=[0, 0, -10], contact_m=[0.5, 0, 0.5])
    scene.pushes = [palpate.Push(name="top", steps=[palpate.Step(time_s=1, loads=[load], observations=[seen])])]
    return scene


def found_quickly(**options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return palpate.identify(pushed_block(), refine="none", cross_checks=False, poisson_ratio=0.3, **options)


class Export(unittest.TestCase):
    def test_refuses_a_density_that_cannot_be(self):
        found = found_quickly(element="tet4")
        with warnings.catch_warnings(), tempfile.TemporaryDirectory() as folder:
            warnings.simplefilter("ignore")
            for density in (-5, float("nan"), 1.1, float("inf"), 4e4):
                with self.assertRaises(palpate.Error) as raised:
                    palpate.export(found, "mujoco", folder + "/none", density_kg_m3=density)
                self.assertEqual(raised.exception.where, "density_kg_m3")
                self.assertIn(f"is {density:g}, outside 5 to 30000 kg/m3", raised.exception.message)
            self.assertEqual(os.listdir(folder), [])
            with self.assertRaisesRegex(palpate.Error, "density_kg_m3: must be a number, not str"):
                palpate.export(found, "mujoco", folder + "/none", density_kg_m3="30")
            found.object.density_kg_m3 = 40.0
            same = []
            for name, density in (("none", {}), ("zero", dict(density_kg_m3=0.0)), ("said", dict(density_kg_m3=40))):
                files = palpate.export(found, "mujoco", f"{folder}/{name}", **density)
                same.append(pathlib.Path(folder, name, files[0]).read_text())
            self.assertEqual(same, same[:1] * 3, "None and 0 are the recording's")

    def test_a_folder_that_cannot_be_made_is_an_error_like_any_other(self):
        class Late(palpate.Identified):
            """A file comes to stand at the folder's place once it was looked at."""

            def __getattribute__(self, name):
                if name == "volume":
                    out.write_text("")
                return super().__getattribute__(name)

        found = found_quickly(element="tet4")
        late = Late(answer=found.answer, volume=found.volume, region=found.region, object=found.object)
        with tempfile.TemporaryDirectory() as folder:
            out = pathlib.Path(folder, "out")
            with self.assertRaises(palpate.Error) as raised:
                palpate.export(late, "calculix", out)
            self.assertEqual(raised.exception.where, str(out))
            self.assertRegex(raised.exception.message, r"cannot be made, read or written \(.+\); give another path")

    def test_corners_alone_are_an_eighth_of_the_elements(self):
        with warnings.catch_warnings(), tempfile.TemporaryDirectory() as folder:
            warnings.simplefilter("ignore")
            found = palpate.identify(pushed_block(), refine="none", element="tet10", cross_checks=False, poisson_ratio=0.3)
            size = {}
            for elements in ("split", "corners"):
                files = palpate.export(found, "sofa", f"{folder}/{elements}", density_kg_m3=30, elements=elements)
                size[elements] = sum(os.path.getsize(f"{folder}/{elements}/{name}") for name in files)
            self.assertLess(size["corners"], 0.3 * size["split"])
            with self.assertRaisesRegex(palpate.Error, "elements: is 'corner'; it is split or corners"):
                palpate.export(found, "sofa", folder, elements="corner")


class Warnings(unittest.TestCase):
    def test_what_is_odd_is_said_once(self):
        scene = pushed_block()
        scene.tools[0].shape = "sphere"
        quick = dict(refine="none", element="tet4", cross_checks=False, poisson_ratio=0.3)
        with self.assertWarnsRegex(UserWarning, "taken to press all of its radius") as caught:
            palpate.identify(scene, **quick)
        self.assertEqual(caught.filename, __file__)
        scene.warnings = [str(caught.warning)]
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            palpate.identify(scene, **quick)


class Refusals(unittest.TestCase):
    def test_a_robot_that_lacks_a_call_says_which(self):
        class Half(palpate.Robot):
            pass

        with self.assertRaisesRegex(NotImplementedError, "Half.read"):
            palpate.push(Half(), block_on_a_table(), [0.5, 0, 0.05])

    def test_a_patch_without_a_size(self):
        scene = block_on_a_table()
        scene.tools[0].radius_m = 0
        scene.pushes = [palpate.Push(name="top", steps=[palpate.Step(loads=[palpate.Load(tool="stick", force_n=[0, 0, -1], contact_m=[0.5, 0, 0.05])])])]
        where, what = palpate.check_recording(scene)[0]
        self.assertEqual(where, "pushes[0].steps[0].loads[0].force_n")
        self.assertIn("radius_m is 0", what)


if __name__ == "__main__":
    unittest.main()
