"""The cell that is looked at: a copy of a scenario that waits instead of beginning its plan."""

from __future__ import annotations

import shutil
from pathlib import Path

SCENARIO = "short_cell"
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
    shutil.copytree(root / "launch_configs" / SCENARIO, cell)
    replaced(cell / "sequencer.yaml", "start_delay_s: 3.0", "start_delay_s: 3600.0")
    replaced(cell / "scenario.yaml", "limit_min: 3.0", "limit_min: 60.0")
    return cell
