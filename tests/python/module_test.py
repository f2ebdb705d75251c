# SPDX-License-Identifier: Apache-2.0
"""`import palpate` as a user meets it: data made of numpy, an answer against closed forms and against the program's, errors that name
the field. Run by ctest with PYTHONPATH set to the built package and examples/python; PALPATE_CLI names the program."""
import ast
import copy
import dataclasses
import json
import os
import pathlib
import pickle
import re
import signal
import subprocess
import sys
import tempfile
import threading
import unittest

import numpy as np

import palpate
from soft_block import Gantry, block_on_a_table

YOUNG_PA, POISSON = 21.0e3, 0.31
EDGE_M = np.array([0.06, 0.05, 0.08])


def block(cells=(4, 3, 5)):
    """A block of tetrahedra (six a cell) on z = 0, and the nodes of its top."""
    nx, ny, nz = (n + 1 for n in cells)
    at = lambda i, j, k: (i * ny + j) * nz + k
    nodes = np.array([[i / cells[0], j / cells[1], k / cells[2]] for i in range(nx) for j in range(ny) for k in range(nz)]) * EDGE_M
    tetrahedra = []
    ways = [(0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)]
    for i in range(cells[0]):
        for j in range(cells[1]):
            for k in range(cells[2]):
                for way in ways:
                    corner, path = np.array([i, j, k]), [at(i, j, k)]
                    for axis in way:
                        corner[axis] += 1
                        path.append(at(*corner))
                    edges = nodes[path[1:]] - nodes[path[0]]
                    tetrahedra.append(path if np.linalg.det(edges) > 0 else [path[0], path[2], path[1], path[3]])
    return palpate.TetMesh(nodes_m=nodes, tetrahedra=np.array(tetrahedra)), np.flatnonzero(np.abs(nodes[:, 2] - EDGE_M[2]) < 1e-9)


def pressed_block():
    """A block pressed evenly by a smooth platen on a smooth table: stress -F / A everywhere, in closed form (linear law)."""
    volume, _ = block()
    recording = palpate.Recording(name="block")
    recording.rest.volume = volume
    recording.model = palpate.ModelDefaults(mesh="as_given", element="tet4", refine="none", material="linear")
    symmetric = lambda axis: palpate.Support(kind="plane", plane=palpate.Plane(point_m=np.zeros(3), normal=np.eye(3)[axis]), contact="frictionless",
                                             name="xyz"[axis])
    recording.supports = [symmetric(axis) for axis in range(3)]
    recording.tools = [palpate.Tool(name="plate", shape="platen", plane=palpate.Plane(point_m=[0, 0, EDGE_M[2]], normal=[0, 0, -1]), contact="frictionless")]
    push = palpate.Push(name="press")
    area_m2 = EDGE_M[0] * EDGE_M[1]
    rng = np.random.default_rng(7)
    side_m = EDGE_M * np.column_stack([np.ones(40), rng.uniform(0.1, 0.9, (40, 2))])  # on the far face, away from its rim
    for step, strain in enumerate([0.0, 0.01, 0.02, 0.03]):
        seen = side_m * (1 + strain * np.array([POISSON, POISSON, -1])) + rng.normal(0, 2e-5, side_m.shape)
        force_n = YOUNG_PA * strain * area_m2 + rng.normal(0, 0.002)
        load = palpate.Load(tool="plate", travel_m=strain * EDGE_M[2], direction=[0, 0, -1])
        push.steps.append(palpate.Step(time_s=step, loads=[load], observations=[
            palpate.PointCloud(points_m=seen, sigma_m=[2e-5]),
            palpate.Wrench(force_n=[0, 0, -force_n], force_sigma_n=0.002, tool="plate", along=[0, 0, -1])]))
    recording.pushes.append(push)
    return recording


class Identified(unittest.TestCase):
    def test_a_block_in_closed_form(self):
        answer = palpate.identify(pressed_block(), threads=1).answer
        self.assertEqual(answer.termination, "converged", answer.message)
        for found, truth in ((answer.young_modulus, YOUNG_PA), (answer.poisson_ratio, POISSON)):
            self.assertLess(found.lower_95, truth)
            self.assertGreater(found.upper_95, truth)
            self.assertLess(found.upper_95 - found.lower_95, 0.05 * truth)

    def test_the_programs_digits(self):
        recording = pressed_block()
        with tempfile.TemporaryDirectory() as folder:
            palpate.write_recording(recording, folder + "/recording")
            subprocess.run([os.environ["PALPATE_CLI"], "--threads", "1", "--quiet", "estimate", folder + "/recording", "-o", folder + "/out"], check=True)
            with open(folder + "/out/result.json") as file:
                theirs = json.load(file)["parameters"]
            read = palpate.read_recording(folder + "/recording")
            ours = palpate.identify(read, threads=1)
            self.assertEqual(palpate.result_json(ours.answer)["parameters"], theirs)
            palpate.write_result(ours, read, folder + "/ours")
            for name in ("result.json", "report.html", "model/object.vtu", "model/recording.yaml"):
                self.assertTrue(os.path.exists(f"{folder}/ours/{name}"), name)
            again = palpate.read_result(folder + "/ours")
            self.assertEqual(again.answer.young_modulus.value, ours.answer.young_modulus.value)
            self.assertEqual(again.volume.tetrahedra.shape, ours.volume.tetrahedra.shape)

    def test_one_step_after_another_ends_where_all_at_once_does(self):
        recording = pressed_block()
        scene = copy.deepcopy(recording)
        steps = scene.pushes[0].steps
        scene.pushes = []
        estimator = palpate.OnlineEstimator(scene, threads=1)
        estimator.begin(palpate.Push(name="press"))
        spreads = [estimator.add(step).young_modulus.std for step in steps][1:]
        self.assertEqual(sorted(spreads, reverse=True), spreads)
        self.assertEqual(len(estimator.recording.pushes[0].steps), len(steps))
        self.assertAlmostEqual(estimator.answer().answer.young_modulus.value / palpate.identify(recording, threads=1).answer.young_modulus.value, 1, 6)

    def test_what_was_learned_is_predicted_with_and_exported(self):
        recording = pressed_block()
        found = palpate.identify(recording, threads=1)
        with tempfile.TemporaryDirectory() as folder, self.assertWarnsRegex(UserWarning, "the law there is stvk, and"):
            for name in palpate.exporters():
                files = palpate.export(found, name, f"{folder}/{name}", density_kg_m3=30)
                self.assertTrue(os.path.getsize(f"{folder}/{name}/{files[0]}") > 0, name)
        pressed = palpate.predict(found, contact_m=[0.03, 0.025, 0.08], radius_m=0.01, force_n=0.5)
        self.assertTrue(pressed.converged)
        self.assertEqual(pressed.displacement_m.shape, found.volume.nodes_m.shape)
        with tempfile.TemporaryDirectory() as folder:
            palpate.write_result(found, recording, folder)
            words = "--quiet --json predict OUT --contact 0.03 0.025 0.08 --radius 0.01 --force 0.5".replace("OUT", folder).split()
            theirs = json.loads(subprocess.run([os.environ["PALPATE_CLI"], *words], check=True, capture_output=True).stdout)
        self.assertAlmostEqual(pressed.travel_m.upper_95 / theirs["travel_m"]["upper_95"], 1, 6)
        self.assertRaisesRegex(palpate.Error, "round", palpate.suggest, recording, found.answer)  # a platen has no place to choose


def fields_of_structs(header):
    """{struct: its fields}, of plain structs as `core` has them."""
    text = re.sub(r"//[^\n]*", "", header.read_text())
    text = re.sub(r"static constexpr[^;]*;|enum class \w+ \{[^}]*\}", "", text)
    out = {}
    for name, start in [(m.group(1), m.end()) for m in re.finditer(r"struct (\w+) \{", text)]:
        depth, end = 1, start
        while depth:
            depth += {"{": 1, "}": -1}.get(text[end], 0)
            end += 1
        body = text[start:end - 1]
        while re.search(r"\{[^{}]*\}", body):
            body = re.sub(r"\{[^{}]*\}", "", body)  # initialisers and bodies of functions
        body = re.sub(r"<[^<>;]*>", "", re.sub(r"<[^<>;]*>", "", body))
        fields = []
        for declaration in body.split(";"):
            if "operator" in declaration or not declaration.strip():
                continue
            for one in declaration.split(","):
                words = re.sub(r"=.*", "", one, flags=re.S).split("(")[0].split()
                if words and re.fullmatch(r"\w+", words[-1]):
                    fields.append(words[-1])
        out[name] = fields
    return out


class Data(unittest.TestCase):
    def test_every_field_of_core_has_its_place_in_python(self):
        core = pathlib.Path(__file__).parents[2] / "palpate" / "core"
        structs = {}
        for header in ("recording.hpp", "mesh.hpp", "identification.hpp"):
            structs |= fields_of_structs(core / header)
        self.assertGreater(len(structs), 40)
        elsewhere = {"RayCloud", "SurfaceEmbedding", "ObjectModel", "Material"}  # no recording and no answer holds them
        for name, fields in structs.items():
            if name not in elsewhere:
                self.assertEqual(fields, [f.name for f in dataclasses.fields(getattr(palpate, name))], name)

    def test_every_noun_goes_there_and_back(self):
        recording, truth = palpate.demo()
        self.assertGreater(truth["young_modulus_pa"], 0)
        with tempfile.TemporaryDirectory() as folder:
            palpate.write_recording(recording, folder + "/one")
            read = palpate.read_recording(folder + "/one")
            palpate.write_recording(read, folder + "/two")
            with open(folder + "/one/recording.yaml") as one, open(folder + "/two/recording.yaml") as two:
                self.assertEqual(one.read(), two.read())
        frame = next(one for one in read.pushes[0].steps[1].observations if isinstance(one, palpate.DepthFrame))
        self.assertEqual(frame.depth_m.shape, (frame.camera.height_px, frame.camera.width_px))
        self.assertEqual(frame.T_base_camera.shape, (4, 4))

    def test_data_are_plain_objects(self):
        tool = palpate.Tool(name="stick", radius_m=0.01)
        other = pickle.loads(pickle.dumps(copy.deepcopy(tool)))
        self.assertEqual((other.name, other.radius_m, other.shape), ("stick", 0.01, "sphere"))
        with self.assertRaises(AttributeError):
            tool.radius = 0.01  # a field that is not there
        with self.assertRaises(TypeError):
            palpate.Tool(radius=0.01)
        self.assertIn("radius_m", palpate.Tool.__doc__)
        self.assertLess(len(repr(pressed_block())), 5000)
        push = palpate.Push()
        push.steps.append(palpate.Step())
        self.assertEqual(palpate.Push().steps, [])  # defaults are not shared

    def test_editors_know_every_name_and_field(self):
        from palpate import _palpate, _stubs
        written = pathlib.Path(palpate.__file__).with_name("__init__.pyi").read_text()
        self.assertEqual(written, _stubs.stubs(), "made of this module")
        known = {one.name: one for one in ast.parse(written).body if isinstance(one, (ast.ClassDef, ast.FunctionDef))}
        self.assertEqual(sorted(known), sorted(palpate.__all__))
        for name, _, fields, _ in _palpate.nouns():
            types = {one.target.id: ast.unparse(one.annotation) for one in known[name].body if isinstance(one, ast.AnnAssign)}
            self.assertEqual(types, {field: re.sub(r"numpy.ndarray, [\w ]+", "NDArray[Any]", kind) for field, kind, _, _ in fields}, name)
        self.assertIn("read", [one.name for one in known["Robot"].body if isinstance(one, ast.FunctionDef)])
        self.assertEqual(ast.unparse(known["identify"].returns), "'Identified'")

    def test_tables(self):
        self.assertIn("neo_hookean", palpate.materials())
        self.assertIn("mujoco", palpate.exporters())
        self.assertIn("realsense_d435", palpate.depth_sensors())
        for name in palpate.__all__:
            self.assertTrue(getattr(palpate, name).__doc__, name)


class Refused(unittest.TestCase):
    def refused(self, change, where, what):
        recording = pressed_block()
        change(recording)
        with self.assertRaises(palpate.Error) as raised:
            palpate.identify(recording, threads=1)
        self.assertIn(where, raised.exception.where)
        self.assertIn(what, raised.exception.message)

    def test_with_the_place_and_the_cure(self):
        step = lambda recording: recording.pushes[0].steps[2]
        self.refused(lambda r: setattr(step(r), "time_s", "late"), "recording.pushes[0].steps[2].time_s", "must be a number, not str")
        self.refused(lambda r: setattr(step(r).loads[0], "direction", [0, 1]), "recording.pushes[0].steps[2].loads[0].direction", "array of 3 numbers, is 2")
        self.refused(lambda r: setattr(step(r), "observations", [palpate.Tool()]), "recording.pushes[0].steps[2].observations[0]", "PointCloud")
        self.refused(lambda r: setattr(r.tools[0], "shape", "ball"), "recording.tools[0].shape", "'sphere'")
        self.refused(lambda r: setattr(r.rest.volume, "tetrahedra", [[0.5, 1, 2, 3]]), "recording.rest.volume.tetrahedra", "whole numbers")
        self.refused(lambda r: setattr(r.model, "material", "rubber"), "recording.model.material", "neo_hookean")
        self.refused(lambda r: setattr(step(r), "T_base_tip", 2 * np.eye(4)), "recording.pushes[0].steps[2].T_base_tip", "rigid transform")
        self.refused(lambda r: setattr(r, "pushes", "all"), "recording.pushes", "list of Push")
        self.refused(lambda r: setattr(r, "name", os.fsdecode(b"caf\xe9")), "recording.name", "not UTF-8")
        self.refused(lambda r: setattr(r.tools[0], "shape", "caf\udce9"), "recording.tools[0].shape", "not UTF-8")

    def test_as_a_file_would_be(self):
        def upside_down(recording):
            recording.rest.volume.tetrahedra = recording.rest.volume.tetrahedra[:, [1, 0, 2, 3]]
        recording = pressed_block()
        upside_down(recording)
        problems = palpate.check_recording(recording)
        self.assertTrue(problems)
        with self.assertRaises(palpate.Error) as raised:
            palpate.identify(recording)
        self.assertIn(problems[0][0], str(raised.exception))

    def test_files(self):
        with self.assertRaisesRegex(palpate.Error, "nowhere"):
            palpate.read_recording("nowhere")
        with self.assertRaisesRegex(palpate.Error, "nowhere.ply"):
            palpate.read_surface("nowhere.ply")
        with self.assertRaisesRegex(palpate.Error, "nowhere"):
            palpate.read_result("nowhere")
        with self.assertRaises(TypeError):
            palpate.identify(pressed_block(), poison_ratio=0.3)
        with self.assertRaisesRegex(palpate.Error, "poisson_range"):
            palpate.identify(pressed_block(), poisson_range=[0.3])

    def test_files_whose_names_are_no_utf_8(self):
        latin = "café".encode("latin-1")
        with tempfile.TemporaryDirectory() as folder:
            palpate.write_recording(pressed_block(), folder + "/recording")
            index = pathlib.Path(folder, "recording", "recording.yaml")
            index.write_bytes(index.read_bytes().replace(b"rest.vtu", latin + b".vtu"))
            with self.assertRaises(palpate.Error) as raised:
                palpate.read_recording(folder + "/recording")
            for text in (str(raised.exception), raised.exception.where + raised.exception.message):
                self.assertIn("caf\ufffd.vtu", text)
            named = os.path.join(os.fsencode(folder), latin)
            for name in (named, os.fsdecode(named)):  # as os.listdir() gives it for bytes and for text
                with self.assertRaisesRegex(palpate.Error, "caf\ufffd"):
                    palpate.read_recording(name)
            palpate.write_recording(pressed_block(), os.fsdecode(named))
            self.assertTrue(os.path.exists(os.path.join(named, b"recording.yaml")))
            self.assertEqual(len(palpate.read_recording(os.fsdecode(named)).pushes), 1)

    def test_a_push_that_nothing_can_make(self):
        found = palpate.identify(pressed_block(), threads=1)
        with self.assertRaises(palpate.Error) as raised:
            palpate.predict(found, contact_m=[0.03, 0.025, 0.3], radius_m=0.01, force_n=0.5)
        self.assertEqual(raised.exception.where.split(" ")[0], "contact")
        with self.assertRaisesRegex(palpate.Error, "must be a number above 0"):
            palpate.predict(found, contact_m=[0.03, 0.025, 0.08], radius_m=0.01, force_n=-0.5)


class LongWork(unittest.TestCase):
    def test_stops_when_asked_to(self):
        answer = palpate.identify(pressed_block(), progress=lambda stage, share: False).answer
        self.assertEqual(answer.termination, "cancelled")

    def test_hands_on_what_progress_raises(self):
        def interrupted(stage, share):
            raise KeyboardInterrupt
        with self.assertRaises(KeyboardInterrupt):
            palpate.identify(pressed_block(), progress=interrupted)

    def test_leaves_other_threads_alone(self):
        answers = [None, None]

        def fit(i):
            answers[i] = palpate.identify(pressed_block(), threads=1).answer.young_modulus.value
        both = [threading.Thread(target=fit, args=(i,)) for i in range(2)]
        for one in both:
            one.start()
        for one in both:
            one.join()
        self.assertEqual(answers[0], answers[1])
        self.assertEqual(answers[0], palpate.identify(pressed_block(), threads=1).answer.young_modulus.value)


class Stubborn(Gantry):
    """Does what it is told to once it is deep enough in the object."""

    def __init__(self, act):
        super().__init__()
        self.act, self.stopped = act, 0

    def stop(self):
        self.stopped += 1

    def read(self):
        if self.act and self.pressed_m() > 0.001:
            act, self.act = self.act, None
            return act()
        return super().read()


class CtrlC(Gantry):
    """Ctrl-C comes in one of its calls, once it is deep enough in the object."""

    def __init__(self, call):
        super().__init__()
        self.call, self.since = call, None  # what was asked of it since then

    def asked(self, call):
        if self.since is not None:
            self.since.append(call)
        elif call == self.call and self.pressed_m() > 0.001:
            self.since = []
            signal.raise_signal(signal.SIGINT)

    def read(self):
        self.asked("read")
        return super().read()

    def move(self, T_base_tip, speed_m_s):
        self.asked("move")
        return super().move(T_base_tip, speed_m_s)

    def wait(self, duration_s):
        self.asked("wait")
        super().wait(duration_s)

    def stop(self):
        self.asked("stop")


def explore_once(robot, *folder, **options):
    """One push down onto a block whose nu is known."""
    return palpate.explore(robot, block_on_a_table(), *folder, goal="young-modulus", young_modulus_within=0.05, poisson_ratio=0.3, max_pushes=1,
                           contacts=6, tilts=0, travel_limit_m=0.004, **options)


class Robots(unittest.TestCase):
    def test_explores_a_half_space_in_closed_form(self):
        told = []
        with tempfile.TemporaryDirectory() as folder:
            done = explore_once(Gantry(), folder + "/recording", on_push=lambda name, young, poisson: told.append(young[0].value))
            self.assertTrue(done.reached, done.message)
            young = done.found.answer.young_modulus
            self.assertLess(young.lower_95, 20e3)
            self.assertGreater(young.upper_95, 20e3)
            self.assertAlmostEqual(told[0] / young.value, 1, 9)
            kept = palpate.read_recording(folder + "/recording")
        self.assertEqual([len(push.steps) for push in kept.pushes], [len(push.steps) for push in done.recording.pushes])
        self.assertTrue(done.pushes[0].report.whole)
        self.assertAlmostEqual(done.pushes[0].report.contact_m[2], 0.5, 3)

    def test_makes_one_push(self):
        steps = []
        made, report = palpate.push(Gantry(), block_on_a_table(), [0.5, 0, 0.5], name="first", force_limit_n=1, force_step_n=0.25,
                                    on_step=lambda name, step: steps.append(name))
        self.assertEqual((made.name, report.stop, report.steps, steps), ("first", "force limit", len(made.steps), ["first"] * len(made.steps)))
        self.assertAlmostEqual(report.highest_force_n, 1, 1)
        scene = block_on_a_table()
        scene.pushes.append(made)  # whose sensors are those of the next
        further = palpate.suggest(scene, goal="young-modulus", tilts=0)
        self.assertIn("push at", further[0].words)
        self.assertLessEqual(further[0].young_modulus_within, further[-1].young_modulus_within)
        found = palpate.identify(scene, poisson_ratio=0.3, refine="none", regions="by-site", cross_checks=False)
        self.assertIn("push at", palpate.suggest(scene, found, tilts=0)[0].words)

    def test_is_stopped_where_a_call_raises(self):
        def broken():
            raise OSError("the cable is out")

        for act, raised in ((broken, OSError), (lambda: None, palpate.Error)):
            robot = Stubborn(act)
            with self.assertRaises(raised) as caught:
                palpate.push(robot, block_on_a_table(), [0.5, 0, 0.5], force_limit_n=1)
            self.assertGreater(robot.stopped, 0)
            self.assertEqual(robot.pressed_m(), 0, "the tip is away from the object")
        self.assertEqual(caught.exception.where, "robot.read()")

    def test_stands_still_after_ctrl_c(self):
        push = lambda robot, **hooks: palpate.push(robot, block_on_a_table(), [0.5, 0, 0.5], force_limit_n=1, force_step_n=0.25, **hooks)
        for call in ("move", "read", "wait"):
            for use in (push, explore_once):
                robot = CtrlC(call)
                with self.assertRaises(KeyboardInterrupt):
                    use(robot)
                self.assertEqual(robot.since, ["stop"], call)
                self.assertGreater(robot.pressed_m(), 0, "only the user knows why")

        def asked_to_end(name, step):
            if robot.pressed_m() > 0:
                robot.since = []
                sys.exit("enough")  # as a handler of SIGTERM may
        for use in (push, explore_once):
            robot = CtrlC(None)
            with self.assertRaisesRegex(SystemExit, "enough"):
                use(robot, on_step=asked_to_end)
            self.assertEqual(robot.since, ["stop"])

    def test_ends_where_progress_says_so(self):
        robot = Stubborn(None)
        made, report = palpate.push(robot, block_on_a_table(), [0.5, 0, 0.5], force_limit_n=1, progress=lambda stage, share: not robot.pressed_m() > 0)
        self.assertEqual((report.stop, robot.stopped), ("stopped by the user", 1))
        self.assertGreater(robot.pressed_m(), 0)
        stages = []

        def not_in_the_fit(stage, share):
            stages.append(stage)
            return stage != "fit"
        done = explore_once(Gantry(), progress=not_in_the_fit)
        self.assertEqual(done.message, "push 1 is recorded, but nothing is estimated: stopped on request")
        self.assertEqual(done.found.answer.termination, "cancelled")
        self.assertEqual(stages.count("fit"), 1, "who said so once is not asked again")

    def test_leaves_a_recording_that_is_there_as_it_is(self):
        with tempfile.TemporaryDirectory() as folder:
            there = folder + "/recording"
            palpate.write_recording(pressed_block(), there)
            with self.assertRaises(palpate.Error) as raised:
                explore_once(Gantry(), there)
            self.assertEqual(raised.exception.where, there)
            self.assertIn("is there already", raised.exception.message)
            self.assertEqual(len(palpate.read_recording(there).pushes[0].steps), len(pressed_block().pushes[0].steps))

    def test_leaves_nothing_where_nothing_was_recorded(self):
        def broken():
            raise OSError("the cable is out")
        with tempfile.TemporaryDirectory() as folder:
            os.mkdir(folder + "/empty")
            for name in ("new", "empty"):
                robot = Stubborn(broken)
                robot.pressed_m = lambda: 1  # its first reading fails
                with self.assertRaises(OSError):
                    explore_once(robot, f"{folder}/{name}")
            self.assertEqual(os.listdir(folder), ["empty"])
            self.assertEqual(os.listdir(folder + "/empty"), [])
            explore_once(Gantry(), folder + "/stopped", progress=lambda stage, share: stage != "push")
            self.assertEqual(os.listdir(folder), ["empty"])

    def test_records_its_own_pushes_only(self):
        def broken(name, step):
            raise OSError("the disk is full")
        scene = block_on_a_table()
        scene.pushes = [palpate.Push(name="of an earlier day", steps=[palpate.Step()])]
        with tempfile.TemporaryDirectory() as folder:
            with self.assertRaises(OSError):
                palpate.explore(Gantry(), scene, folder, poisson_ratio=0.3, max_pushes=1, contacts=6, tilts=0, on_step=broken)
            recorded = pathlib.Path(folder, "recording.yaml").read_text()
            self.assertIn("push 1", recorded)
            self.assertNotIn("of an earlier day", recorded)

    def test_says_how_well_it_knows_its_tip(self):
        for sigma_m in (0, -1e-4, float("nan"), float("inf")):
            robot = Gantry()
            robot.travel_sigma_m = sigma_m
            for use in (explore_once, lambda robot: palpate.push(robot, block_on_a_table(), [0.5, 0, 0.5])):
                with self.assertRaises(palpate.Error) as raised:
                    use(robot)
                self.assertEqual(raised.exception.where, "robot.travel_sigma_m")
                self.assertIn("must be positive", raised.exception.message)

    def test_must_have_its_calls(self):
        with self.assertRaisesRegex(palpate.Error, "derive it from palpate.Robot"):
            palpate.push(object(), block_on_a_table(), [0.5, 0, 0.5])
        with self.assertRaisesRegex(palpate.Error, "tool"):
            palpate.push(Gantry(), block_on_a_table(), [0.5, 0, 0.5], tool="spoon")
        with self.assertRaisesRegex(palpate.Error, "force_limit_kg: is no option"):
            palpate.push(Gantry(), block_on_a_table(), [0.5, 0, 0.5], force_limit_kg=1)
        with self.assertRaises(NotImplementedError):
            palpate.push(palpate.Robot(), block_on_a_table(), [0.5, 0, 0.5])


if __name__ == "__main__":
    unittest.main()
