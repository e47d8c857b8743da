#!/usr/bin/python3
"""The tables of docs/performance.md from the JSON files of a result folder.

    bench/table.py bench/results/CPU-SET [--into docs/performance.md]

Prints Markdown; with --into also puts it between the two marks in that file.
"""
import argparse
import json
import pathlib
import sys

BEGIN, END = "<!-- figures: begin (written by bench/run --docs) -->", "<!-- figures: end -->"
# What is asked of an AVX-512 core in its fast state: particles -> M particle-steps/s on one thread and on two.
ASKED = {5000: (24, 40), 35000: (20, 37), 280000: (15, 28), 1000000: (12, 22)}


def rows_of(folder, name):
    file = folder / f"{name}.json"
    return json.loads(file.read_text())["rows"] if file.exists() else []


def number(value, digits=1):
    return "-" if value is None or isinstance(value, str) else f"{value:.{digits}f}"


def table(headings, lines):
    text = ["| " + " | ".join(headings) + " |", "|" + "---|" * len(headings)]
    return "\n".join(text + ["| " + " | ".join(str(cell) for cell in line) + " |" for line in lines]) + "\n"


def state(row):
    """Of the machine; with what lies between two cores where more than one thread ran."""
    cores = f" / {number(row['cores'], 0)} ns" if row.get("cores") and row.get("threads", 1) > 1 else ""
    return f"{number(row.get('fma'), 0)} / {number(row.get('l2'), 0)} / {number(row.get('l3'), 0)}{cores}"


def make(folder):
    parts = []
    rows = rows_of(folder, "steps")
    if rows:
        lines = []
        for r in rows:
            asked = ASKED.get(r["particles"], (None, None))
            asked = asked[r["threads"] - 1] if r["threads"] <= 2 and r["set"] == "avx512" else None
            lines.append((f"{r['particles']:,}", r["threads"], number(r["rate"]), "-" if asked is None else asked, number(r["best"]),
                          number(r.get("ns")), number(r["Z"], 2), number(r.get("memory"), 0), r["rebuilds"], state(r)))
        parts.append(f"### Whole step, scene `full`, {rows[0]['set']}\n\n" + table(
            ("particles", "threads", "M particle-steps/s", "asked", "best block", "ns per contact and core", "Z",
             "bytes per particle", "rebuilds", "FMA Gflop/s / L2 / L3 GB/s / between cores"), lines))
    rows = rows_of(folder, "scalar")
    if rows:
        parts.append("### Against the plain scalar half-list step, one thread\n\n" + table(
            ("particles", "scene", "platen M/s", "scalar M/s", "ratio (asked 3.2)", "positions differ by, R", "FMA / L2 / L3"),
            [(f"{r['particles']:,}", r["scene"], number(r["rate"]), number(r["scalar"]), number(r["ratio"], 2), r["agrees"], state(r))
             for r in rows]))
    rows = rows_of(folder, "threads")
    if rows:
        parts.append("### One thread against many\n\n" + table(
            ("particles", "threads", "M/s, one", "M/s, many", "speed-up (asked 1.75 on 2)", "as many beds side by side", "pairs", "dropped", "same bits", "FMA / L2 / L3 / between cores"),
            [(f"{r['particles']:,}", r["threads"], number(r["rate_one"]), number(r["rate"]), number(r["speedup"], 2), number(r["apart"], 2) if "apart" in r else "-", r["rounds"],
              r["dropped"], "yes" if r["same"] else "NO", state(r)) for r in rows]))
    rows = rows_of(folder, "executors")
    if rows:
        parts.append("### Flow graph against two `parallel_for` a step\n\n" + table(
            ("particles", "threads", "graph M/s", "graph, fused tasks", "parallel_for", "graph / parallel_for"),
            [(f"{r['particles']:,}", r["threads"], number(r["split"]), number(r["fused"]), number(r["rate"]), number(r["ratio"], 2))
             for r in rows]))
    rows = rows_of(folder, "phases")
    if rows:
        parts.append("### Where the time of a step goes, one thread, ns per particle\n\n" + table(
            ("particles", "contacts", "integrate", "lists and the saved copy", "whole step", "bytes moved", "GB/s", "ns if the third cache were all", "L2 / L3 GB/s"),
            [(f"{r['particles']:,}", number(r["contacts"]), number(r["integrate"]), number(r["lists"]), number(r["whole"]),
              number(r["bytes"], 0), number(r["GB/s"]), number(r["memory_bound"]), f"{number(r['l2'], 0)} / {number(r['l3'], 0)}") for r in rows]))
    rows = rows_of(folder, "orders")
    if rows:
        parts.append("### Order of tasks of large beds: bytes from memory for each particle and step, counted in a model of a cache\n\nSeveral workers have a part of the bed and a cache each.\n\n" + table(
            ("particles", "workers", "batches", "touched", "MiB of each cache", "in the order of steps", "in the order for a cache", "ms to find it"),
            [(f"{r['particles']:,}", r.get("workers", 1), r["batches"], number(r["touched"], 0), number(r["cache_MiB"], 0), number(r["by_step"], 0),
              number(r["ordered"], 0), number(r["milliseconds"], 1)) for r in rows]))
    rows = rows_of(folder, "schedule")
    if rows:
        parts.append("### More cores: simulated, not measured\n\nThe real graph with task times measured on one core; shared caches and "
                     "memory are not in it (`bench/step_schedule.cpp`).\n\n" + table(
            ("particles", "workers", "batches", "us per task", "overhead of a task, us", "work over longest chain", "speed-up", "workers busy"),
            [(f"{r['particles']:,}", r["workers"], r["batches"], number(r["task_us"]), number(r["overhead_us"], 2), number(r["bound"]),
              number(r["speedup"]), number(r["busy"], 2)) for r in rows]))
    rows = rows_of(folder, "sets")
    if rows:
        last = rows[-1]["rate"]
        parts.append(f"### Instruction sets, {rows[0]['particles']:,} particles, one thread\n\n" + table(
            ("set", "M/s", f"of {rows[-1]['set']}", "ns per contact", "FMA / L2 / L3"),
            [(r["set"], number(r["rate"]), number(r["rate"] / last, 2), number(r.get("ns")), state(r)) for r in rows]))
    rows = rows_of(folder, "features")
    if rows:
        parts.append(f"### What a feature costs, {rows[0]['particles']:,} particles, one thread, blocks in turn\n\n" + table(
            ("scene", "kernels", "M/s", "time over that of `full`", "ns per contact", "Z"),
            [(r["scene"], r["kernels"], number(r["rate"]), number(r["relative"], 2), number(r.get("ns")), number(r["Z"], 2)) for r in rows]))
    rows = rows_of(folder, "rebuilds")
    if rows:
        parts.append("### A rebuild of all lists\n\n" + table(
            ("particles", "threads", "ns per particle (asked 450 on one thread)", "processor ns per particle", "FMA / L2 / L3"),
            [(f"{r['particles']:,}", r["threads"], number(r["wall"], 0), number(r["cpu"], 0), state(r)) for r in rows]))
    rows = rows_of(folder, "rain")
    if rows:
        parts.append("### Rain, 35,000 spheres\n\n" + table(
            ("scene", "threads", "M/s (asked 40 on one thread)", "Z at the end", "steps", "rebuilds", "prunes", "FMA / L2 / L3"),
            [(r["scene"], r["threads"], number(r["rate"]), number(r["Z"], 3), r["steps"], r["rebuilds"], r["prunes"], state(r)) for r in rows]))
    rows = [r for r in rows_of(folder, "peers") if "skipped" not in r]
    if rows:
        parts.append("### Peers on the same packing, runs in turn\n\n" + table(
            ("bed", "cores", "program", "law or scene", "M/s", "Z", "platen is faster by", "asked"),
            [(r["bed"], r["cores"], r["program"], r["law"], number(r["rate"]), number(r["Z"], 2),
              f"{number(r['ratio'], 2)} (`{r['scene']}`)" if "ratio" in r else "-", r.get("asked") or "-") for r in rows]))
    for r in rows_of(folder, "peers"):
        if "skipped" in r:
            parts.append(f"{r['peer']}: {r['skipped']}.\n")
    return f"Measured with `bench/run` on `{folder.name}`; files in `bench/results/{folder.name}/`.\n\n" + "\n".join(parts)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--into", type=pathlib.Path)
    options = parser.parse_args()
    text = make(options.folder)
    print(text)
    if options.into:
        page = options.into.read_text()
        if BEGIN not in page or END not in page:
            print(f"table.py: {options.into} lacks the marks '{BEGIN}' and '{END}'", file=sys.stderr)
            return 2
        head, rest = page.split(BEGIN, 1)
        options.into.write_text(head + BEGIN + "\n" + text + END + rest.split(END, 1)[1])
    return 0


if __name__ == "__main__":
    sys.exit(main())
