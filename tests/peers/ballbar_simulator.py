"""Simulates a ballbar on an XY table and writes the table of its readings.

    ballbar_simulator.py TABLE.csv RADIUS_MM REPEATS DEGREES_PER_READING PLAY_UM NOISE_UM

A simulator that shares nothing with the crates: slides follow their commands along the path through a dead band,
screws have a lead error and a wrong pitch, the guides are off square, and the ballbar reads the distance of the tip from
the centre. Each repeat is a circle counter-clockwise and one clockwise. With PLAY_UM = 0 the screw of X has no play;
NOISE_UM scatters readings, and by 0.7 of it the third and fourth harmonic of each run (normal, seed 20261127).

Columns: run, angle_deg from X towards Y, radial_um outwards. Errors are of the tip relative to the table.
"""

from __future__ import annotations

import math
import random
import sys

LEAD_ERROR_UM, LEAD_PERIOD_MM = 6.0, 260.0
PITCH_Y_UM_PER_M = 15.0
SQUARENESS_URAD = 20.0
# Steps of the path within a degree, and the way before the first reading, deg.
STEPS, AHEAD_DEG = 4, 90


class Slide:
    """A slide behind a nut with play, mm."""

    def __init__(self, play_um: float) -> None:
        self.half_mm = 0.5e-3 * play_um
        self.at_mm = None

    def follow(self, command_mm: float) -> float:
        """Where it is once the nut is at a command."""
        if self.at_mm is None:
            self.at_mm = command_mm
        low, high = command_mm - self.half_mm, command_mm + self.half_mm
        self.at_mm = min(max(self.at_mm, low), high)
        return self.at_mm


def tip_mm(x_mm: float, y_mm: float) -> tuple[float, float]:
    """The tip above a table whose slides are at x and y."""
    lead_um = LEAD_ERROR_UM * math.sin(2.0 * math.pi * x_mm / LEAD_PERIOD_MM)
    pitch_um = 1e-3 * PITCH_Y_UM_PER_M * y_mm
    lean_um = 1e-3 * SQUARENESS_URAD * y_mm
    return x_mm + 1e-3 * (lead_um + lean_um), y_mm + 1e-3 * pitch_um


def circle(sense: int, radius_mm: float, degrees: int, play_um: float) -> list[tuple[int, float]]:
    """Angles in degrees and readings in micrometres of one turn from the X axis."""
    x, y = Slide(play_um), Slide(0.0)
    read = []
    for step in range(-AHEAD_DEG * STEPS, 360 * STEPS + 1):
        angle = math.radians(sense * step / STEPS)
        at_mm = x.follow(radius_mm * math.cos(angle)), y.follow(radius_mm * math.sin(angle))
        if step >= 0 and step % (degrees * STEPS) == 0:
            length_mm = math.hypot(*tip_mm(*at_mm))
            read.append((sense * step // STEPS, 1e3 * (length_mm - radius_mm)))
    return read


def main() -> None:
    """Writes the table."""
    path, *numbers = sys.argv[1:]
    radius_mm, repeats, degrees, play_um, noise_um = map(float, numbers)
    normal = random.Random(20261127)
    with open(path, "w", encoding="utf-8") as table:
        table.write("run,angle_deg,radial_um\n")
        for run in range(2 * int(repeats)):
            own = [normal.gauss(0.0, 0.7 * noise_um) for _ in range(4)]
            for angle_deg, radial_um in circle(1 - 2 * (run % 2), radius_mm, int(degrees), play_um):
                angle = math.radians(angle_deg)
                waves = math.cos(3 * angle), math.sin(3 * angle), math.cos(4 * angle), math.sin(4 * angle)
                radial_um += sum(size * wave for size, wave in zip(own, waves))
                radial_um += normal.gauss(0.0, noise_um)
                table.write(f"{run + 1},{angle_deg},{radial_um:.4f}\n")


main()
