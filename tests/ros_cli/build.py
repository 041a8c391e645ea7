"""Builds `abbe_msgs` with colcon as it is, and shows every interface of it."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

from desk import Desk

BUILD_LIMIT_S = 900.0
COMMENT = re.compile(r"\s*#.*$")
PACKAGES = ["abbe", "abbe_msgs"]


def sourced(desk: Desk, setup: Path) -> dict[str, str]:
    """The environment that a workspace's setup file makes."""
    script = '. "$1" >/dev/null && env -0'
    done = subprocess.run(
        ["bash", "-c", script, "bash", str(setup)],
        env=desk.env,
        check=True,
        capture_output=True,
        timeout=60,
    )
    pairs = (line.split("=", 1) for line in done.stdout.decode().split("\0") if "=" in line)
    return dict(pairs)


def has_colcon(desk: Desk) -> bool:
    return shutil.which("colcon", path=desk.env.get("PATH")) is not None


def packages(desk: Desk, root: Path) -> None:
    """What colcon finds in the repository, with or without its extension for cargo."""
    if not has_colcon(desk):
        desk.lack("packages that colcon finds", "no colcon on PATH")
        return
    words = ["colcon", "--log-base", os.devnull, "list", "--names-only", "--base-paths", str(root)]
    code, said = desk.run(words, 60.0)
    found = sorted(said.split())
    right = code == 0 and found == PACKAGES
    desk.judge("colcon finds two packages", " ".join(PACKAGES), right, " ".join(found), said)


def messages(desk: Desk, msgs: Path) -> bool:
    """Makes the types known to `ros2`; whether they are."""
    code, said = desk.run(["ros2", "pkg", "prefix", "abbe_msgs"], 20.0)
    if code == 0:
        desk.lack("colcon build of abbe_msgs", f"it is in {said.strip()} already: that one is used")
        return True
    if not has_colcon(desk):
        desk.lack("colcon build of abbe_msgs", "no colcon on PATH")
        return False
    base = desk.folder / "messages"
    words = ["colcon", "--log-base", str(base / "log"), "build", "--base-paths", str(msgs)]
    words += ["--build-base", str(base / "build"), "--install-base", str(base / "install")]
    words += ["--cmake-args", "-DBUILD_TESTING=OFF"]
    desk.see("colcon builds abbe_msgs unchanged", words, "1 package finished", limit_s=BUILD_LIMIT_S)
    setup = base / "install" / "local_setup.bash"
    if not setup.is_file():
        return False
    desk.env = sourced(desk, setup)
    return True


def hash_of(desk: Desk, name: str) -> str:
    """The hash that colcon gave a type such as `msg/AxisState`; no hash where it has none."""
    _, said = desk.run(["ros2", "pkg", "prefix", "--share", "abbe_msgs"], 20.0)
    file = Path(said.strip()) / f"{name}.json"
    whole = json.loads(file.read_text()) if file.is_file() else {"type_hashes": []}
    hashes = {entry["type_name"]: entry["hash_string"] for entry in whole["type_hashes"]}
    return hashes.get(f"abbe_msgs/{name}", "no hash")


def fields(text: str) -> list[str]:
    """Lines of an interface file that are no comments."""
    bare = (COMMENT.sub("", line).strip() for line in text.splitlines())
    return [" ".join(line.split()) for line in bare if line]


def interfaces(desk: Desk, msgs: Path) -> None:
    """`ros2 interface show` of each file: every line of it, in order."""
    for kind in ("msg", "srv", "action"):
        for file in sorted((msgs / kind).glob(f"*.{kind}")):
            name = f"abbe_msgs/{kind}/{file.stem}"
            code, said = desk.run(["ros2", "interface", "show", name], 20.0)
            # What is nested is shown indented below its field.
            own = [line for line in said.splitlines() if not line.startswith("\t")]
            shown = [" ".join(COMMENT.sub("", line).split()) for line in own]
            shown = [line for line in shown if line]
            wanted = fields(file.read_text())
            desk.judge(
                f"ros2 interface show {name}",
                f"{len(wanted)} lines: {'; '.join(wanted)}",
                code == 0 and shown == wanted,
                f"{len(shown)} lines: {'; '.join(shown)}",
                said,
            )
