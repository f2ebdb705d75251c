# SPDX-License-Identifier: Apache-2.0
"""A robot in Python, whole: a gantry whose stick presses a soft block from above, under a camera that looks straight down.
Replace the bodies of the calls by those of your arm's and sensors' libraries (rclpy, ur_rtde, franky, pyrealsense2, ...).

    PYTHONPATH=build/release/python python3 examples/python/soft_block.py OUT

The block gives way as the theory of the half space says (K. L. Johnson, Contact Mechanics, section 3.4: even pressure on a disc);
E = 20 kPa is to be found. The scene's block is fifty pads wide and as high, which is nearly a half space; nu, which hangs on what moves
far from the pad, is taken as known.
"""
import pathlib
import sys

import numpy as np

import palpate

MIDDLE_X_M, HALF_M, TOP_M, PAD_M, CAMERA_M = 0.5, 0.25, 0.5, 0.01, 0.9


def elliptic(k):
    """Complete elliptic integrals of modulus k, by the arithmetic-geometric mean."""
    a, b, c = np.ones_like(k), np.sqrt(1 - k * k), k
    weight, total = 0.5, 0.5 * k * k
    for _ in range(40):
        a, b, c = 0.5 * (a + b), np.sqrt(a * b), 0.5 * (a - b)
        weight *= 2
        total = total + weight * c * c
    first = np.pi / (2 * a)
    return first, first * (1 - total)


class Gantry(palpate.Robot):
    travel_sigma_m = 5e-5
    limits = palpate.RobotLimits(force_n=40, speed_m_s=0.1)  # of the load cell, of the axes

    def __init__(self, young_pa=20e3, poisson=0.3, seed=7):
        self.stiffness_n_m = 3 * np.pi**2 / 16 * PAD_M * young_pa / (1 - poisson**2)
        self.noise = np.random.default_rng(seed)
        self.clock_s = 0.0
        self.T_base_tip = np.diag([1.0, -1.0, -1.0, 1.0])
        self.T_base_tip[:3, 3] = MIDDLE_X_M, 0, TOP_M + 0.1
        self.camera = palpate.Camera(width_px=160, height_px=120, fx_px=200, fy_px=200, cx_px=79.5, cy_px=59.5)

    def pressed_m(self):
        x, y, z = self.T_base_tip[:3, 3]
        return max(0.0, TOP_M - z) if abs(x - MIDDLE_X_M) < HALF_M and abs(y) < HALF_M else 0.0

    def read(self):
        force_n = 0.3 + 0.02 * self.noise.normal(size=3)  # the sensor is not tared
        force_n[2] -= self.stiffness_n_m * self.pressed_m()
        return palpate.RobotState(time_s=self.clock_s, T_base_tip=self.T_base_tip, force_n=force_n)

    def reaches(self, T_base_tip):
        """Straight down, away from the block's edges, where the theory of the half space ends."""
        x, y, z = T_base_tip[:3, 3]
        return T_base_tip[2, 2] < -0.9999 and abs(x - MIDDLE_X_M) < 0.04 and abs(y) < 0.04 and TOP_M - 0.05 < z < TOP_M + 0.3

    def move(self, T_base_tip, speed_m_s):
        if not self.reaches(T_base_tip):
            return False
        self.clock_s += np.linalg.norm(T_base_tip[:3, 3] - self.T_base_tip[:3, 3]) / speed_m_s
        self.T_base_tip = T_base_tip
        return True

    def stop(self):
        pass

    def wait(self, duration_s):
        self.clock_s += duration_s

    def sunk_m(self, x_m, y_m):
        away = np.hypot(x_m - self.T_base_tip[0, 3], y_m - self.T_base_tip[1, 3]) / PAD_M
        first, second = elliptic(np.minimum(np.where(away < 1, away, 1 / np.maximum(away, 1)), 1 - 1e-9))
        outside = away * (second - (1 - 1 / np.maximum(away, 1) ** 2) * first)
        return 0.75 * self.pressed_m() * np.where(away < 1, second, outside)

    def take_depth_image(self):
        column, row = np.meshgrid(np.arange(160), np.arange(120))
        x, y = (column - 79.5) / 200, -(row - 59.5) / 200
        depth_m = np.full(x.shape, CAMERA_M - TOP_M)
        for _ in range(3):
            depth_m = CAMERA_M - TOP_M + self.sunk_m(MIDDLE_X_M + x * depth_m, y * depth_m)
        beside = (np.abs(x * depth_m) > HALF_M) | (np.abs(y * depth_m) > HALF_M)
        depth_m = np.where(beside, CAMERA_M, depth_m) + 0.0005 * self.noise.normal(size=x.shape)
        T_base_camera = np.diag([1.0, -1.0, -1.0, 1.0])  # looks down
        T_base_camera[:3, 3] = MIDDLE_X_M, 0, CAMERA_M
        return palpate.DepthFrame(time_s=self.clock_s, camera=self.camera, T_base_camera=T_base_camera, depth_m=depth_m,
                                  noise=palpate.DepthNoise(model="constant", sigma_m=0.0005), robot_is_masked=True)


def block_on_a_table():
    """What stands before the robot: shape, what holds it, what presses it, and what is known of the sensors."""
    corner = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (0, 1)])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]  # counter-clockwise from outside
    surface = palpate.TriMesh(vertices_m=corner * [HALF_M, HALF_M, TOP_M] + [MIDDLE_X_M, 0, 0],
                              triangles=[three for a, b, c, d in sides for three in ((a, b, c), (a, c, d))])
    return palpate.Recording(name="soft block", rest=palpate.Rest(surface=surface), environment=palpate.Environment(planes=[palpate.Plane()]),
                             supports=[palpate.Support(kind="table", plane=palpate.Plane(), tolerance_m=0.001, name="table")],
                             tools=[palpate.Tool(name="stick", shape="disc", radius_m=PAD_M)], force_scale_std=0.01,
                             model=palpate.ModelDefaults(material="linear"))


if __name__ == "__main__":
    out = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "soft_block")
    if (out / "recording").exists():
        sys.exit(f"{out} is there already: give another folder, or remove it")

    def told(name, young_moduli, poisson_ratio):
        young = young_moduli[0]
        print(f"{name}: E {young.value / 1e3:.2f} kPa, 95 % in [{young.lower_95 / 1e3:.2f}, {young.upper_95 / 1e3:.2f}]", flush=True)

    done = palpate.explore(Gantry(), block_on_a_table(), out / "recording", goal="young-modulus", young_modulus_within=0.04,
                           poisson_ratio=0.3, max_pushes=3, travel_limit_m=0.004, on_push=told)
    print(done.message)
    palpate.write_result(done.found, done.recording, out)
    print(f"see {out}/report.html")
