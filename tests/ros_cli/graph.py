"""Nodes, topics and messages, as `ros2 node` and `ros2 topic` show them."""

from __future__ import annotations

import re

from build import hash_of
from cell import NODES
from desk import Desk
from router import ZENOH

DISCOVERY_S = 20.0
BACKGROUND_RATE_HZ = 10.0
"""Rate of `axes/state` while nothing moves, from the cell's fake_cnc.yaml."""


def nodes(desk: Desk) -> None:
    whole = [f"^/{node}$" for node in NODES]
    desk.see("every node is listed", ["ros2", "node", "list"], *whole, within_s=DISCOVERY_S)
    parameters = [
        rf"/fake_cnc/{service}: rcl_interfaces/srv/{kind}"
        for service, kind in {
            "describe_parameters": "DescribeParameters",
            "get_parameter_types": "GetParameterTypes",
            "get_parameters": "GetParameters",
            "list_parameters": "ListParameters",
            "set_parameters": "SetParameters",
            "set_parameters_atomically": "SetParametersAtomically",
            "get_logger_levels": "GetLoggerLevels",
            "set_logger_levels": "SetLoggerLevels",
        }.items()
    ]
    described = "type_description_interfaces/srv/GetTypeDescription"
    parameters.append(rf"/fake_cnc/get_type_description: {described}")
    desk.see(
        "a node's ends are listed by kind",
        ["ros2", "node", "info", "/fake_cnc"],
        r"Subscribers:\n(.*\n)*? +/compensation: abbe_msgs/msg/AxisCompensation",
        r"Publishers:\n(.*\n)*? +/axes/state: abbe_msgs/msg/AxisState",
        r"/joint_states: sensor_msgs/msg/JointState",
        r"/rosout: rcl_interfaces/msg/Log",
        r"/parameter_events: rcl_interfaces/msg/ParameterEvent",
        *parameters,
        r"Action Servers:\n +/cnc/run_program: abbe_msgs/action/RunProgram",
        within_s=DISCOVERY_S,
    )
    desk.see(
        "clients are listed too",
        ["ros2", "node", "info", "/sequencer"],
        r"Service Clients:\n(.*\n)*? +/axis_compensation/enable: std_srvs/srv/SetBool",
        r"Action Servers:\n +/sequencer/run_cycle: abbe_msgs/action/RunCycle",
        r"Action Clients:\n +/cnc/run_program: abbe_msgs/action/RunProgram",
        within_s=DISCOVERY_S,
    )


def topics(desk: Desk) -> None:
    desk.see(
        "topics are listed with their types",
        ["ros2", "topic", "list", "-t"],
        r"^/axes/state \[abbe_msgs/msg/AxisState\]$",
        r"^/joint_states \[sensor_msgs/msg/JointState\]$",
        r"^/temperature/ambient \[sensor_msgs/msg/Temperature\]$",
        r"^/diagnostics \[diagnostic_msgs/msg/DiagnosticArray\]$",
        r"^/sequencer/status \[abbe_msgs/msg/PlanStatus\]$",
        within_s=DISCOVERY_S,
    )
    desk.see(
        "quality of service of both sides, and whose they are",
        ["ros2", "topic", "info", "-v", "/axes/state"],
        r"Type: abbe_msgs/msg/AxisState",
        r"Node name: fake_cnc\n(.*\n)*?Endpoint type: PUBLISHER\n(.*\n)*? +Reliability: RELIABLE",
        r"Node name: probe\n(.*\n)*?Endpoint type: SUBSCRIPTION",
        r"Durability: VOLATILE",
        within_s=DISCOVERY_S,
    )
    desk.see(
        "a latched topic says so",
        ["ros2", "topic", "info", "-v", "/thermal/model"],
        r"Node name: thermal_model\n(.*\n)*? +Durability: TRANSIENT_LOCAL",
    )


def type_hashes(desk: Desk) -> None:
    """Over Zenoh each end has the hash that colcon gave its type; over DDS ours send none."""
    is_zenoh = desk.env.get("RMW_IMPLEMENTATION") == ZENOH
    wanted = hash_of(desk, "msg/AxisState") if is_zenoh else "INVALID"
    desk.see(
        "the type's hash",
        ["ros2", "topic", "info", "-v", "/axes/state"],
        rf"Node name: fake_cnc\nNode namespace: /\n.*\nTopic type hash: {wanted}\nEndpoint type: PUBLISHER",
        rf"Node name: probe\nNode namespace: /\n.*\nTopic type hash: {wanted}\nEndpoint type: SUBSCRIPTION",
    )


def messages(desk: Desk) -> None:
    echo = ["ros2", "topic", "echo", "--once"]
    desk.see(
        "a topic of our own is read",
        [*echo, "/axes/state"],
        r"^controller_stamp:",
        r"^axis:\n- X\n- Y\n- Z$",
        r"^commanded:\n- 0.0\n- 0.0\n- 0.24$",
    )
    desk.see(
        "a standard topic is read",
        [*echo, "/joint_states"],
        r"^name:\n- X\n- Y\n- Z$",
        r"^position:\n- -?\d",
    )
    desk.see(
        "a best-effort topic is read",
        [*echo, "/temperature/ambient"],
        r"^temperature: \d+\.\d+$",
        limit_s=30.0,
    )
    desk.see(
        "who comes late gets what is latched",
        [*echo, "/rosout"],
        # On a busy computer a later message is first.
        r"^msg: (started parameters=\d+$|'over for \d+ s: )",
    )
    desk.see("health is told", [*echo, "/diagnostics"], r"message: running")
    desk.see(
        "one field of a topic",
        [*echo, "--field", "commanded", "/axes/state"],
        r"0\.24",
    )
    desk.watch("its rate", ["ros2", "topic", "hz", "/axes/state"], 8.0, "9.5 to 10.5 Hz", rate)
    desk.watch("its bandwidth", ["ros2", "topic", "bw", "/axes/state"], 8.0, "B/s", bandwidth)


def rate(said: str) -> str | None:
    rates = [float(text) for text in re.findall(r"average rate: ([\d.]+)", said)]
    right = bool(rates) and abs(rates[-1] - BACKGROUND_RATE_HZ) <= 0.5
    return f"{rates[-1]} Hz" if right else None


def bandwidth(said: str) -> str | None:
    found = re.search(r"[\d.]+ [KkM]?B/s from \d+ messages", said)
    return found.group(0) if found else None


def received(desk: Desk, node: str, topic: str) -> int | None:
    """How many messages a node has counted on a topic, from its diagnostics."""
    words = ["ros2", "topic", "echo", "--once", "--full-length", "/diagnostics"]
    words += ["--filter", f"m.status[0].name == '{node}'"]
    _, said = desk.run(words, 20.0)
    found = re.search(rf"key: {topic} received\s+value: '(\d+)'", said)
    return int(found.group(1)) if found else None


LATENCY = (
    "{method: 2, latency_s: 0.0011, standard_uncertainty_s: 1.0e-05, two_feed_latency_s: 0.0011, "
    "least_squares_latency_s: 0.0011, feeds_m_s: [0.001, 0.002, 0.004], n: 6, lack_of_fit_p: 0.5}"
)


def sending(desk: Desk) -> None:
    before = received(desk, "/probe", "/latency")
    words = ["ros2", "topic", "pub", "--once", "/latency", "abbe_msgs/msg/ProbeLatency", LATENCY]
    words += ["--qos-durability", "transient_local", "--qos-reliability", "reliable"]
    desk.see("a message is sent to a node", words, r"publishing #1", limit_s=30.0)
    after = received(desk, "/probe", "/latency")
    desk.judge(
        "the node counts it on /diagnostics",
        "one more than before",
        before is not None and after == before + 1,
        f"{before}, then {after}",
    )
