"""Messages per second of PyPI `rosbags`, raw, without decoding.

    bench_bag.py write|write_zstd|read MESSAGES PASSES DIRECTORY
"""

from __future__ import annotations

import math
import shutil
import statistics
import struct
import sys
import time
from pathlib import Path

from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

TYPE = "std_msgs/msg/UInt8MultiArray"


def payload(number: int) -> bytes:
    """The bytes of benches/bag.rs: positions on a grid of 2^-20 m."""
    values = []
    for index in range(23):
        phase = number * 1e-3 * (index + 1)
        values.append(math.floor(math.fmod(phase, 1.0) * 1048576.0) / 1048576.0)
    head = bytes([0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 184, 0, 0, 0])
    return head + struct.pack("<23d", *values)


def write(directory: Path, payloads: list[bytes], compress: bool) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    writer = Writer(directory, version=9, storage_plugin=StoragePlugin.MCAP)
    if compress:
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/axes/state", TYPE, typestore=store)
        for stamp, data in enumerate(payloads):
            writer.write(connection, stamp * 1_000_000, data)


def read(directory: Path, messages: int) -> None:
    count = 0
    with Reader(directory) as reader:
        for _ in reader.messages():
            count += 1
    if count != messages:
        raise SystemExit(f"{count} of {messages} messages")


def main(what: str, messages: int, passes: int, directory: Path) -> None:
    payloads = [] if what == "read" else [payload(n) for n in range(messages)]
    rates = []
    for _ in range(passes):
        if what != "read":
            shutil.rmtree(directory, ignore_errors=True)
        begin = time.perf_counter()
        if what == "read":
            read(directory, messages)
        else:
            write(directory, payloads, what == "write_zstd")
        rates.append(messages / (time.perf_counter() - begin))
    print(statistics.median(rates))


if __name__ == "__main__":
    if len(sys.argv) != 5 or sys.argv[1] not in ("write", "write_zstd", "read"):
        sys.exit(__doc__)
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4]))
