"""How often U (k = 2) holds the truth, from numpy alone: circles, diagonals, thermal drift.

    coverage_of_circles.py [MACHINES]

Machines, figures by the words of ISO 230-3, -4 and -6, and their U are made here and in coverage_of_u.py; nothing of the
product is used. The truth is what an exact instrument would have shown of the same runs. Of E_d, B_d and thermal
drift beside an artefact that is read, k is that of their distribution, here from samples of it. Certificates hold what k = 2
promises: errors are normal, and between two places L apart (of a plate: at L from its centre) have u = (U0 + U1 L)/2.

Printed with numpy 2.4.6 for 4000 machines, in % (two standard deviations are 0.7 at 95 %, 0.3 at 99 %):

    circle     G 95.7  F max 96.9  F min 96.0  G(b) 93.9  D 97.0  H 95.9  G ccw 95.5  F max ccw 96.5
      with all of the certificate  G 95.0  F max 98.0  F min 97.4  G(b) 93.0  D 98.1  H 93.2  G ccw 94.8  F max ccw 98.0
    diagonals  E_d 96.5  B_d 95.9  spread 95.7  lengths 96.6, with k = 2  E_d 97.5  B_d 97.4
    thermal    d 94.8  range 93.1  rate 98.8, with the period of the instrument's error  rate 95.3
               with that and the range of an artefact's temperature  d 99.7  range 98.2  rate 99.9
               with that and an artefact that is read  d 96.2  range 95.8  rate 96.0
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from coverage_of_u import RUNS, TAU, Held, body, certified, drifting, of_reversal, print_shares, screw, watch

DIAGONALS = ((1, 1, 1), (-1, 1, 1), (1, -1, 1), (1, 1, -1))


def shares() -> tuple[list[float], list[float]]:
    """What a circle's fitted centre and radius take of waves over a plate, and all, centre, radius of steps along its axes.

    Waves of any length up to the diameter: mean of J0^2 + J2^2 and of J1^2 of the circumference in waves.
    """
    turn = TAU * (np.arange(1200) + 0.5) / 1200
    argument = np.minimum(np.pi / ((np.arange(1000) + 0.5) / 1000), 500)
    j0, j1, j2 = (np.cos(n * turn - argument[:, None] * np.sin(turn)).mean(axis=1) for n in range(3))
    cov = np.zeros((1200, 1200))
    for axis in (np.cos(turn), np.sin(turn)):
        same = np.outer(axis, axis) > 0
        cov += np.where(same, np.minimum(abs(axis)[:, None], abs(axis)), 0) * np.outer(axis, axis)
    centre = 2 * np.stack([np.cos(turn), np.sin(turn)]) / len(turn)
    shift = np.trace(centre @ cov @ centre.T) / 2
    return [(j0**2 + j2**2).mean(), (j1**2).mean()], [np.trace(cov) / len(turn), shift, cov.mean()]


def circle_path(rng: np.random.Generator) -> Callable[[np.ndarray, int], np.ndarray]:
    """Settled radial deviation (um) at an angle in a sense: lobes, contraction, mismatch, reversals and their spikes."""
    lobes = [(0.8 * rng.normal(), rng.uniform(0, TAU)) for _ in range(5)]
    contraction, mismatch, spike = rng.uniform(-6, 1), rng.normal(), rng.uniform(0, 5)
    play = rng.uniform(-0.5, 4, 2)

    def deviation(angle: np.ndarray, sense: int) -> np.ndarray:
        behind = np.mod(sense * angle, TAU / 4)
        shape = sum(a * np.cos(n * angle + p) for n, (a, p) in enumerate(lobes, 2))
        lag = play[0] * np.sign(np.sin(angle)) * np.cos(angle) - play[1] * np.sign(np.cos(angle)) * np.sin(angle)
        uneven = mismatch * np.sin(2 * angle)
        return shape + contraction + sense * (uneven + lag / 2) + spike * np.exp(-behind / 0.05)

    return deviation


def circle_figures(turn: np.ndarray, ccw: np.ndarray, cw: np.ndarray) -> dict[str, float]:
    """ISO 230-4 in the first order of the deviations, both senses in one frame; F counts from the programmed radius."""

    def centred(angle: np.ndarray, r: np.ndarray) -> np.ndarray:
        u, v = 2 * (r * np.cos(angle)).mean(), 2 * (r * np.sin(angle)).mean()
        return r - u * np.cos(angle) - v * np.sin(angle)

    both = centred(np.r_[turn, turn], np.r_[ccw, cw])
    return {
        "G": np.ptp(centred(turn, cw)),
        "F max": both[len(turn) :].max(),
        "F min": both[len(turn) :].min(),
        "G(b)": np.ptp(both),
        "D": both.mean(),
        "H": abs(cw - ccw).max(),
        "G ccw": np.ptp(centred(turn, ccw)),
        "F max ccw": both[: len(turn)].max(),
    }


def plate(rng: np.random.Generator, constant: float, by_length: float, radius: float) -> Callable[..., np.ndarray]:
    """Error (um) along one axis of a plate without its scale's: waves over the plate, and steps along the axis."""
    lengths, sizes = rng.uniform(15, 120, 2), constant / 2 / np.sqrt(2) * rng.normal(size=(2, 2))
    grid = np.linspace(0, 1.01 * radius, 201)
    sides = np.sqrt(constant * by_length / 2 * grid[1]) * rng.normal(size=(2, 200))
    sides = np.c_[np.zeros(2), np.cumsum(sides, axis=1)]

    def error(at: list[np.ndarray], along: np.ndarray) -> np.ndarray:
        waves = sum(
            a * np.cos(TAU * x / length) + b * np.sin(TAU * x / length) for x, length, (a, b) in zip(at, lengths, sizes)
        )
        steps = [np.interp(abs(along), grid, side) for side in sides]
        return waves + np.where(along < 0, steps[1], steps[0])

    return error


def circle(rng: np.random.Generator, whole: bool = False) -> Held:
    """ISO 230-4 of a settled circle over a plate at 20 degC, um and mm.

    `whole`: every part of the certificate counts in full at R, the constant half in D, and unrest not at all in H.
    """
    path, radius, shop = circle_path(rng), rng.uniform(50, 150), rng.uniform(-3, 7)
    bodies = body(rng, shop, 1, 0.011), body(rng, shop, 0.5, 0.008)
    constant, by_length, size = rng.uniform(0.2, 0.8), rng.uniform(1, 4) * 1e-3, rng.uniform(0.05, 0.5)
    errors = [plate(rng, constant, by_length, radius) for _ in range(2)]
    drifts = [drifting(rng, size) for _ in range(2)]
    rest, unrest = np.max([watch(drift) for drift in drifts], axis=0)
    slope = by_length / 2 * rng.normal() + bodies[0]["growth"] - bodies[1]["growth"]
    slope -= bodies[0]["alpha"] * bodies[0]["warm"] - bodies[1]["alpha"] * bodies[1]["warm"]
    n = 400
    turn = TAU * (np.arange(n) + 0.5) / n
    truth, read = [], []
    for leg, sense in enumerate((1, -1)):
        angle = sense * turn
        ways = np.cos(angle), np.sin(angle)
        at, time = [radius * way for way in ways], (leg + np.arange(n) / n) / 2
        off = [e(at, x) + d(time) + 0.025 * constant * rng.normal(size=n) for e, x, d in zip(errors, at, drifts)]
        moved = path(angle, sense)
        # Clockwise readings in the order of ascending angles.
        truth.append(moved[::sense])
        read.append((moved + slope * radius + ways[0] * off[0] + ways[1] * off[1])[::sense])
    right, found = circle_figures(turn, *truth), circle_figures(turn, *read)
    local, steps, scale = constant**2 / 4, constant * by_length * radius / 2, (by_length * radius) ** 2 / 4
    (shift, mean), (every, step_shift, step_mean) = SHARES
    of_r = (1 - shift) * local + (every - step_shift) * steps + scale
    of_m = mean * local + step_mean * steps + scale
    of_g = (1 - shift - mean) * local + (every - step_shift - step_mean) * steps
    lift = 4 * unrest**2 * np.log(n) / 3
    if whole:
        of_r, of_m, of_g, lift = local + steps + scale, (constant / 2 + by_length * radius) ** 2 / 4, local, 0.0
    heat = sum((b["alpha"] * radius * b["half_width"]) ** 2 + (b["warm"] * radius * b["half_alpha"]) ** 2 for b in bodies)
    drift = rest**2 / 12
    of = {"G": 2 * (of_g + drift), "F": of_r + drift + heat / 3, "D": of_m + drift / 4 + heat / 3, "H": 2 * drift + lift}
    return {k: abs(found[k] - right[k]) <= 2 * np.sqrt(of[k[0]]) for k in right}


def circle_whole(rng: np.random.Generator) -> Held:
    """The same with all of the certificate at every radius."""
    return circle(rng, whole=True)


def diagonals(rng: np.random.Generator) -> Held:
    """ISO 230-6, each diagonal with the same drift from its zero on, um and mm."""
    m, travels, lean = 7, rng.uniform(250, 800, 3), 0.015 * rng.normal(size=3)
    screws = [screw(rng, travel) for travel in travels]
    shop, alpha = rng.uniform(-3, 7), rng.choice([0.008, 0.011, 0.0115])
    drift = drifting(rng, rng.uniform(0.1, 0.8))
    rest, unrest = watch(drift)
    constant, by_length = rng.uniform(0.1, 0.5), rng.uniform(0.3, 2) * 1e-3
    bodies = body(rng, shop, 1, alpha), body(rng, shop, 0.5, rng.choice([0, 0.0115]))
    scatter, aside, z = rng.uniform(0.05, 0.6), 1e3 * rng.uniform(0, 0.3), rng.normal()
    length = np.linalg.norm(travels)
    share, weight = np.arange(m) / (m - 1), travels / length
    far = share * length
    taken_out = bodies[0]["alpha"] * bodies[0]["warm"] - bodies[1]["alpha"] * bodies[1]["warm"]
    truth, read = np.zeros((2, 4, 2, m))
    for q, signs in enumerate(DIAGONALS):
        place = [travels[a] * (share if signs[a] > 0 else 1 - share) for a in range(3)]
        turned = sum(signs[a] * weight[a] * lean[i] * place[b] for i, (a, b) in enumerate(((0, 1), (0, 2), (1, 2))))
        along = [
            turned + sum(signs[a] * weight[a] * screws[a](place[a], signs[a] * side) for a in range(3)) for side in (1, -1)
        ]
        beam = -((aside * rng.uniform(0, 1)) ** 2) / 2e3 / length**2
        slope = by_length / 2 * z + bodies[0]["growth"] - bodies[1]["growth"] - taken_out + beam
        off = slope * far + certified(rng, far, constant, by_length)
        for run in range(RUNS):
            for leg in range(2):
                order = np.arange(m)[:: 1 - 2 * leg]
                time = np.empty(m)
                time[order] = ((2 * run + leg) * m + np.arange(m)) / (2 * RUNS * m)
                moved = along[leg] - along[0][0] + scatter * rng.normal(size=m)
                truth[q, leg] += moved / RUNS
                read[q, leg] += (moved + off + drift(time)) / RUNS
    return of_diagonals(truth, read, far, (constant, by_length, aside, rest / 2 / np.sqrt(3), unrest), bodies)


def of_diagonals(truth: np.ndarray, read: np.ndarray, far: np.ndarray, known: tuple, bodies: tuple) -> Held:
    """E_d, B_d, the spread of means by diagonal, side and target, and the range of lengths; `known`: both parts, beam, drift and unrest."""
    constant, by_length, aside, u_drift, unrest = known

    def figures_of(means: np.ndarray) -> tuple[float, float, float, float]:
        lengths = means.mean(axis=1)[:, -1] - means.mean(axis=1)[:, 0]
        of_each = np.ptp(means, axis=(1, 2)).max(), abs(means[:, 0] - means[:, 1]).max()
        return *of_each, float(np.ptp(means)), float(np.ptp(lengths))

    def heat(apart: float) -> float:
        return sum((b["alpha"] * apart * b["half_width"]) ** 2 + (b["warm"] * apart * b["half_alpha"]) ** 2 for b in bodies)

    longest = read[np.ptp(read, axis=(1, 2)).argmax()]
    apart = abs(far[longest.argmax() % len(far)] - far[longest.argmin() % len(far)])
    ends = far[read.argmax() % len(far)], far[read.argmin() % len(far)]
    beam = aside**2 / 4e3 / far[-1] ** 2
    drift = 2 / RUNS * u_drift**2
    new = 2 * constant**2 + 2 * constant * by_length * (ends[0] + ends[1])
    split = (new + (by_length * (ends[0] - ends[1])) ** 2) / 4
    of_e = ((constant + by_length * apart) / 2) ** 2 + (heat(apart) + (beam * apart) ** 2) / 3 + drift
    of_split = split + (heat(ends[0] - ends[1]) + beam**2 * (ends[0] ** 2 + ends[1] ** 2)) / 3 + 2 * drift
    of_one = ((constant + by_length * abs(ends[0] - ends[1])) / 2) ** 2 + drift
    of_one += (heat(ends[0] - ends[1]) + (beam * (ends[0] - ends[1])) ** 2) / 3
    one_line = read.argmax() // read[0].size == read.argmin() // read[0].size
    of_spread = of_one if one_line else of_split
    of_lengths = (2 * constant**2 + 4 * constant * by_length * far[-1]) / 4
    of_lengths += 2 * (beam * far[-1]) ** 2 / 3 + drift
    of_b, slow = of_reversal(u_drift, unrest), (2 * u_drift / RUNS) ** 2
    variances = of_e, of_b, of_spread, of_lengths
    every = list(zip(("E_d", "B_d", "spread", "lengths"), figures_of(read), figures_of(truth), variances))
    hot = [(b["alpha"] * apart * b["half_width"], b["warm"] * apart * b["half_alpha"]) for b in bodies]
    e_limits = np.array([*hot[0], *hot[1], beam * apart]) / np.sqrt(3)
    factors = {"E_d": factor(of_e, e_limits), "B_d": factor(of_b, np.array([np.sqrt(slow)])) if slow < of_b < 2 / RUNS * u_drift**2 else 2}
    held = {name: abs(found - right) <= factors.get(name, 2) * np.sqrt(variance) for name, found, right, variance in every}
    return held | {f"{name} k = 2": abs(found - right) <= 2 * np.sqrt(variance) for name, found, right, variance in every[:2]}


def factor(variance: float, limits: np.ndarray) -> float:
    """k that holds what 2 holds of a normal distribution: of a sum of this variance with limits of these standard deviations."""
    normal = max(variance - (limits**2).sum(), 0.0)
    both = np.sqrt(normal) * NORMAL + np.sqrt(3) * WITHIN[:, : len(limits)] @ limits
    return float(np.quantile(abs(both), 0.9545) / np.sqrt(variance))


def warming(rng: np.random.Generator, times: np.ndarray) -> np.ndarray:
    """Three hours of warming with two time constants, and the shop, um."""
    parts = [(8 * rng.normal(), rng.uniform(*of)) for of in ((300, 1800), (2400, 9000))]
    shop, period, phase = rng.uniform(0.2, 2), rng.uniform(1200, 20000), rng.uniform(0, TAU)
    return sum(a * (1 - np.exp(-times / tau)) for a, tau in parts) + shop * np.sin(TAU * times / period + phase)


def thermal(rng: np.random.Generator) -> Held:
    """ISO 230-3, um, s and K: without an artefact, as `abbe report` states it, with the range of its temperature, and with one that is read."""
    times = 60.0 * np.arange(181)
    u, artefact = rng.uniform(0.05, 0.3), 0.0115 * rng.uniform(100, 300) * rng.uniform(0.1, 1.5)
    tau, sign = rng.uniform(1200, 7200), rng.choice([-1, 1])
    warm = sign * (1 - np.exp(-times / tau)) / (1 - np.exp(-times[-1] / tau))
    truth, period = warming(rng, times), rng.uniform(3, 40)
    a, b = u * rng.normal(size=2)
    wave = TAU / period
    noise = 0.1 * u * rng.normal(size=len(times))
    growth, *known = mandrel(rng, times, warm)
    late = times[120:] - times[120:].mean()

    def by_sensor(moved: np.ndarray) -> np.ndarray:
        return moved + a * np.cos(wave * moved) + b * np.sin(wave * moved) + noise

    def slope(values: np.ndarray) -> float:
        return float(np.polyfit(late, values[120:], 1)[0])

    def of(values: np.ndarray) -> np.ndarray:
        return np.array([values[60] - values[0], np.ptp(values), slope(values)])

    def normal(read: np.ndarray, period: float | None) -> np.ndarray:
        bends = read[1:-1] - (read[:-2] + read[2:]) / 2
        scatter = np.sqrt((bends**2 / 1.5).mean())
        of_wave = np.sqrt(2) if period is None else slope_of_wave(slope(read) * 3600 / period)
        of_rate = scatter**2 / (late**2).sum() + (of_wave * u / 3600) ** 2
        return np.array([2 * u**2 + 2 * scatter**2] * 2 + [of_rate])

    def held(read: np.ndarray, bound: float, period: float | None) -> np.ndarray:
        most = 2 * np.sqrt(normal(read, period)) + bound * np.array([1, 1, 1 / times[-1]])
        return abs(of(read) - of(truth)) <= most

    def held_of_read(read: np.ndarray) -> np.ndarray:
        (degc, half_width), (grow, half_grow) = known
        values = read - grow * (degc - degc[0])
        changes = degc[60] - degc[0], degc[values.argmax()] - degc[values.argmin()], slope(degc)
        limits = [np.array([grow * half_width / over] * 2 + [half_grow * abs(k)]) for over, k in zip((1, 1, 3600), changes)]
        limits = [each / np.sqrt(3) for each in limits]
        variances = normal(read, period) + [(each**2).sum() for each in limits]
        most = [factor(*one) * np.sqrt(one[0]) for one in zip(variances, limits)]
        return abs(of(values) - of(truth)) <= most

    alone = by_sensor(truth)
    every = {
        "": held(alone, 0, None),
        " with period": held(alone, 0, period),
        " with artefact": held(by_sensor(truth + artefact * warm), artefact, period),
        " with artefact read": held_of_read(by_sensor(truth + growth)),
    }
    return {f"{name}{what}": one for what, held in every.items() for name, one in zip(("d", "range", "rate"), held)}


def mandrel(rng: np.random.Generator, times: np.ndarray, warm: np.ndarray) -> tuple[np.ndarray, tuple, tuple]:
    """Growth (um) of an artefact that warms and swings slowly; its thermometer and growth (um/K) as stated, with half widths.

    The thermometer is off by a constant and by a wander between knots 20 to 60 min apart.
    """
    length, alpha, half_alpha = 1e-3 * rng.uniform(100, 300), rng.uniform(8, 12.5), rng.uniform(0.3, 1.5)
    swing, period, phase = rng.uniform(0, 0.2), rng.uniform(2400, 14400), rng.uniform(0, TAU)
    degc = 20 + rng.uniform(0.1, 3) * warm + swing * np.sin(TAU * times / period + phase)
    half_width, every = rng.uniform(0.02, 0.2), rng.uniform(1200, 3600)
    knots = every * (np.arange(times[-1] // every + 3) - rng.uniform(0, 1))
    off = rng.uniform(-0.5, 0.5) + np.interp(times, knots, half_width * rng.uniform(-1, 1, len(knots)))
    growth = (alpha + half_alpha * rng.uniform(-1, 1)) * length * (degc - degc[0])
    return growth, (degc + off, half_width), (alpha * length, half_alpha * length)


def slope_of_wave(turns: float) -> float:
    """Standard deviation over all phases of the slope of a line through a wave of standard deviation 1 in a window of 1.

    The wave makes `turns` in the window; its line is fitted to 400 places, the greatest over longer windows is kept beyond
    the first maximum, as the wave's place there is not known.
    """
    place = (np.arange(400) + 0.5) / 400 - 0.5

    def of(turns: float) -> float:
        both = [(place * part(TAU * turns * place)).sum() / (place**2).sum() for part in (np.cos, np.sin)]
        return float(np.hypot(*both))

    turns = abs(turns)
    return of(turns) if turns < 0.6626 else max(of(turns + back) for back in np.linspace(-min(0.5, turns - 0.6626), 0, 21))


SHARES = shares()
NORMAL = np.random.default_rng(1).normal(size=20000)
WITHIN = np.random.default_rng(2).uniform(-1, 1, (20000, 5))

if __name__ == "__main__":
    print("shares of waves and of steps on a circle:", np.round(SHARES[0], 4), np.round(SHARES[1], 4))
    print_shares((circle, circle_whole, diagonals, thermal), 8)
