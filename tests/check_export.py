"""Reads what `platen export` wrote with other people's readers and compares it with results.h5.

    /usr/bin/python3 tests/check_export.py RUN_FOLDER EXPORT_FOLDER
"""
import csv
import sys
import xml.etree.ElementTree as xml
from pathlib import Path

import h5py
import numpy
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

run, out = (Path(name) for name in sys.argv[1:3])
results = h5py.File(run / "results.h5")
stages = sorted(results["stages"].items(), key=lambda item: item[1].attrs["number"])
columns = {"position": "xyz", "velocity": ["vx", "vy", "vz"], "angular_velocity": ["wx", "wy", "wz"]}

for number, (name, stage) in enumerate(stages, 1):
    with open(out / f"{number}-{name}.csv", newline="") as text:
        rows = list(csv.DictReader(text))
    particles = stage["particles"]
    assert [int(row["id"]) for row in rows] == list(particles["id"])
    for quantity, names in columns.items():
        assert ([[float(row[c]) for c in names] for row in rows] == particles[quantity][:]).all(), (name, quantity)

listed = xml.parse(out / "stages.pvd").getroot().findall("Collection/DataSet")
assert len(listed) == len(stages)
for entry, (name, stage) in zip(listed, stages):
    assert float(entry.get("timestep")) == stage.attrs["time_end"]
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(out / entry.get("file")))
    reader.Update()
    grid = reader.GetOutput()
    assert grid.GetNumberOfCells() == grid.GetNumberOfPoints() == len(stage["particles/id"])
    assert (vtk_to_numpy(grid.GetPoints().GetData()) == stage["particles/position"][:]).all(), name
    for quantity in ("id", "radius", "velocity", "angular_velocity"):
        assert (vtk_to_numpy(grid.GetPointData().GetArray(quantity)) == stage["particles"][quantity][:]).all(), (name, quantity)

h5md = h5py.File(out / "stages.h5md")
assert list(h5md["h5md"].attrs["version"]) == [1, 1] and h5md["h5md/creator"].attrs["name"] == "platen"
everything = h5md["particles/all"]
# The run took its sides away: no boundaries, and places without the box around them.
assert list(everything["box"].attrs["boundary"]) == ["none", "none", "none"] and everything["box"].attrs["dimension"] == 3
box = everything["box/edges/value"][0]
for frame, (name, stage) in enumerate(stages):
    assert everything["position/time"][frame] == stage.attrs["time_end"] and everything["position/step"][frame] == stage.attrs["last_step"]
    for quantity in ("velocity", "angular_velocity"):
        assert (everything[quantity]["value"][frame] == stage["particles"][quantity][:]).all(), (name, quantity)
    place = stage["particles/position"][:]
    place[:, :2] += stage["particles/image"][:] * box[:2]
    assert (everything["position/value"][frame] == place).all(), name
assert "image" not in everything

lines = (out / "stages.dump").read_text().splitlines()
starts = [k for k, line in enumerate(lines) if line == "ITEM: TIMESTEP"]
assert len(starts) == len(stages)
for start, (name, stage) in zip(starts, stages):
    assert int(lines[start + 1]) == stage.attrs["last_step"]
    n = int(lines[start + 3])
    names = lines[start + 8].split()[2:]
    table = numpy.array([[float(x) for x in line.split()] for line in lines[start + 9:start + 9 + n]])
    assert (table[:, [names.index(c) for c in "xyz"]] == stage["particles/position"][:]).all(), name
    assert (table[:, names.index("id")] == stage["particles/id"][:] + 1).all()
    box = numpy.array([[float(x) for x in line.split()] for line in lines[start + 5:start + 8]])
    position, radius = stage["particles/position"][:], stage["particles/radius"][:]
    assert (position[:, 2] - radius >= box[2, 0] - 1e-3 * radius).all() and (position[:, :2] >= box[:2, 0]).all() and (position[:, :2] <= box[:2, 1]).all(), name
data = (out / "last.data").read_text()
atoms = numpy.array([[float(x) for x in line.split()] for line in data.split("Atoms # sphere\n\n")[1].split("\n\nVelocities")[0].splitlines()])
assert (atoms[:, 4:7] == stages[-1][1]["particles/position"][:]).all() and (atoms[:, 3] == 2000.0).all()

with open(out / "contacts.csv", newline="") as text:
    rows = list(csv.DictReader(text))
assert [[int(row["id_1"]), int(row["id_2"])] for row in rows] == results["contacts/pair"][:].tolist()
assert [float(row["normal_force"]) for row in rows] == results["contacts/normal_force"][:].tolist()
