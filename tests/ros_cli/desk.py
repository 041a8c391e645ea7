"""Runs commands, compares what they say with what is expected, and keeps the account."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from pathlib import Path

SHOWN = 160
"""Longest text that is shown of what was seen, characters."""
BETWEEN_TRIES_S = 0.5
NO_HASH = re.compile(r"^.*Failed to parse (?:a )?type hash for (?:a )?topic .*\n", re.MULTILINE)
"""What rmw_cyclonedds_cpp says of every end that sends no type hash: all of ours (README, known limits)."""


def plain(text: str) -> str:
    """One line, short enough to be read."""
    line = " ".join(text.split())
    return line if len(line) <= SHOWN else f"{line[: SHOWN - 1]}…"


class Background:
    """A program that goes on while others are asked about it."""

    def __init__(self, words: Sequence[str], env: dict[str, str], log: Path, cwd: Path) -> None:
        self.words = list(words)
        self.log = log
        with log.open("wb") as sink:
            self.process = subprocess.Popen(
                self.words,
                env=env,
                cwd=cwd,
                stdin=subprocess.DEVNULL,
                stdout=sink,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def said(self) -> str:
        return NO_HASH.sub("", self.log.read_text(errors="replace"))

    def interrupt(self) -> None:
        """What Ctrl-C does in a terminal: every process of the group gets it."""
        self._signal(signal.SIGINT)

    def _signal(self, number: int) -> None:
        try:
            os.killpg(self.process.pid, number)
        except ProcessLookupError:
            pass

    def end(self, patience_s: float) -> int | None:
        """Interrupts it and waits; `None` when it had to be killed."""
        self.interrupt()
        try:
            return self.process.wait(patience_s)
        except subprocess.TimeoutExpired:
            self._signal(signal.SIGKILL)
            self.process.wait()
            return None


class Desk:
    """Where checks are made and counted."""

    def __init__(self, env: dict[str, str], folder: Path, cwd: Path) -> None:
        self.env = env
        self.folder = folder
        self.cwd = cwd
        self.passed = 0
        self.failed: list[str] = []
        self.not_run: list[str] = []
        self.running: list[Background] = []

    def start(self, name: str, *words: str) -> Background:
        log = self.folder / f"{name.replace(' ', '_')}.log"
        background = Background(words, self.env, log, self.cwd)
        self.running.append(background)
        return background

    def end(self, background: Background, patience_s: float = 30.0) -> int | None:
        self.running.remove(background)
        return background.end(patience_s)

    def end_all(self) -> None:
        while self.running:
            self.end(self.running[-1])

    def run(self, words: Sequence[str], limit_s: float) -> tuple[int | None, str]:
        """Exit code and everything said; no code when the time was over."""
        name = f"command_{self.passed + len(self.failed)}"
        background = Background(words, self.env, self.folder / f"{name}.log", self.cwd)
        self.running.append(background)
        try:
            code: int | None = background.process.wait(limit_s)
        except subprocess.TimeoutExpired:
            self.end(background, 5.0)
            return None, background.said()
        self.running.remove(background)
        return code, background.said()

    def lack(self, what: str, reason: str) -> None:
        self.not_run.append(f"{what}: {reason}")
        print(f"not run  {what}\n         {reason}", flush=True)

    def judge(self, name: str, expected: str, right: bool, seen: str, said: str = "") -> bool:
        """Writes down what was expected and what was seen."""
        print(f"{'ok      ' if right else 'FAILED  '} {name}", flush=True)
        print(f"         expected: {plain(expected)}\n         saw:      {plain(seen)}", flush=True)
        if right:
            self.passed += 1
        else:
            self.failed.append(name)
            for line in said.splitlines()[-40:]:
                print(f"         | {line}", flush=True)
        return right

    def see(
        self,
        name: str,
        words: Sequence[str],
        *patterns: str,
        absent: Sequence[str] = (),
        code: int | None = 0,
        limit_s: float = 20.0,
        within_s: float = 0.0,
    ) -> str:
        """Runs a command, again until `within_s` is over, and looks for every pattern in what it says.

        `code` is the exit code that is right; `None`: any.
        """
        deadline = time.monotonic() + within_s
        while True:
            ended, said = self.run(words, limit_s)
            found = [re.search(pattern, said, re.MULTILINE) for pattern in patterns]
            lacking = [p for p, match in zip(patterns, found) if match is None]
            wrong = [p for p in absent if re.search(p, said, re.MULTILINE)]
            right_code = ended is not None and code in (None, ended)
            right = not lacking and not wrong and right_code
            if right or time.monotonic() >= deadline:
                break
            time.sleep(BETWEEN_TRIES_S)
        expected = ", ".join([f"/{pattern}/" for pattern in patterns] or ["exit code 0"])
        expected += "".join(f", not /{pattern}/" for pattern in absent)
        if right:
            seen = " · ".join(match.group(0) for match in found if match) or f"exit code {ended}"
        elif ended is None:
            seen = f"no end within {limit_s} s"
        else:
            seen = f"exit code {ended}, lacking {lacking}, unwanted {wrong}"
        self.judge(f"{name}: {plain(' '.join(words))}", expected, right, seen, said)
        return said

    def watch(
        self,
        name: str,
        words: Sequence[str],
        seconds: float,
        expected: str,
        right: Callable[[str], str | None],
    ) -> str:
        """Lets a command that has no end run for a while; `right` says what it saw, or nothing."""
        background = self.start(name, *words)
        time.sleep(seconds)
        self.end(background, 10.0)
        said = background.said()
        seen = right(said)
        title = f"{name}: {plain(' '.join(words))}"
        self.judge(title, expected, seen is not None, seen or "nothing of it", said)
        return said

    def account(self) -> int:
        """The end: counts, what failed, what could not be run; the exit code."""
        print(f"\n{self.passed} checks passed, {len(self.failed)} failed")
        for name in self.failed:
            print(f"- failed: {name}")
        if self.not_run:
            print("Not everything could be run:")
            for line in self.not_run:
                print(f"- {line}")
        return 1 if self.failed else 0
