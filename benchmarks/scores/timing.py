"""CPU time of the busiest thread: what a run would take on a machine that does nothing else."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

Name = TypeVar("Name", bound=Hashable)
_TASKS = Path("/proc/self/task")


def _thread_times() -> dict[str, float] | None:
    """CPU seconds of every other thread of this process; None where the system has no such file."""
    try:
        tasks = [task for task in _TASKS.iterdir() if task.name != str(threading.get_native_id())]
        return {task.name: int((task / "schedstat").read_text().split()[0]) * 1e-9 for task in tasks}
    except (OSError, ValueError, IndexError):
        return None


@dataclass(frozen=True)
class Time:
    """Best of several runs, seconds."""

    busiest: float
    """CPU time of the busiest thread."""
    wall: float
    """Time on the clock, in the run with the least CPU time."""


def once(work: Callable[[], object]) -> Time:
    """Runs `work` and measures it."""
    before, cpu, clock, own = _thread_times(), time.process_time(), time.perf_counter(), time.thread_time()
    work()
    own, wall, cpu, after = (
        time.thread_time() - own,
        time.perf_counter() - clock,
        time.process_time() - cpu,
        _thread_times(),
    )
    if before is None or after is None:
        return Time(cpu, wall)
    # Asking for the times of many threads takes milliseconds of this one: its own are taken right around the
    # work.
    others = [spent - before.get(thread, 0.0) for thread, spent in after.items()]
    # What no thread has that is still there was the work of threads that ended, of one where there was one.
    ended = cpu - own - sum(others)
    return Time(max(own, ended, *others, 0.0), wall)


def race(contestants: dict[Name, Callable[[], object]], rounds: int) -> dict[Name, Time]:
    """The best of `rounds` runs of each, taken in turns so that a noisy neighbour hits all alike; one run
    of each goes unmeasured before."""
    best: dict[Name, Time] = {}
    for work in contestants.values():
        work()
    for _ in range(rounds):
        for name, work in contestants.items():
            measured = once(work)
            if name not in best or measured.busiest < best[name].busiest:
                best[name] = measured
    return best
