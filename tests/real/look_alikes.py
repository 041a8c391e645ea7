"""Makes the look-alikes: recordings like those of workshops, whose right answers are known.

Nothing here is a formula of the crates. Lead errors are sums of random waves with a kink, heat flows through lumped masses by
small steps of time, and stops have the time that the axis needs for them. Seeds are fixed.
Run: python look_alikes.py [FOLDER]   (numpy 2.4.6; FOLDER is `recordings` beside this file by default)
"""

import pathlib
import sys

import numpy as np

HERE = pathlib.Path(__file__).parent
FEED_MM_S = 100.0


def smooth(rng, places, shortest_share):
    """A lead error of any shape, largest value 1: random waves not shorter than a share of the travel."""
    s = (places - places.min()) / np.ptp(places)
    waves = rng.uniform(0.5, 1.0 / shortest_share, 6)
    sizes = rng.normal(size=6) / waves
    curve = sum(a * np.sin(2 * np.pi * w * s + rng.uniform(0, 2 * np.pi)) for a, w in zip(sizes, waves))
    curve = curve + rng.normal() * s
    return (curve - curve.mean()) / np.abs(curve - curve.mean()).max()


def stops(targets, runs, dwell_s):
    """(run, way, index, time s) of an axis that goes up and down, with the time that it needs."""
    at, time, found = targets[0] - 5.0, 0.0, []
    for run in range(runs):
        for way in ("up", "down"):
            places = range(len(targets)) if way == "up" else range(len(targets) - 1, -1, -1)
            for k in places:
                time += abs(targets[k] - at) / FEED_MM_S + dwell_s
                at = targets[k]
                found.append((run, way, k, time))
            time += 10.0 / FEED_MM_S
    return found


def positioning(rng, targets, lead_um, play_um, noise_um, runs=5, rate_um_min=0.0, dwell_s=10.0):
    """Readings (run, way, target, deviation) of a laser; half of the play on each side."""
    rows = []
    for run, way, k, time in stops(targets, runs, dwell_s):
        side = -0.5 if way == "up" else 0.5
        deviation = lead_um[k] + side * play_um[k] + rate_um_min * time / 60.0 + noise_um * rng.normal()
        rows.append((run + 1, way, targets[k], round(deviation, 2)))
    return rows


def write(folder, name, table, head, rows, comment):
    path = folder / name / table
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = [f"# {comment}", head, *rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_rows(folder, name, rows, comment, target="{:.3f}", number=lambda k, row: row[0]):
    lines = [f"{number(k, r)},{r[1]},{target.format(r[2])},{r[3]:.2f}" for k, r in enumerate(rows)]
    write(folder, name, "laser_X.csv", "run,direction,target_mm,deviation_um", lines, comment)


def uneven(rng, low, high, n, share=0.12):
    """Targets that avoid one phase of a period, as ISO 230-2 asks."""
    spacing = (high - low) / (n - 1)
    inner = low + spacing * np.arange(1, n - 1) + share * spacing * rng.uniform(-1, 1, n - 2)
    return np.round(np.concatenate([[low], inner, [high]]), 3)


def axes(folder):
    rng = np.random.default_rng(3201)
    targets = uneven(rng, -300.0, 300.0, 9)
    lead = 50.0 * smooth(rng, targets, 0.3)
    play = np.interp(targets, [-300, -60, 120, 300], [16.0, 22.0, 34.0, 28.0])
    rows = positioning(rng, targets, lead, play, 0.5, rate_um_min=-0.2)
    write_rows(folder, "real_axis", rows, "lead error within 50 um, lost motion 16 to 34 um (mean 25), drift -0.2 um/min, noise 0.5 um")

    rng = np.random.default_rng(3202)
    targets = np.array([0.0, 5.0, 10.0, 15.0, 20.0])
    rows = positioning(rng, targets, np.array([-1.9, 0.4, 2.1, 1.2, -1.1]), np.full(5, 1.6), 0.12)
    write_rows(folder, "short_screw", rows, "lead error of 4 um, lost motion 1.6 um, noise 0.12 um; screw of 2 mm lead")

    for k, seed in enumerate((3203, 3213, 3223)):
        rng = np.random.default_rng(seed)
        targets = uneven(rng, -280.0, 280.0, 13)
        size = (6.0, 12.0, 25.0)[k]
        rows = positioning(rng, targets, size * smooth(rng, targets, 0.4), np.full(13, 4.0), 0.25)
        name = f"smooth_13_{'abc'[k]}"
        write_rows(folder, name, rows, f"smooth lead error within {size} um, lost motion 4 um, noise 0.25 um")

    rng = np.random.default_rng(3204)
    targets = uneven(rng, -300.0, 300.0, 11)
    rows = positioning(rng, targets, 90.0 * smooth(rng, targets, 0.5), np.full(11, 8.0), 0.4)
    write_rows(folder, "lead_90", rows, "lead error within 90 um, lost motion 8 um, noise 0.4 um")


def forms(folder):
    """One axis in the forms that tables have: all from the same readings."""
    rng = np.random.default_rng(3205)
    targets = uneven(rng, -250.0, 250.0, 11)
    lead = 10.0 * smooth(rng, targets, 0.4)
    rows = positioning(rng, targets, lead, np.full(11, 5.0), 0.3)
    truth = "smooth lead error within 10 um, lost motion 5 um, noise 0.3 um"
    passes = [0]
    for before, row in zip(rows, rows[1:]):
        passes.append(passes[-1] + (before[1] != row[1]))
    write_rows(folder, "passes_as_runs", rows, truth, number=lambda k, row: passes[k] + 1)
    write_rows(folder, "one_way", [r for r in rows if r[1] == "up"], truth)
    write_rows(folder, "one_run", [r for r in rows if r[0] == 1], truth)
    listed = sorted((r for r in rows if r[0] == 1), key=lambda r: (r[2], r[1]))
    write_rows(folder, "one_run_listed", listed, truth + "; sorted by target, down before up")
    by_target = [r for t in targets for run in range(1, 6) for way in ("up", "down") for r in rows if r[:3] == (run, way, t)]
    write_rows(folder, "step_cycle", by_target, truth + "; each target five times from both sides before the next")
    read = {(r[0], r[1], r[2]): r[3] for r in rows}
    ways = [(run, way) for run in range(1, 6) for way in ("up", "down")]
    head = ";".join(["Position [mm]", *[f"Run {run} {'↑' if way == 'up' else '↓'} [µm]" for run, way in ways]])
    lines = [";".join([f"{t:.3f}", *[f"{read[(*w, t)]:.2f}" for w in ways]]).replace(".", ",") for t in targets]
    write(folder, "wide_table", "laser_X.csv", head, lines, truth)


def rotary(folder):
    rng = np.random.default_rng(3206)
    targets = np.arange(0.0, 331.0, 30.0)
    turn = np.radians(targets)
    lead = 5.0 * np.sin(turn + 0.7) + 2.0 * np.cos(2 * turn - 0.3)
    rows = positioning(rng, targets, lead - lead[0], np.full(12, 8.0), 0.6)
    lines = [f"{r[0]},{r[1]},{r[2]:.0f},{r[3]:.2f}" for r in rows]
    comment = "eccentricity 5 arcsec, second harmonic 2 arcsec, lost motion 8 arcsec, noise 0.6 arcsec"
    head = "run,direction,target_deg,deviation_arcsec"
    write(folder, "rotary_table", "collimator_C.csv", head, lines, comment)
    write(folder, "rotary_one_run", "collimator_C.csv", head, [line for line in lines if line.startswith("1,")], comment)
    write(folder, "rotary_one_way", "collimator_C.csv", head, [line for line in lines if line.startswith("1,up")], comment)


def circles(folder):
    rng = np.random.default_rng(3207)
    angles, rows, centre = np.arange(0, 361, 3), [], 0.0
    for run in range(1, 9):
        if run in (4, 7):
            centre += 5.0
        ways = angles if run % 2 else angles[::-1]
        for angle in ways:
            turn = np.radians(angle)
            # 15 urad less than a right angle over 100 mm.
            radial = centre * np.cos(turn) + 0.75 * np.sin(2 * turn) + 0.3 * rng.normal()
            rows.append(f"{run},{angle},{radial:.2f}")
    comment = "the clamp of the plate slips by 5 um along X before run 4 and before run 7; squareness 15 urad, noise 0.3 um"
    write(folder, "slipped_clamp", "ballbar_XY.csv", "run,angle_deg,radial_um", rows, comment)


def masses(power, room, capacity, conductance, start, step_s, every):
    """Temperatures of a chain of masses (spindle, then housing, then column): heat goes into the first, each loses to the room.

    `conductance[k]` leads from mass k to the next, the last row to the room. Explicit steps of `step_s`; each `every`-th is kept.
    """
    heat, kept = np.array(start, dtype=float), []
    to_next, to_room = conductance
    for k, (watt, air) in enumerate(zip(power, room)):
        if k % every == 0:
            kept.append(heat.copy())
        flow = np.array(to_next) * (heat[:-1] - heat[1:])
        gain = -np.array(to_room) * (heat - air)
        gain[0] += watt
        gain[:-1] -= flow
        gain[1:] += flow
        heat = heat + step_s * gain / np.array(capacity)
    return np.array(kept)


def delayed(values, lag_s, step_s):
    """A mass that follows its neighbour: small steps of its heat balance, beginning settled."""
    heat, found = values[0], []
    for value in values:
        found.append(heat)
        heat += (value - heat) * step_s / lag_s
    return np.array(found)


def environment(folder):
    rng = np.random.default_rng(3208)
    step, hours = 5.0, 24
    time = np.arange(0, hours * 3600 + 1, step)
    room = 20.5 + 1.2 * np.sin(2 * np.pi * (time / 86400 - 0.3)) + 0.25 * np.sign(np.sin(2 * np.pi * time / 2400))
    frame = delayed(room, 2.5 * 3600, step)
    rows = []
    for k in range(0, len(time), 48):
        x = 1.8 * (frame[k] - frame[0]) + 0.08 * rng.normal()
        rows.append(f"{time[k]:.0f},{x:.3f},{room[k] + 0.02 * rng.normal():.2f}")
    comment = "ETVE of a day: X goes by 1.8 um/K with a frame that follows the room by 150 min; noise 0.08 um"
    write(folder, "etve_day", "etve_X.csv", "time_s,x_um,room", rows, comment)


def two_thermometers(folder):
    rng = np.random.default_rng(3209)
    step, rows = 2.0, []
    for run in range(3):
        time = np.arange(0, 6 * 3600, step)
        cycle = np.where((time // 2700) % 4 < 3, 1.0, 0.35)
        rear = masses(180.0 * cycle, np.full(time.size, 20.0 + 0.4 * run), [9000, 30000], ([9.0], [1.0, 5.0]), [20.0 + 0.4 * run] * 2, step, 1)[:, 0]
        # The front bearing has a jacket with a thermostat: it settles early and swings.
        front = 22.0 + 6.0 * (1 - np.exp(-time / 1500.0)) + 0.5 * np.sin(2 * np.pi * time / 1900.0)
        nose = delayed(rear, 45 * 60, step)
        for k in range(0, time.size, 60):
            z = 1.2 * (nose[k] - 20.0) + 0.15 * rng.normal()
            rows.append(f"{run + 1},{run * 86400 + time[k]:.0f},{z:.3f},{front[k] + 0.02 * rng.normal():.2f},{rear[k] + 0.02 * rng.normal():.2f}")
    comment = "growth 1.2 um/K of the rear bearing, lagged by 45 min; the front bearing has a thermostat; noise 0.15 um"
    write(folder, "lagged_rear_bearing", "growth_Z.csv", "run,time_s,growth_um,front,rear", rows, comment)


def mornings(folder):
    rng = np.random.default_rng(3210)
    step, rows = 2.0, []
    for run, room in enumerate((19.2, 20.1, 18.6, 19.8, 20.4)):
        time = np.arange(0, 2 * 3600, step)
        heat = masses(np.full(time.size, 55.0), np.full(time.size, room), [15000, 60000], ([4.0], [1.5, 6.0]), [room] * 2, step, 1)[:, 0]
        nose = delayed(heat, 20 * 60, step)
        for k in range(0, time.size, 30):
            z = -3.0 * (nose[k] - 19.2) + 0.1 * rng.normal()
            rows.append(f"{run + 1},{run * 86400 + time[k]:.0f},{z:.3f},{heat[k] + 0.02 * rng.normal():.2f}")
    comment = "-30 um per 10 K of the spindle, lagged by 20 min; five mornings of two hours, nights not recorded, each begins settled; noise 0.1 um"
    write(folder, "five_mornings", "mornings_Z.csv", "run,time_s,z_um,spindle", rows, comment)


def back_to_back(folder):
    rng = np.random.default_rng(3211)
    step, cycle_s, runs = 2.0, 90 * 60, 6
    time = np.arange(0, runs * cycle_s, step)
    power = np.where(time % cycle_s < cycle_s / 2, 160.0, 0.0)
    heat = masses(power, np.full(time.size, 20.0), [6000, 14000], ([12.0], [4.0, 10.0]), [20.0, 20.0], step, 1)[:, 1]
    rows = []
    for k in range(0, time.size, 30):
        z = -2.5 * (heat[k] - heat[0]) + 0.3 * rng.normal()
        rows.append(f"{int(time[k] // cycle_s) + 1},{time[k]:.0f},{z:.3f},{heat[k] + 0.01 * rng.normal():.3f}")
    comment = "-2.5 um/K of the column; six cycles of 45 min warm and 45 min cooling, one after another; noise 0.3 um"
    write(folder, "warm_ups_back_to_back", "cycles_Z.csv", "run,time_s,z_um,column", rows, comment)


def main():
    folder = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "recordings"
    for make in (axes, forms, rotary, circles, environment, two_thermometers, mornings, back_to_back):
        make(folder)


if __name__ == "__main__":
    main()
