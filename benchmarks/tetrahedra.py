#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Prints a table of what `palpate model` makes of mesh files (OBJ): quality, fidelity in percent of the diagonal, CPU seconds.

usage: benchmarks/tetrahedra.py PALPATE N[,N...] MESH.obj [MESH.obj ...]
"""
import json
import os
import resource
import subprocess
import sys
import tempfile


def diagonal(path):
    points = [[float(x) for x in line.split()[1:4]] for line in open(path) if line.startswith("v ")]
    return sum((max(c) - min(c)) ** 2 for c in zip(*points)) ** 0.5


def main():
    program, counts, meshes = sys.argv[1], [int(n) for n in sys.argv[2].split(",")], sys.argv[3:]
    print("| mesh | asked | tetrahedra | dihedral angles | volume | rms | Hausdorff | CPU |\n|---|---|---|---|---|---|---|---|")
    for count in counts:
        for mesh in meshes:
            before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            with tempfile.TemporaryDirectory() as out:
                done = subprocess.run([program, "model", mesh, "-o", out, "--tetrahedra", str(count), "--json"],
                                      stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=False)
            seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
            name, result = os.path.splitext(os.path.basename(mesh))[0], json.loads(done.stdout)
            if done.returncode != 0:
                print(f"| {name} | {count} | refused: {result['error']['message']} | | | | | {seconds:.2f} s |")
                continue
            d = diagonal(mesh)
            volume = "open" if result["volume_error"] is None else f"{100 * result['volume_error']:+.2f} %"
            print(f"| {name} | {count} | {result['tetrahedra']} | {result['min_dihedral_deg']:.1f} to "
                  f"{result['max_dihedral_deg']:.1f}° | {volume} | {100 * result['surface_rms_m'] / d:.3f} % | "
                  f"{100 * result['hausdorff_m'] / d:.2f} % | {seconds:.2f} s |")


if __name__ == "__main__":
    main()
