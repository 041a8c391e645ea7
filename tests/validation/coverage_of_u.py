"""How often U (k = 2) holds the truth, from numpy alone: linear and rotary axes, probing, periodic errors.

    coverage_of_u.py [MACHINES]

Machines, their drift, certificates and temperatures, the figures by the words of ISO 230-2 and ISO 230-10 and their U are
all made here; nothing of the product is used. The truth is what an exact instrument would have shown of the same runs.
`nodes/libraries/iso230/tests/it/iso230/machines` has the same machines with the product's evaluations, 1000 of each.

Printed with numpy 2.4.6 for 4000 machines, in % (two standard deviations are 0.7 at 95 %, 0.3 at 99 %):

    linear     A 96.7  E 95.4  R 96.7  B 96.3  mean B 95.4  M 95.5  A up 96.6  E up 95.7  R up 96.2
      without a stated unrest  R 97.4  B 99.2  mean B 99.5
      against endless runs  A 94.8  E 95.2  R 76.3  B 60.6  mean B 84.2  M 95.3  A up 95.5  E up 95.4  R up 58.0
      with the length part of the whole travel  A 98.2  E 98.2  M 98.2  A up 98.3  E up 98.0
    rotary     A 96.9  E 96.2  R 96.3  B 93.9  mean B 95.7  M 96.4  A up 96.9  E up 97.0  R up 96.6
      with a certificate of one position  E 87.6  M 87.0
    probing    P_FTU,3D 96.0  size error 95.8  R_SPT 96.0
    periodic   P 95.6  first amplitude 94.9
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np

TAU = 2 * np.pi
RUNS = 5
LEADS_MM = (5.0, 8.0, 10.0, 12.0)
RINGS = ((1.0, 1), (0.9, 4), (0.7, 6), (0.4, 6), (0.05, 8))
Held = dict[str, bool]


def drifting(rng: np.random.Generator, size: float) -> Callable[[np.ndarray], np.ndarray]:
    """Drift at times in units of the test's length: a trend, three waves, unrest of each reading."""
    trend = size * rng.normal()
    waves = [(size * rng.uniform(0.1, 0.5), rng.uniform(0.25, 8), rng.uniform(0, TAU)) for _ in range(3)]

    def at(time: np.ndarray) -> np.ndarray:
        slow = trend * time + sum(a * np.sin(TAU * f * time + p) for a, f, p in waves)
        return slow + 0.1 * size * rng.normal(size=time.shape)

    return at


def watched(drift: Callable[[np.ndarray], np.ndarray]) -> float:
    """Range at rest, for as long as the test, before it."""
    return watch(drift)[0]


def watch(drift: Callable[[np.ndarray], np.ndarray]) -> tuple[float, float]:
    """That range, and the unrest of a reading by the spread about the line between its neighbours."""
    read = drift(np.arange(60) / 60 - 1)
    bends = read[1:-1] - (read[:-2] + read[2:]) / 2
    return float(np.ptp(read)), float(np.sqrt((bends**2 / 1.5).mean()))


def chi2_of_4(probability: float) -> float:
    """Point of chi squared of four degrees of freedom: 1 - (1 + x/2) exp(-x/2) is its probability."""
    low, high = 0.0, 100.0
    for _ in range(60):
        middle = (low + high) / 2
        below = 1 - (1 + middle / 2) * np.exp(-middle / 2) < probability
        low, high = (middle, high) if below else (low, middle)
    return high


def of_scatter(s: float, u_drift: float, scatters: int) -> tuple[float, float]:
    """By how much drift between the runs moves a standard deviation: standard uncertainty, and greatest offset.

    The component along the machine's own scatter by the law of propagation, the others by the sum of squares; all of the
    others where drift alone makes the greatest of all `scatters` as great in 5 % of tests.
    """
    added = u_drift * np.sqrt((RUNS - 2) / (RUNS - 1))
    by_drift_alone = s * s < chi2_of_4(0.95 ** (1 / scatters)) / (RUNS - 1) * u_drift**2
    return u_drift / np.sqrt(RUNS - 1), min(s, added) if by_drift_alone else s - np.sqrt(s * s - added**2)


def of_reversal(u_drift: float, unrest: float | None) -> float:
    """Variance of a difference of the means of one target from both sides, at most two legs of the test apart."""
    at_most = 2 / RUNS * u_drift**2
    return at_most if unrest is None else min(at_most, (2 * u_drift / RUNS) ** 2 + 2 / RUNS * unrest**2)


def of_ends(high: tuple[float, float], low: tuple[float, float]) -> float:
    """Variance that A has of the standard deviations at its two ends."""
    return 4 * sum(r * r + o * o for r, o in (high, low))


def of_repeatability(up: tuple[np.ndarray, np.ndarray], down: tuple[np.ndarray, np.ndarray], u_drift: float) -> float:
    """Variance of R without that of the reversal in it; means and standard deviations of each side."""
    across = 2 * up[1] + 2 * down[1] + abs(up[0] - down[0])
    i = np.maximum.reduce([across, 4 * up[1], 4 * down[1]]).argmax()
    (r, o_up), (_, o_down) = (of_scatter(s[i], u_drift, 2 * len(s)) for s in (up[1], down[1]))
    return 8 * r * r + 4 * (o_up + o_down) ** 2


def figures(up: np.ndarray, down: np.ndarray) -> dict[str, float]:
    """ISO 230-2; rows are runs."""
    mean_up, mean_down = up.mean(axis=0), down.mean(axis=0)
    s_up, s_down = up.std(axis=0, ddof=1), down.std(axis=0, ddof=1)
    mean, s = np.concatenate([mean_up, mean_down]), np.concatenate([s_up, s_down])
    reversal = mean_up - mean_down
    repeat = np.maximum.reduce([2 * s_up + 2 * s_down + abs(reversal), 4 * s_up, 4 * s_down])
    return {
        "A": (mean + 2 * s).max() - (mean - 2 * s).min(),
        "E": np.ptp(mean),
        "R": repeat.max(),
        "B": abs(reversal).max(),
        "mean B": reversal.mean(),
        "M": np.ptp((mean_up + mean_down) / 2),
        "A up": (mean_up + 2 * s_up).max() - (mean_up - 2 * s_up).min(),
        "E up": np.ptp(mean_up),
        "R up": 4 * s_up.max(),
    }


def body(rng: np.random.Generator, about: float, spread: float, alpha: float) -> dict[str, float]:
    """Temperature (K above 20 degC) and coefficient (um/mm/K) as stated, their half widths, and the true growth."""
    warm, half_width, half_alpha = about + rng.uniform(-spread, spread), rng.uniform(0.1, 0.4), 0.1 * alpha
    return {
        "warm": warm + half_width * rng.uniform(-1, 1),
        "half_width": half_width,
        "alpha": alpha,
        "half_alpha": half_alpha,
        "growth": (alpha + half_alpha * rng.uniform(-1, 1)) * warm,
    }


def screw(rng: np.random.Generator, travel: float) -> Callable[[np.ndarray, int], np.ndarray]:
    """Error (um) at a place (mm) from a side: lead, a wander between knots, a cycle, a reversal that changes along the axis."""
    every = rng.uniform(40, 120)
    knots = np.cumsum(0.8 * rng.normal(size=int(travel / every) + 3))
    lead, size, period, phase = 0.012 * rng.normal(), rng.uniform(0, 1), rng.uniform(5, 20), rng.uniform(0, TAU)
    reversal, slope = rng.uniform(-1, 6), 0.002 * rng.normal()

    def error(at: np.ndarray, side: int) -> np.ndarray:
        wander = np.interp(at, every * np.arange(len(knots)), knots)
        cycle = size * np.sin(TAU * at / period + phase)
        return lead * at + wander + cycle + side * (reversal + slope * at) / 2

    return error


def certified(rng: np.random.Generator, far: np.ndarray, constant: float, by_length: float) -> np.ndarray:
    """Errors (um) of places from the first one on, without the scale's.

    With the scale's the error between any two places L apart has u = (constant + by_length L)/2: of its square the constant
    part is new at each place, twice the product adds up in steps, the rest is the scale.
    """
    steps = np.sqrt(constant * by_length * np.diff(far) / 2) * rng.normal(size=len(far) - 1)
    own = constant / 2 / np.sqrt(2) * rng.normal(size=len(far)) + np.r_[0, np.cumsum(steps)]
    return own - own[0]


def of_endless_runs(up: np.ndarray, down: np.ndarray, scatter: float) -> dict[str, float]:
    """ISO 230-2 of means and a scatter that are known."""
    both, reversal = np.r_[up, down], up - down
    return {
        "A": np.ptp(both) + 4 * scatter,
        "E": np.ptp(both),
        "R": 4 * scatter + abs(reversal).max(),
        "B": abs(reversal).max(),
        "mean B": reversal.mean(),
        "M": np.ptp((up + down) / 2),
        "A up": np.ptp(up) + 4 * scatter,
        "E up": np.ptp(up),
        "R up": 4 * scatter,
    }


def linear(rng: np.random.Generator, whole: bool = False, endless: bool = False, fast: bool = False) -> Held:
    """ISO 230-2 of a linear axis at 20 degC, um and mm.

    `whole`: the length part of U is that of the whole travel; `endless`: the truth is that of endless runs;
    `fast`: the unrest at rest is not stated, so that all drift counts as new at every reading.
    """
    travel = rng.uniform(300, 1200)
    error = screw(rng, travel)
    shop, alpha = rng.uniform(-3, 7), rng.choice([0.008, 0.011, 0.0115])
    drift = drifting(rng, rng.uniform(0.1, 0.8))
    range_at_rest, unrest = watch(drift)
    u_drift = range_at_rest / 2 / np.sqrt(3)
    constant, by_length = rng.uniform(0.1, 0.5), rng.uniform(0.3, 2) * 1e-3
    bodies = body(rng, shop, 1, alpha), body(rng, shop, 0.5, rng.choice([0, 0.0115]))
    aside, scatter = 1e3 * rng.uniform(0, 0.3), rng.uniform(0.05, 0.6)
    m = rng.integers(5, 12)
    at = (np.arange(m) + rng.uniform(0.1, 0.9, m)) * travel / m
    far = at - at[0]
    span = far[-1]
    own = certified(rng, far, constant, by_length)
    beam = -((aside * rng.uniform(0, 1)) ** 2) / 2e3 / span**2
    slope = by_length / 2 * rng.normal() + bodies[0]["growth"] - bodies[1]["growth"] + beam
    taken_out = bodies[0]["alpha"] * bodies[0]["warm"] - bodies[1]["alpha"] * bodies[1]["warm"]
    truth, read = ([], []), ([], [])
    for run in range(RUNS):
        for leg, side in enumerate((1, -1)):
            order = np.arange(m) if leg == 0 else np.arange(m)[::-1]
            time = np.empty(m)
            time[order] = ((2 * run + leg) * m + np.arange(m)) / (2 * RUNS * m)
            moved = error(at, side) + scatter * rng.normal(size=m)
            truth[leg].append(moved)
            read[leg].append(moved + (slope - taken_out) * far + own + drift(time))

    def of_length(apart: float) -> float:
        length = span if whole else apart
        heat = sum(
            (b["alpha"] * length * b["half_width"]) ** 2 + (b["warm"] * length * b["half_alpha"]) ** 2 for b in bodies
        )
        off = length / span * aside**2 / 4e3 / span
        return ((constant + by_length * length) / 2) ** 2 + (heat + off**2) / 3

    up, down = np.array(read[0]), np.array(read[1])
    right, found = figures(np.array(truth[0]), np.array(truth[1])), figures(up, down)
    if endless:
        right = of_endless_runs(error(at, 1), error(at, -1), scatter)
    (mean_up, s_up), (mean_down, s_down) = ((x.mean(axis=0), x.std(axis=0, ddof=1)) for x in (up, down))
    mean, s, both = np.r_[mean_up, mean_down], np.r_[s_up, s_down], np.r_[far, far]
    middle, two_means = (mean_up + mean_down) / 2, 2 / RUNS * u_drift**2
    of_b = of_reversal(u_drift, None if fast else unrest)

    def apart(high: np.ndarray, low: np.ndarray, place: np.ndarray) -> float:
        return abs(place[high.argmax()] - place[low.argmin()])

    def ends(mean: np.ndarray, s: np.ndarray) -> float:
        highest, lowest = s[(mean + 2 * s).argmax()], s[(mean - 2 * s).argmin()]
        return two_means + of_ends(*(of_scatter(one, u_drift, 2 * m) for one in (highest, lowest)))

    variance = {
        "A": of_length(apart(mean + 2 * s, mean - 2 * s, both)) + ends(mean, s),
        "E": of_length(apart(mean, mean, both)) + two_means,
        "R": of_repeatability((mean_up, s_up), (mean_down, s_down), u_drift) + of_b,
        "B": of_b,
        "mean B": of_b,
        "M": of_length(apart(middle, middle, far)) + two_means / 2,
        "A up": of_length(apart(mean_up + 2 * s_up, mean_up - 2 * s_up, far)) + ends(mean_up, s_up),
        "E up": of_length(apart(mean_up, mean_up, far)) + two_means,
        "R up": 4 * of_ends(of_scatter(s_up.max(), u_drift, 2 * m), (0.0, 0.0)),
    }
    return {k: abs(found[k] - right[k]) <= 2 * np.sqrt(variance[k]) for k in right}


def rotary(rng: np.random.Generator, share: float = 1 / np.sqrt(2)) -> Held:
    """ISO 230-2 of one turn, seconds of arc; the certificate states the angle between two positions.

    Each position has `share` of its u: with 1 the certificate would state one position.
    """
    m = rng.integers(8, 14)
    at = (np.arange(m) + rng.uniform(0.1, 0.9, m)) * TAU / m
    u = rng.uniform(0.05, 0.5)
    drift = drifting(rng, rng.uniform(0.05, 0.4))
    range_at_rest, unrest = watch(drift)
    u_drift = range_at_rest / 2 / np.sqrt(3)
    waves = [(size * rng.normal(), rng.uniform(0, TAU)) for size in (3.0, 1.5, 0.5)]
    worm, phase = rng.uniform(0, 1), rng.uniform(0, TAU)
    reversal, scatter = rng.uniform(-0.5, 4), rng.uniform(0.05, 0.6)
    slow = sum(a * np.cos((h + 1) * at + p) for h, (a, p) in enumerate(waves)) + worm * np.sin(90 * at + phase)
    reference = share * u * rng.normal(size=m)
    truth, read = ([], []), ([], [])
    for run in range(RUNS):
        for leg, side in enumerate((1, -1)):
            order = np.arange(m) if leg == 0 else np.arange(m)[::-1]
            time = np.empty(m)
            time[order] = ((2 * run + leg) * m + np.arange(m)) / (2 * RUNS * m)
            turned = slow + side * reversal / 2 + scatter * rng.normal(size=m)
            truth[leg].append(turned)
            read[leg].append(turned + reference + drift(time))
    right, found = figures(*map(np.array, truth)), figures(*map(np.array, read))
    length, two_means, of_b = u**2, 2 / RUNS * u_drift**2, of_reversal(u_drift, unrest)
    (mean_up, s_up), (mean_down, s_down) = ((np.mean(x, axis=0), np.std(x, axis=0, ddof=1)) for x in read)

    def ends(mean: np.ndarray, s: np.ndarray) -> float:
        highest, lowest = s[(mean + 2 * s).argmax()], s[(mean - 2 * s).argmin()]
        return two_means + of_ends(*(of_scatter(one, u_drift, 2 * m) for one in (highest, lowest)))

    variance = {
        "A": length + ends(np.r_[mean_up, mean_down], np.r_[s_up, s_down]),
        "E": length + two_means,
        "R": of_repeatability((mean_up, s_up), (mean_down, s_down), u_drift) + of_b,
        "B": of_b,
        "mean B": of_b,
        "M": length + two_means / 2,
        "A up": length + ends(mean_up, s_up),
        "E up": length + two_means,
        "R up": 4 * of_ends(of_scatter(s_up.max(), u_drift, 2 * m), (0.0, 0.0)),
    }
    return {k: abs(found[k] - right[k]) <= 2 * np.sqrt(variance[k]) for k in right}


def directions() -> np.ndarray:
    """25 directions on the half of a sphere that a probe reaches."""
    rows = []
    for z, n in RINGS:
        about = TAU * (np.arange(n) + 0.3 * n) / n
        rows.append(np.c_[np.sqrt(1 - z * z) * np.cos(about), np.sqrt(1 - z * z) * np.sin(about), np.full(n, z)])
    return np.concatenate(rows)


def sphere(points: np.ndarray) -> tuple[float, float]:
    """Diameter and range of the distances from the centre of the least-squares sphere, by Gauss and Newton."""
    first = np.linalg.lstsq(np.c_[2 * points, np.ones(len(points))], (points**2).sum(axis=1), rcond=None)[0]
    centre, radius = first[:3], np.sqrt(first[3] + first[:3] @ first[:3])
    for _ in range(8):
        apart = points - centre
        distance = np.linalg.norm(apart, axis=1)
        slopes = np.c_[-apart / distance[:, None], -np.ones(len(points))]
        step = np.linalg.lstsq(slopes, radius - distance, rcond=None)[0]
        centre, radius = centre + step[:3], radius + step[3]
    return 2 * radius, float(np.ptp(np.linalg.norm(points - centre, axis=1)))


def probing(rng: np.random.Generator) -> Held:
    """ISO 230-10, mm; the artefact is as warm as the scale is stated to be, and of its coefficient."""
    um = 1e-3
    way = directions()
    n, about, flat = len(way), np.arctan2(way[:, 1], way[:, 0]), np.hypot(way[:, 0], way[:, 1])
    diameter, alpha, half_alpha = rng.uniform(20, 40), 11.5e-6, 1e-6
    warm, half_width = rng.uniform(-3, 7), rng.uniform(0.1, 0.5)
    form, u_form, u_diameter = um * rng.uniform(0.05, 0.5), um * rng.uniform(0.02, 0.1), um * rng.uniform(0.1, 0.4)
    lobing, phase, scatter = um * rng.uniform(0, 1.5), rng.uniform(0, TAU), um * rng.uniform(0.05, 0.5)
    touched = lobing * np.cos(3 * about + phase) * flat + scatter * rng.normal(size=n) + um * rng.normal() / 2
    shape = np.cos(rng.integers(2, 6) * about + rng.uniform(0, TAU)) * flat
    own = shape / np.ptp(shape) * (form + u_form * rng.normal()) + u_diameter * rng.normal() / 2
    scale = (alpha + half_alpha * rng.uniform(-1, 1)) * (warm + half_width * rng.uniform(-1, 1))
    size = um * rng.uniform(0.05, 0.4)
    drifts = [drifting(rng, size) for _ in range(3)]
    u_drift = max(watched(drift) for drift in drifts) / 2 / np.sqrt(3)
    moved = np.stack([drift(np.arange(n) / n) for drift in drifts], axis=1)
    read = way * (diameter / 2 * (1 + alpha * warm - scale) + touched + own)[:, None] + moved
    (true_size, true_form), (found_size, found_form) = sphere(way * (diameter / 2 + touched)[:, None]), sphere(read)
    rows = np.c_[way, np.ones(n)]
    q = np.linalg.inv(rows.T @ rows)[3, 3]
    u_p = np.sqrt(2 * u_drift**2 * (1 - 4 / n) + (form**2 + u_form**2) / 6)
    of_heat = (diameter * alpha * half_width) ** 2 / 3 + (diameter * warm * half_alpha) ** 2 / 3
    u_s = np.sqrt(u_diameter**2 + of_heat + 4 * q * u_drift**2)
    drift, touches = drifting(rng, size), um * rng.uniform(0.05, 0.5) * rng.normal(size=10)
    u_r = np.sqrt(2) * watched(drift) / 2 / np.sqrt(3)
    again = np.ptp(touches + drift(np.arange(10) / 10)) - np.ptp(touches)
    return {
        "P_FTU,3D": abs(found_form - true_form) <= 2 * u_p,
        "size error": abs(found_size - true_size) <= 2 * u_s,
        "R_SPT": abs(again) <= 2 * u_r,
    }


def periodic(rng: np.random.Generator) -> Held:
    """Periodic error of five runs in short steps beside a lead error, a bow, scatter and drift, µm."""
    period, m, step = rng.choice(LEADS_MM), rng.integers(25, 50), rng.uniform(0.08, 0.125)
    at = np.arange(m) * step * period
    harmonics = int(np.clip(min(np.floor(0.5 / step + 1e-6) - 1, np.floor(m / 4 - 1)), 1, 4))
    waves = [(rng.uniform(0.3, 2), rng.uniform(0, TAU)), (rng.uniform(0, 0.5), rng.uniform(0, TAU))]
    lead, bow, scatter = 0.012 * rng.normal(), 0.3 * rng.normal(), rng.uniform(0.05, 0.4)
    drift = drifting(rng, rng.uniform(0.05, 0.4))

    def cycle(u: np.ndarray) -> np.ndarray:
        return sum(a * np.cos(TAU * (h + 1) * u / period + p) for h, (a, p) in enumerate(waves))

    def columns(u: np.ndarray) -> list[np.ndarray]:
        turns = [TAU * h * u / period for h in range(1, harmonics + 1)]
        return [of(turn) for turn in turns for of in (np.cos, np.sin)]

    read = np.zeros(m)
    for run in range(RUNS):
        slow = lead * at + bow * (at / at[-1]) ** 2 + cycle(at)
        read += (slow + scatter * rng.normal(size=m) + drift((2 * run + np.arange(m) / m) / (2 * RUNS))) / RUNS
    design = np.c_[np.ones(m), at - at.mean(), *columns(at)]
    beta = np.linalg.lstsq(design, read, rcond=None)[0]
    covariance = np.linalg.inv(design.T @ design) * ((read - design @ beta) ** 2).sum() / (m - design.shape[1])
    turn = np.arange(1440) / 1440 * period
    over = np.c_[np.zeros(1440), np.zeros(1440), *columns(turn)]
    value = over @ beta
    contrast = over[value.argmax()] - over[value.argmin()]
    u_p = np.sqrt(contrast @ covariance @ contrast)
    amplitude = np.hypot(beta[2], beta[3])
    along = beta[2:4] / amplitude
    return {
        "P": abs(np.ptp(value) - np.ptp(cycle(turn))) <= 2 * u_p,
        "first amplitude": abs(amplitude - waves[0][0]) <= 2 * np.sqrt(along @ covariance[2:4, 2:4] @ along),
    }


def rotary_by_position(rng: np.random.Generator) -> Held:
    """The same where the certificate states one position: U of E and M is too small."""
    held = rotary(rng, 1.0)
    return {name: held[name] for name in ("E", "M")}


def linear_whole_travel(rng: np.random.Generator) -> Held:
    """The linear axis with the length part of the whole travel: U of E and M is too great."""
    held = linear(rng, whole=True)
    return {name: held[name] for name in ("A", "E", "M", "A up", "E up")}


def linear_endless_runs(rng: np.random.Generator) -> Held:
    """The linear axis against what it does on the average of endless runs, whose scatter is not in U."""
    return linear(rng, endless=True)


def linear_fast_drift(rng: np.random.Generator) -> Held:
    """The linear axis without a stated unrest: U of B, mean B and R is an upper bound."""
    held = linear(rng, fast=True)
    return {name: held[name] for name in ("R", "B", "mean B")}


def print_shares(kinds: tuple[Callable[[np.random.Generator], Held], ...], first: int) -> None:
    """Each figure of every kind over as many machines as the command asks for; `first` numbers the kinds."""
    machines = int(sys.argv[1]) if len(sys.argv) > 1 else 4000
    for kind, of in enumerate(kinds, first):
        all_held = [of(np.random.default_rng([230, kind, seed])) for seed in range(machines)]
        for name in all_held[0]:
            print(f"{of.__name__} {name}: {100 * np.mean([held[name] for held in all_held]):.1f}")


if __name__ == "__main__":
    of_axes = (rotary, probing, periodic, rotary_by_position, linear)
    print_shares((*of_axes, linear_whole_travel, linear_endless_runs, linear_fast_drift), 0)
