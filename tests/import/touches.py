"""Writes lists of touches as controls write them. Made: no machine was measured.

A ball of 25 mm (radius 12.5 mm) is touched with a stylus ball of 3 mm. The positions come from a search along the approach for the
place where the ball of the stylus meets a body that is described by its surface heights (three lobes, a little pretravel that depends
on the direction of the approach in steps of 120 degrees) plus noise: no fit of spheres or circles, and no formula of the crates.
Run in this folder: python touches.py   (numpy 2.4.6)
"""

import pathlib

import numpy as np

HERE = pathlib.Path(__file__).parent
RNG = np.random.default_rng(20260301)
BALL_MM, TIP_MM = 12.5, 1.5


def pretravel_mm(direction):
    """A stylus that bends less above each of three supports: by the angle round the spindle."""
    angle = np.degrees(np.arctan2(direction[1], direction[0])) % 120.0
    lateral = np.hypot(direction[0], direction[1])
    return lateral * (0.0030 + 0.0025 * abs(angle - 60.0) / 60.0) + (1.0 - lateral) * 0.0008


def met(centre, direction, surface_mm):
    """Goes along the approach in ever smaller steps until the distance from the centre is that of the surface and the tip."""
    far, step = 40.0, 1.0
    while step > 1e-9:
        while np.linalg.norm((far - step) * direction) > surface_mm + TIP_MM:
            far -= step
        step /= 2.0
    return centre + (far - step - pretravel_mm(direction)) * direction


def touch(centre, direction):
    angle = np.arctan2(direction[1], direction[0])
    surface_mm = BALL_MM + 0.0004 * np.cos(3.0 * angle) * np.hypot(direction[0], direction[1])
    noise = RNG.normal(0.0, 0.00025, 3)
    return met(np.asarray(centre), direction, surface_mm) + noise


def directions():
    """25 approaches: the pole, and 4, 8 and 12 round the ball at 22.5, 45 and 90 degrees from it."""
    yield np.array([0.0, 0.0, 1.0])
    for n, tilt in ((4, 22.5), (8, 45.0), (12, 90.0)):
        for k in range(n):
            turn = 2.0 * np.pi * k / n + np.radians(tilt)
            tip = np.radians(tilt)
            yield np.array([np.sin(tip) * np.cos(turn), np.sin(tip) * np.sin(turn), np.cos(tip)])


def spheres(n, drift_mm):
    for k in range(n):
        for direction in directions():
            yield k + 1, touch(np.array([210.0, -85.0, -142.0]) + k * np.asarray(drift_mm), direction)


def write(name, lines):
    (HERE / name).write_text("\n".join(lines) + "\n", encoding="utf-8")


def main():
    made = "# made by touches.py: no machine was measured"
    rows = [f"{run},sphere 25,{p[0]:.4f},{p[1]:.4f},{p[2]:.4f}" for run, p in spheres(5, (0.0006, -0.0003, 0.0011))]
    write("touches.csv", [made, "run,feature,x_mm,y_mm,z_mm", *rows])
    # LinuxCNC: nine numbers with six decimals, no header, rounds one after another.
    zeros = " 0.000000" * 6
    rows = [f"{p[0]:.6f} {p[1]:.6f} {p[2]:.6f}{zeros}" for _, p in spheres(3, (0.001, 0.0, 0.0005))]
    write("touches_linuxcnc.txt", rows)
    # DPRNT, inch: a bore in Z-X, 36 touches.
    rows = []
    for k in range(36):
        turn = np.radians(10.0 * k)
        way = np.array([np.cos(turn), 0.0, np.sin(turn)])
        radius_mm = 20.0 - TIP_MM + 0.002 * np.cos(2.0 * turn) + RNG.normal(0.0, 0.0002)
        p = np.array([50.8, -12.7, 25.4]) + radius_mm * way
        rows.append(f"X{p[0] / 25.4:.5f} Y{p[1] / 25.4:.5f} Z{p[2] / 25.4:.5f}")
    write("touches_dprnt.txt", ["%", "BORE 1", *rows, "%"])
    # One place touched again and again, FN 16 with decimal commas: 10 touches that drift.
    rows = [f"X = 120,000; Y = -40,000; Z = {-55.0 + 0.0004 * k + RNG.normal(0.0, 0.0006):.4f}".replace(".", ",") for k in range(10)]
    write("touches_place.txt", rows)


if __name__ == "__main__":
    main()
