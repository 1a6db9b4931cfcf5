"""The command line through Python: `python -m jacoflow` and the console script."""

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import jacoflow


def run(*arguments, folder, command=(sys.executable, "-m", "jacoflow")):
    return subprocess.run([*command, *map(str, arguments)], cwd=folder, capture_output=True, text=True, timeout=120)


def test_version_and_help(tmp_path):
    assert run("--version", folder=tmp_path).stdout.split() == ["jacoflow", jacoflow.__version__]
    help_text = run("--help", folder=tmp_path)
    assert help_text.returncode == 0 and "flow" in help_text.stdout


def test_console_script(tmp_path):
    script = Path(sys.executable).parent / "jacoflow"
    assert run("--version", folder=tmp_path, command=(script,)).stdout.split() == ["jacoflow", jacoflow.__version__]


def test_wrong_usage_has_exit_code_2(tmp_path):
    result = run("flow", "--no-such-option", folder=tmp_path)
    assert result.returncode == 2 and "no-such-option" in result.stderr


def test_missing_input_has_exit_code_1(tmp_path):
    result = run("flow", "nowhere", "-o", "out", folder=tmp_path)
    assert result.returncode == 1 and "nowhere" in result.stderr
    assert not (tmp_path / "out").exists() or not any((tmp_path / "out").iterdir())


def test_inputs_that_are_no_frames_are_named(tmp_path):
    result = run("info", "/dev/null", folder=tmp_path)
    assert result.returncode == 1 and "/dev/null: neither a file nor a folder; expected one of these" in result.stderr
    (tmp_path / "a.y4m").write_bytes(b"")
    result = run("measure", "a.y4m", "a.y4m", "--quantity", "u", folder=tmp_path)
    assert result.returncode == 2 and "input: expected image files only, when several inputs are given, got a.y4m" in result.stderr


def test_flow_equals_the_python_call(tmp_path):
    frames = np.clip(np.round(jacoflow.scenes.Scene("affine", width=40, height=32).frames(3)), 0, 255).astype(np.uint8)
    np.save(tmp_path / "frames.npy", frames)
    result = run("flow", "frames.npy", "-o", "field.npz", "--json", folder=tmp_path)
    assert result.returncode == 0, result.stderr
    json.loads(result.stdout)
    field = jacoflow.FlowField.load(tmp_path / "field.npz")
    np.testing.assert_array_equal(field.flow, jacoflow.flow(*frames).flow)


def test_info_says_how_an_archive_of_frames_is_opened(tmp_path):
    np.savez(tmp_path / "frames.npz", frames=np.zeros((3, 8, 8)))
    result = run("info", "frames.npz", folder=tmp_path)
    assert result.returncode == 3 and "jacoflow.io.frames" in result.stderr


def test_the_filter_of_the_command_is_that_of_python(tmp_path):
    """In float64 where R is below 0.25, in both."""
    frames = np.clip(np.round(jacoflow.scenes.Scene("affine", width=32, height=24).frames(3)), 0, 255).astype(np.uint8)
    np.save(tmp_path / "frames.npy", frames)
    for noise, dtype in ((None, np.float64), (0.25, np.float32)):
        option = [] if noise is None else ["--measurement-noise", noise]
        result = run("filter", "frames.npy", "-o", "out", "--force", "--profile", "measured", *option, folder=tmp_path)
        assert result.returncode == 0, result.stderr
        ours = jacoflow.FlowFilter(profile=jacoflow.FilterProfile("measured", R=noise))
        last = [ours.push(frame) for frame in frames][-1]
        assert last.flow.dtype == dtype
        saved = jacoflow.FlowField.load(tmp_path / "out" / "000002.npz")
        assert saved.flow.dtype == dtype
        np.testing.assert_array_equal(saved.flow, last.flow)
        assert ours.smooth(frames).flow.dtype == dtype


def test_a_damaged_state_is_described_in_either_precision(tmp_path):
    frames = np.random.default_rng(1).integers(0, 256, (2, 24, 32)).astype(np.uint8)
    np.save(tmp_path / "frames.npy", frames)
    for precision in ("float32", "float64"):
        flow_filter = jacoflow.FlowFilter(precision=precision)
        flow_filter.push(frames[0])
        flow_filter.save(tmp_path / "state.npz")
        good = dict(np.load(tmp_path / "state.npz"))
        unknown = {name: np.array(array) for name, array in good.items()}
        unknown["mean"].flat[3] = np.nan
        infinite, vast = ({name: np.array(array) for name, array in good.items()} for _ in range(2))
        infinite["root"].flat[0], vast["mean"].flat[3] = np.inf, 1e308 if precision == "float64" else 3e38
        for arrays, words in (
            (unknown, "array 'mean' holds NaN, expected numbers from"),
            (infinite, "array 'root' holds inf, expected numbers from"),
            (vast, "array 'mean' holds "),
            ({**good, "mean": good["mean"][:-1]}, "expected mean of shape "),
            ({name: array for name, array in good.items() if name != "root"}, "root"),
        ):
            np.savez(tmp_path / "damaged.npz", **arrays)
            result = run("filter", "frames.npy", "-o", "out", "--start", 1, "--resume", "damaged.npz", folder=tmp_path)
            assert result.returncode == 1 and words in result.stderr, result.stderr
            assert "expected a state in" not in result.stderr
            assert not (tmp_path / "out").exists()


@pytest.mark.skipif(not os.path.exists("/proc/self/status"), reason="the system does not show a process's signals")
def test_the_first_interrupt_ends_the_opening_of_a_pipe(tmp_path):
    os.mkfifo(tmp_path / "pipe.y4m")
    process = subprocess.Popen([sys.executable, "-m", "jacoflow", "info", "pipe.y4m"], cwd=tmp_path)
    # Python itself does not catch SIGTERM, the command line does.
    caught = 0
    while not caught >> (signal.SIGTERM - 1) & 1:
        assert process.poll() is None
        caught = int(re.search(r"SigCgt:\s*(\w+)", Path(f"/proc/{process.pid}/status").read_text())[1], 16)
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=60) == 130


def test_a_closed_standard_output_is_an_error(tmp_path):
    np.save(tmp_path / "frames.npy", np.zeros((3, 24, 32), np.uint8))
    command = f"exec {shlex.quote(sys.executable)} -m jacoflow measure frames.npy --quantity u -q >&-"
    result = run("-c", command, folder=tmp_path, command=("sh",))
    assert result.returncode == 1 and "standard output: expected to be open" in result.stderr
