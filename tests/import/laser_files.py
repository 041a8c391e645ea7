"""Writes laser.rtl and rotary.rta: the readings of positioning.csv and rotary.csv in the form of Renishaw's laser programs.

Made files: no program of the maker wrote them. The form is that of nodes/abbe/src/import/renishaw_laser.rs.
Run in this folder: python3 laser_files.py
"""

import csv
import math

MRAD_PER_ARCSEC = math.pi / 648.0


def rows(name, delimiter):
    with open(name, encoding="utf-8") as table:
        lines = [line for line in table if not line.startswith("#")]
    cells = list(csv.reader(lines, delimiter=delimiter))[1:]
    number = lambda cell: float(cell.replace(",", "."))
    found = [[int(run), way == "up", number(target), number(deviation)] for run, way, target, deviation in cells]
    for k, (run, is_up, target, _) in enumerate(found):
        # A control shows 0 at a whole turn: it is behind 330 upwards, and before it downwards.
        before = found[k - 1] if k and found[k - 1][:2] == [run, is_up] else None
        if target == 0.0 and (is_up and before or not is_up and not before):
            found[k][2] = 360.0
    return found


def write(name, kind, owner, axis, readings, factor, environment):
    targets = sorted({target for _, _, target, _ in readings})
    runs = sorted({run for run, _, _, _ in readings})
    lines = ["HEADER::", f"File type  : {kind}", f"Owner      : {owner}", "Version no : V20.02.02", ""]
    lines += ["TARGET DATA::", "Filetype  : ISO", f"Target-count: {len(targets)}", "Targets :"]
    for k in range(0, len(targets), 5):
        lines.append(" ".join(f"{target:.6f}" for target in targets[k : k + 5]) + " ")
    lines += ["Flags: 0 0 2 0", "", "USER-TEXT::", "Machine: made", "Serial No: 0", "Date:2026-01-05 08:00:00", "By:abbe"]
    lines += [f"Axis:{axis}", "Location:", "TITLE:made file", "", "RUNS::", f"Run-count:{2 * len(runs)}", "", "DEVIATIONS::"]
    lines.append("Run Target Data:")
    for run in runs:
        for is_up in (True, False):
            own = [(t, d) for r, up, t, d in readings if (r, up) == (run, is_up)]
            own.sort(reverse=not is_up)
            number = 2 * run - is_up
            lines += [f"{number}   {targets.index(t) + 1}      {d * factor:.9g}" for t, d in own]
    lines += ["", "ENVIRONMENT::"] + environment + ["", "EOF::", ""]
    with open(name, "w", encoding="utf-8", newline="") as file:
        file.write("\r\n".join(lines))


ENVIRONMENT = [
    "Air temp   : 21.400000 21.520000 0",
    "Air press  : 100.100000 100.200000 1",
    "Air humid  : 45.000000 44.500000",
    "Mat temp 1 : 20.900000 21.100000 0",
    "Mat temp 2 : -10.000000 -10.000000 0",
    "Mat temp 3 : -10.000000 -10.000000 0",
    "Exp coeff  : 11.000000 11.000000 0",
    'Date Time  : "08:00 Jan 05 2026" "08:40 Jan 05 2026"',
    "Final Data : 1 0",
]

if __name__ == "__main__":
    write("laser.rtl", "rtl", "Linear", "X", rows("positioning.csv", ";"), 1.0, ENVIRONMENT)
    write("rotary.rta", "rta", "Rotary", "C", rows("rotary.csv", ","), MRAD_PER_ARCSEC, [])
