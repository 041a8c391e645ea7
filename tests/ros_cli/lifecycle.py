"""Managed nodes, as `ros2 lifecycle` steers them, beside a managed node of ROS 2's own."""

from __future__ import annotations

import re
import time

from desk import Desk

NODE = "/axis_compensation"
MANAGED = [NODE, "/fake_cnc"]
PEER = "/lifecycle_peer"
"""A node of rclpy, whose steps ours must equal."""
PEER_PROGRAM = """
import rclpy
from rclpy.lifecycle import LifecycleNode
rclpy.init()
node = LifecycleNode("lifecycle_peer")
try:
    rclpy.spin(node)
except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
    pass
"""
UNCOMPENSATED_S = 15.0
STEPS_S = 300.0
"""Longer than all steps of the node together take."""
MEETING_S = 4.0
"""Until a listener of a topic that is not latched has met its node."""


def state(desk: Desk, label: str, number: int, within_s: float = 0.0) -> None:
    desk.see(
        f"the node is {label}",
        ["ros2", "lifecycle", "get", NODE],
        rf"^{label} \[{number}\]$",
        within_s=within_s,
    )


def step(desk: Desk, label: str) -> None:
    desk.see(
        f"{label} is done",
        ["ros2", "lifecycle", "set", NODE, label],
        r"^Transitioning successful$",
        limit_s=UNCOMPENSATED_S,
    )


def lifecycle(desk: Desk) -> None:
    code, _ = desk.run(["ros2", "lifecycle", "--help"], 20.0)
    if code != 0:
        desk.lack("managed nodes", "this ROS 2 has no `ros2 lifecycle`")
        return
    desk.see(
        "managed nodes are found, and no others",
        ["ros2", "lifecycle", "nodes"],
        *[f"^{node}$" for node in MANAGED],
        absent=["^/probe$", "^/sequencer$"],
        within_s=10.0,
    )
    state(desk, "active", 3)
    same_steps(desk)
    desk.see(
        "what can be asked of an active node",
        ["ros2", "lifecycle", "list", NODE],
        r"^- deactivate \[4\]\n\tStart: active\n\tGoal: deactivating$",
        r"^- shutdown \[7\]\n\tStart: active\n\tGoal: shuttingdown$",
        absent=["^- configure", "^- activate"],
    )
    events = desk.start("transition_event", "ros2", "topic", "echo", f"{NODE}/transition_event")
    time.sleep(MEETING_S)
    step(desk, "deactivate")
    state(desk, "inactive", 2)
    silent(desk)
    step(desk, "cleanup")
    state(desk, "unconfigured", 1)
    desk.see(
        "a service of an unconfigured node says why it does nothing",
        ["ros2", "service", "call", f"{NODE}/enable", "std_srvs/srv/SetBool", "{data: true}"],
        r"success=False, message='axis_compensation is unconfigured'",
    )
    desk.see(
        "a step that does not begin here is refused",
        ["ros2", "lifecycle", "set", NODE, "activate"],
        r"Unknown transition requested",
        code=None,
    )
    step(desk, "configure")
    step(desk, "activate")
    state(desk, "active", 3)
    desk.end(events, 10.0)
    said = events.said()
    goals = re.findall(r"goal_state:\n  id: \d+\n  label: (\w+)", said)
    wanted = "deactivating inactive cleaningup unconfigured configuring inactive activating active"
    desk.judge("every step is told", wanted, goals == wanted.split(), " ".join(goals), said)
    # Jazzy counts nanoseconds; Lyrical has a stamp.
    counted = [int(nanos) // 10**9 for nanos in re.findall(r"^timestamp: (\d+)$", said, re.MULTILINE)]
    stamps = counted or [int(sec) for sec in re.findall(r"^stamp:\n  sec: (\d+)$", said, re.MULTILINE)]
    ages = [time.time() - stamp for stamp in stamps]
    right = len(ages) == len(goals) and all(-1.0 <= age < STEPS_S for age in ages)
    shown = " ".join(f"{age:.0f}" for age in ages)
    desk.judge("each with the time of its step", f"ages below {STEPS_S:.0f} s", right, shown, said)


def silent(desk: Desk) -> None:
    """An inactive compensation publishes nothing; the controller's positions go on."""
    desk.watch(
        "positions go on while the compensation is inactive",
        ["ros2", "topic", "hz", "/axes/state"],
        4.0,
        "average rate",
        lambda said: match.group(0) if (match := re.search(r"average rate: \S+", said)) else None,
    )
    desk.watch(
        "and no offset is published",
        ["ros2", "topic", "echo", "/compensation"],
        3.0,
        "no message",
        lambda said: "nothing said" if "total:" not in said else None,
    )


def listed(said: str) -> list[str]:
    """The steps alone: a command may warn of something else before them."""
    return [line for line in said.splitlines() if line.startswith(("- ", "\t"))]


def same_steps(desk: Desk) -> None:
    """All steps of our node are those of a node of ROS 2's own."""
    peer = desk.start("lifecycle_peer", "python3", "-c", PEER_PROGRAM)
    said = desk.see(
        "a managed node of ROS 2's own is there",
        ["ros2", "lifecycle", "list", "-a", PEER],
        r"^- configure \[1\]$",
        within_s=20.0,
    )
    _, ours = desk.run(["ros2", "lifecycle", "list", "-a", NODE], 20.0)
    steps = said.count("Goal: ")
    right = listed(ours) == listed(said) and steps > 20
    desk.judge("ours has the same steps", f"{steps} steps, equal", right, f"{ours.count('Goal: ')} steps", ours)
    desk.end(peer, 10.0)
