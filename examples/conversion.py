# SPDX-License-Identifier: Apache-2.0
"""What the converters of the example data sets share: arguments, errors, and writing a recording folder.

Every converter is called `convert SET_FOLDER SEQUENCE RECORDING`. Exit codes are palpate's own: 0 done, 2 wrong usage,
3 bad input (a folder, file or sequence that is not there or not as documented).
"""

import argparse
import json
import os
import shutil
import sys

import numpy as np


class BadInput(Exception):
    """Something in the data or the arguments makes the conversion impossible; the message says what to do."""


def run(convert, description, add_options=lambda parser: None):
    """Parses the arguments and calls convert(set_folder, sequence, recording, options)."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("set_folder", help="folder of the data set, as downloaded")
    parser.add_argument("sequence", help="name of the sequence, as in the data set")
    parser.add_argument("recording", help="folder to write the recording into (made if absent)")
    add_options(parser)
    options = parser.parse_args()
    recording = None
    try:
        if not os.path.isdir(options.set_folder):
            raise BadInput(f"{options.set_folder}: no such folder; give the folder of the data set")
        recording = Recording(options.recording, options.sequence)
        convert(options.set_folder, options.sequence, recording, options)
        recording.finish()
    except BadInput as error:
        if recording:
            recording.discard()
        print(f"{os.path.basename(os.path.dirname(os.path.abspath(sys.argv[0])))}/convert: {error}", file=sys.stderr)
        sys.exit(3)


def require(path, hint):
    """The path if it is there, else an error with a hint about what to do."""
    if not os.path.exists(path):
        raise BadInput(f"{path}: not found; {hint}")
    return path


def sequences(folder, pattern):
    """Names in `folder` that a compiled pattern matches, its first group if it has one: for messages."""
    found = []
    for name in sorted(os.listdir(folder)):
        match = pattern.fullmatch(name)
        if match:
            found.append(match.group(1) if match.groups() else name)
    return ", ".join(found) or "none"


def read_table(path, columns):
    """Columns of a CSV with one header line, by name: array rows x len(columns). Empty cells become NaN."""
    with open(require(path, "the folder is incomplete"), encoding="utf-8-sig") as file:
        header = [name.strip() for name in file.readline().split(",")]
        missing = [name for name in columns if name not in header]
        if missing:
            raise BadInput(f"{path}: column {', '.join(missing)} is missing from the header line")
        wanted = [header.index(name) for name in columns]
        rows = []
        for number, line in enumerate(file, 2):
            if not line.strip():
                continue
            cells = line.rstrip("\n").split(",")
            try:
                rows.append([float(cells[k]) if cells[k].strip() else np.nan for k in wanted])
            except (ValueError, IndexError):
                raise BadInput(f"{path}, line {number}: {len(header)} numbers expected") from None
    if not rows:
        raise BadInput(f"{path}: no rows below the header line")
    return np.array(rows)


class Recording:
    """A recording folder in the making. The index is written last, so that a broken conversion leaves none behind."""

    def __init__(self, folder, name):
        self.folder = folder
        self.written = []
        self.index = {"format": "palpate-recording/1", "name": name}
        if os.path.exists(folder) and not os.path.isdir(folder):
            raise BadInput(f"{folder}: is a file; give a folder")
        index = os.path.join(folder, "recording.yaml")
        if os.path.isdir(folder) and os.listdir(folder) and not os.path.exists(index):
            raise BadInput(f"{folder}: is not empty and no recording; give a new folder")
        try:
            os.makedirs(folder, exist_ok=True)
            if os.path.exists(index):
                os.remove(index)
        except OSError as error:
            raise BadInput(f"{folder}: {error.strerror}; give a folder that can be written") from None

    def path(self, name):
        """Where to write a file of this name."""
        path = os.path.join(self.folder, name)
        self.written.append(path)
        if os.path.dirname(name):
            os.makedirs(os.path.dirname(path), exist_ok=True)
        return path

    def copy(self, source, name):
        """Copies a file of the data set into the recording and returns its name there."""
        shutil.copyfile(require(source, "the folder is incomplete"), self.path(name))
        return name

    def table(self, name, columns, rows):
        """Writes a CSV: columns are names, rows are sequences of numbers or strings."""
        with open(self.path(name), "w") as file:
            file.write(",".join(columns) + "\n")
            for row in rows:
                file.write(",".join(cell if isinstance(cell, str) else repr(float(cell)) for cell in row) + "\n")
        return name

    def points(self, name, points_m):
        """Writes a cloud as .xyz."""
        np.savetxt(self.path(name), points_m, fmt="%.9g")
        return name

    def indices(self, name, values):
        np.savetxt(self.path(name), np.asarray(values, dtype=int), fmt="%d")
        return name

    def discard(self):
        """Takes back what was written, so that a second try finds the folder as it was."""
        for path in self.written:
            if os.path.exists(path):
                os.remove(path)
        for folder in sorted({os.path.dirname(path) for path in self.written} | {self.folder}, key=len, reverse=True):
            if os.path.isdir(folder) and not os.listdir(folder):
                os.rmdir(folder)

    def finish(self):
        """Writes the index."""
        with open(self.path("recording.yaml"), "w") as file:
            file.write("\n".join(_block(self.index)) + "\n")


def write_obj(path, vertices_m, triangles):
    """Triangles are 0-based, counter-clockwise seen from outside."""
    with open(path, "w") as file:
        for vertex in vertices_m:
            file.write("v %.9g %.9g %.9g\n" % tuple(vertex))
        for triangle in triangles:
            file.write("f %d %d %d\n" % tuple(np.asarray(triangle) + 1))


def write_tetrahedra_vtk(path, nodes_m, tetrahedra):
    """Legacy VTK, linear tetrahedra."""
    with open(path, "w") as file:
        file.write("# vtk DataFile Version 3.0\nrest tetrahedra, metres\nASCII\nDATASET UNSTRUCTURED_GRID\n")
        file.write(f"POINTS {len(nodes_m)} double\n")
        for node in nodes_m:
            file.write("%.9g %.9g %.9g\n" % tuple(node))
        file.write(f"CELLS {len(tetrahedra)} {5 * len(tetrahedra)}\n")
        for tetrahedron in tetrahedra:
            file.write("4 %d %d %d %d\n" % tuple(tetrahedron))
        file.write(f"CELL_TYPES {len(tetrahedra)}\n" + "10\n" * len(tetrahedra))


def _flow(value):
    """One line of YAML. JSON is YAML, and keys of a recording need no quotes."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ", ".join(_flow(item) for item in value) + "]"
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    if isinstance(value, np.integer):
        return str(int(value))
    return json.dumps(value)


def _block(value, indent=""):
    """Lines of block style YAML, with what fits on a line in flow style."""
    lines = []
    for key, item in value.items():
        flow = _flow(item)
        if len(indent) + len(key) + len(flow) < 118 or not isinstance(item, (dict, list)) or not item:
            lines.append(f"{indent}{key}: {flow}")
        elif isinstance(item, dict):
            lines += [f"{indent}{key}:"] + _block(item, indent + "  ")
        else:
            lines.append(f"{indent}{key}:")
            for entry in item:
                flow = _flow(entry)
                if isinstance(entry, dict) and len(indent) + len(flow) > 114:
                    nested = _block(entry, indent + "    ")
                    lines += [indent + "  - " + nested[0].strip()] + nested[1:]
                else:
                    lines.append(f"{indent}  - {flow}")
    return lines
