"""Services and actions, as `ros2 service` and `ros2 action` use them."""

from __future__ import annotations

import time

from desk import Desk

MOVE = r"G21 G90\nG1 X{to} F{feed}\nM2\n"


def services(desk: Desk) -> None:
    desk.see(
        "services are listed with their types",
        ["ros2", "service", "list", "-t"],
        r"^/axis_compensation/enable \[std_srvs/srv/SetBool\]$",
        r"^/probe/get_parameters \[rcl_interfaces/srv/GetParameters\]$",
    )
    enable = "/axis_compensation/enable"
    desk.see("a service's type", ["ros2", "service", "type", enable], r"^std_srvs/srv/SetBool$")
    for wanted in ("true", "false"):
        desk.see(
            "a service is called",
            ["ros2", "service", "call", enable, "std_srvs/srv/SetBool", f"{{data: {wanted}}}"],
            r"SetBool_Response\(success=True",
        )


def sending(program: str, *more: str) -> list[str]:
    goal = f'{{name: from_the_command_line, program: "{program}"}}'
    words = ["ros2", "action", "send_goal", *more]
    return [*words, "/cnc/run_program", "abbe_msgs/action/RunProgram", goal]


def actions(desk: Desk) -> None:
    desk.see(
        "actions are listed with their types",
        ["ros2", "action", "list", "-t"],
        r"^/cnc/run_program \[abbe_msgs/action/RunProgram\]$",
        r"^/sequencer/run_cycle \[abbe_msgs/action/RunCycle\]$",
    )
    desk.see(
        "an action's clients and servers",
        ["ros2", "action", "info", "-t", "/cnc/run_program"],
        r"Action clients: \d+\n(.*\n)*? +/sequencer \[abbe_msgs/action/RunProgram\]",
        r"Action servers: 1\n +/fake_cnc \[abbe_msgs/action/RunProgram\]",
    )
    desk.see(
        "a program runs, with feedback and result",
        sending(MOVE.format(to=20, feed=1200), "--feedback"),
        r"Goal accepted with ID",
        r"Feedback:\n +line: \d+\nstate: 1\nprogress: ",
        r"Result:\n +outcome: 0",
        r"Goal finished with status: SUCCEEDED",
        limit_s=30.0,
    )
    desk.see(
        "the axis is where the program sent it",
        ["ros2", "topic", "echo", "--once", "--field", "commanded", "/axes/state"],
        r"0\.02\b",
    )
    desk.see(
        "a program that cannot be is refused with line and column",
        sending(r"G21 G90\nG1 X20 Q7\nM2\n"),
        r"Result:\n +outcome: 1\nmessage: .line 2, column 8: .*Q7",
        r"Goal finished with status: ABORTED",
        code=None,
    )
    cancelled(desk)


def cancelled(desk: Desk) -> None:
    """Ctrl-C while the axis moves slowly: the goal is called off and the axis stays where it is."""
    words = sending(MOVE.format(to=0, feed=30), "--feedback")
    sender = desk.start("send_goal", *words)
    deadline = time.monotonic() + 20.0
    while "Feedback" not in sender.said() and time.monotonic() < deadline:
        time.sleep(0.2)
    code = desk.end(sender, 15.0)
    said = sender.said()
    # From Iron on its context is shut down by then, and it does not wait for the answer.
    desk.judge(
        f"Ctrl-C calls a goal off: {' '.join(words[:4])}",
        "Canceling goal...",
        "Canceling goal..." in said,
        f"exit code {code}, {said.splitlines()[-1] if said else 'nothing said'}",
        said,
    )
    desk.see(
        "the controller has called it off",
        ["ros2", "topic", "echo", "--once", "/cnc/run_program/_action/status"],
        r"status: 5\n---",
        within_s=15.0,
    )
    desk.see(
        "and takes the next program",
        sending(MOVE.format(to=0, feed=6000)),
        r"Goal finished with status: SUCCEEDED",
        limit_s=30.0,
    )
