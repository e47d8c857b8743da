#!/usr/bin/python3
"""Puts what a study found into docs/results.md.

    /usr/bin/python3 docs/fill_results.py STUDY_FOLDER

Between `<!-- KIND WHAT -->` and `<!-- end -->` everything is written anew; nothing else is touched. Kinds:

    figure N        the study's image, copied to docs/results/, and the statements on that figure
    statements WHAT the statements of a figure column: filling, S2, checks, ...
    collapse        collapse errors of all curves
    runs            steps, time steps, ledger and wall time of every run, times of every seed
    total           how many statements hold
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
    return verdict if verdict == "holds" else f"**{verdict}**"


class Study:
    def __init__(self, folder):
        self.folder = folder
        self.statements = table(folder / "statements.csv")

    def said(self, what):
        rows = [s for s in self.statements if s["figure"] == what]
        if not rows:
            return "No statement of this kind in the study."
        return markdown(["statement", "number", "seeds", ""], [(s["statement"], s["number"], s["seeds"], shown(s["verdict"])) for s in rows])

    def figure(self, number):
        found = sorted(self.folder.glob(f"figures/fig{number}.svg")) + sorted(self.folder.glob(f"*/figures/fig{number}.svg"))
        if not found:
            return f"Figure {number} is not in the study.\n\n" + self.said(number)
        (DOCS / "results").mkdir(exist_ok=True)
        shutil.copyfile(found[0], DOCS / "results" / found[0].name)
        return f"![Fig. {number}](results/{found[0].name})\n\n" + self.said(number)

    def collapse(self):
        rows = []
        for file in sorted(self.folder.glob("tables/collapse.csv")) + sorted(self.folder.glob("*/tables/collapse.csv")):
            part = file.parent.parent.name if file.parent.parent != self.folder else "-"
            for row in table(file):
                number = lambda key: f"{float(row[key]):.3g}" if row[key] else "-"
                rows.append((part, row["curve"], row["observable"], row["seeds"], number("error"), number("scatter"),
                             number("over range [-]"), number("over seed scatter [-]")))
        return markdown(["study", "curve", "observable", "seeds", "error", "scatter", "over range", "over seed scatter"], rows)

    def runs(self):
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

    def total(self):
        count = lambda verdict: sum(s["verdict"] == verdict for s in self.statements)
        return f"{count('holds')} statements hold, {count('does not hold')} do not, {count('not judged')} cannot be judged from these runs."

    def block(self, kind, what):
        if kind == "figure":
            return self.figure(what)
        if kind == "statements":
            return self.said(what)
        return {"collapse": self.collapse, "runs": self.runs, "total": self.total}[kind]()


def main():
    if len(sys.argv) != 2 or not (Path(sys.argv[1]) / "statements.csv").exists():
        sys.exit(__doc__)
    study = Study(Path(sys.argv[1]))
    page = DOCS / "results.md"
    text = page.read_text(encoding="utf-8")
    pattern = re.compile(r"(<!-- (figure|statements|collapse|runs|total) ?([^ ]*) -->\n).*?(<!-- end -->)", re.DOTALL)
    text = pattern.sub(lambda m: m[1] + "\n" + study.block(m[2], m[3]) + "\n\n" + m[4], text)
    page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
