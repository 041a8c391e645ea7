"""Reads a board with Grafana's own models (PyPI grafana-foundation-sdk) and prints every key that they lose or change.

Argument: the board. Exit code 0 also with such keys.
"""

import json
import sys

from grafana_foundation_sdk.cog import plugins
from grafana_foundation_sdk.models.dashboard import Dashboard


def differences(given, read, place=""):
    if isinstance(given, dict):
        for key, value in given.items():
            if not isinstance(read, dict) or key not in read:
                yield f"{place}/{key}: unknown"
            else:
                yield from differences(value, read[key], f"{place}/{key}")
    elif isinstance(given, list):
        if not isinstance(read, list) or len(given) != len(read):
            yield f"{place}: another length"
        else:
            for number, (one, other) in enumerate(zip(given, read)):
                yield from differences(one, other, f"{place}[{number}]")
    elif given != read:
        yield f"{place}: {given!r} is read as {read!r}"


def written(value):
    return value.to_json() if hasattr(value, "to_json") else str(value)


plugins.register_default_plugins()
with open(sys.argv[1], encoding="utf-8") as file:
    given = json.load(file)
read = json.loads(json.dumps(Dashboard.from_json(given), default=written))
for line in differences(given, read):
    print(line)
