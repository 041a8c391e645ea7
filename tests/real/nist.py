"""Cuts two tables from logs of real machines in nodes/mtconnect_bridge/tests/data (NIST, public information).

`machine_at_rest`: X as the control of the five-axis machine displays it during its longest rest with readings.
`spindle_temperature`: spindle temperature of the mill-turn centre, every reading of the day.
Run: python nist.py [FOLDER]   (FOLDER is `recordings` beside this file by default)
"""

import gzip
import pathlib
import sys

HERE = pathlib.Path(__file__).parent
LOGS = HERE.parent.parent / "nodes/mtconnect_bridge/tests/data"


def values(log, key):
    with gzip.open(LOGS / log, "rt", encoding="utf-8") as lines:
        for line in lines:
            time, name, value = line.rstrip("\n").split("|", 2)
            if name == key and value != "UNAVAILABLE":
                yield time, value


def write(folder, name, table, head, rows):
    path = folder / name / table
    path.parent.mkdir(parents=True, exist_ok=True)
    comment = "# National Institute of Standards and Technology (NIST), smstestbed, commit 968279f; cut by nist.py"
    path.write_text("\n".join([comment, head, *rows]) + "\n", encoding="utf-8")


def longest_rest():
    """The most readings in a row within 1 um of the first of them."""
    found, best = [], []
    for time, value in values("gfagie01_20160513.shdr.gz", "Xposition"):
        mm = float(value)
        if found and abs(mm - found[0][1]) > 0.001:
            found = []
        found.append((time, mm))
        if len(found) > 100 and seconds(found) > seconds(best):
            best = list(found)
    return best


def seconds(found):
    """Length of a list of readings of one day."""
    of_day = lambda time: sum(u * float(p) for u, p in zip((3600, 60, 1), time[11:-1].split(":")))
    return of_day(found[-1][0]) - of_day(found[0][0]) if found else 0.0


def main():
    folder = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "recordings"
    rest = [f"{time},{mm:.5f}" for time, mm in longest_rest()]
    write(folder, "machine_at_rest", "rest_X.csv", "time,x_mm", rest)
    warm = [f"{time},{degc}" for time, degc in values("mazak01_20161129.shdr.gz", "Stemp")]
    write(folder, "spindle_temperature", "spindle.csv", "time,spindle [degC]", warm)


if __name__ == "__main__":
    main()
