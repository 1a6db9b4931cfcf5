"""Outcomes of the package's tests with a heuristic switched off: their bars hold what rows of means do not
show, such as a single scene that is lost."""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[2] / "tests" / "python"


class Recorder:
    """Keeps 1 for each test that passes and 0 for each that fails, in the order of the tests."""

    def __init__(self) -> None:
        self.passed: list[float] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Called by pytest for each phase of a test."""
        if report.when == "call" and not report.skipped:
            self.passed.append(float(report.passed))


def passed(*names: str) -> list[float]:
    """Whether each test of the files passes, 1 or 0. RuntimeError where they cannot be run."""
    recorder = Recorder()
    files = [str(TESTS / name) for name in names]
    with contextlib.redirect_stdout(sys.stderr):
        code = pytest.main(["-q", "--no-header", "--tb=no", "-p", "no:cacheprovider", *files], plugins=[recorder])
    if code not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
        raise RuntimeError(f"tests: expected to run {', '.join(names)}, got exit status {code}")
    return recorder.passed
