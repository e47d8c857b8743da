#!/usr/bin/python3
"""Figures of finished runs that the summary does not hold, as a markdown table.

    /usr/bin/python3 tests/run_figures.py RUN_FOLDER...

For each stage: why it ended, simulated time, stress on the top plate, porosity, coordination number, and the difference of
bottom and top stress over weight/area, averaged over the last 50 ms (1 where the bed is at rest or pressed slowly). For
each folder: strain at the largest stress and after unloading, counted from 1 kPa and from 5 kPa, and the strength.
"""
import csv
import json
import math
import sys
from pathlib import Path

import h5py


def columns(folder):
    with open(folder / "series.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    return [{key.split(" [")[0]: value for key, value in row.items()} for row in rows]


def number(row, name):
    return float(row[name]) if row[name] else math.nan


def weight_per_area(folder):
    import tomllib

    case = tomllib.loads((folder / "case.toml").read_text())
    with h5py.File(folder / "results.h5") as file:
        radius = file["/particles/radius"][:]
    si = lambda text: float(text) if not isinstance(text, str) else float(text.split()[0]) * {
        "mm": 1e-3, "m": 1.0, "kg/m3": 1.0, "m/s2": 1.0}[text.split()[1]]
    gravity = si(case.get("environment", {}).get("gravity", 9.81))
    volume = (4.0 / 3.0 * math.pi * radius**3).sum()
    return volume * si(case["particles"]["density"]) * gravity / (si(case["box"]["width"]) * si(case["box"]["depth"]))


def main(folders):
    for folder in map(Path, folders):
        rows = columns(folder)
        summary = json.loads((folder / "summary.json").read_text())
        unit = weight_per_area(folder)
        print(f"\n{folder.name}: state hash {summary['state_hash']}\n")
        print("| stage | ended by | simulated s | top kPa | porosity | CN | (bottom - top)/(weight/area) |")
        print("|---|---|---|---|---|---|---|")
        for stage in summary["stages"]:
            mine = [row for row in rows if row["stage"] == stage["name"]]
            end = number(mine[-1], "time")
            last = [row for row in mine if number(row, "time") >= end - 0.05]
            balance = sum(number(r, "stress_bottom") - number(r, "stress_top") for r in last) / len(last) / unit
            row = mine[-1]
            print(f"| {stage['name']} | {stage['end_reason']} | {stage['time']:.3f} | {number(row, 'stress_top') / 1e3:.2f} "
                  f"| {number(row, 'porosity'):.4f} | {number(row, 'coordination_number'):.3f} | {balance:.4f} |")
        press = [row for row in rows if row["stage"] == "compress"]
        back = [row for row in rows if row["stage"] == "unload"]
        for zero in (1e3, 5e3):
            start = next((row for row in press if number(row, "stress_top") >= zero), None)
            if start is None:
                continue
            h0 = number(start, "height")
            peak = 1.0 - number(press[-1], "height") / h0
            text = f"\nfrom {zero / 1e3:g} kPa: strain at the largest stress {100 * peak:.2f} %"
            if back:
                rest = 1.0 - number(back[-1], "height") / h0
                text += f", after unloading {100 * rest:.2f} % (ratio {rest / peak:.3f})"
            print(text)
        for stage in summary["stages"]:
            if "strength" in stage:
                print(f"\n{stage['name']}: strength {stage['strength'] / 1e3:.2f} kPa at strain "
                      f"{100 * stage['strength_strain']:.2f} %, initial stiffness {stage.get('initial_stiffness', math.nan) / 1e3:.0f} kPa, "
                      f"{'a peak' if stage['peak_found'] else 'no peak within the stage'}")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(sys.argv[1:])
