"""Reads a bag with other people's software and compares every value of every message.

    read_bag.py BAG_DIRECTORY DUMP.jsonl

Three decodings of the same bytes are compared: PyPI `rosbags` with a type store built from the
bag's own definitions, `mcap` with `mcap-ros2-support`, and the dump that our side wrote. Ends with
exit code 1 at the first difference and names it.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import numpy
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

SPECIAL = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf}
# rosbags gives a message without fields the one byte that it has on the wire.
FILLER = "structure_needs_at_least_one_member"


class Different(Exception):
    """Two readers do not agree."""


def plain(value, fielddefs=None):
    """Turns a decoded value of either library into dicts, lists, numbers and texts.

    `fielddefs` are those of rosbags' type store, whose classes carry the constants as fields too.
    """
    if isinstance(value, (bool, numpy.bool_)):
        return bool(value)
    if isinstance(value, (int, numpy.integer)):
        return int(value)
    if isinstance(value, (float, numpy.floating)):
        return float(value)
    if isinstance(value, str):
        return value
    if isinstance(value, (bytes, bytearray, memoryview)):
        return list(bytes(value))
    if isinstance(value, numpy.ndarray):
        return [plain(item) for item in value.tolist()]
    if hasattr(value, "__msgtype__"):
        names = [name for name, _ in fielddefs[value.__msgtype__][1] if name != FILLER]
        return {name: plain(getattr(value, name), fielddefs) for name in names}
    if hasattr(value, "__slots__"):
        return {name: plain(getattr(value, name)) for name in value.__slots__}
    return [plain(item, fielddefs) for item in value]


def compare(where, ours, theirs):
    """Compares values exactly; a number must be the same number, NaN is NaN."""
    if isinstance(theirs, dict):
        names = list(ours) if isinstance(ours, dict) else ours
        if names != list(theirs):
            raise Different(f"{where}: fields {names} and {list(theirs)}")
        for name, value in theirs.items():
            compare(f"{where}.{name}", ours[name], value)
    elif isinstance(theirs, list):
        if not isinstance(ours, list) or len(ours) != len(theirs):
            raise Different(f"{where}: {ours!r} and {theirs!r}")
        for index, (mine, other) in enumerate(zip(ours, theirs)):
            compare(f"{where}[{index}]", mine, other)
    else:
        if isinstance(theirs, float) and isinstance(ours, str):
            ours = SPECIAL.get(ours, ours)
        both_nan = isinstance(theirs, float) and isinstance(ours, float)
        both_nan = both_nan and math.isnan(theirs) and math.isnan(ours)
        same_kind = isinstance(ours, bool) == isinstance(theirs, bool)
        if not both_nan and (not same_kind or ours != theirs):
            raise Different(f"{where}: {ours!r} and {theirs!r}")


def own_typestore(bag: Path):
    """A type store that holds the bag's own definitions and nothing else."""
    store = get_typestore(Stores.EMPTY)
    with Reader(bag) as reader:
        for connection in reader.connections:
            types = get_types_from_msg(connection.msgdef.data, connection.msgtype)
            new = {name: value for name, value in types.items() if name not in store.fielddefs}
            store.register(new)
            digest = connection.digest
            if digest and digest != store.hash_rihs01(connection.msgtype):
                raise Different(f"{connection.topic}: type hash {digest}")
    return store


def by_rosbags(bag: Path):
    store = own_typestore(bag)
    with Reader(bag) as reader:
        counts = {c.topic: c.msgcount for c in reader.connections}
        qos = {c.topic: len(c.ext.offered_qos_profiles) for c in reader.connections}
        messages = [
            (c.topic, stamp, plain(store.deserialize_cdr(data, c.msgtype), store.fielddefs))
            for c, stamp, data in reader.messages()
        ]
        span = (reader.start_time, reader.end_time - 1, reader.message_count)
    return messages, counts, qos, span


def by_any_reader(bag: Path):
    """The high-level way in, which finds the definitions itself."""
    with AnyReader([bag], default_typestore=get_typestore(Stores.EMPTY)) as reader:
        return [
            (c.topic, stamp, plain(reader.deserialize(data, c.msgtype), reader.typestore.fielddefs))
            for c, stamp, data in reader.messages()
        ]


def by_mcap(bag: Path):
    messages = []
    for file in sorted(bag.glob("*.mcap"), key=lambda p: int(p.stem.rsplit("_", 1)[1])):
        with file.open("rb") as stream:
            reader = make_reader(
                stream, validate_crcs=True, decoder_factories=[DecoderFactory()]
            )
            if reader.get_header().profile != "ros2":
                raise Different(f"{file.name}: profile {reader.get_header().profile!r}")
            for _, channel, message, decoded in reader.iter_decoded_messages():
                messages.append(
                    (
                        channel.topic,
                        message.log_time,
                        plain(decoded),
                        message.publish_time,
                        message.sequence,
                    )
                )
    return messages


def main(bag: Path, dump: Path) -> str:
    ours = [json.loads(line) for line in dump.read_text(encoding="utf-8").splitlines()]
    # Both libraries give messages by log time; the sort keeps equal times in recorded order.
    ours.sort(key=lambda line: line["log_time_ns"])
    rosbags, counts, qos, span = by_rosbags(bag)
    highlevel = by_any_reader(bag)
    mcap = by_mcap(bag)
    lengths = [len(ours), len(rosbags), len(highlevel), len(mcap)]
    if len(set(lengths)) != 1 or not ours:
        raise Different(f"messages of dump, rosbags, AnyReader, mcap: {lengths}")
    first, last = ours[0]["log_time_ns"], ours[-1]["log_time_ns"]
    if span != (first, last, len(ours)):
        raise Different(f"metadata.yaml says {span}, the dump {(first, last, len(ours))}")
    for number, line in enumerate(ours):
        topic, stamp = line["topic"], line["log_time_ns"]
        where = f"message {number}, {topic} at {stamp}"
        for name, other in (
            ("rosbags", rosbags[number]),
            ("AnyReader", highlevel[number]),
            ("mcap-ros2-support", mcap[number]),
        ):
            if (topic, stamp) != other[:2]:
                raise Different(f"{where}: {name} has {other[:2]}")
            compare(f"{where}: dump and {name}: message", line["message"], other[2])
        compare(f"{where}: rosbags and mcap: message", rosbags[number][2], mcap[number][2])
        if mcap[number][3:] != (line["publish_time_ns"], line["sequence"]):
            raise Different(f"{where}: publish time and sequence {mcap[number][3:]}")
    for topic, count in counts.items():
        found = sum(1 for line in ours if line["topic"] == topic)
        if found != count:
            raise Different(f"{topic}: metadata.yaml says {count} messages, there are {found}")
    offered = ", ".join(f"{topic} {n}" for topic, n in sorted(qos.items()))
    return (
        f"{len(ours)} messages on {len(counts)} topics equal in dump, rosbags, AnyReader and "
        f"mcap-ros2-support; QoS profiles: {offered}"
    )


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: read_bag.py BAG_DIRECTORY DUMP.jsonl")
    try:
        print(main(Path(sys.argv[1]), Path(sys.argv[2])))
    except Different as difference:
        sys.exit(f"different: {difference}")
