#!/usr/bin/python3
"""Puts what a study found into docs/results.md.

    /usr/bin/python3 docs/fill_results.py STUDY_FOLDER [STUDY_FOLDER ...]

Between `<!-- KIND WHAT -->` and `<!-- end -->` everything is written anew from the first of the folders that has it; what none of
them has is left as it is. Kinds:

    figure N        the study's image, copied to docs/results/, and the statements on that figure
    image NAME      an image alone; STUDY/NAME where several studies have it
    statements WHAT the statements of a figure column: filling, S2, ...; STUDY/WHAT where several studies have it
    scan POWER      the best of the tried powers and the minimum, by observable: stiffness, adhesion; STUDY/POWER for that study's folder
    scalars STUDY   strain, porosity and strength of every curve
    collapse STUDY  collapse errors of all curves
    runs STUDY      steps, time steps, ledger and wall time of every run, times of every seed
    total STUDY     how many statements hold

STUDY is the name of a folder here.
"""
import csv
import json
import re
import shutil
import sys
from datetime import datetime
from pathlib import Path

DOCS = Path(__file__).resolve().parent


def table(file):
    with open(file, newline="", encoding="utf-8") as text:
        return list(csv.DictReader(text))


def markdown(header, rows):
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(str(cell).replace("|", "\\|") for cell in row) + " |" for row in rows])


def shown(verdict):
    return f"**{verdict}**" if verdict == "does not hold" else verdict


class Study:
    def __init__(self, folder):
        self.folder = folder
        self.statements = table(folder / "statements.csv") if (folder / "statements.csv").exists() else []

    def files(self, name):
        return sorted(self.folder.glob(name)) + sorted(self.folder.glob("*/" + name))

    def said(self, what):
        study, _, figure = what.rpartition("/")  # "figure" of any study, or "study/figure"
        rows = [s for s in self.statements if s["figure"] == figure and study in ("", s["study"])]
        if not rows:
            return None
        return markdown(["statement", "number", "seeds", ""], [(s["statement"], s["number"], s["seeds"], shown(s["verdict"])) for s in rows])

    def image(self, what, alt=None):
        study, _, name = what.rpartition("/")
        if study not in ("", self.folder.name):
            return None
        found = self.files(f"figures/{name}.svg")
        if not found:
            return None
        (DOCS / "results").mkdir(exist_ok=True)
        shutil.copyfile(found[0], DOCS / "results" / found[0].name)
        return f"![{alt or name}](results/{found[0].name})"

    def figure(self, number):
        said = self.said(number)
        image = self.image("fig" + number, f"Fig. {number}") if said else None
        return f"{image}\n\n{said}" if image else None

    def scalars(self, _):
        columns = {"porosity_filled": ("porosity after the rain", 1, "{:.4f}"), "strain_peak": ("strain at 40 kPa, %", 100, "{:.2f}"),
                   "porosity_peak": ("porosity there", 1, "{:.4f}"), "strength": ("strength, kPa", 1e-3, "{:.2f}"),
                   "initial_stiffness": ("initial stiffness, kPa", 1e-3, "{:.0f}")}
        rows = {}
        for file in self.files("tables/scalars.csv"):
            for row in table(file):
                if row["quantity"] in columns and row["mean"]:
                    _, scale, form = columns[row["quantity"]]
                    spread = " ± " + form.format(scale * float(row["deviation"])) if row["deviation"] else ""
                    found = rows.setdefault((row["curve"], f"{1e3 * float(row['radius [m]']):g}"), {"seeds": row["seeds"]})
                    found[row["quantity"]] = form.format(scale * float(row["mean"])) + spread
        there = [q for q in columns if any(q in found for found in rows.values())]
        header = ["curve", "R mm", "seeds", *(columns[q][0] for q in there)]
        return markdown(header, [(*key, found["seeds"], *(found.get(q, "-") for q in there)) for key, found in rows.items()]) if rows else None

    def scan(self, what):
        study, _, power = what.rpartition("/")
        if study not in ("", self.folder.name):
            return None
        rows = []
        for file in self.files("tables/scans.csv"):
            for row in table(file):
                if row["scanned power"] != power:
                    continue
                errors = ", ".join(f"{p}: {float(e):.3f}" for p, e in zip(row["powers"].split(";"), row["errors over range [-]"].split(";")))
                minimum = f"{float(row['minimum']):.3f}" if row["minimum"] else "none"
                minimum += f" ± {float(row['uncertainty']):.3f}" if row["uncertainty"] else ""
                where = f"{1e3 * float(row['radius [m]']):g} mm, other power {float(row['other power [-]']):g}"
                rows.append((where, row["observable"], row["seeds"], errors, row["best tried"], minimum))
        return markdown(["curve", "observable", "seeds", "error over range, by power", "best tried", "minimum"], rows) if rows else None

    def collapse(self, _):
        rows = []
        for file in self.files("tables/collapse.csv"):
            part = file.parent.parent.name if file.parent.parent != self.folder else "-"
            for row in table(file):
                number = lambda key: f"{float(row[key]):.3g}" if row[key] else "-"
                rows.append((part, row["curve"], row["observable"], row["seeds"], number("error"), number("scatter"),
                             number("over range [-]"), number("over seed scatter [-]")))
        if not rows:
            return None
        return markdown(["study", "curve", "observable", "seeds", "error", "scatter", "over range", "over seed scatter"], rows)

    def runs(self, _):
        rows, spans = [], {}  # seed -> runs, seconds of one thread, first start, last end
        for run in table(self.folder / "runs.csv"):
            file = self.folder / "runs" / run["run"] / "summary.json"
            if not file.exists():
                rows.append((run["run"], run["spheres"], run["state"], "", "", "", ""))
                continue
            summary = json.loads(file.read_text(encoding="utf-8"))
            stages = summary["stages"]
            steps = [s["time_step"] for s in stages if "largest" in s.get("time_step", {})]
            pressed = [s["energy_residual_share"] for s in stages if s["kind"] == "compress" and "energy_residual_share" in s]
            wall = summary["performance"]["wall_seconds"]
            times = [json.loads(line)["timestamp"] for line in (file.parent / "log.jsonl").read_text(encoding="utf-8").splitlines()]
            span = spans.setdefault(run["seed"], [0, 0.0, min(times), max(times)])
            span[:] = [span[0] + 1, span[1] + wall, min(span[2], *times), max(span[3], *times)]
            rows.append((run["run"], run["spheres"], f"{sum(s['time'] for s in stages):.2f}", sum(s["steps"] for s in stages),
                         f"{1e6 * min(s['smallest'] for s in steps):.1f} to {1e6 * max(s['largest'] for s in steps):.1f}" if steps else "",
                         f"{pressed[0]:.1e}" if pressed else "", f"{wall / 60:.1f}"))
        header = ["run", "spheres", "simulated s", "steps", "time step us", "ledger residual, compress", "wall min"]
        minutes = lambda text: datetime.fromisoformat(text.replace("Z", "+00:00")).timestamp() / 60
        seeds = [(seed, count, f"{seconds / 3600:.2f}", f"{minutes(last) - minutes(first):.0f}") for seed, (count, seconds, first, last) in spans.items()]
        return markdown(header, rows) + "\n\n" + markdown(["seed", "runs", "h of one thread", "min from the first start to the last end"], seeds)

    def total(self, _):
        if not self.statements:
            return None
        count = lambda verdict: sum(s["verdict"] == verdict for s in self.statements)
        return f"{count('holds')} statements hold, {count('does not hold')} do not, {count('not judged')} cannot be judged from these runs."

    def block(self, kind, what):
        of_study = {"scalars": self.scalars, "collapse": self.collapse, "runs": self.runs, "total": self.total}
        if kind in of_study:
            return of_study[kind](what) if what == self.folder.name else None
        return {"figure": self.figure, "image": self.image, "statements": self.said, "scan": self.scan}[kind](what)


def main():
    folders = [Path(folder).resolve() for folder in sys.argv[1:]]
    if not folders or not all((folder / "runs.csv").exists() for folder in folders):
        sys.exit(__doc__)
    studies = [Study(folder) for folder in folders]
    page = DOCS / "results.md"
    pattern = re.compile(r"(<!-- (figure|image|statements|scan|scalars|collapse|runs|total) (.*?) -->\n).*?(<!-- end -->)", re.DOTALL)

    def filled(match):
        for study in studies:
            if block := study.block(match[2], match[3]):
                return f"{match[1]}\n{block}\n\n{match[4]}"
        print(f"left as it is: {match[1].strip()}")
        return match[0]

    page.write_text(pattern.sub(filled, page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
