"""Starting: `ros2 run`, `ros2 launch`, and a scenario in one process."""

from __future__ import annotations

import os
from pathlib import Path

from cell import NODES, SCENARIO
from desk import Desk

SIMULATED = "first_run"


def installed(desk: Desk, abbe: str, prefix: Path) -> bool:
    """`abbe install-ros PREFIX`; whether `ros2` finds the package then."""
    words = [abbe, "install-ros", str(prefix)]
    desk.see("abbe installs itself as a package", words, r"abbe")
    path = desk.env.get("AMENT_PREFIX_PATH", "")
    desk.env["AMENT_PREFIX_PATH"] = f"{prefix}{os.pathsep}{path}"
    desk.see("ros2 finds it", ["ros2", "pkg", "prefix", "abbe"], str(prefix))
    desk.see(
        "and its programs", ["ros2", "pkg", "executables", "abbe"], *[f"^abbe {n}$" for n in NODES]
    )
    return not desk.failed or (prefix / "lib" / "abbe").is_dir()


def run(desk: Desk, cell: Path) -> None:
    words = ["ros2", "run", "abbe", "probe", "--ros-args", "-r", "__node:=gauge"]
    words += ["-r", "__ns:=/second", "-r", "probe/point:=corrected", "-p", "longest_gap_ms:=7.5"]
    words += ["--log-level", "warn", "--params-file", str(cell / "probe.yaml")]
    node = desk.start("ros2 run", *words)
    desk.see(
        "ros2 run with a name, a namespace and a remapped topic",
        ["ros2", "node", "info", "/second/gauge"],
        r"/second/corrected: abbe_msgs/msg/ProbedPoint",
        r"/second/axes/state: abbe_msgs/msg/AxisState",
        within_s=20.0,
    )
    desk.see(
        "and a parameter that the file does not set",
        ["ros2", "param", "get", "/second/gauge", "longest_gap_ms"],
        r"Double value is: 7.5",
    )
    code = desk.end(node, 20.0)
    desk.judge("Ctrl-C ends it", "exit code 0", code == 0, f"exit code {code}", node.said())


def launch(desk: Desk, cell: Path) -> None:
    file = cell / f"{SCENARIO}.launch.xml"
    system = desk.start("ros2 launch", "ros2", "launch", str(file))
    whole = [f"^/{node}$" for node in NODES]
    desk.see(
        "ros2 launch starts every node of the scenario",
        ["ros2", "node", "list"],
        *whole,
        within_s=30.0,
    )
    desk.see(
        "each with its parameters",
        ["ros2", "param", "get", "/sequencer", "start_delay_s"],
        r"Double value is: 3600.0",
        within_s=20.0,
    )
    code = desk.end(system, 40.0)
    said = system.said()
    ended = said.count("process has finished cleanly")
    desk.judge(
        "Ctrl-C ends them all in good order",
        f"exit code 0, {len(NODES)} nodes finish cleanly",
        code == 0 and ended == len(NODES),
        f"exit code {code}, {ended} nodes finished cleanly",
        said,
    )


def in_one_process(desk: Desk, abbe: str, cell: Path) -> None:
    """A cell in real time: one process, all its nodes on the graph."""
    words = [abbe, "run", str(cell), "--runs", str(desk.folder / "runs")]
    system = desk.start("abbe run", *words)
    whole = [f"^/{node}$" for node in NODES]
    desk.see("one process, every node", ["ros2", "node", "list"], *whole, within_s=20.0)
    desk.see(
        "each answers for itself",
        ["ros2", "param", "get", "/sequencer", "start_delay_s"],
        r"Double value is: 3600.0",
        within_s=20.0,
    )
    desk.end(system, 40.0)


def in_simulated_time(desk: Desk, abbe: str, root: Path) -> None:
    """A scenario in simulated time shows what it says as one node."""
    words = [abbe, "run", str(root / "launch_configs" / SIMULATED), "--pace", "10"]
    system = desk.start("abbe run simulated", *words, "--runs", str(desk.folder / "runs"))
    desk.see("one node for the run", ["ros2", "node", "list"], r"^/abbe_run$", within_s=20.0)
    for topic, pattern in {
        "/axes/state": r"^commanded:\n- -?\d",
        "/clock": r"^clock:\n +sec: \d+",
        "/temperature/ambient": r"^temperature: \d+",
    }.items():
        desk.see(
            "its topics are read",
            ["ros2", "topic", "echo", "--once", topic],
            pattern,
            limit_s=30.0,
            within_s=20.0,
        )
    desk.end(system, 30.0)

