"""Copies a bag with PyPI `rosbags`: copy_bag.py FROM_DIRECTORY TO_DIRECTORY."""

from __future__ import annotations

import sys
from pathlib import Path

from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer

from read_bag import own_typestore


def copy(source: Path, target: Path, mode: CompressionMode = CompressionMode.NONE) -> int:
    """The messages with their definitions, hashes and qualities of service; no attachment, no record of ours."""
    store = own_typestore(source)
    count = 0
    writer = Writer(target, version=9, storage_plugin=StoragePlugin.MCAP)
    if mode is not CompressionMode.NONE:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with Reader(source) as reader, writer:
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
    print(copy(Path(sys.argv[1]), Path(sys.argv[2])))
