"""Copies a bag by other people's writers, once for each compression of chunks: foreign_bags.py FROM_DIRECTORY TO_DIRECTORY.

PyPI `rosbags` writes a directory with metadata.yaml, PyPI `mcap` one file. What was written is printed, a path a line.
"""

from __future__ import annotations

import sys
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer as McapWriter
from rosbags.rosbag2 import CompressionMode

from copy_bag import copy


def by_mcap(source: Path, target: Path, compression: CompressionType) -> None:
    """The messages with their definitions by `mcap`, which knows nothing of ROS."""
    with (source / "bag_0.mcap").open("rb") as stream, target.open("wb") as out:
        writer = McapWriter(out, chunk_size=64 * 1024, compression=compression)
        writer.start(profile="ros2", library="mcap")
        schemas, channels = {}, {}
        for schema, channel, message in make_reader(stream).iter_messages(log_time_order=False):
            if schema.id not in schemas:
                schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
            if channel.id not in channels:
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, schemas[schema.id], channel.metadata
                )
            writer.add_message(
                channels[channel.id],
                message.log_time,
                message.data,
                message.publish_time,
                message.sequence,
            )
        writer.finish()


def main(source: Path, target: Path) -> None:
    for name, mode in (("none", CompressionMode.NONE), ("zstd", CompressionMode.STORAGE)):
        copy(source, target / f"rosbags_{name}", mode)
        print(target / f"rosbags_{name}")
    for name in ("none", "lz4", "zstd"):
        by_mcap(source, target / f"mcap_{name}.mcap", CompressionType[name.upper()])
        print(target / f"mcap_{name}.mcap")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
