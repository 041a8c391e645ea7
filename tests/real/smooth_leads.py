"""Random smooth lead errors of an axis, measured like ISO 230-2: which causes does `abbe diagnose` name?

A lead error is a sum of random waves (look_alikes.py). Every draw has 5 to 41 targets, 1 to 5 runs, and a lead error within 5 to
90 um. Lost motion is 0 to 20 um, none in one draw of five; noise is 0.2 to 1 um, the screw's lead 2 to 20 mm. No formula of the crates.

A name is right if it is pitch or scale error of X, or backlash of X where there is lost motion, or a set with one of them.
Any other name is false.

Run:  python smooth_leads.py --program ABBE [--first SEED] [--count N]      (numpy 2.4.6)
      python smooth_leads.py --write FOLDER [--first SEED] [--count N]      tables, maps, machine files and nothing else
"""

import argparse
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

from look_alikes import HERE, positioning, smooth

FORM = ("pitch_error X", "scale_error X")
PLAY = "backlash X"
TRAVEL_MM = 310.0


def targets_of(rng, count):
    """Places of the targets, even or not, over 40 to 600 mm of the travel."""
    length = 10.0 * rng.integers(4, 61)
    low = rng.uniform(-TRAVEL_MM + 5.0, TRAVEL_MM - 5.0 - length)
    spacing = length / (count - 1)
    places = spacing * np.arange(count)
    if rng.random() < 0.5:
        places[1:-1] += 0.2 * spacing * rng.uniform(-1, 1, count - 2)
    return np.round(low + places, 3)


def draw(seed):
    """One axis: its rows, and what is true of it."""
    rng = np.random.default_rng([3232, seed])
    targets = targets_of(rng, int(rng.integers(5, 42)))
    runs, size = int(rng.integers(1, 6)), math.exp(rng.uniform(math.log(5.0), math.log(90.0)))
    play = 0.0 if rng.random() < 0.2 else rng.uniform(0.0, 20.0)
    noise, screw = rng.uniform(0.2, 1.0), float(rng.choice([2.0, 4.0, 5.0, 8.0, 10.0, 12.0, 16.0, 20.0]))
    # Not shorter than four spacings: what is shorter is not smooth for these targets.
    shortest = max(rng.uniform(0.2, 0.8), min(4.0 / (len(targets) - 1), 1.0))
    lead = size * smooth(rng, targets, shortest)
    rows = positioning(rng, targets, lead, np.full(len(targets), play), noise, runs=runs)
    truth = {"seed": seed, "targets": len(targets), "runs": runs, "size_um": round(size, 1), "play_um": round(play, 2)}
    return rows, truth | {"noise_um": round(noise, 2), "screw_mm": screw}


def write(folder, seed):
    """Table, map and machine file of a draw; returns what is true."""
    rows, truth = draw(seed)
    folder.mkdir(parents=True, exist_ok=True)
    lines = [f"{run},{way},{target:.3f},{deviation:.2f}" for run, way, target, deviation in rows]
    table = "\n".join(["run,direction,target_mm,deviation_um", *lines]) + "\n"
    (folder / "laser_X.csv").write_text(table, encoding="utf-8")
    (folder / "map.yaml").write_text((HERE / "recordings/smooth_13_a/map.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    machine = (HERE / "machines/vmc_3x.yaml").read_text(encoding="utf-8")
    before, after = machine.split("  Y: {", 1)
    lead = f"lead_mm: {truth['screw_mm']:.1f}"
    (folder / "machine.yaml").write_text(before.replace("lead_mm: 10.0", lead) + "  Y: {" + after, encoding="utf-8")
    return truth


def run(program, *arguments):
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


def names(report):
    """Each named cause, and each set, as the names that it can stand for."""
    found = []
    for cause in report["causes"]:
        if cause["status"] in ("named", "set"):
            others = [other for other in cause["confusable_with"] if not other["excluded"]]
            found.append([f"{one['effect']} {one['axis']}" for one in [cause, *others]])
    return found


def judge(truth, report):
    """(lead error found, lost motion found, false names)."""
    right = {*FORM, PLAY} if truth["play_um"] > 0.0 else {*FORM}
    found = names(report)
    has = lambda wanted: any(set(wanted) & set(one) for one in found)
    false = [" or ".join(one) for one in found if not right & set(one)]
    return has(FORM), has([PLAY]), false


def diagnosed(program, seed):
    with tempfile.TemporaryDirectory() as home:
        home = pathlib.Path(home)
        truth = write(home, seed)
        machine = home / "machine.yaml"
        code, text = run(program, "import", home / "laser_X.csv", "--map", home / "map.yaml", "--machine", machine, "-o", home / "bag")
        if code == 0:
            code, text = run(program, "diagnose", home / "bag", "--machine", machine, "--json", home / "gap.json")
        if code not in (0, 3):
            return truth, None, text.strip().splitlines()[:1]
        report = json.loads((home / "gap.json").read_text(encoding="utf-8"))
        return truth, report, []


def wilson(k, n):
    """95 % interval of a share, in percent."""
    z, p = 1.959964, k / n
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return [100 * max(middle - half, 0.0), 100 * min(middle + half, 1.0)]


def share(words, k, n):
    low, high = wilson(k, n) if n else [0.0, 100.0]
    return f"{words}: {k} of {n} ({low:.1f} to {high:.1f} %)"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=os.environ.get("ABBE", "target/release/abbe"))
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--write", type=pathlib.Path)
    given = parser.parse_args()
    seeds = range(given.first, given.first + given.count)
    if given.write:
        for seed in seeds:
            print(json.dumps(write(given.write / str(seed), seed)))
        return
    all_of, refused, false, leads, plays, with_play = 0, 0, 0, 0, 0, 0
    for seed in seeds:
        truth, report, why = diagnosed(given.program, seed)
        all_of += 1
        if report is None:
            refused += 1
            print(f"refused: {truth} {why}", flush=True)
            continue
        lead, play, wrong = judge(truth, report)
        leads += lead
        with_play += truth["play_um"] > 0.0
        plays += play and truth["play_um"] > 0.0
        if wrong:
            false += 1
            print(f"false name: {truth} {wrong}", flush=True)
        elif not lead:
            print(f"lead error not named: {truth}", flush=True)
    answered = all_of - refused
    print(f"draws {seeds.start} to {seeds.stop - 1}: {answered} diagnosed, {refused} refused")
    print(share("with a false name", false, answered))
    print(share("lead error named", leads, answered))
    print(share("lost motion named, where there is some", plays, with_play))


if __name__ == "__main__":
    sys.exit(main())
