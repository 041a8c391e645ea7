"""Evaluates every table by ISO 230-2, 230-3 or 230-4 with numpy and writes the figures to the end of its expected.yaml.

It shares nothing with the crates: readings are gathered by target and side, whatever the numbers of the runs are.
Lengths are um, angles arcsec.
Run: python figures.py [FOLDER]   (numpy 2.4.6; FOLDER has NAME/expected.yaml, `recordings` beside this file by default)
"""

import csv
import datetime
import pathlib
import sys

import numpy as np

RECORDINGS = pathlib.Path(__file__).parent / "recordings"
BEGIN = "# Written by figures.py; compared within 1e-6.\nnumpy:\n"

PLAIN = {"delimiter": ","}
GERMAN = {"delimiter": ";", "decimal": ","}
# Recording: table, and how it is read. `digits`: targets that agree to so many decimals are one.
POSITIONING = {
    "laser_cycle_per_run": ("cycle_per_run.csv", PLAIN),
    "laser_pass_per_run": ("pass_per_run.csv", PLAIN),
    "laser_one_way": ("one_way.csv", PLAIN),
    "laser_step_cycle": ("pilgrim.csv", PLAIN),
    "laser_single_run": ("single_run.csv", PLAIN),
    "laser_jitter": ("jitter.csv", PLAIN | {"digits": 0}),
    "lead_a": ("lead_a.csv", PLAIN),
    "lead_b": ("lead_b.csv", PLAIN),
    "lead_c": ("lead_c.csv", PLAIN),
    "rotary_c": ("c.csv", PLAIN | {"columns": ("direction", "target_deg", "deviation_arcsec")}),
    "dial_10_um": ("dial.csv", PLAIN),
    "dial_fine": ("fine.csv", PLAIN),
    "sorted_table": ("sorted.csv", GERMAN | {"columns": ("direction", "target mm", "deviation um")}),
    "one_sided": ("up.csv", GERMAN | {"columns": ("direction", "target mm", "deviation um")}),
    "one_missing": ("one_missing.csv", GERMAN | {"columns": ("direction", "target mm", "deviation um")}),
    "real_axis": ("laser_X.csv", PLAIN),
    "short_screw": ("laser_X.csv", PLAIN),
    "smooth_13_a": ("laser_X.csv", PLAIN),
    "smooth_13_b": ("laser_X.csv", PLAIN),
    "smooth_13_c": ("laser_X.csv", PLAIN),
    "lead_90": ("laser_X.csv", PLAIN),
    "passes_as_runs": ("laser_X.csv", PLAIN),
    "one_way": ("laser_X.csv", PLAIN),
    "one_run": ("laser_X.csv", PLAIN),
    "one_run_listed": ("laser_X.csv", PLAIN),
    "step_cycle": ("laser_X.csv", PLAIN),
    "rotary_table": ("collimator_C.csv", PLAIN | {"columns": ("direction", "target_deg", "deviation_arcsec")}),
}
for name in ("rotary_one_run", "rotary_one_way"):
    POSITIONING[name] = POSITIONING["rotary_table"]
WIDE = {"wide_table": ("laser_X.csv", GERMAN)}
# Recording: a form with the targets across, one row for each pass.
ACROSS = {"targets_across": ("across.csv", GERMAN)}
# Recording: a file in the form of Renishaw's laser programs, and its unit of deviations in um or arcsec.
LASER_FILES = {"laser_file": ("laser.rtl", 1.0), "laser_file_rotary": ("rotary.rta", 648.0 / np.pi)}
# Recording: table, displacement, column of the run.
LOGS = {
    "spindle_both": ("spindle.csv", "growth_um", "run"),
    "spindle_rear": ("../spindle_both/spindle.csv", "growth_um", "run"),
    "spindle_once": ("spindle_once.csv", "growth_um", None),
    "warm_ups_a": ("a_60rows_pause.csv", "z_um", "run"),
    "warm_ups_b": ("b_60rows_no_pause.csv", "z_um", "run"),
    "warm_ups_c": ("c_240rows_pause.csv", "z_um", "run"),
    "warm_ups_d": ("d_240rows_jitter1s.csv", "z_um", "run"),
    "warm_ups_e": ("e_90rows_jitter1s.csv", "z_um", "run"),
    "warm_ups_f": ("f_last_run_cut.csv", "z_um", "run"),
    "mornings_three": ("lag20.csv", "z_um", "run"),
    "mornings_six": ("lag20_six.csv", "z_um", "run"),
    "mornings_soak": ("lag20_six_soak.csv", "z_um", "run"),
    "warm_up_with_cooling": ("control_no_pause.csv", "z_um", "run"),
    "warm_up_once": ("warm_once.csv", "z_um", None),
    "machine_at_rest": ("rest_X.csv", "x_mm", None),
    "etve_day": ("etve_X.csv", "x_um", None),
    "lagged_rear_bearing": ("growth_Z.csv", "growth_um", "run"),
    "five_mornings": ("mornings_Z.csv", "z_um", "run"),
    "warm_ups_back_to_back": ("cycles_Z.csv", "z_um", "run"),
}


def rows(name, table, delimiter=",", decimal="."):
    text = (RECORDINGS / name / table).read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    return [{k: c.replace(decimal, ".") for k, c in row.items()} for row in csv.DictReader(lines, delimiter=delimiter)]


def readings(name, table, form):
    """(side, target, deviation) in the order of the rows."""
    form = dict(form)
    way, target, deviation = form.pop("columns", ("direction", "target_mm", "deviation_um"))
    digits = form.pop("digits", None)
    found = []
    for row in rows(name, table, **form):
        at = float(row[target])
        found.append((row[way], at if digits is None else round(at, digits), float(row[deviation])))
    return found


def wide(name, table, form):
    head, *lines = rows_of_cells(name, table, form)
    found = []
    for line in lines:
        at, *cells = (float(cell.replace(form["decimal"], ".")) for cell in line)
        found += [("up" if "↑" in title else "down", at, cell) for title, cell in zip(head[1:], cells)]
    return found


def across(name, table, form):
    """Rows whose name has a number and an arrow are passes; the row of targets is above them."""
    number = lambda cell: float(cell.replace(form["decimal"], "."))
    found, targets = [], []
    for title, *cells in rows_of_cells(name, table, form):
        if title.startswith("Target"):
            targets = [number(cell) for cell in cells]
        elif title[0].isdigit():
            side = "up" if "↑" in title else "down"
            found += [(side, target, number(cell)) for target, cell in zip(targets, cells)]
    return found


def laser_file(name, table, unit):
    """Readings of each pass; the side of approach is the way from its first target to its last."""
    text = (RECORDINGS / name / table).read_text(encoding="utf-8")
    part = lambda begin, end: text.split(begin)[1].split(end)[0].split()
    targets = np.array(part("Targets :", "Flags:"), dtype=float)
    cells = np.array(part("Run Target Data:", "ENVIRONMENT::"), dtype=float).reshape(-1, 3)
    found = []
    for run in sorted(set(cells[:, 0])):
        _, places, values = cells[cells[:, 0] == run].T
        at = targets[places.astype(int) - 1]
        side = "up" if at[-1] > at[0] else "down"
        found += [(side, float(t), unit * v) for t, v in zip(at, values)]
    return found


def rows_of_cells(name, table, form):
    text = (RECORDINGS / name / table).read_text(encoding="utf-8")
    return [line.split(form["delimiter"]) for line in text.splitlines() if not line.startswith("#")]


def stacks(found):
    """Deviations [reading, target] of each side; targets that lack a reading of a run are left out."""
    sides = sorted({side for side, _, _ in found}, reverse=True)
    places = sorted({at for _, at, _ in found})
    gathered = {(s, p): [d for side, at, d in found if (side, at) == (s, p)] for s in sides for p in places}
    most = max(len(list_of) for list_of in gathered.values())
    whole = [p for p in places if all(len(gathered[s, p]) == most for s in sides)]
    return {s: np.array([gathered[s, p] for p in whole]).T for s in sides}


def positioning(found):
    """ISO 230-2. Of one run there is no repeatability, and so no accuracy."""
    sides = stacks(found)
    means = {side: x.mean(axis=0) for side, x in sides.items()}
    n_runs, n_targets = next(iter(sides.values())).shape
    figures = {"runs": n_runs, "targets": n_targets}
    spread = {side: x.std(axis=0, ddof=1) for side, x in sides.items()} if n_runs > 1 else {}
    for side, mean in means.items():
        figures[f"E_{side}"] = np.ptp(mean)
        if spread:
            s = spread[side]
            figures[f"R_{side}"] = 4 * s.max()
            figures[f"A_{side}"] = (mean + 2 * s).max() - (mean - 2 * s).min()
    if len(means) == 2:
        up, down = means["up"], means["down"]
        figures |= {"B": abs(up - down).max(), "B_mean": (up - down).mean()}
        figures |= {"M": np.ptp((up + down) / 2), "E": np.ptp(np.concatenate([up, down]))}
    if len(means) == 2 and spread:
        su, sd = spread["up"], spread["down"]
        figures["R"] = np.max([2 * su + 2 * sd + abs(up - down), 4 * su, 4 * sd])
        figures["A"] = max((up + 2 * su).max(), (down + 2 * sd).max()) - min((up - 2 * su).min(), (down - 2 * sd).min())
    return figures


def within_a_second(t, z):
    """Readings within a second of the first of them are one, their mean, as `abbe report` states them."""
    groups = []
    for time, value in zip(t, z):
        if not groups or time - groups[-1][0] >= 1.0:
            groups.append((time, []))
        groups[-1][1].append(value)
    found = [(time, np.mean(values)) for time, values in groups]
    return np.array(found).T


def drift(t, z):
    """ISO 230-3: drift since the first reading, between readings along a straight line."""
    t, z = within_a_second(t, z)
    z = z - z[0]
    after = lambda seconds: np.interp(t[0] + seconds, t, z) if t[-1] - t[0] >= seconds else None
    return {"after_1_h": after(3600.0), "after_3_h": after(10800.0), "range": np.ptp(z)}


def logs(name, table, displacement, run):
    every = rows(name, table)
    numbers = sorted({float(row[run]) for row in every}) if run else [None]
    for number in numbers:
        those = [row for row in every if number is None or float(row[run]) == number]
        t = np.array([float(row["time_s"]) if "time_s" in row else instant(row["time"]) for row in those])
        scale = 1000.0 if displacement.endswith("_mm") else 1.0
        yield drift(t, scale * np.array([float(row[displacement]) for row in those]))


def instant(cell):
    return datetime.datetime.fromisoformat(cell.replace("Z", "+00:00")).timestamp()


def circle_of(points):
    """Least squares of distances (Gauss and Newton): centre and radius."""
    x, y = points.T
    centre, radius = np.zeros(2), np.hypot(x, y).mean()
    for _ in range(20):
        dx, dy = x - centre[0], y - centre[1]
        r = np.hypot(dx, dy)
        step = np.linalg.lstsq(np.column_stack([dx / r, dy / r, np.ones_like(r)]), r - radius, rcond=None)[0]
        centre, radius = centre + step[:2], radius + step[2]
    return centre, radius


def circles(name, table, radius_mm):
    """ISO 230-4 of runs in pairs, the first of each counter-clockwise: G, D and the hysteresis H at equal angles."""
    every = rows(name, table)
    numbers = sorted({int(row["run"]) for row in every})
    for pair in zip(numbers[::2], numbers[1::2]):
        turns = []
        for number in pair:
            those = [row for row in every if int(row["run"]) == number]
            turn = np.radians([float(row["angle_deg"]) for row in those])
            r = radius_mm + np.array([float(row["radial_um"]) for row in those]) / 1000.0
            turns.append((np.column_stack([r * np.cos(turn), r * np.sin(turn)]), turn, r))
        figures = {}
        for word, points in (("G_ccw", turns[0][0]), ("G_cw", turns[1][0]), ("G", np.vstack([t[0] for t in turns]))):
            centre, radius = circle_of(points)
            figures[word] = 1000.0 * np.ptp(np.hypot(*(points - centre).T))
        figures["D"] = 1000.0 * (radius - radius_mm)
        back = np.argsort(turns[1][1])
        figures["H"] = 1000.0 * abs(turns[0][2] - turns[1][2][back]).max()
        yield figures


def block(tests):
    number = lambda value: "null" if value is None else repr(value if isinstance(value, int) else round(float(value), 9))
    lines = ["  - {" + ", ".join(f"{key}: {number(value)}" for key, value in test.items()) + "}\n" for test in tests]
    return BEGIN + "".join(lines)


def main():
    folder = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else RECORDINGS
    tests = {name: [positioning(readings(name, *how))] for name, how in POSITIONING.items()}
    tests |= {name: [positioning(wide(name, *how))] for name, how in WIDE.items()}
    tests |= {name: [positioning(across(name, *how))] for name, how in ACROSS.items()}
    tests |= {name: [positioning(laser_file(name, *how))] for name, how in LASER_FILES.items()}
    tests |= {name: list(logs(name, *how)) for name, how in LOGS.items()}
    tests["slipped_clamp"] = list(circles("slipped_clamp", "ballbar_XY.csv", 100.0))
    for name, figures in tests.items():
        file = folder / name / "expected.yaml"
        file.parent.mkdir(exist_ok=True)
        before = file.read_text(encoding="utf-8").split(BEGIN)[0] if file.exists() else ""
        file.write_text(before + block(figures), encoding="utf-8")


if __name__ == "__main__":
    main()
