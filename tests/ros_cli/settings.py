"""Parameters, log levels and types, as `ros2 param` and service calls show them."""

from __future__ import annotations

from build import hash_of
from desk import Desk

FROZEN = "parameters are frozen after start"


def parameters(desk: Desk) -> None:
    param = ["ros2", "param"]
    desk.see(
        "parameters are listed",
        [*param, "list", "/probe"],
        r"^ +longest_gap_ms$",
        r"^ +machine_file$",
        r"^ +use_sim_time$",
    )
    desk.see("those of every node", [*param, "list"], r"^/fake_cnc:$", r"^/thermal_model:$")
    desk.see("a value is got", [*param, "get", "/probe", "longest_gap_ms"], r"Double value is: 5.0")
    desk.see(
        "a parameter that is not there",
        [*param, "get", "/probe", "longest_gap"],
        r"Parameter not set",
        code=None,
    )
    desk.see(
        "a parameter is described, with range and reason",
        [*param, "describe", "/fake_cnc", "background_rate_hz"],
        r"Type: double",
        r"Description: Rate of axis states otherwise",
        r"Constraints:\n +Read only: true\n +Min value: 0\.0\n +Max value: 20000\.0$",
        rf"Additional constraints: {FROZEN}",
    )
    setting = [*param, "set", "/probe"]
    for name, value, reason in [
        ("longest_gap_ms", "6.0", FROZEN),
        ("longest_gap_ms", "-1.0", r"-1 is outside"),
        ("longest_gap_ms", "wide", r"`longest_gap_ms` is a double, not a string"),
        ("longest_gap", "6.0", r"`longest_gap` is unknown"),
    ]:
        desk.see("setting is refused with the reason", [*setting, name, value], reason, code=None)
    said = desk.see(
        "parameters are dumped as a file",
        [*param, "dump", "/probe"],
        r"^/probe:\n +ros__parameters:",
        r"^ +longest_gap_ms: 5.0$",
    )
    dumped = desk.folder / "probe_dumped.yaml"
    dumped.write_text(said[said.find("/probe:") :])
    desk.see(
        "loading them again is refused with the reason",
        [*param, "load", "/probe", str(dumped)],
        rf"Set parameter longest_gap_ms failed: .*{FROZEN}",
        code=None,
    )


def calling(service: str, kind: str, request: str) -> list[str]:
    return ["ros2", "service", "call", service, kind, request]


def log_levels(desk: Desk) -> None:
    get, put = "rcl_interfaces/srv/GetLoggerLevels", "rcl_interfaces/srv/SetLoggerLevels"
    asking = calling("/probe/get_logger_levels", get, "{names: [probe, stranger]}")
    desk.see(
        "log levels that nobody set",
        asking,
        r"LoggerLevel\(name='probe', level=0\).*LoggerLevel\(name='stranger', level=0\)",
    )
    setting = "{levels: [{name: probe, level: 10}, {name: stranger, level: 10}, {name: probe, level: 11}]}"
    desk.see(
        "a log level is set, another logger's and an unknown level refused with the reason",
        calling("/probe/set_logger_levels", put, setting),
        r"successful=True, reason=''.*successful=False, reason=.logger `stranger`.*"
        r"successful=False, reason=.log level 11",
    )
    desk.see("it is in force", asking, r"LoggerLevel\(name='probe', level=10\)")
    desk.see(
        "and taken back",
        calling("/probe/set_logger_levels", put, "{levels: [{name: probe, level: 0}]}"),
        r"successful=True",
    )


DESCRIBED = ["msg/AxisState", "msg/GapReport", "action/RunProgram"]


def type_descriptions(desk: Desk) -> None:
    """A node knows its types by the hashes that colcon gave them."""
    kind = "type_description_interfaces/srv/GetTypeDescription"
    for name in DESCRIBED:
        full = f"abbe_msgs/{name}"
        request = f"{{type_name: {full}, type_hash: {hash_of(desk, name)}, include_type_sources: false}}"
        desk.see(
            "a type is described under the hash that colcon gave it",
            calling("/fake_cnc/get_type_description", kind, request),
            rf"successful=True, failure_reason='', .*type_name='{full}'",
        )
    wrong = "{type_name: abbe_msgs/msg/AxisState, type_hash: RIHS01_0}"
    desk.see(
        "another hash is refused with the reason",
        calling("/fake_cnc/get_type_description", kind, wrong),
        r"successful=False, failure_reason='type `abbe_msgs/msg/AxisState` has the hash RIHS01_",
    )
