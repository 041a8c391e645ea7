"""The cell that is looked at: a copy of a scenario that waits instead of beginning its plan."""

from __future__ import annotations

import shutil
from pathlib import Path

SCENARIO = "short_cell"
BASE = "first_run"
NODES = [
    "axis_compensation",
    "fake_cnc",
    "latency_calibrator",
    "machine_frames",
    "probe",
    "sequencer",
    "thermal_model",
]


def replaced(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    if old not in text:
        raise SystemExit(f"{file} does not hold \"{old}\"")
    file.write_text(text.replace(old, new))


def waiting_copy(root: Path, folder: Path) -> Path:
    """The scenario with a plan that begins in an hour: the machine stands still until asked."""
    cell = folder / SCENARIO
    # Machine and plant of the scenario are those of its base.
    for name in (BASE, SCENARIO):
        shutil.copytree(root / "launch_configs" / name, folder / name)
    replaced(cell / "sequencer.yaml", "start_delay_s: 3.0", "start_delay_s: 3600.0")
    replaced(cell / "scenario.yaml", "limit_min: 3.0", "limit_min: 60.0")
    return cell
