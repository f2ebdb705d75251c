#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Times one linear static analysis of the pressed cube against CalculiX and DOLFINx/PETSc on the same meshes.

The cube has an edge of 0.15 m, n^3 cells of five linear or quadratic tetrahedra, its bottom is held, a pressure of 10 N in all acts on a
disc of 25 mm radius at the centre of the top. CalculiX and palpate run as whole processes from the same input deck (read,
assemble, solve, write); DOLFINx and palpate are compared in process (assemble and solve; DOLFINx' just-in-time compilation is not counted,
mesh and sparsity pattern are counted on neither side). Seconds are CPU seconds of all threads, the smallest of the repeats; wall
seconds stand beside them where --threads is above one. Each line also says peak memory and by how much the displacements
differ. PETSc has no threads of its own and is left out above one.

  cmake --preset developer && ninja -C build/developer solve_deck
  benchmarks/compare_solvers.py build/developer/benchmarks/solve_deck --cells 6 13 27 --poisson 0.3 0.49

Programs that are absent are left out with a word. Options: --element tet4 tet10, --threads N..., --patient (SPOOLES, MUMPS and
CHOLMOD on every mesh), --calculix and --petsc SOLVER... (those alone; none: leaves the program out), --timeout, --repeats, --keep
FOLDER, --json FILE. Everything at once, for a machine with nothing else to do:

  benchmarks/compare_solvers.py build/developer/benchmarks/solve_deck --cells 6 13 27 47 --element tet4 --threads 1 2 --patient
  benchmarks/compare_solvers.py build/developer/benchmarks/solve_deck --cells 6 13 20 --element tet10 --threads 1 2 --patient
"""
import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time

import numpy as np

EDGE, RADIUS, FORCE, YOUNG = 0.15, 0.025, 10.0, 20e3
CALCULIX = ("SPOOLES", "ITERATIVE SCALING", "ITERATIVE CHOLESKY")
PETSC = {
    "CG + Jacobi": dict(ksp_type="cg", pc_type="jacobi"),
    "CG + ICC": dict(ksp_type="cg", pc_type="icc"),
    "CG + GAMG": dict(ksp_type="cg", pc_type="gamg"),
    "MUMPS Cholesky": dict(ksp_type="preonly", pc_type="cholesky", pc_factor_mat_solver_type="mumps"),
    "CHOLMOD": dict(ksp_type="preonly", pc_type="cholesky", pc_factor_mat_solver_type="cholmod"),
}


def environment(threads):
    return dict(os.environ, OMP_NUM_THREADS=str(threads), OPENBLAS_NUM_THREADS="1", CCX_NPROC_EQUATION_SOLVER=str(threads))


def quadratic(nodes, tets):
    """Midpoints of edges 01, 12, 02, 03, 13, 23 after the corners (CalculiX' order)."""
    edges = np.sort(np.stack([tets[:, list(pair)] for pair in ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))], 1), -1)
    unique, index = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
    return (np.concatenate([nodes, nodes[unique].mean(1)]),
            np.concatenate([tets, len(nodes) + index.reshape(-1, 6)], 1))


def cube(n):
    """Nodes (N x 3), tetrahedra (M x 4) with positive volume; five to a cell, alternating parity."""
    m = n + 1
    z, y, x = np.meshgrid(*(np.arange(m),) * 3, indexing="ij")
    nodes = np.stack([x, y, z], -1).reshape(-1, 3) * (EDGE / n)
    pattern = np.array([[0, 1, 2, 4], [3, 2, 1, 7], [5, 4, 7, 1], [6, 7, 4, 2], [1, 2, 4, 7]])
    cz, cy, cx = (c.ravel() for c in np.meshgrid(*(np.arange(n),) * 3, indexing="ij"))
    bits = pattern[None] ^ ((cx + cy + cz) % 2)[:, None, None]
    tets = ((cz[:, None, None] + (bits >> 2 & 1)) * m + cy[:, None, None] + (bits >> 1 & 1)) * m + cx[:, None, None] + (bits & 1)
    tets = tets.reshape(-1, 4)
    corner = nodes[tets]
    flipped = np.linalg.det(corner[:, 1:] - corner[:, :1]) < 0
    tets[flipped] = tets[flipped][:, [0, 1, 3, 2]]
    return nodes, tets


def disc_load(nodes, tets, samples=24):
    """Consistent nodal forces along z of the pressure on the disc (top triangles, sampled finely)."""
    sides = ([1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2])
    if tets.shape[1] == 10:  # midpoints of 01, 12, 02 of each side
        middle = {(0, 1): 4, (1, 2): 5, (0, 2): 6, (0, 3): 7, (1, 3): 8, (2, 3): 9}
        sides = [side + [middle[side[0], side[1]], middle[side[1], side[2]], middle[side[0], side[2]]] for side in sides]
    faces = np.concatenate([tets[:, f] for f in sides])
    faces = faces[(nodes[faces][:, :, 2] > EDGE * (1 - 1e-9)).all(1)]
    weights = np.array([((i + s) / samples, (j + s) / samples, 1 - (i + j + 2 * s) / samples)
                        for i in range(samples) for j in range(samples - i)
                        for s in ((1 / 3, 2 / 3) if j < samples - i - 1 else (1 / 3,))])
    points = np.einsum("sk,fkd->fsd", weights, nodes[faces[:, :3]][:, :, :2])
    inside = np.hypot(*(points - EDGE / 2).transpose(2, 0, 1)) <= RADIUS
    if tets.shape[1] == 10:
        a, b, c = weights.T
        weights = np.stack([a * (2 * a - 1), b * (2 * b - 1), c * (2 * c - 1), 4 * a * b, 4 * b * c, 4 * a * c], 1)
    load = np.zeros(len(nodes))
    np.add.at(load, faces, np.einsum("fs,sk->fk", inside.astype(float), weights))
    return -FORCE * load / load.sum()


def write_deck(path, nodes, tets, load, poisson, solver):
    # CalculiX reads twenty characters of a number and no more: -1.23456789012345e-05 loses its last digit, that of the exponent.
    with open(path, "w") as deck:
        deck.write("*NODE, NSET=ALL\n")
        np.savetxt(deck, np.column_stack([np.arange(1, len(nodes) + 1), nodes]), fmt=["%d"] + ["%.12g"] * 3, delimiter=",")
        deck.write(f"*ELEMENT, TYPE=C3D{tets.shape[1]}, ELSET=BODY\n")
        np.savetxt(deck, np.column_stack([np.arange(1, len(tets) + 1), tets + 1]), fmt="%d", delimiter=",")
        deck.write("*BOUNDARY\n")
        deck.writelines(f"{i + 1},1,3\n" for i in np.flatnonzero(nodes[:, 2] < 1e-9))
        deck.write(f"*MATERIAL, NAME=FOAM\n*ELASTIC\n{YOUNG},{poisson}\n*SOLID SECTION, ELSET=BODY, MATERIAL=FOAM\n")
        deck.write(f"*STEP\n*STATIC{', SOLVER=' + solver if solver else ''}\n*CLOAD\n")
        deck.writelines(f"{i + 1},3,{load[i]:.12g}\n" for i in np.flatnonzero(load))
        deck.write("*NODE PRINT, NSET=ALL\nU\n*END STEP\n")


def run(command, folder, timeout, threads=1):
    """CPU seconds, wall seconds, peak megabytes, stdout of a process."""
    start, peak = time.monotonic(), 0.0
    with open(os.path.join(folder, "out.txt"), "wb") as out:
        process = subprocess.Popen(command, cwd=folder, env=environment(threads), stdout=out, stderr=subprocess.STDOUT)
        while True:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                break
            try:  # ru_maxrss would count this interpreter's memory, which the child has until it starts its program
                with open(f"/proc/{process.pid}/status") as text:
                    peak = max([peak] + [float(line.split()[1]) / 1024 for line in text if line.startswith("VmHWM")])
            except (OSError, ValueError):
                pass
            if time.monotonic() - start > timeout:
                process.kill()
            time.sleep(0.001)
    process.returncode = os.waitstatus_to_exitcode(status)
    with open(os.path.join(folder, "out.txt"), errors="replace") as out:
        text = out.read()
    if process.returncode != 0:
        raise RuntimeError(f"{command[0]}: {text.strip().splitlines()[-1] if text.strip() else process.returncode}")
    return usage.ru_utime + usage.ru_stime, time.monotonic() - start, peak, text


def smallest(command, folder, repeats, timeout, threads):
    """Of CPU and of wall seconds each the smallest, the largest memory."""
    results = [run(command, folder, timeout, threads) for _ in range(repeats)]
    return min(r[0] for r in results), min(r[1] for r in results), max(r[2] for r in results), results[0][3]


def displacements(path, count):
    """Rows 'node ux uy uz' of a CalculiX .dat file or of solve_deck's table."""
    u = np.zeros((count, 3))
    for line in open(path):
        words = line.split()
        if len(words) == 4 and words[0].isdigit():
            u[int(words[0]) - 1] = [float(w) for w in words[1:]]
    return u


def dolfinx_worker(path):
    """Assembles and solves with PETSc; prints CPU seconds of every solver as JSON."""
    import dolfinx
    import ufl
    from dolfinx import fem
    from mpi4py import MPI
    from petsc4py import PETSc

    case = np.load(path)
    nodes, tets, load, poisson = case["nodes"], case["tets"], case["load"], float(case["poisson"])
    degree, patient, cells = (2 if tets.shape[1] == 10 else 1), bool(case["patient"]), int(case["cells"])
    corners = tets[:, :4].max() + 1
    domain = ufl.Mesh(ufl.VectorElement("Lagrange", ufl.tetrahedron, 1))
    mesh = dolfinx.mesh.create_mesh(MPI.COMM_SELF, tets[:, :4].astype(np.int64), nodes[:corners], domain)
    space = fem.VectorFunctionSpace(mesh, ("Lagrange", degree))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    lame = YOUNG * poisson / ((1 + poisson) * (1 - 2 * poisson)), YOUNG / (2 * (1 + poisson))
    strain = lambda w: ufl.sym(ufl.grad(w))
    form = fem.form(ufl.inner(lame[0] * ufl.tr(strain(u)) * ufl.Identity(3) + 2 * lame[1] * strain(u), strain(v)) * ufl.dx)
    held = fem.locate_dofs_geometrical(space, lambda x: x[2] < 1e-9)
    bc = fem.dirichletbc(np.zeros(3), held, space)
    matrix = fem.petsc.create_matrix(form)

    def assemble():
        matrix.zeroEntries()
        fem.petsc.assemble_matrix(matrix, form, bcs=[bc])
        matrix.assemble()

    assemble()  # compiles
    start = time.process_time()
    assemble()
    assembly = time.process_time() - start

    # Degrees of freedom of the nodes as they were given: both lie on a lattice of half cells.
    lattice = lambda x: tuple(np.rint(x * (2 * cells / EDGE)).astype(np.int64).T)
    at = {place: k for k, place in enumerate(zip(*lattice(space.tabulate_dof_coordinates())))}
    block_of = np.array([at[place] for place in zip(*lattice(nodes))])
    b = matrix.createVecLeft()
    values = np.zeros(3 * len(nodes))
    values[3 * block_of + 2] = load
    values.reshape(-1, 3)[held] = 0
    b.setArray(values)
    matrix.setBlockSize(3)
    coordinates = PETSc.Vec().createWithArray(space.tabulate_dof_coordinates().ravel().copy(), bsize=3)
    matrix.setNearNullSpace(PETSc.NullSpace().createRigidBody(coordinates))
    matrix.setOption(PETSc.Mat.Option.SPD, True)

    results = {}
    for name in case["petsc"]:
        options = PETSC[str(name)]
        if len(nodes) > 60000 and not patient and name in ("MUMPS Cholesky", "CHOLMOD", "CG + GAMG"):
            continue  # minutes and gigabytes
        try:
            for _ in range(2):  # the second counts: its memory was touched before
                ksp = PETSc.KSP().create(MPI.COMM_SELF)
                for key, value in options.items():
                    PETSc.Options()[key] = value
                ksp.setOperators(matrix)
                ksp.setFromOptions()
                if options["ksp_type"] == "cg":
                    ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
                    ksp.setTolerances(rtol=1e-8, max_it=5000)
                x = b.duplicate()
                start = time.process_time()
                ksp.setUp()
                ksp.solve(b, x)
                seconds = time.process_time() - start
            if ksp.getConvergedReason() > 0:
                results[name] = dict(seconds=seconds, steps=ksp.getIterationNumber())
                solution = x.getArray().reshape(-1, 3)[block_of]
            for key in options:
                PETSc.Options().delValue(key)
        except PETSc.Error as error:
            print(f"{name}: {error}", file=sys.stderr)
    np.save(path + ".u.npy", solution)
    with open("/proc/self/status") as text:  # with the interpreter, the compiler's results and both matrices
        peak = [float(line.split()[1]) / 1024 for line in text if line.startswith("VmHWM")][0]
    print(json.dumps(dict(assembly=assembly, peak_mb=peak, solvers=results)))


def compare(case, arguments, folder):
    n, element, poisson, threads = case
    nodes, tets = cube(n) if element == "tet4" else quadratic(*cube(n))
    load = disc_load(nodes, tets)
    deck = os.path.join(folder, "cube.inp")
    write_deck(deck, nodes, tets, load, poisson, "")
    result = dict(cells=n, element=element, tetrahedra=len(tets), nodes=len(nodes), poisson=poisson, threads=threads,
                  load_average=os.getloadavg()[0])
    cpu, wall, memory, text = smallest([os.path.abspath(arguments.solve_deck), deck, "ours.txt", "--threads", str(threads)],
                                       folder, arguments.repeats, arguments.timeout, threads)
    ours = json.loads(text.strip().splitlines()[-1])
    u = displacements(os.path.join(folder, "ours.txt"), len(nodes))
    result["palpate"] = dict(ours, cpu_s=cpu, wall_s=wall, peak_mb=memory)
    beside = lambda seconds: f" (wall {seconds:.3f} s)" if threads > 1 else ""
    print(f"\n{len(tets)} {element}, {len(nodes)} nodes, nu = {poisson}, threads {threads}, load average {result['load_average']:.1f}\n"
          f"  palpate, whole process         {cpu:9.3f} s{beside(wall)} {memory:7.0f} MB   {ours['method']}, {ours['steps']} steps",
          flush=True)

    if shutil.which("ccx"):
        for solver in arguments.calculix:
            if solver == "SPOOLES" and len(nodes) > 60000 and not arguments.patient:
                continue
            name = solver.replace(" ", "_").lower()
            write_deck(os.path.join(folder, name + ".inp"), nodes, tets, load, poisson, solver)
            try:
                cpu, wall, memory, _ = smallest(["ccx", "-i", name], folder, arguments.repeats if len(tets) < 50000 else 1,
                                                arguments.timeout, threads)
            except RuntimeError as error:
                print(f"  CalculiX {solver:21} {error}")
                continue
            other = displacements(os.path.join(folder, name + ".dat"), len(nodes))
            difference = np.linalg.norm(other - u) / np.linalg.norm(u)
            ratio = cpu / result["palpate"]["cpu_s"]
            result["CalculiX " + solver] = dict(cpu_s=cpu, wall_s=wall, peak_mb=memory, ratio=ratio, difference=difference)
            print(f"  CalculiX {solver:21} {cpu:9.3f} s{beside(wall)} {memory:7.0f} MB   {ratio:6.1f} x ours, differs by "
                  f"{difference:.1e}", flush=True)
    else:
        print("  CalculiX: ccx is not installed")

    if threads > 1 or not arguments.petsc:
        return result
    # As often as it takes until the memory was touched before, as that of the worker was.
    _, _, _, text = smallest([os.path.abspath(arguments.solve_deck), deck, "ours.txt", "--threads", str(threads), "--passes", "3"],
                             folder, 1, arguments.timeout, threads)
    ours = json.loads(text.strip().splitlines()[-1])
    in_process = ours["assemble_s"] + ours["solve_s"]
    path = os.path.join(folder, "case.npz")
    np.savez(path, nodes=nodes, tets=tets, load=load, poisson=poisson, cells=n, patient=arguments.patient, petsc=arguments.petsc)
    worker = subprocess.run([sys.executable, os.path.abspath(__file__), "--dolfinx-worker", path], env=environment(1),
                            capture_output=True, text=True)
    if worker.returncode != 0:
        reason = worker.stderr.strip().splitlines()
        print(f"  DOLFINx: left out ({reason[-1] if reason else 'it crashed'})")
        return result
    peer = json.loads(worker.stdout.strip().splitlines()[-1])
    print(f"  palpate, in process            {in_process:9.3f} s              assemble {ours['assemble_s']:.3f}, solve {ours['solve_s']:.3f}"
          f" (pattern {ours['pattern_s']:.3f} not counted)")
    difference = np.linalg.norm(np.load(path + ".u.npy") - u) / np.linalg.norm(u)
    for name, solved in peer["solvers"].items():
        total = peer["assembly"] + solved["seconds"]
        result["PETSc " + name] = dict(cpu_s=total, ratio=total / in_process, steps=solved["steps"], difference=difference)
        print(f"  PETSc {name:24} {total:9.3f} s              {total / in_process:6.1f} x ours, assemble "
              f"{peer['assembly']:.3f}, {solved['steps']} steps")
    print(f"  (DOLFINx' displacements differ by {difference:.1e}; {peer['peak_mb']:.0f} MB)", flush=True)
    return result


def main():
    if len(sys.argv) == 3 and sys.argv[1] == "--dolfinx-worker":
        return dolfinx_worker(sys.argv[2])
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("solve_deck", help="the program of benchmarks/solve_deck.cpp")
    parser.add_argument("--cells", type=int, nargs="+", default=[6, 13, 27], help="cells along an edge (47: 519 115 tetrahedra)")
    parser.add_argument("--element", nargs="+", choices=["tet4", "tet10"], default=["tet4"])
    parser.add_argument("--poisson", type=float, nargs="+", default=[0.3, 0.49])
    parser.add_argument("--threads", type=int, nargs="+", default=[1])
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--timeout", type=float, default=300, help="seconds a process")
    parser.add_argument("--patient", action="store_true", help="SPOOLES, MUMPS, CHOLMOD and GAMG above 60 000 nodes too")
    parser.add_argument("--calculix", nargs="*", choices=CALCULIX, default=CALCULIX)
    parser.add_argument("--petsc", nargs="*", choices=list(PETSC), default=list(PETSC))
    parser.add_argument("--keep", help="folder for decks and results (otherwise they are deleted)")
    parser.add_argument("--json", help="writes all numbers to this file")
    arguments = parser.parse_args()
    results = []
    for case in [(n, element, nu, threads) for element in arguments.element for n in arguments.cells for nu in arguments.poisson for threads in arguments.threads]:
        with tempfile.TemporaryDirectory() as folder:
            if arguments.keep:
                folder = os.path.join(arguments.keep, f"cube_{case[0]}_{case[1]}_{case[2]}_{case[3]}")
                os.makedirs(folder, exist_ok=True)
            results.append(compare(case, arguments, folder))
    if arguments.json:
        with open(arguments.json, "w") as file:
            json.dump(results, file, indent=1)


if __name__ == "__main__":
    main()
