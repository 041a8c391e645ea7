"""Cyclone DDS types made from the repository's own .msg files.

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
    r"^(?P<base>[A-Za-z][\w/]*)(?:<=\d+)?(?P<list>\[(?P<length>\d*|<=\d+)\])?\s+(?P<name>[a-z]\w*)$"
)


def file_of(package: str, name: str) -> Path:
    if package == "abbe_msgs":
        return MSGS / "msg" / f"{name}.msg"
    return MSGS / "standard" / package / "msg" / f"{name}.msg"


@dataclass(frozen=True)
class Field:
    """One field as its file declares it; `length` is None for a single value, -1 for any number."""

    name: str
    base: str
    length: int | None


class Types:
    """Types by their ROS name, e.g. `sensor_msgs/msg/Temperature`."""

    def __init__(self) -> None:
        self.classes: dict[str, type] = {}
        self.fields: dict[str, list[Field]] = {}

    def read(self, ros_type: str) -> list[Field]:
        package, _, name = ros_type.split("/")
        fields = []
        path = file_of(package, name)
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            line = line.split("#")[0].strip()
            if not line or "=" in line.replace("<=", ""):
                continue
            match = LINE.match(line)
            if match is None:
                raise ValueError(f"{path}:{number}: {line!r} is no field")
            base = match["base"]
            if base not in PRIMITIVES:
                parts = base.split("/")
                base = f"{parts[0] if len(parts) > 1 else package}/msg/{parts[-1]}"
            length = None
            if match["list"]:
                length = int(match["length"]) if match["length"].isdigit() else -1
            fields.append(Field(match["name"], base, length))
        return fields

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
        package, _, name = ros_type.split("/")
        made = types.new_class(
            f"{name}_",
            (IdlStruct,),
            {"typename": f"{package}::msg::dds_::{name}_"},
            lambda space: space.update(
                {"__annotations__": annotations, "__module__": f"{package}.msg.dds_"}
            ),
        )
        self.classes[ros_type] = dataclass(made)
        return self.classes[ros_type]

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
