"""Bags both ways: ours in `ros2 bag`, and its recordings in `abbe`."""

from __future__ import annotations

import json
import re
import time
from pathlib import Path

from desk import Desk

OURS = "bags/cold_reference"
LISTENER = "listening"
RECORDED = "/axes/state"
# A player has its publishers before it waits; without that what it sends comes before listeners have met them.
PLAY = ["--rate", "20", "--delay", "3"]


def bags(desk: Desk, abbe: str, root: Path, cell: Path) -> None:
    code, said = desk.run(["ros2", "bag", "--help"], 20.0)
    if code != 0 or "record" not in said:
        desk.lack("ros2 bag record, info, play", "this ROS 2 has no rosbag2")
        return
    ours = root / OURS
    counts = counted(desk, abbe, ours)
    described(desk, ours, counts)
    played(desk, ours, counts)
    into_a_node(desk, abbe, ours, root)
    converted(desk, abbe, ours, root)
    theirs = recorded(desk, abbe, cell)
    if theirs is not None:
        read_here(desk, abbe, theirs)


def counted(desk: Desk, abbe: str, bag: Path) -> dict[str, int]:
    """Messages of each topic, as `abbe check` counts them by computing them again."""
    _, said = desk.run([abbe, "check", "--json", str(bag)], 60.0)
    text = said[said.index("{") :]
    compared = json.JSONDecoder().raw_decode(text)[0]["compared"]
    return {topic: told["messages"] for topic, told in compared.items()}


def described(desk: Desk, bag: Path, counts: dict[str, int]) -> None:
    rows = [rf"Topic: {topic} \| Type: abbe_msgs/\S+ \| Count: {n} " for topic, n in counts.items()]
    desk.see(
        "our bag is described",
        ["ros2", "bag", "info", str(bag)],
        r"Storage id: +mcap",
        r"Duration: +46\.015",
        *rows,
    )


def played(desk: Desk, bag: Path, counts: dict[str, int]) -> None:
    """`ros2 bag play` sends our bag; what arrives is heard by `ros2 topic echo`."""
    topic = "/probe/point"
    listener = desk.start(LISTENER, "ros2", "topic", "echo", topic, "abbe_msgs/msg/ProbedPoint")
    time.sleep(4.0)
    desk.see(
        "our bag is played",
        ["ros2", "bag", "play", str(bag), *PLAY, "--topics", topic, "/thermal/model"],
        limit_s=60.0,
    )
    time.sleep(1.0)
    desk.end(listener, 10.0)
    heard = len(re.findall(r"^feature_id:", listener.said(), re.MULTILINE))
    expected = counts[topic]
    right = heard == expected
    desk.judge("every touch of it arrives", f"{expected} touches", right, f"{heard} touches", listener.said())


def into_a_node(desk: Desk, abbe: str, bag: Path, root: Path) -> None:
    """A node of ours computes from what `ros2 bag play` sends."""
    parameters = root / "launch_configs" / "first_run" / "thermal_model.yaml"
    words = [abbe, "node", "thermal_model", "--ros-args", "--params-file", str(parameters)]
    node = desk.start("thermal_model", *words)
    echo = ["ros2", "topic", "echo", "/thermal/model", "abbe_msgs/msg/ThermalModel"]
    model = desk.start("model", *echo, "--field", "sequence")
    time.sleep(4.0)
    desk.see(
        "blocks of our bag are played into a node",
        ["ros2", "bag", "play", str(bag), *PLAY, "--topics", "/blocks/measurement"],
        limit_s=60.0,
    )
    time.sleep(2.0)
    desk.end(model, 10.0)
    desk.end(node, 20.0)
    said = model.said()
    right = re.search(r"^\d+$", said, re.MULTILINE)
    desk.judge("the node answers with a model", "a sequence number", right is not None, said, node.said())


CONVERSION = """
output_bags:
- uri: {bag}
  storage_id: mcap
  storage_preset_profile: zstd_fast
  max_bagfile_duration: 20
  all: true
  all_topics: true
"""


def converted(desk: Desk, abbe: str, bag: Path, root: Path) -> None:
    """Our bag, compressed and in several files by their recorder, is diagnosed alike with and without its description."""
    theirs, options = desk.folder / "converted", desk.folder / "conversion.yaml"
    options.write_text(CONVERSION.format(bag=theirs))
    desk.see(
        "our bag is converted",
        ["ros2", "bag", "convert", "-i", str(bag), "-o", str(options)],
        limit_s=60.0,
    )
    files = sorted(file.name for file in theirs.glob("*.mcap"))
    desk.judge("into several files", "3 files", len(files) == 3, " ".join(files))
    wanted = diagnosis(desk, abbe, bag, root)
    for case in ("with", "without"):
        found = diagnosis(desk, abbe, theirs, root)
        right = found is not None and found == wanted
        seen = "no report" if found is None else f"causes {[cause['effect'] for cause in found['causes']]}"
        expected = "the report of our bag"
        desk.judge(f"they are diagnosed alike {case} their description", expected, right, seen, str(found))
        (theirs / "metadata.yaml").unlink(missing_ok=True)


def diagnosis(desk: Desk, abbe: str, bag: Path, root: Path) -> dict | None:
    """The report of `abbe diagnose` without the bag's place, the hash of its bytes and the time taken."""
    machine = root / "launch_configs" / "cold_reference" / "machine.yaml"
    _, said = desk.run([abbe, "diagnose", "--json", "-", str(bag), "--machine", str(machine)], 120.0)
    if "{" not in said:
        return None
    report = json.JSONDecoder().raw_decode(said[said.index("{") :])[0]
    report.pop("runtime_s", None)
    for read in report["inputs"]["bags"]:
        read.pop("path")
        read.pop("sha256")
    return report


def recorded(desk: Desk, abbe: str, cell: Path) -> Path | None:
    """`ros2 bag record` of a cell whose axis moves."""
    words = [abbe, "run", str(cell), "--separate", "--runs", str(desk.folder / "runs")]
    system = desk.start("cell to be recorded", *words)
    desk.see("the cell is there", ["ros2", "node", "list"], r"^/fake_cnc$", within_s=20.0)
    bag = desk.folder / "theirs"
    recorder = desk.start("recording", "ros2", "bag", "record", "--all", "-o", str(bag))
    time.sleep(8.0)
    code = desk.end(recorder, 30.0)
    desk.end(system, 40.0)
    said = recorder.said()
    right = code == 0 and (bag / "metadata.yaml").is_file()
    desk.judge("a cell is recorded", "exit code 0, a bag", right, f"exit code {code}", said)
    return bag if right else None


def read_here(desk: Desk, abbe: str, bag: Path) -> None:
    desk.see(
        "their bag holds our topics",
        ["ros2", "bag", "info", str(bag)],
        rf"Topic: {RECORDED} \| Type: abbe_msgs/msg/AxisState \| Count: [1-9]",
    )
    desk.see(
        "their bag is no run that can be computed again, and that is said",
        [abbe, "check", str(bag)],
        r"total order|composed run|abbe\.run",
        code=None,
        limit_s=60.0,
    )
    mirror = desk.start("played here", abbe, "play", str(bag), "--rate", "5", "--delay", "3")
    desk.see(
        "their bag is played by us",
        ["ros2", "topic", "echo", "--once", RECORDED, "abbe_msgs/msg/AxisState"],
        r"^commanded:\n- -?\d",
        limit_s=20.0,
        within_s=15.0,
    )
    desk.end(mirror, 20.0)
