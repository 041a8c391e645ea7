"""Cyclone DDS on plain loopback, driven line by line.

    cyclone.py '{"domain": 42, "readers": [...], "writers": [...]}'

A reader or writer is {"topic", "type", "reliable", "latched", "depth"}, with ROS names; "user_data", in
hexadecimal digits, is what its endpoint announces. Events go to
standard output, one JSON object a line: `matched` and `sample`, each with its topic and the seconds
since the participant was made. Commands come on standard input: {"topic", "message"} is written.

With "on_network" it is on every interface, and with "peers", a list of addresses, it looks for those alone and
without multicast.

A client is {"service", "type"}, as rmw_cyclonedds_cpp maps services onto topics. The command {"service",
"number", "request"} asks; the event `reply` has service, number and message. `matched` names the
service when both of its topics have the server. The end of standard input ends the program, after
everything written was acknowledged.

A server is {"service", "type"} too. The event `request` has the service, the request's number and its
message; the command {"service", "number", "response"} answers it.
"""

from __future__ import annotations

import json
import math
import sys
import threading
import time

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from message_types import Types, plain

LOOPBACK = """<CycloneDDS><Domain><General>
<Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>50</MaxAutoParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>"""


AMONG = """<CycloneDDS><Domain><General><AllowMulticast>false</AllowMulticast></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>31</MaxAutoParticipantIndex>
<Peers>{}</Peers></Discovery></Domain></CycloneDDS>"""


def configuration(plan: dict) -> str:
    if "peers" in plan:
        return AMONG.format("".join(f'<Peer address="{peer}"/>' for peer in plan["peers"]))
    return "" if plan.get("on_network") else LOOPBACK


def quality(end: dict) -> Qos:
    depth = end.get("depth", 10)
    policies = [
        Policy.History.KeepLast(depth),
        Policy.Durability.TransientLocal if end["latched"] else Policy.Durability.Volatile,
        Policy.Reliability.Reliable(duration(seconds=1))
        if end["reliable"]
        else Policy.Reliability.BestEffort,
    ]
    if end["latched"]:
        # Without it Cyclone keeps one sample for those who come late.
        policies.append(
            Policy.DurabilityService(
                duration(seconds=0), Policy.History.KeepLast(depth), -1, -1, -1
            )
        )
    if "user_data" in end:
        policies.append(Policy.Userdata(bytes.fromhex(end["user_data"])))
    return Qos(*policies)


def said(value):
    """JSON has no NaN."""
    if isinstance(value, dict):
        return {name: said(item) for name, item in value.items()}
    if isinstance(value, list):
        return [said(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def calls() -> Qos:
    """Of requests and replies."""
    return Qos(
        Policy.History.KeepAll,
        Policy.Durability.Volatile,
        Policy.Reliability.Reliable(duration(seconds=1)),
    )


class Client:
    """Asks a service; every client of the participant has a number of its own."""

    def __init__(self, participant, types: Types, service: str, ros_type: str, number: int) -> None:
        self.types = types
        self.request_type = f"{ros_type}_Request"
        self.number = number << 32 | 0xABBE
        request = types.of_call(self.request_type)
        reply = types.of_call(f"{ros_type}_Response")
        requests = Topic(participant, f"rq{service}Request", request)
        replies = Topic(participant, f"rr{service}Reply", reply)
        self.writer = DataWriter(participant, requests, calls())
        self.reader = DataReader(participant, replies, calls())

    def is_matched(self) -> bool:
        both = self.writer.get_matched_subscriptions(), self.reader.get_matched_publications()
        return all(both)

    def ask(self, number: int, values: dict) -> None:
        request = self.types.build_call(self.request_type, self.number, number, values)
        self.writer.write(request)

    def replies(self):
        """Numbers and contents of the answers to us, among those to everybody."""
        for sample in self.reader.take(64):
            if sample.sample_info.valid_data and sample.client == self.number:
                message = plain(sample)
                del message["client"]
                yield message.pop("number"), message


class Server:
    """Is asked: what stands in front of a request stands in front of its answer."""

    def __init__(self, participant, types: Types, service: str, ros_type: str) -> None:
        self.types = types
        self.response_type = f"{ros_type}_Response"
        self.asked: list[tuple[int, int]] = []
        request = types.of_call(f"{ros_type}_Request")
        reply = types.of_call(self.response_type)
        replies = Topic(participant, f"rr{service}Reply", reply)
        requests = Topic(participant, f"rq{service}Request", request)
        self.writer = DataWriter(participant, replies, calls())
        self.reader = DataReader(participant, requests, calls())

    def is_matched(self) -> bool:
        both = self.writer.get_matched_subscriptions(), self.reader.get_matched_publications()
        return all(both)

    def requests(self):
        """Numbers, in the order of their coming, and contents."""
        for sample in self.reader.take(64):
            if sample.sample_info.valid_data:
                message = plain(sample)
                self.asked.append((message.pop("client"), message.pop("number")))
                yield len(self.asked), message

    def answer(self, place: int, values: dict) -> None:
        client, number = self.asked[place - 1]
        self.writer.write(self.types.build_call(self.response_type, client, number, values))


def main(plan: dict) -> None:
    types = Types()
    domain = Domain(plan["domain"], configuration(plan))
    participant = DomainParticipant(plan["domain"])
    began = time.monotonic()
    lock = threading.Lock()

    def tell(event: str, topic: str, **more) -> None:
        after_s = time.monotonic() - began
        line = {"event": event, "topic": topic, "after_s": after_s, **said(more)}
        with lock:
            print(json.dumps(line), flush=True)

    def topic_of(end: dict) -> Topic:
        return Topic(participant, f"rt{end['topic']}", types.of(end["type"]))

    readers = {
        end["topic"]: DataReader(participant, topic_of(end), quality(end))
        for end in plan.get("readers", [])
    }
    ends = {end["topic"]: end for end in plan.get("writers", [])}
    writers = {
        topic: DataWriter(participant, topic_of(end), quality(end)) for topic, end in ends.items()
    }
    clients = {
        end["service"]: Client(participant, types, end["service"], end["type"], place)
        for place, end in enumerate(plan.get("clients", []), 1)
    }
    servers = {
        end["service"]: Server(participant, types, end["service"], end["type"])
        for end in plan.get("servers", [])
    }
    ended = threading.Event()

    def obey() -> None:
        for line in sys.stdin:
            command = json.loads(line)
            if "response" in command:
                servers[command["service"]].answer(command["number"], command["response"])
                continue
            if "service" in command:
                clients[command["service"]].ask(command["number"], command["request"])
                continue
            topic = command["topic"]
            writers[topic].write(types.build(ends[topic]["type"], command["message"]))
        ended.set()

    threading.Thread(target=obey, daemon=True).start()
    unmatched = {**readers, **writers}
    unmet = {**clients, **servers}
    while not ended.is_set():
        for topic, end in list(unmatched.items()):
            matched = (
                end.get_matched_publications()
                if isinstance(end, DataReader)
                else end.get_matched_subscriptions()
            )
            if matched:
                del unmatched[topic]
                tell("matched", topic)
        for topic, reader in readers.items():
            for sample in reader.take(256):
                if sample.sample_info.valid_data:
                    tell("sample", topic, message=plain(sample))
        for service, client in list(unmet.items()):
            if client.is_matched():
                del unmet[service]
                tell("matched", service)
        for service, client in clients.items():
            for number, message in client.replies():
                tell("reply", service, number=number, message=message)
        for service, server in servers.items():
            for number, message in server.requests():
                tell("request", service, number=number, message=message)
        time.sleep(0.002)
    for writer in writers.values():
        writer.wait_for_acks(duration(seconds=2))
    del domain


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(json.loads(sys.argv[1]))
