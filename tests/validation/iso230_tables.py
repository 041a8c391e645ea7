"""Evaluates the tables of tests/import by ISO 230-2 and 230-3 with numpy and writes the figures as JSON.

An implementation of the definitions that shares nothing with the crates: arrays instead of loops, numpy's least squares,
a fine grid for extremes. Lengths are in um, angles in arcsec, temperatures in degC or K.
Run in this folder: python iso230_tables.py > iso230_tables.json   (numpy 2.4.6)
"""

import csv
import json
import pathlib

import numpy as np

TABLES = pathlib.Path(__file__).parent.parent / "import"


def rows(name, delimiter=",", decimal="."):
    with open(TABLES / name, encoding="utf-8") as text:
        lines = [line for line in text if not line.startswith("#")]
    table = list(csv.DictReader(lines, delimiter=delimiter))
    return [{key: cell.replace(decimal, ".") for key, cell in row.items()} for row in table]


def by_side(table, target, deviation, wrap=None):
    """Deviations [run, target] of each side, targets ascending, rows in their order."""
    sides = {}
    for side in ("up", "down"):
        runs = {}
        for row in table:
            if row["direction"] == side:
                runs.setdefault(row["run"], []).append((float(row[target]), float(row[deviation])))
        stacked = []
        for pairs in runs.values():
            if side == "down":
                pairs = pairs[::-1]
            if wrap is not None:
                # The last target of an ascending pass may show the angle of the first.
                pairs = [(t + wrap if k and t < pairs[0][0] + 1e-9 else t, d) for k, (t, d) in enumerate(pairs)]
            stacked.append(pairs)
        if stacked:
            sides[side] = np.array(stacked)
    return sides


def positioning(sides):
    figures, high, low, means = {}, [], [], {}
    for side, stack in sides.items():
        x = stack[:, :, 1]
        mean, s = x.mean(axis=0), x.std(axis=0, ddof=1)
        means[side] = (mean, s)
        high.append(mean + 2 * s)
        low.append(mean - 2 * s)
        figures |= {
            f"e_{side}": float(np.ptp(mean)),
            f"r_{side}": float(4 * s.max()),
            f"a_{side}": float(high[-1].max() - low[-1].min()),
        }
    if len(means) == 2:
        (mu, su), (md, sd) = means["up"], means["down"]
        figures |= {
            "b": float(abs(mu - md).max()),
            "b_mean": float((mu - md).mean()),
            "m": float(np.ptp((mu + md) / 2)),
            "e": float(np.ptp(np.concatenate([mu, md]))),
            "r": float(np.max([2 * su + 2 * sd + abs(mu - md), 4 * su, 4 * sd])),
            "a": float(np.max(high) - np.min(low)),
        }
    return figures


def periodic(sides, period, harmonics):
    found = {}
    for side, stack in sides.items():
        at, x = stack[0, :, 0], stack[:, :, 1].mean(axis=0)
        waves = [f(2 * np.pi * h * at / period) for h in range(1, harmonics + 1) for f in (np.cos, np.sin)]
        design = np.column_stack([np.ones_like(at), at, *waves])
        beta, residual, _, _ = np.linalg.lstsq(design, x, rcond=None)
        turn = np.linspace(0, 1, 400_001)
        angles = [f(2 * np.pi * h * turn) for h in range(1, harmonics + 1) for f in (np.cos, np.sin)]
        wave = np.column_stack(angles) @ beta[2:]
        found[side] = {
            "p": float(np.ptp(wave)),
            "amplitudes": [float(np.hypot(*beta[2 * h : 2 * h + 2])) for h in range(1, harmonics + 1)],
            "s": float(np.sqrt(residual[0] / (at.size - design.shape[1]))),
        }
    return found


def scatter(t, z):
    """Standard deviation of one reading: a matrix that takes each reading against the line between its neighbours."""
    n = t.size - 2
    against = np.zeros((n, t.size))
    for row in range(n):
        against[row, row + 1] = 1.0
        # Lagrange's weights of the two neighbours at the time in between.
        against[row, row] = -(t[row + 1] - t[row + 2]) / (t[row] - t[row + 2])
        against[row, row + 2] = -(t[row + 1] - t[row]) / (t[row + 2] - t[row])
    variance_of_unit_noise = np.diag(against @ against.T)
    return float(np.sqrt(np.mean((against @ z) ** 2 / variance_of_unit_noise)))


def drift(name, displacement, temperatures):
    table = rows(name)
    t, z = (np.array([float(row[key]) for row in table]) for key in ("time_s", displacement))
    z = z - z[0]
    last = t >= t[-1] - 3600
    figures = {
        "after_1_h": float(np.interp(t[0] + 3600, t, z)),
        "after_3_h": float(np.interp(t[0] + 10800, t, z)),
        "range": float(np.ptp(z)),
        "rate_per_h": float(np.polyfit(t[last] - t[-1], z[last], 1)[0] * 3600),
        "scatter": scatter(t, z),
    }
    for name_of in temperatures:
        degc = np.array([float(row[name_of]) for row in table])
        figures[f"{name_of}_range_k"] = float(np.ptp(degc))
    return figures


LASER = {"delimiter": ";", "decimal": ","}
print(
    json.dumps(
        {
            "drift": drift("drift.csv", "z_um", ("spindle", "ambient")),
            "rotary": positioning(by_side(rows("rotary.csv"), "target_deg", "deviation_arcsec", wrap=360.0)),
            "steps": periodic(by_side(rows("steps.csv"), "target_mm", "deviation_um"), 10.0, 3),
            "positioning": positioning(by_side(rows("positioning.csv", **LASER), "target mm", "deviation um")),
        },
        indent=2,
    )
)
