"""Cyclone DDS types made from the repository's own .msg, .srv and .action files.

No type is written by hand: a field that is added to a file, or a wrong order in our serialisation,
is seen by the peer.
"""

from __future__ import annotations

import re
import types
from dataclasses import dataclass
from pathlib import Path

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import (
    array,
    float32,
    float64,
    int8,
    int16,
    int32,
    int64,
    sequence,
    uint8,
    uint16,
    uint32,
    uint64,
)

MSGS = Path(__file__).resolve().parents[2] / "msgs"

PRIMITIVES = {
    "bool": bool,
    "byte": uint8,
    "char": uint8,
    "int8": int8,
    "uint8": uint8,
    "int16": int16,
    "uint16": uint16,
    "int32": int32,
    "uint32": uint32,
    "int64": int64,
    "uint64": uint64,
    "float32": float32,
    "float64": float64,
    "string": str,
}

LINE = re.compile(
    r"^(?P<base>[A-Za-z][\w/]*)(?:<=\d+)?(?P<list>\[(?P<length>\d*|<=\d+)\])?"
    r"\s+(?P<name>[a-z]\w*)(?:\s+\S.*)?$"
)


SECTIONS = {"Request": 0, "Response": 1, "Goal": 0, "Result": 1, "Feedback": 2}
"""Which part of a .srv or .action file a type with such an ending is."""

DERIVED = {
    "SendGoal_Request": ["unique_identifier_msgs/UUID goal_id", "{name}_Goal goal"],
    "SendGoal_Response": ["bool accepted", "builtin_interfaces/Time stamp"],
    "GetResult_Request": ["unique_identifier_msgs/UUID goal_id"],
    "GetResult_Response": ["int8 status", "{name}_Result result"],
    "FeedbackMessage": ["unique_identifier_msgs/UUID goal_id", "{name}_Feedback feedback"],
}
"""What ROS 2 makes of every action."""


FILLER = "structure_needs_at_least_one_member"
"""What ROS 2 puts where a type has no field."""


def lines_of(package: str, kind: str, name: str) -> list[str]:
    """The lines that declare a type."""
    folder = MSGS if package == "abbe_msgs" else MSGS / "standard" / package
    if kind == "msg":
        return (folder / kind / f"{name}.msg").read_text(encoding="utf-8").splitlines()
    stem, _, ending = name.partition("_")
    if ending in DERIVED:
        return [line.format(name=stem) for line in DERIVED[ending]]
    text = (folder / kind / f"{stem}.{kind}").read_text(encoding="utf-8")
    parts = re.split(r"^---$", text, flags=re.MULTILINE)
    return parts[SECTIONS[ending]].splitlines()


@dataclass(frozen=True)
class Field:
    """One field as its file declares it; `length` is None for a single value, -1 for any number."""

    name: str
    base: str
    length: int | None


def struct(ros_type: str, annotations: dict[str, type]) -> type:
    """A class with its DDS name as ROS 2 mangles it."""
    package, kind, name = ros_type.split("/")
    made = types.new_class(
        f"{name}_",
        (IdlStruct,),
        {"typename": f"{package}::{kind}::dds_::{name}_"},
        lambda space: space.update(
            {"__annotations__": annotations, "__module__": f"{package}.{kind}.dds_"}
        ),
    )
    return dataclass(made)


class Types:
    """Types by their ROS name, e.g. `sensor_msgs/msg/Temperature`."""

    def __init__(self) -> None:
        self.classes: dict[str, type] = {}
        self.fields: dict[str, list[Field]] = {}

    def read(self, ros_type: str) -> list[Field]:
        package, kind, name = ros_type.split("/")
        fields = []
        for number, line in enumerate(lines_of(package, kind, name), 1):
            line = line.split("#")[0].strip()
            if not line or "=" in line.replace("<=", ""):
                continue
            match = LINE.match(line)
            if match is None:
                raise ValueError(f"{ros_type}:{number}: {line!r} is no field")
            base = match["base"]
            if base not in PRIMITIVES:
                parts = base.split("/")
                # Parts of an action are of its own kind; everything else that is nested is a message.
                nested = "action" if base.partition("_")[2] in SECTIONS else "msg"
                base = f"{parts[0] if len(parts) > 1 else package}/{nested}/{parts[-1]}"
            length = None
            if match["list"]:
                length = int(match["length"]) if match["length"].isdigit() else -1
            fields.append(Field(match["name"], base, length))
        return fields or [Field(FILLER, "uint8", None)]

    def of(self, ros_type: str) -> type:
        """The class for `ros_type`, with its DDS name as ROS 2 mangles it."""
        if ros_type in self.classes:
            return self.classes[ros_type]
        self.fields[ros_type] = self.read(ros_type)
        annotations = {}
        for field in self.fields[ros_type]:
            single = PRIMITIVES.get(field.base) or self.of(field.base)
            if field.length is None:
                annotations[field.name] = single
            elif field.length < 0:
                annotations[field.name] = sequence[single]
            else:
                annotations[field.name] = array[single, field.length]
        self.classes[ros_type] = struct(ros_type, annotations)
        return self.classes[ros_type]

    def of_call(self, ros_type: str) -> type:
        """The same with what rmw_cyclonedds puts in front of requests and replies.

        That is `cdds_request_header_t`: the client's number and that of its request.
        """
        name = f"{ros_type} of a call"
        if name not in self.classes:
            plain_class = self.of(ros_type)
            front = {"client": uint64, "number": int64}
            self.classes[name] = struct(ros_type, {**front, **plain_class.__annotations__})
        return self.classes[name]

    def build_call(self, ros_type: str, client: int, number: int, values: dict):
        """A request with its front."""
        message = self.build(ros_type, values)
        fields = {field.name: getattr(message, field.name) for field in self.fields[ros_type]}
        return self.of_call(ros_type)(client=client, number=number, **fields)

    def build(self, ros_type: str, values: dict):
        """A message with `values`, and zeros where none is given."""
        made = self.of(ros_type)
        unknown = set(values) - {field.name for field in self.fields[ros_type]}
        if unknown:
            raise ValueError(f"{ros_type} has no {sorted(unknown)}")
        return made(**{f.name: self.value(f, values.get(f.name)) for f in self.fields[ros_type]})

    def value(self, field: Field, given):
        if field.length is None:
            return self.single(field.base, given)
        if given is None:
            given = [None] * max(field.length, 0)
        return [self.single(field.base, item) for item in given]

    def single(self, base: str, given):
        if base not in PRIMITIVES:
            return self.build(base, given or {})
        if given is not None:
            # JSON has neither NaN nor infinities: they come as texts.
            return float(given) if base.startswith("float") else given
        return {"bool": False, "string": ""}.get(base, 0.0 if base.startswith("float") else 0)


def plain(value):
    """A decoded message as dicts, lists, numbers and texts."""
    if isinstance(value, IdlStruct):
        return {name: plain(getattr(value, name)) for name in value.__dataclass_fields__}
    if isinstance(value, (list, tuple, bytes, bytearray)):
        return [plain(item) for item in value]
    return value
