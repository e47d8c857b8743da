"""Reads the frames of a run with VTK's own reader and compares them with results.h5.

    /usr/bin/python3 tests/check_frames.py RUN_FOLDER

Ends with an error where a frame is not what the run has at that time.
"""
import json
import sys
from pathlib import Path

import h5py
import numpy
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOHDF import vtkHDFReader

folder = Path(sys.argv[1])
listed = json.loads((folder / "frames.hdf.series").read_text())
assert listed["file-series-version"] == "1.0"
frames = listed["files"]
times = [frame["time"] for frame in frames]
assert times == sorted(set(times)), "times do not rise"
assert len(frames) == len(list((folder / "frames").iterdir())), "files that are not listed"

results = h5py.File(folder / "results.h5")
stages = {round(stage.attrs["time_end"], 12): name for name, stage in results["stages"].items()}
compared = 0
lines = 0
for frame in frames:
    reader = vtkHDFReader()
    assert reader.CanReadFile(str(folder / frame["name"])), frame
    reader.SetFileName(str(folder / frame["name"]))
    reader.Update()
    grid = reader.GetOutput()
    points = vtk_to_numpy(grid.GetPoints().GetData())
    of_points = {name: vtk_to_numpy(grid.GetPointData().GetArray(name)) for name in ("id", "radius", "velocity", "angular_velocity", "coordination_number")}
    of_cells = {name: vtk_to_numpy(grid.GetCellData().GetArray(name)) for name in ("contact", "overlap", "normal_force", "tangential_force", "branch")}
    spheres = int((of_points["id"] >= 0).sum())
    assert spheres == int((of_cells["contact"] == 0).sum())
    assert (of_points["radius"][:spheres] > 0).all() and (of_points["radius"][spheres:] == 0).all()
    for k in range(grid.GetNumberOfCells()):
        assert grid.GetCellType(k) == (3 if of_cells["contact"][k] else 1)
    # A contact is as long as the radii less the overlap, also through a periodic side.
    for k in range(spheres, grid.GetNumberOfCells()):
        a, b = (grid.GetCell(k).GetPointId(end) for end in (0, 1))
        R = 2 * of_points["radius"][0]  # equal spheres
        assert abs(numpy.linalg.norm(points[a] - points[b]) - (R - of_cells["overlap"][k])) < 1e-12, frame
        lines += 1
    assert of_points["coordination_number"].sum() == 2 * (grid.GetNumberOfCells() - spheres)
    name = stages.get(round(frame["time"], 12))
    if name is None or "particles" not in results["stages"][name]:
        continue
    particles = results["stages"][name]["particles"]
    assert (points[:spheres] == particles["position"][:]).all(), name
    assert (of_points["velocity"][:spheres] == particles["velocity"][:]).all(), name
    assert (of_points["id"][:spheres] == particles["id"][:]).all(), name
    compared += 1
assert compared == len(stages), (compared, sorted(stages))
assert lines > 0
last = h5py.File(folder / frames[-1]["name"])["VTKHDF/CellData/normal_force"][:]
assert (last[len(results["particles/id"]):] == results["contacts/normal_force"][:] + results["contacts/damping_force"][:]).all()
print(len(frames), "frames,", lines, "contacts")
