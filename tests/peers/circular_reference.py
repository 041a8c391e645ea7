"""Computes ISO 230-4 from the raw readings of a bag with numpy and prints it as JSON.

    circular_reference.py BAG_DIRECTORY

Shares nothing with the crates: the bag is read by PyPI `mcap`, the evaluated turn is taken from the commanded place
alone (one turn, 360 degrees, from where the control began to record at its full rate), circles are fitted by Gauss and Newton's iteration.
Both senses stand in the frame of the plate, whose readings are used as they are. Only circles that were run through
and recorded with a change of the rate are evaluated.

Printed for each pair of runs: the runs; G of each sense about its own least-squares centre; F max and F min of each
sense, G(b), D and H about the least-squares centre of both; the distance of the two centres; mm. With them the same
figures from all readings at feed, the run-in included, and of two senses of which each was centred alone.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

TOPICS = ["/axes/state", "/grid/position", "/test/segment"]
CIRCLE, PLANES = 6, {1: ("X", "Y"), 2: ("Y", "Z"), 3: ("Z", "X")}
CLOCKWISE, COUNTER_CLOCKWISE = 1, 2
# The command is on the circle when it is this close to it, and at its feed above this share of it.
ON_CIRCLE_MM, AT_FEED = 2e-3, 0.98


def seconds(stamp):
    return stamp.sec + 1e-9 * stamp.nanosec


def recordings(folder: Path):
    """Circles that were run through: segment, states (time, u, v), readings (time, u, v); mm and s."""
    current, done = None, []
    for path in sorted(folder.glob("*.mcap")):
        with path.open("rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()])
            for _, channel, _, message in reader.iter_decoded_messages(topics=TOPICS):
                if channel.topic == "/test/segment":
                    if message.begin:
                        through = message.kind == CIRCLE and message.stations == 0 and message.plane in PLANES
                        current = (message, [], []) if through else None
                    elif current and message.completed and message.run == current[0].run:
                        done.append(current)
                        current = None
                elif current is None:
                    continue
                elif channel.topic == "/axes/state":
                    place = dict(zip(message.axis, message.commanded))
                    centre = current[0].centre
                    at = [1e3 * (place[a] - getattr(centre, a.lower())) for a in PLANES[current[0].plane]]
                    current[1].append([seconds(message.controller_stamp), *at])
                elif (message.plane, message.zero_id) == (current[0].plane, current[0].zero_id):
                    current[2].append([seconds(message.header.stamp), 1e3 * message.u_m, 1e3 * message.v_m])
    return [(segment, np.array(states), np.array(readings)) for segment, states, readings in done]


def turns(segment, states, readings):
    """Readings of the turn at the full rate, and of all that the command spent on the circle at its feed."""
    time, place = states[:, 0], states[:, 1:]
    step = np.diff(time)
    speed = np.concatenate([[0.0], np.hypot(*np.diff(place, axis=0).T) / step])
    radius, feed = 1e3 * segment.radius_m, 1e3 * segment.feed_m_s
    good = (abs(np.hypot(*place.T) - radius) < ON_CIRCLE_MM) & (speed >= AT_FEED * feed)
    fine = step < 3.0 * step.min()
    # The longest stretch of close states.
    edges = np.flatnonzero(np.diff(np.concatenate([[0], fine.astype(int), [0]])))
    starts, ends = edges[::2], edges[1::2]
    longest = np.argmax(time[ends] - time[starts])
    begin_s, end_s = time[starts[longest]], time[ends[longest]]
    at = readings[:, 0]
    # The control switches its rate late: one turn of the command, no more.
    angle = np.unwrap(np.arctan2(place[:, 1], place[:, 0]))
    swept = abs(angle - angle[starts[longest]])[np.maximum(np.searchsorted(time, at, side="right") - 1, 0)]
    marked = readings[(at >= begin_s) & (at <= end_s) & (swept < 2 * np.pi - 1e-6), 1:]
    on = np.flatnonzero(good)
    whole = readings[(at >= time[on[0]]) & (at <= time[on[-1]]), 1:]
    return marked, whole


def circle(points, weights):
    """Least-squares circle: centre and radius."""
    c = np.array([*points.mean(axis=0), 1.0])
    c[2] = np.hypot(*(points - c[:2]).T).mean()
    for _ in range(50):
        arms = points - c[:2]
        distance = np.hypot(*arms.T)
        jacobian = -np.column_stack([arms / distance[:, None], np.ones(len(points))])
        residual = distance - c[2]
        step = np.linalg.lstsq(jacobian * weights[:, None], -residual * weights, rcond=None)[0]
        c = c + step
        if np.abs(step).max() < 1e-13:
            break
    return c


def figures(cw, ccw, radius):
    both = np.concatenate([cw, ccw])
    weights = np.concatenate([np.full(len(p), 1 / np.sqrt(len(p))) for p in (cw, ccw)])
    common = circle(both, weights)
    own = [circle(p, np.ones(len(p))) for p in (cw, ccw)]
    polar = []
    for points in (cw, ccw):
        arms = points - common[:2]
        angle = np.arctan2(arms[:, 1], arms[:, 0])
        order = np.argsort(angle)
        polar.append((angle[order], np.hypot(*arms.T)[order]))
    every = np.concatenate([polar[0][0], polar[1][0]])
    apart = [np.interp(every, a, r, period=2 * np.pi) for a, r in polar]
    result = {
        "g_both": float(np.ptp(np.hypot(*(both - common[:2]).T))),
        "d": float(common[2] - radius),
        "h": float(abs(apart[0] - apart[1]).max()),
        "centres_apart": float(np.hypot(*(own[0] - own[1])[:2])),
    }
    for name, points, centre in (("clockwise", cw, own[0]), ("counter_clockwise", ccw, own[1])):
        radial = np.hypot(*(points - common[:2]).T) - radius
        result[name] = {
            "points": len(points),
            "g": float(np.ptp(np.hypot(*(points - centre[:2]).T))),
            "f_max": float(radial.max()),
            "f_min": float(radial.min()),
        }
    return result


def main():
    pairs, waiting = [], []
    for segment, states, readings in recordings(Path(sys.argv[1])):
        key = (segment.plane, segment.zero_id, segment.setup_id, segment.radius_m, segment.feed_m_s,
               segment.centre.x, segment.centre.y, segment.centre.z)
        entry = (key, segment, turns(segment, states, readings))
        partner = next((w for w in waiting if w[0] == key and w[1].sense != segment.sense), None)
        if partner is None:
            waiting.append(entry)
            continue
        waiting.remove(partner)
        of = {e[1].sense: e for e in (partner, entry)}
        cw, ccw = of[CLOCKWISE], of[COUNTER_CLOCKWISE]
        radius = 1e3 * segment.radius_m
        alone = [p - circle(p, np.ones(len(p)))[:2] for p in (cw[2][0], ccw[2][0])]
        pairs.append({
            "runs": sorted([cw[1].run, ccw[1].run]),
            "radius_mm": radius,
            "marked_turn": figures(cw[2][0], ccw[2][0], radius),
            "with_run_in": figures(cw[2][1], ccw[2][1], radius),
            "each_sense_centred_alone": figures(*alone, radius),
        })
    json.dump(pairs, sys.stdout, indent=1)


main()
