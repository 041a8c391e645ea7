"""Writes the readings of positioning.csv as a form of ISO 230-2 prints them: targets across, a row for each pass, results below.

across.csv has semicolons and decimal commas; across.xlsx (ECMA-376, the least that programs read) run and direction in two columns, in
mm. Run in this folder: python across.py   (numpy 2.4.6)
"""

import csv
import pathlib
import zipfile

import numpy as np

HERE = pathlib.Path(__file__).parent
ARROWS = {"up": "↑", "down": "↓"}


def passes():
    text = (HERE / "positioning.csv").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    found = {}
    for row in csv.DictReader(lines, delimiter=";"):
        target, deviation = (float(row[name].replace(",", ".")) for name in ("target mm", "deviation um"))
        found.setdefault((row["run"], row["direction"]), {})[target] = deviation
    return found


FOUND = passes()
TARGETS = sorted(next(iter(FOUND.values())))


def results():
    """Rows that an import must leave out."""
    means = {}
    for side, arrow in ARROWS.items():
        stack = np.array([[read[target] for target in TARGETS] for (_, own), read in FOUND.items() if own == side])
        means[side] = stack.mean(axis=0)
        yield f"x̄ {arrow}", means[side]
        yield f"s {arrow}", stack.std(axis=0, ddof=1)
    yield "B_i", means["up"] - means["down"]


def text():
    rows = [["Positioning of X, ISO 230-2"], ["i", *range(1, len(TARGETS) + 1)], ["Target position P_i [mm]", *TARGETS]]
    rows += [[f"{run} {ARROWS[side]} [µm]", *(read[target] for target in TARGETS)] for (run, side), read in FOUND.items()]
    rows += [[name, *np.round(values, 3)] for name, values in results()]
    cell = lambda value: value if isinstance(value, str) else f"{float(value):.10g}".replace(".", ",")
    return "".join(";".join(cell(value) for value in row) + "\n" for row in rows)


def column(k):
    return (chr(ord("A") + k // 26 - 1) if k >= 26 else "") + chr(ord("A") + k % 26)


def worksheet():
    rows = [["Axis X"], ["Run", "Direction", *TARGETS]]
    for (run, side), read in FOUND.items():
        # A merged cell has the run in its first row alone.
        rows.append([run if side == "up" else "", f"{side} [mm]", *(read[target] / 1000.0 for target in TARGETS)])
    rows += [["", name, *(value / 1000.0 for value in values)] for name, values in results()]

    def cell(at, value):
        if isinstance(value, str):
            return f'<c r="{at}" t="inlineStr"><is><t>{value}</t></is></c>' if value else ""
        return f'<c r="{at}"><v>{float(value)!r}</v></c>'

    body = "".join(
        f'<row r="{n}">' + "".join(cell(f"{column(k)}{n}", value) for k, value in enumerate(row)) + "</row>"
        for n, row in enumerate(rows, 1)
    )
    main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    return f'<?xml version="1.0" encoding="UTF-8"?><worksheet xmlns="{main}"><sheetData>{body}</sheetData></worksheet>'


def main():
    (HERE / "across.csv").write_text(text(), encoding="utf-8")
    with zipfile.ZipFile(HERE / "wide.xlsx") as wide, zipfile.ZipFile(HERE / "across.xlsx", "w", zipfile.ZIP_DEFLATED) as book:
        for part in wide.infolist():
            data = wide.read(part.filename)
            if part.filename == "xl/worksheets/sheet2.xml":
                data = worksheet().encode()
            # Always the same bytes.
            book.writestr(zipfile.ZipInfo(part.filename, (2026, 1, 5, 8, 0, 0)), data, zipfile.ZIP_DEFLATED)


if __name__ == "__main__":
    main()
