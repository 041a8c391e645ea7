"""Round trips through Cyclone DDS between two processes, in slices that the caller asks for.

    echo_cyclone.py echo DOMAIN ANSWER_BYTES
    echo_cyclone.py ping DOMAIN PING_BYTES

`echo` answers each ping with ANSWER_BYTES until its input closes. `ping` reads lines with a number
of pings, sends them at 1 kHz, and prints one JSON object for each line: what was sent, and the round
trips in ns of what came back within 1 s.
"""

import json
import os
import sys
import threading
import time
from dataclasses import dataclass

CONFIG = """<CycloneDDS><Domain>
<General><Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>50</MaxAutoParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""
os.environ["CYCLONEDDS_URI"] = CONFIG

from cyclonedds.core import Qos, Policy, ReadCondition, SampleState, InstanceState, ViewState, WaitSet
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import int64, sequence, uint8
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

HEADER_BYTES = 16  # encapsulation, number and length in front of the filling
PERIOD_NS = 1_000_000
QOS = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(20000))


@dataclass
class Filled(IdlStruct, typename="Filled"):
    number: int64
    filling: sequence[uint8]


class End:
    """A writer, a reader and what to wait on."""

    def __init__(self, domain: int, out: str, into: str) -> None:
        self.participant = DomainParticipant(domain)
        self.writer = DataWriter(self.participant, Topic(self.participant, out, Filled), qos=QOS)
        self.reader = DataReader(self.participant, Topic(self.participant, into, Filled), qos=QOS)
        self.waitset = WaitSet(self.participant)
        self.waitset.attach(
            ReadCondition(self.reader, SampleState.Any | ViewState.Any | InstanceState.Any)
        )

    def take(self, patience_ns: int) -> list[Filled]:
        if patience_ns > 0:
            self.waitset.wait(duration(nanoseconds=patience_ns))
        # A writer that left is told of by a sample without contents.
        return [sample for sample in self.reader.take(N=64) if isinstance(sample, Filled)]


def echo(domain: int, answer_bytes: int) -> None:
    end = End(domain, "answer", "ping")
    filling = bytes(answer_bytes - HEADER_BYTES)
    closed = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), closed.set()), daemon=True).start()
    while not closed.is_set():
        for sample in end.take(100_000_000):
            end.writer.write(Filled(sample.number, filling))


def ping(domain: int, ping_bytes: int) -> None:
    end = End(domain, "ping", "answer")
    filling = bytes(ping_bytes - HEADER_BYTES)
    number = 0
    for line in sys.stdin:
        sent: dict[int, int] = {}
        round_trips_ns = []
        total = int(line)
        due = time.time_ns()
        last = due + total * PERIOD_NS + 1_000_000_000
        while time.time_ns() < last and not (len(sent) == 0 and due >= last - 1_000_000_000):
            now = time.time_ns()
            more = due < last - 1_000_000_000
            if more and now >= due:
                sent[number] = time.time_ns()
                end.writer.write(Filled(number, filling))
                number += 1
                due += PERIOD_NS
            for sample in end.take(max(due - time.time_ns(), 0) if more else 10_000_000):
                begin = sent.pop(sample.number, None)
                if begin is not None:
                    round_trips_ns.append(time.time_ns() - begin)
        print(json.dumps({"sent": total, "round_trips_ns": round_trips_ns}), flush=True)


if __name__ == "__main__":
    if len(sys.argv) != 4 or sys.argv[1] not in ("echo", "ping"):
        sys.exit(__doc__)
    {"echo": echo, "ping": ping}[sys.argv[1]](int(sys.argv[2]), int(sys.argv[3]))
