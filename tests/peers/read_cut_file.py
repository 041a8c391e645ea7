"""How other readers take a file without its end: read_cut_file.py FILE.mcap.

Prints one line of JSON: messages that `mcap`'s stream reader gives before it stops, what it stops
with, and what its seeking reader and `rosbags` say.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from mcap.reader import NonSeekingReader, SeekingReader
from rosbags.rosbag2 import Reader


def outcome(work) -> str:
    try:
        work()
    except Exception as error:  # the peers' own kinds differ from version to version
        return f"{type(error).__name__}: {error}"
    return "read"


def main(path: Path) -> None:
    count = 0

    def stream() -> None:
        nonlocal count
        with path.open("rb") as file:
            for _ in NonSeekingReader(file).iter_messages(log_time_order=False):
                count += 1

    def seek() -> None:
        with path.open("rb") as file:
            list(SeekingReader(file).iter_messages())

    def rosbags() -> None:
        with Reader(path) as reader:
            list(reader.messages())

    said = {"stream": outcome(stream), "seeking": outcome(seek), "rosbags": outcome(rosbags)}
    print(json.dumps({"messages": count, **said}))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
