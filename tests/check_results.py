"""Reads a run folder the way a user would (h5py, csv, json) and checks it against docs/output.md.

Usage: check_results.py FOLDER [--sample]   (--sample: also the numbers of tests/sample_run.h)
Exit code 0 when all is well; else the first failure is shown.
"""
import csv
import json
import sys

import h5py
import numpy as np

COLUMNS = """time step stage height strain stress_top stress_bottom porosity coordination_number contacts kinetic_energy
potential_energy kinetic_to_potential inertial_number energy_residual elastic_energy adhesion_energy tangential_energy
plate_energy plastic_dissipation viscous_dissipation sliding_dissipation rolling_dissipation plate_model_work plate_work
inserted_energy removed_energy""".split()
PARTICLES = {"id": (1, "i8"), "position": (3, "f8"), "image": (2, "i4"), "velocity": (3, "f8"),
             "angular_velocity": (3, "f8"), "radius": (1, "f8"), "mass": (1, "f8")}
CONTACTS = {"pair": (2, "i8"), "image": (2, "i4"), "overlap": (1, "f8"), "plastic_overlap": (1, "f8"),
            "normal_force": (1, "f8"), "damping_force": (1, "f8"), "tangential_force": (3, "f8"), "branch": (1, "i1")}
PLATE_CONTACTS = {"id": (1, "i8"), "plate": (1, "i1"), "overlap": (1, "f8"), "force": (3, "f8")}


def same(a, b):
    return np.array_equal(np.asarray(a), np.asarray(b), equal_nan=True)


def check_group(group, fields):
    assert set(group) == set(fields), (group.name, sorted(group))
    rows = {group[name].shape[0] for name in fields}
    assert len(rows) == 1, (group.name, rows)
    for name, (columns, kind) in fields.items():
        data = group[name]
        assert data.shape == ((data.shape[0],) if columns == 1 else (data.shape[0], columns)), data
        assert np.dtype(data.dtype.str) == np.dtype("<" + kind), (data, data.dtype)


def check_folder(folder):
    with open(f"{folder}/series.csv", newline="") as text:
        header, *rows = csv.reader(text)
    names = [cell.split(" [")[0] for cell in header]
    assert names == COLUMNS, names
    assert all(cell.endswith("]") for cell in header), header
    log = [line[name] for name in ("time", "step") for line in [dict(zip(names, row)) for row in rows]]
    assert log and all(log)

    with h5py.File(f"{folder}/results.h5", "r") as file:
        meanings = []
        file.visititems(lambda _, item: meanings.append(item) if isinstance(item, h5py.Dataset) else None)
        assert len(meanings) > 30
        for item in meanings:
            assert isinstance(item.attrs["unit"], str) and item.attrs["unit"], item
            assert isinstance(item.attrs["description"], str) and item.attrs["description"], item

        series = file["series"]
        assert set(series) == set(COLUMNS), sorted(series)
        stages = {number: name for name, number in h5py.check_enum_dtype(series["stage"].dtype).items()}
        for c, name in enumerate(names):
            assert series[name].shape == (len(rows),), series[name]
            cells = [row[c] for row in rows]
            if name == "stage":
                assert [stages[n] for n in series["stage"][:]] == cells
                continue
            assert f"{name} [{series[name].attrs['unit']}]" == header[c]
            if name != "strain":
                assert same(series[name][:].astype(float), [float(x) if x else np.nan for x in cells]), name

        in_stage = np.array([stages[n] for n in series["stage"][:]])
        for name, stage in file["stages"].items():
            assert stage.attrs["name"] == name
            for key in ("kind", "end_reason", "steps", "time_begin", "time_end"):
                assert key in stage.attrs, (name, key)
            check_group(stage["particles"], PARTICLES)
            assert (np.diff(stage["particles/id"][:]) > 0).all()
            if "stress" in stage:
                assert stage["stress"].shape == (3, 3) and stage["fabric"].shape == (3, 3)
            if "strain_zero_height" in stage.attrs:
                zero = stage.attrs["strain_zero_height"]
                mine = in_stage == name
                assert same(series["strain"][:][mine], (zero - series["height"][:][mine]) / zero), name
            profile = file["profiles"][name]
            assert set(profile) == {"z", "porosity", "coordination_number"}
        last = max(file["stages"].values(), key=lambda stage: stage.attrs["number"])
        for name in PARTICLES:
            assert same(file["particles"][name][:], last["particles"][name][:]), name
        if "contacts" in file:
            check_group(file["contacts"], CONTACTS)
            check_group(file["plate_contacts"], PLATE_CONTACTS)
            pair = file["contacts/pair"][:]
            assert (pair[:, 0] < pair[:, 1]).all()
        with open(f"{folder}/case.toml", encoding="utf-8") as text:
            assert file["case"].asstr()[()] == text.read()
        for key in ("program", "version", "title", "seed", "threads", "instruction_set", "reproducible", "scene", "start_time",
                    "host", "compiler"):
            assert key in file["provenance"].attrs, key

        with open(f"{folder}/summary.json", encoding="utf-8") as text:
            summary = json.load(text)
        assert summary["version"] == file["provenance"].attrs["version"]
        assert len(summary["state_hash"]) == 16 and int(summary["state_hash"], 16) >= 0
        for stage in summary["stages"]:
            attributes = file["stages"][stage["name"]].attrs
            assert stage["end_reason"] == attributes["end_reason"] and stage["steps"] == attributes["steps"]
            assert set(stage["values"]) <= set(COLUMNS)
            if "bed" in stage:
                assert same(np.array(stage["bed"]["stress"]), file["stages"][stage["name"]]["stress"][:])
            row = np.flatnonzero(in_stage == stage["name"])[-1]
            for name, value in stage["values"].items():
                if name != "stage":
                    assert value == series[name][row], (stage["name"], name)
            assert ("strain" in stage["values"]) == bool(np.isfinite(series["strain"][row]))
    with open(f"{folder}/log.jsonl", encoding="utf-8") as text:
        for line in text:
            assert {"timestamp", "level", "event"} <= set(json.loads(line))


def check_sample(folder):
    with h5py.File(f"{folder}/results.h5", "r") as file:
        assert list(sorted(file["stages"])) == ["compress", "crush", "settle", "unload"]
        i = np.arange(40)
        for number, name in enumerate(["settle", "compress", "unload", "crush"]):
            particles = file["stages"][name]["particles"]
            assert same(particles["id"][:], 2 * i)
            for c in range(3):
                assert same(particles["position"][:, c], 0.001 * i + 0.1 * c + number), name
                assert same(particles["velocity"][:, c], -0.5 * i + c)
                assert same(particles["angular_velocity"][:, c], 1.0 / 3.0 * i - c)
            assert same(particles["image"][:, 0], i % 3 - 1)
            assert same(file["profiles"][name]["porosity"][:], [0.4 + 0.01 * number, 0.39])
            assert np.isnan(file["profiles"][name]["coordination_number"][1])
        assert np.isnan(file["series/strain"][:5]).all() and not np.isnan(file["series/strain"][5:]).any()
        assert h5py.check_enum_dtype(file["contacts/branch"].dtype)["adhesive"] == 3
        assert same(file["contacts/branch"][:], np.arange(30) % 4)
        assert same(file["contacts/tangential_force"][:, 1], 0.2 * np.arange(30))
        assert same(file["plate_contacts/plate"][:], np.arange(6))
        assert "5 wall_y_high" in file["plate_contacts/plate"].attrs["description"]
        assert file["provenance"].attrs["seed"] == 7 and "\u03c3" in file["provenance"].attrs["title"]
        crush = file["stages/crush"].attrs
        assert crush["strength"] == 5432.1 and crush["peak_found"] and "made up warning" in crush["warnings"]


if __name__ == "__main__":
    check_folder(sys.argv[1])
    if "--sample" in sys.argv[2:]:
        check_sample(sys.argv[1])
