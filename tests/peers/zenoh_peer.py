"""PyPI eclipse-zenoh as the other side of a graph over Zenoh, and as its router.

    zenoh_peer.py router FILE ENDPOINT [ROUTER...] by a configuration, until standard input ends
    zenoh_peer.py secured FILE FOLDER HOST [ROUTER...]
                                                   the same with a host's certificate, as FILE listens
    zenoh_peer.py meet ENDPOINT DOMAIN             meets a fake_cnc, says as JSON what it saw

With ABBE_ROUTER=PROGRAM the router is that program, a `zenohd`.

Keys, tokens and attachments are written here from the design of rmw_zenoh, type hashes are those of
PyPI rosbags: nothing is taken from the side under test.
"""

from __future__ import annotations

import ctypes
import json
import os
import signal
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

import zenoh
import zenoh.ext
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

MSGS = Path(__file__).resolve().parents[2] / "msgs"
GOAL = bytes(range(16))
SENDER = bytes(range(100, 116))
CDR = bytes([0, 1, 0, 0])
PR_SET_PDEATHSIG = 1


def config(listen: list[str], connect: list[str]) -> zenoh.Config:
    made = zenoh.Config()
    made.insert_json5("mode", json.dumps("peer"))
    made.insert_json5("listen/endpoints", json.dumps(listen))
    made.insert_json5("connect/endpoints", json.dumps(connect))
    made.insert_json5("connect/exit_on_failure", "false")
    made.insert_json5("scouting/multicast/enabled", "false")
    made.insert_json5("timestamping/enabled", "true")
    return made


def route(file: str, settings: dict) -> None:
    program = os.environ.get("ABBE_ROUTER")
    if program is not None:
        route_by(program, file, settings)
        return
    # As rmw_zenohd does.
    zenoh.init_log_from_env_or("error")
    made = zenoh.Config.from_file(file)
    for key, value in settings.items():
        made.insert_json5(key, json.dumps(value))
    with zenoh.open(made):
        print("listening", flush=True)
        sys.stdin.read()


def route_by(program: str, file: str, settings: dict) -> None:
    """The same by `zenohd` itself."""
    words = [program, "--config", file]
    for key, value in settings.items():
        words += ["--cfg", f"{key}:{json.dumps(value)}"]
    router = subprocess.Popen(
        words,
        env=os.environ | {"RUST_LOG": "info"},
        preexec_fn=end_with_parent,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    for line in router.stdout:
        if "can be reached at" in line:
            break
    else:
        sys.exit(f"{program} ended with {router.wait()}")
    print("listening", flush=True)
    # Where nobody reads them, its lines stop it once the pipe is full.
    threading.Thread(target=forward, args=[router.stdout]).start()
    sys.stdin.read()
    router.terminate()
    router.wait()


def end_with_parent() -> None:
    """A script that is killed ends no router: the kernel does."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


def forward(lines) -> None:
    for line in lines:
        print(line, end="", flush=True)


def certificates(folder: str, host: str) -> dict:
    """Settings that give a session or router the certificate of a host."""
    tls, own = "transport/link/tls", f"{folder}/{host}"
    return {
        f"{tls}/root_ca_certificate": f"{folder}/ca.pem",
        f"{tls}/listen_private_key": f"{own}.key",
        f"{tls}/listen_certificate": f"{own}.pem",
        f"{tls}/connect_private_key": f"{own}.key",
        f"{tls}/connect_certificate": f"{own}.pem",
    }


def attachment(number: int) -> bytes:
    return struct.pack("<qqB", number, time.time_ns(), 16) + SENDER


def read(attached) -> tuple[int, int, str]:
    number, nanos, length = struct.unpack_from("<qqB", attached)
    assert length == 16 and len(attached) == 33
    return number, nanos, attached[17:].hex()


def text(value: str) -> bytes:
    """A string as CDR has it, filled up to four bytes."""
    raw = value.encode() + b"\0"
    return struct.pack("<I", len(raw)) + raw + bytes(-len(raw) % 4)


def types():
    store = get_typestore(Stores.ROS2_JAZZY)
    found = {}
    for file in sorted((MSGS / "msg").glob("*.msg")):
        found.update(get_types_from_msg(file.read_text(), f"abbe_msgs/msg/{file.stem}"))
    store.register(found)
    return store


def dds(ros_type: str) -> str:
    package, kind, name = ros_type.split("/")
    return f"{package}::{kind}::dds_::{name}_"


class Desk:
    """A session in a domain."""

    def __init__(self, endpoint: str, domain: int) -> None:
        self.session = zenoh.open(config(["tcp/127.0.0.1:0"], [endpoint]))
        self.domain = domain
        self.types = types()

    def tokens(self, wanted: list[tuple[str, str]]) -> list[str]:
        """All tokens of the domain, once each kind and name of `wanted` is there: a node declares them one by one."""
        deadline = time.monotonic() + 15
        while time.monotonic() < deadline:
            replies = self.session.liveliness().get(f"@ros2_lv/{self.domain}/**", timeout=2.0)
            found = [str(reply.ok.key_expr) for reply in replies if reply.ok]
            absent = [end for end in wanted if not named(found, *end)]
            if not absent:
                return sorted(found)
            time.sleep(0.1)
        raise SystemExit(f"no token of {absent} in 15 s")

    def key(self, topic: str, ros_type: str) -> str:
        digest = self.types.hash_rihs01(ros_type)
        return f"{self.domain}{topic}/{dds(ros_type)}/{digest}"

    def hear(self, topic: str, ros_type: str, count: int) -> dict:
        samples = []

        def take(sample) -> None:
            samples.append((sample, time.time_ns()))

        subscriber = self.session.declare_subscriber(self.key(topic, ros_type), take)
        deadline = time.monotonic() + 20
        while len(samples) < count and time.monotonic() < deadline:
            time.sleep(0.01)
        subscriber.undeclare()
        attached = [read(sample.attachment.to_bytes()) for sample, _ in samples]
        last = self.types.deserialize_cdr(samples[-1][0].payload.to_bytes(), ros_type)
        delays = sorted(came - nanos for (_, nanos, _), (_, came) in zip(attached, samples))
        return {
            "numbers": [number for number, _, _ in attached],
            "senders": sorted({sender for _, _, sender in attached}),
            "delay_us": [delays[len(delays) * share // 1000] / 1e3 for share in (500, 990)],
            "frame": last.header.frame_id,
            "motor": list(last.motor),
        }

    def heard_by(self, token: str, seconds: float, during) -> list[bytes]:
        """What a publisher said while something was done, and for some time after."""
        *_, topic, ros_type, digest, _qos = token.split("/")
        payloads = []
        subscriber = self.session.declare_subscriber(
            f"{self.domain}{topic.replace('%', '/')}/{ros_type}/{digest}",
            lambda sample: payloads.append(sample.payload.to_bytes()),
        )
        during()
        time.sleep(seconds)
        subscriber.undeclare()
        return payloads

    def latched(self, topic: str, ros_type: str) -> int:
        """How many samples who comes late gets."""
        found = []
        subscriber = zenoh.ext.declare_advanced_subscriber(
            self.session,
            self.key(topic, ros_type),
            found.append,
            history=zenoh.ext.HistoryConfig(detect_late_publishers=True),
        )
        deadline = time.monotonic() + 5
        while not found and time.monotonic() < deadline:
            time.sleep(0.01)
        subscriber.undeclare()
        return len(found)

    def ask(self, token: str, number: int, request: bytes, timeout: float = 10.0) -> bytes:
        """Asks the server that a token stands for."""
        *_, service, service_type, digest, _qos = token.split("/")
        key = f"{self.domain}{service.replace('%', '/')}/{service_type}/{digest}"
        replies = self.session.get(
            key,
            payload=CDR + request,
            attachment=attachment(number),
            target=zenoh.QueryTarget.ALL_COMPLETE,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=timeout,
        )
        for reply in replies:
            if reply.ok:
                echoed, _, sender = read(reply.ok.attachment.to_bytes())
                assert (echoed, sender) == (number, SENDER.hex()), "the reply names its request"
                return reply.ok.payload.to_bytes()
        raise SystemExit(f"no reply of {key}")

    def say(self, topic: str, ros_type: str, digest: str, payloads: list[bytes]) -> None:
        """Says something with the token of a publisher, which stays until the end."""
        session = self.session
        key = f"{self.domain}{topic}/{dds(ros_type)}/{digest}"
        place = f"@ros2_lv/{self.domain}/{session.zid()}/0"
        token = f"{place}/1/MP/%/%/peer/{topic.replace('/', '%')}/{dds(ros_type)}/{digest}/::,10:,:,:,,"
        self.kept = [
            session.liveliness().declare_token(f"{place}/0/NN/%/%/peer"),
            session.liveliness().declare_token(token),
        ]
        publisher = session.declare_publisher(key)
        time.sleep(1.0)
        for number, payload in enumerate(payloads, 1):
            publisher.put(payload, attachment=attachment(number))
            time.sleep(0.002)
        time.sleep(0.5)


# The publishers and services of the node that this peer meets.
ENDS = [
    ("MP", "/axes/state"),
    ("MP", "/cnc/run_program/_action/feedback"),
    ("MP", "/cnc/run_program/_action/status"),
    ("SS", "/cnc/run_program/_action/cancel_goal"),
    ("SS", "/cnc/run_program/_action/get_result"),
    ("SS", "/cnc/run_program/_action/send_goal"),
    ("SS", "/fake_cnc/change_state"),
    ("SS", "/fake_cnc/get_parameters"),
    ("SS", "/fake_cnc/get_state"),
    ("SS", "/fake_cnc/list_parameters"),
    ("SS", "/fake_cnc/set_parameters"),
]


def named(tokens: list[str], kind: str, name: str) -> list[str]:
    mangled = name.replace("/", "%")
    return [t for t in tokens if t.split("/")[5] == kind and t.split("/")[9:10] == [mangled]]


def one(tokens: list[str], kind: str, name: str) -> str:
    found = named(tokens, kind, name)
    assert len(found) == 1, f"{kind} {name}: {found}"
    return found[0]


def parameters(desk: Desk, tokens: list[str]) -> dict:
    """The rate that the node has, and why it cannot be set."""
    name = "background_rate_hz"
    names = struct.pack("<I", 1) + text(name)
    values = desk.ask(one(tokens, "SS", "/fake_cnc/get_parameters"), 2, names)
    kind, rate_hz = values[8], struct.unpack_from("<d", values, 4 + 16)[0]
    # Name; type, bool, int64 and double at their places; an empty string and five empty lists.
    request = struct.pack("<I", 1) + struct.pack("<I", len(name) + 1) + name.encode() + b"\0"
    request += bytes([3, 0])
    request += bytes(-len(request) % 8) + bytes(8) + struct.pack("<d", 20.0)
    request += text("") + bytes(20)
    answer = desk.ask(one(tokens, "SS", "/fake_cnc/set_parameters"), 3, request)
    length = struct.unpack_from("<I", answer, 12)[0]
    reason = answer[16 : 16 + length - 1].decode()
    return {"kind": kind, "rate_hz": rate_hz, "set": answer[8] == 1, "reason": reason}


def called_off(desk: Desk, tokens: list[str]) -> dict:
    """A goal of ten minutes: what it says on its way, that it is called off, and its end."""
    goal = bytes(range(16, 32))

    def send() -> None:
        program = text("G21 G90\nG1 X102 F10\nM2\n") + text("peer")
        sent = desk.ask(one(tokens, "SS", "/cnc/run_program/_action/send_goal"), 4, goal + program)
        assert sent[4] == 1, "the goal was refused"

    feedback = desk.heard_by(one(tokens, "MP", "/cnc/run_program/_action/feedback"), 2.0, send)
    own = [payload for payload in feedback if payload[4:20] == goal]
    cancel = one(tokens, "SS", "/cnc/run_program/_action/cancel_goal")
    answer = desk.ask(cancel, 5, goal + bytes(8))
    result = desk.ask(one(tokens, "SS", "/cnc/run_program/_action/get_result"), 6, goal, 30.0)
    return {"feedback": len(own), "cancel": answer[4], "status": result[4]}


def managed(desk: Desk, tokens: list[str]) -> list:
    """Deactivated and activated again, with the state after each."""
    seen = []
    for number, step in enumerate([4, 3]):
        change = bytes([step, 0, 0, 0]) + text("")
        done = desk.ask(one(tokens, "SS", "/fake_cnc/change_state"), 7 + 2 * number, change)
        state = desk.ask(one(tokens, "SS", "/fake_cnc/get_state"), 8 + 2 * number, b"\0")
        length = struct.unpack_from("<I", state, 8)[0]
        seen.append([done[4] == 1, state[12 : 12 + length - 1].decode()])
    return seen


def meet(endpoint: str, domain: int) -> None:
    desk = Desk(endpoint, domain)
    tokens = desk.tokens(ENDS)
    seen = {"tokens": tokens}
    state = "abbe_msgs/msg/AxisState"
    seen["hash"] = desk.types.hash_rihs01(state)
    seen["states"] = desk.hear("/axes/state", state, 200)
    status = "/cnc/run_program/_action/status"
    seen["latched"] = desk.latched(status, "action_msgs/msg/GoalStatusArray")
    listed = desk.ask(
        one(tokens, "SS", "/fake_cnc/list_parameters"), 1, struct.pack("<IIQ", 0, 0, 0)
    )
    seen["parameters"] = "background_rate_hz" in listed.decode("utf-8", "replace")
    program = b"G21 G90\nG1 X2 F600\nM2\n\0"
    goal = GOAL + struct.pack("<I", len(program)) + program
    goal += bytes(-len(goal) % 4) + struct.pack("<I", 1) + b"\0"
    answer = desk.ask(one(tokens, "SS", "/cnc/run_program/_action/send_goal"), 1, goal)
    seen["accepted"] = answer[4] == 1
    result = desk.ask(one(tokens, "SS", "/cnc/run_program/_action/get_result"), 1, GOAL, 30.0)
    seen["status"] = result[4]
    seen["values"] = parameters(desk, tokens)
    seen["called_off"] = called_off(desk, tokens)
    seen["managed"] = managed(desk, tokens)
    numbers = [CDR + struct.pack("<q", number) for number in range(100)]
    desk.say("/from_python", "strange_msgs/msg/Bar", "RIHS01_" + "7" * 64, numbers)
    print(json.dumps(seen), flush=True)
    desk.session.close()


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["router", file, endpoint, *others]:
            route(file, {"listen/endpoints": [endpoint], "connect/endpoints": others})
        case ["secured", file, folder, host, *others]:
            route(file, certificates(folder, host) | {"connect/endpoints": others})
        case ["meet", endpoint, domain]:
            meet(endpoint, int(domain))
        case _:
            sys.exit(__doc__)
