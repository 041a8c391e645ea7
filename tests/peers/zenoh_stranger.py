"""Somebody on the network of a secured cell: what does a router let through?

    zenoh_stranger.py ENDPOINT FOLDER|- HOST|- hear KEY SECONDS     how many samples of the cell, and of strangers, come
    zenoh_stranger.py ENDPOINT FOLDER|- HOST|- put KEY COUNT        publishes what only strangers publish
    zenoh_stranger.py ENDPOINT FOLDER|- HOST|- ask KEY SECONDS      how many servers answer

FOLDER has certificates, HOST is the one that it shows; `-` shows none. Prints JSON; of a session that is
refused {"refused": REASON}.
"""

from __future__ import annotations

import json
import sys
import time

import zenoh
from zenoh_peer import CDR, attachment, certificates

PAYLOAD = CDR + b"of a stranger"
NO = CDR + b"\0"
"""Request of std_srvs/srv/SetBool."""
OPEN_MS = 4000
MEETING_S = 1.5


def session(endpoint: str, folder: str, host: str) -> zenoh.Session:
    made = zenoh.Config()
    settings = {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "connect/timeout_ms": OPEN_MS,
        "connect/exit_on_failure": True,
        "listen/endpoints": [],
        "scouting/multicast/enabled": False,
    }
    if host != "-":
        settings |= certificates(folder, host) | {"transport/link/tls/enable_mtls": True}
    elif folder != "-":
        settings["transport/link/tls/root_ca_certificate"] = f"{folder}/ca.pem"
    for key, value in settings.items():
        made.insert_json5(key, json.dumps(value))
    return zenoh.open(made)


def hear(opened: zenoh.Session, key: str, seconds: float) -> dict:
    counts = {"cell": 0, "strangers": 0}

    def take(sample) -> None:
        counts["strangers" if sample.payload.to_bytes() == PAYLOAD else "cell"] += 1

    subscriber = opened.declare_subscriber(key, take)
    time.sleep(seconds)
    subscriber.undeclare()
    return counts


def put(opened: zenoh.Session, key: str, count: int) -> dict:
    publisher = opened.declare_publisher(key)
    time.sleep(MEETING_S)
    for _ in range(count):
        publisher.put(PAYLOAD)
        time.sleep(0.02)
    time.sleep(0.5)
    return {"put": count}


def ask(opened: zenoh.Session, key: str, seconds: float) -> dict:
    time.sleep(MEETING_S)
    replies = opened.get(
        key,
        payload=NO,
        attachment=attachment(1),
        target=zenoh.QueryTarget.ALL,
        timeout=seconds,
    )
    return {"answers": sum(reply.ok is not None for reply in replies)}


def main(endpoint: str, folder: str, host: str, verb: str, key: str, number: str) -> dict:
    zenoh.init_log_from_env_or("error")
    try:
        opened = session(endpoint, folder, host)
    except zenoh.ZError as error:
        return {"refused": str(error)}
    with opened:
        match verb:
            case "hear":
                return hear(opened, key, float(number))
            case "put":
                return put(opened, key, int(number))
            case "ask":
                return ask(opened, key, float(number))
    sys.exit(__doc__)


if __name__ == "__main__":
    if len(sys.argv) != 7:
        sys.exit(__doc__)
    print(json.dumps(main(*sys.argv[1:])), flush=True)
