"""The router that nodes on Zenoh meet through: `zenohd`, or the one of rmw_zenoh_cpp."""

from __future__ import annotations

import json
import os
import shutil
import socket
import time
from pathlib import Path

from desk import Desk

ZENOH = "rmw_zenoh_cpp"
CONFIGURATION = "launch_configs/three_hosts/zenoh_router.json5"
START_S = 20.0


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def start(desk: Desk, root: Path) -> bool:
    """Starts a router of this check's own where the middleware is Zenoh; whether nodes can meet."""
    if desk.env.get("RMW_IMPLEMENTATION") != ZENOH:
        return True
    port = free_port()
    endpoints = json.dumps([f"tcp/127.0.0.1:{port}"])
    words = started_by(desk, str(root / CONFIGURATION), endpoints)
    router = desk.start("router", *words)
    desk.env["ZENOH_CONFIG_OVERRIDE"] = f"connect/endpoints={endpoints}"
    desk.env["ZENOH_ROUTER_CHECK_ATTEMPTS"] = "10"
    deadline = time.monotonic() + START_S
    is_there = False
    while not is_there and time.monotonic() < deadline:
        with socket.socket() as caller:
            is_there = caller.connect_ex(("127.0.0.1", port)) == 0
        time.sleep(0.2)
    name = f"a router listens: {words[0]}"
    seen = "it listens" if is_there else "nothing"
    return desk.judge(name, f"port {port}", is_there, seen, router.said())


def started_by(desk: Desk, file: str, endpoints: str) -> list[str]:
    """The command; `ABBE_ROUTER` names a `zenohd` that is not on PATH."""
    program = os.environ.get("ABBE_ROUTER") or shutil.which("zenohd")
    if program is not None:
        return [program, "--config", file, "--cfg", f"listen/endpoints:{endpoints}"]
    desk.env["ZENOH_ROUTER_CONFIG_URI"] = file
    # Of the router alone: nodes get theirs once it is started.
    desk.env["ZENOH_CONFIG_OVERRIDE"] = f"listen/endpoints={endpoints}"
    return ["ros2", "run", "rmw_zenoh_cpp", "rmw_zenohd"]
