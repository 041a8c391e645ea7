"""Evaluates the lists of touches of tests/import by ISO 230-10 with numpy and writes the figures as JSON.

Shares nothing with the crates: the least-squares centre is found by a search that halves its steps (pattern search over the centre,
with the mean distance as radius), in place of derivatives. Lengths are in mm.
Run in this folder: python touches.py > touches.json   (numpy 2.4.6)
"""

import json
import pathlib
import re

import numpy as np

TABLES = pathlib.Path(__file__).parent.parent / "import"


def fitted(points):
    """Least-squares centre, diameter and form error of points (rows) of a circle or a sphere."""
    distances = lambda centre: np.linalg.norm(points - centre, axis=1)
    loss = lambda centre: np.sum((distances(centre) - distances(centre).mean()) ** 2)
    centre, step = points.mean(axis=0), 10.0
    best = loss(centre)
    steps = np.vstack([np.eye(points.shape[1]), -np.eye(points.shape[1])])
    while step > 1e-11:
        tried = [centre + step * way for way in steps]
        losses = [loss(one) for one in tried]
        if min(losses) < best:
            centre, best = tried[int(np.argmin(losses))], min(losses)
        else:
            step /= 2.0
    found = distances(centre)
    return {"centre": centre.tolist(), "diameter": 2.0 * found.mean(), "form": float(np.ptp(found))}


def location(centres):
    return np.ptp(np.array(centres), axis=0).tolist()


def spheres():
    lines = (TABLES / "touches.csv").read_text(encoding="utf-8").splitlines()[2:]
    rows = [line.split(",") for line in lines]
    runs = {}
    for run, _, *place in rows:
        runs.setdefault(run, []).append([float(cell) for cell in place])
    found = [fitted(np.array(points)) for points in runs.values()]
    return {"runs": found, "location": location([one["centre"] for one in found])}


def linuxcnc():
    points = np.loadtxt(TABLES / "touches_linuxcnc.txt")[:, :3]
    found = [fitted(part) for part in np.split(points, 3)]
    return {"runs": found, "location": location([one["centre"] for one in found])}


def bore():
    text = (TABLES / "touches_dprnt.txt").read_text(encoding="utf-8")
    points = 25.4 * np.array([[float(x), float(z)] for x, z in re.findall(r"X(\S+) Y\S+ Z(\S+)", text)])
    return {"runs": [fitted(points)]}


def place():
    text = (TABLES / "touches_place.txt").read_text(encoding="utf-8")
    heights = np.array([float(z.replace(",", ".")) for z in re.findall(r"Z = (\S+)", text)])
    slope = np.polyfit(np.arange(len(heights)), heights, 1)[0]
    return {"range": float(np.ptp(heights)), "s": float(heights.std(ddof=1)), "drift": float(slope * (len(heights) - 1))}


print(json.dumps({"spheres": spheres(), "linuxcnc": linuxcnc(), "bore": bore(), "place": place()}, indent=1))
