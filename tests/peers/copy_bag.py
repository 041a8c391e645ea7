"""Copies a bag with PyPI `rosbags`: copy_bag.py FROM_DIRECTORY TO_DIRECTORY."""

from __future__ import annotations

import sys
from pathlib import Path

from rosbags.rosbag2 import Reader, StoragePlugin, Writer

from read_bag import own_typestore


def main(source: Path, target: Path) -> int:
    store = own_typestore(source)
    count = 0
    with Reader(source) as reader, Writer(
        target, version=9, storage_plugin=StoragePlugin.MCAP
    ) as writer:
        connections = {
            c.id: writer.add_connection(
                c.topic,
                c.msgtype,
                msgdef=c.msgdef.data,
                rihs01=store.hash_rihs01(c.msgtype),
                offered_qos_profiles=c.ext.offered_qos_profiles,
            )
            for c in reader.connections
        }
        for connection, stamp, data in reader.messages():
            writer.write(connections[connection.id], stamp, data)
            count += 1
    return count


if __name__ == "__main__":
    print(main(Path(sys.argv[1]), Path(sys.argv[2])))
