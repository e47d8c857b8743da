#!/usr/bin/python3
"""platen against Debian's lammps and liggghts: the same packing, runs in turn, medians.

Each round runs every program once, as a process of its own that reads the same bed, warms up and then times the same
number of steps by its own clock; the order is turned round from one round to the next, and rounds with steal time in
/proc/stat are dropped and run again. A peer that is not installed is skipped. Nothing here is part of platen: peers are
only ever run as programs.

    bench/peers/run.py --build build/bench --beds build/bench/beds --json peers.json
"""
import argparse
import json
import os
import pathlib
import re
import shutil
import statistics
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent

# peer: program, deck, then for each kind of bed the neighbour skin [m] and the scenes of platen that it is held against
PEERS = {
    "lammps": dict(program="lmp", deck="lammps.in", law="linear spring, friction",
                   dense=("1.25e-4", ["full", "linear", "linear_no_energy"]),
                   rain=("6e-4", ["rain", "rain_no_energy", "rain_full"])),
    "liggghts": dict(program="liggghts", deck="liggghts.in", law="EEPA, friction, rolling",
                     dense=("1.25e-4", ["full"]), rain=("6e-4", ["rain_full"])),
}
# What platen must be faster by on one core: (peer, scene) -> ratio.
TARGETS = {("liggghts", "full"): 9.0, ("lammps", "full"): 4.0, ("lammps", "linear"): 5.0, ("lammps", "rain"): 3.5}


def stolen_ticks():
    try:
        with open("/proc/stat") as file:
            return int(file.readline().split()[8])
    except (OSError, IndexError, ValueError):
        return 0


def run(command, **more):
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **more)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(map(str, command))}: exit code {done.returncode}\n{done.stdout[-2000:]}")
    return done.stdout


def peer_block(peer, data, kind, processes, warm, steps, folder):
    """Seconds of the timed steps, and Z at their end."""
    about = PEERS[peer]
    command = [about["program"], "-in", HERE / about["deck"], "-var", "data", data, "-var", "lid",
               "1" if kind == "dense" else "0", "-var", "skin", about[kind][0], "-var", "warm", str(warm),
               "-var", "steps", str(steps), "-log", "none"]
    environment = dict(os.environ, OMP_NUM_THREADS="1", OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")
    if processes > 1:
        command = ["mpirun", "--bind-to", "none", "--oversubscribe", "-np", str(processes)] + command
    text = run(command, cwd=folder, env=environment)
    times = re.findall(r"Loop time of (\S+) on \d+ procs for (\d+) steps", text)
    result = re.search(r"RESULT particles \S+ Z (\S+)", text)
    if not times or int(times[-1][1]) != steps or not result:
        raise RuntimeError(f"{peer} printed no time:\n{text[-2000:]}")
    return float(times[-1][0]), float(result.group(1))


def platen_block(options, kind, scene, threads, warm, steps):
    command = [options.build / "bench" / "bench_step", "one" if kind == "dense" else "one-rain", "--beds", options.beds,
               "-n", str(options.particles), "-s", scene, "-t", str(threads), "--warm", str(warm), "--steps",
               str(steps), "-r", "1"]
    result = json.loads(run(command).strip().splitlines()[-1])
    return result["seconds"][0], result["Z"]


def in_turn(variants, rounds):
    """[(name, function)] -> {name: [(seconds, Z)]} of the rounds without steal, and how many were dropped."""
    kept, everything, dropped = {name: [] for name, _ in variants}, {name: [] for name, _ in variants}, 0
    for number in range(3 * rounds):
        if len(next(iter(kept.values()))) >= rounds:
            break
        before, results = stolen_ticks(), {}
        for name, block in variants if number % 2 == 0 else reversed(variants):
            results[name] = block()
        stolen = stolen_ticks() != before
        dropped += stolen
        for name, result in results.items():
            everything[name].append(result)
            if not stolen:
                kept[name].append(result)
    return (kept if next(iter(kept.values())) else everything), dropped


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--build", type=pathlib.Path, default=pathlib.Path("build/bench"), help="folder of the build")
    parser.add_argument("--beds", type=pathlib.Path, help="folder where beds are kept (default: BUILD/beds)")
    parser.add_argument("--particles", type=int, default=35000)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--steps", type=int, default=500, help="timed steps of the dense bed")
    parser.add_argument("--rain-steps", type=int, default=2000)
    # platen tries two ways to run beds that the third cache holds, for up to 768 steps, and then takes the quicker one [core/quicker.h].
    parser.add_argument("--warm", type=int, default=800, help="steps of the dense bed before the timed ones")
    parser.add_argument("--cores", type=int, default=len(os.sched_getaffinity(0)), help="processes of the run on all cores")
    parser.add_argument("--peers", default=",".join(PEERS))
    parser.add_argument("--beds-kinds", default="dense,rain")
    parser.add_argument("--json", type=pathlib.Path)
    options = parser.parse_args()
    options.build = options.build.resolve()
    options.beds = (options.beds or options.build / "beds").resolve()

    rows = []
    there = []
    for peer in options.peers.split(","):
        if shutil.which(PEERS[peer]["program"]):
            there.append(peer)
        else:
            print(f"{peer}: skipped, because the program '{PEERS[peer]['program']}' is not installed (Debian: {peer})")
            rows.append(dict(peer=peer, skipped="not installed"))
    counts = [1] + ([options.cores] if options.cores > 1 else [])
    if len(counts) > 1 and there and not shutil.which("mpirun"):
        print("all cores: skipped, because there is no mpirun (Debian: openmpi-bin)")
        counts = [1]
    heading = f"{'bed':>6}{'cores':>6}  {'program':<10}{'law or scene':<26}{'M/s':>8}{'Z':>7}{'platen is faster by':>21}{'asked':>7}"
    for kind in options.beds_kinds.split(","):
        if not there:
            break
        with tempfile.TemporaryDirectory() as folder:
            data = pathlib.Path(folder) / "bed.data"
            run([options.build / "bench" / "bench_beds", "--beds", options.beds, f"--{kind}", str(options.particles),
                 "--lammps", data])
            steps = options.steps if kind == "dense" else options.rain_steps
            # Rain is timed from its start on, a hundred steps after the file.
            warm = options.warm if kind == "dense" else 100
            for cores in counts:
                scenes = sorted({scene for peer in there for scene in PEERS[peer][kind][1]})
                variants = [(("platen", scene), lambda scene=scene: platen_block(options, kind, scene, cores, warm, steps))
                            for scene in scenes]
                variants += [((peer, PEERS[peer]["law"]),
                              lambda peer=peer: peer_block(peer, data, kind, cores, warm, steps, folder)) for peer in there]
                results, dropped = in_turn(variants, options.rounds)
                print(f"\n{options.particles} particles, {steps} steps, {len(results[variants[0][0]])} rounds"
                      f" ({dropped} dropped for steal)\n{heading}")

                def rate(name):
                    seconds = statistics.median(s for s, _ in results[name])
                    return options.particles * steps / seconds * 1e-6

                for name in results:
                    z = results[name][-1][1]
                    row = dict(bed=kind, particles=options.particles, cores=cores, program=name[0], law=name[1],
                               rate=rate(name), Z=z, steps=steps, rounds=len(results[name]), dropped=dropped)
                    line = f"{kind:>6}{cores:>6}  {name[0]:<10}{name[1]:<26}{rate(name):8.2f}{z:7.2f}"
                    if name[0] == "platen":
                        rows.append(row)
                        print(line)
                        continue
                    for scene in PEERS[name[0]][kind][1]:
                        pairs = zip(results[name], results[("platen", scene)])
                        ratio = statistics.median(theirs[0] / ours[0] for theirs, ours in pairs)
                        asked = TARGETS.get((name[0], scene)) if cores == 1 else None
                        rows.append(dict(row, scene=scene, ratio=ratio, asked=asked))
                        print(f"{line}{ratio:14.2f} ({scene}){'' if asked is None else f'{asked:7.1f}'}")
    if options.json:
        options.json.write_text(json.dumps(dict(bench="peers", rows=rows), indent=1) + "\n")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except RuntimeError as error:
        print(f"run.py: {error}", file=sys.stderr)
        sys.exit(2)
