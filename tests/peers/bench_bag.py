"""Messages per second of PyPI `rosbags`, raw: bench_bag.py write|read MESSAGES PASSES DIRECTORY."""

from __future__ import annotations

import shutil
import statistics
import sys
import time
from pathlib import Path

from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

TYPE = "std_msgs/msg/UInt8MultiArray"


def write(directory: Path, messages: int) -> None:
    shutil.rmtree(directory, ignore_errors=True)
    store = get_typestore(Stores.ROS2_JAZZY)
    data = bytes([0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 184, 0, 0, 0]) + bytes(184)
    with Writer(directory, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/axes/state", TYPE, typestore=store)
        for stamp in range(messages):
            writer.write(connection, stamp, data)


def read(directory: Path, messages: int) -> None:
    count = 0
    with Reader(directory) as reader:
        for _ in reader.messages():
            count += 1
    if count != messages:
        raise SystemExit(f"{count} of {messages} messages")


def main(what: str, messages: int, passes: int, directory: Path) -> None:
    work = {"write": write, "read": read}[what]
    rates = []
    for _ in range(passes):
        begin = time.perf_counter()
        work(directory, messages)
        rates.append(messages / (time.perf_counter() - begin))
    print(statistics.median(rates))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4]))
