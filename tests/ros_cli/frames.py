"""Frames, as `ros2 topic` shows them and tf2's own listener composes them."""

from __future__ import annotations

from desk import Desk

START_Z_M = "0.240"
"""Where the cell's Z waits, from its fake_cnc.yaml; X and Y wait at zero."""


def frames(desk: Desk) -> None:
    desk.see(
        "tf is offered as everybody reads it",
        ["ros2", "topic", "info", "-v", "/tf_static"],
        r"Type: tf2_msgs/msg/TFMessage",
        r"Node name: machine_frames\n(.*\n)*? +Reliability: RELIABLE",
        r"Node name: machine_frames\n(.*\n)*? +Durability: TRANSIENT_LOCAL",
        within_s=20.0,
    )
    desk.see(
        "moving frames are read",
        ["ros2", "topic", "echo", "--once", "/tf"],
        r"frame_id: base_link",
        r"child_frame_id: x_slide",
        r"child_frame_id: machine$",
    )
    desk.see(
        "who comes late gets the fixed frames",
        ["ros2", "topic", "echo", "--once", "--qos-durability", "transient_local"]
        + ["--qos-reliability", "reliable", "/tf_static"],
        r"child_frame_id: probe_tip",
        r"child_frame_id: workpiece",
    )
    code, said = desk.run(["ros2", "pkg", "executables", "tf2_ros"], 20.0)
    if code != 0 or "tf2_echo" not in said:
        desk.lack("tf2's own listener", "tf2_ros with tf2_echo is not installed")
        return
    desk.watch(
        "tf2 composes the tip in the workpiece",
        ["ros2", "run", "tf2_ros", "tf2_echo", "workpiece", "probe_tip"],
        10.0,
        f"Translation: [0.000, 0.000, {START_Z_M}]",
        tip,
    )


def tip(said: str) -> str | None:
    """The last translation where it is the expected one; signs of zeros mean nothing."""
    lines = [line for line in said.splitlines() if "Translation:" in line]
    if not lines:
        return None
    numbers = lines[-1].split("[", 1)[1].rstrip("] ").split(",")
    x_m, y_m, z_m = (float(number) for number in numbers)
    right = abs(x_m) < 1e-4 and abs(y_m) < 1e-4 and abs(z_m - float(START_Z_M)) < 1e-4
    return lines[-1].strip() if right else None
