"""Ctrl-C stops long work in its middle, and what was half changed is not used."""

import os
import subprocess
import sys
import textwrap

import pytest

BEGIN = """
import os, signal, sys, threading
import numpy as np
import jacoflow
from jacoflow import io, track

signal.signal(signal.SIGINT, signal.default_int_handler)
texture = np.random.default_rng(0).integers(0, 256, (1300, 1700)).astype(np.uint8)

def stopped(call):
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    try:
        call()
    except KeyboardInterrupt:
        return True
    return False
"""


def run(script):
    """Runs it as a program of its own: signals are for the main thread of a process."""
    whole = BEGIN + textwrap.dedent(script)
    ended = subprocess.run([sys.executable, "-c", whole], capture_output=True, text=True, timeout=240, check=False)
    assert ended.returncode == 0, ended.stderr


ENDLESS = {
    "mixture": "mixture.VariationalGaussianMixture(8, max_iter=10**9, tol=None).fit(points)",
    "starts of a mixture": "mixture.VariationalGaussianMixture(4, max_iter=2, n_init=10**9).fit(points)",
    "Dirichlet mixture": "mixture.DirichletProcessGaussianMixture(8, max_iter=10**9, tol=None).fit(points)",
    "points": "jacoflow.point_flow(texture, texture[::-1].copy(), np.full((10**6, 2), 600.0), window=201, max_steps=1000)",
    "frames of a scene": "jacoflow.scenes.Scene('turbulence', width=640, height=480).frame(2e4)",
}


def test_work_without_end_stops():
    """One after the other in a process, which goes on working."""
    run(f"""
        from jacoflow import mixture
        points = np.random.default_rng(0).normal(size=(4000, 3))
        calls = {{{", ".join(f"{name!r}: lambda: {call}" for name, call in ENDLESS.items())}}}
        for name, call in calls.items():
            assert stopped(call), name
            assert mixture.VariationalGaussianMixture(2, max_iter=3, random_state=0).fit(points).means_.shape == (2, 3)
    """)


def test_a_tracker_that_was_stopped_in_a_step_says_so():
    run("""
        tracker = track.StereoTracker(n_components=48)
        assert stopped(lambda: [tracker.update(texture, np.roll(texture, k, 1)) for k in range(1000)])
        for use in (lambda: tracker.row_offset, lambda: tracker.graph, lambda: tracker.update(texture, texture)):
            try:
                use()
            except ValueError as error:
                assert str(error).startswith("self: expected a tracker whose last step was completed")
            else:
                raise AssertionError("it goes on")
    """)


def test_an_estimate_stops_and_its_estimator_begins_anew():
    run("""
        estimator = jacoflow.FlowEstimator(method=jacoflow.CoarseToFine(preset="accurate"))
        estimator.push(texture)
        estimator.push(np.roll(texture, 1, 1))
        assert stopped(lambda: estimator.push(np.roll(texture, 2, 1)))
        assert estimator.frames_pushed == 0
        small = [texture[:40, k : k + 50] for k in range(3)]
        for frame in small:
            field = estimator.push(frame)
        np.testing.assert_array_equal(field.flow, jacoflow.flow(*small, method=jacoflow.CoarseToFine(preset="accurate")).flow)
        assert stopped(lambda: jacoflow.estimate([texture, np.roll(texture, 1, 1), np.roll(texture, 2, 1)]))
    """)


def test_a_flow_filter_that_was_stopped_begins_anew():
    run("""
        flow_filter = jacoflow.FlowFilter(profile="patent")
        assert stopped(lambda: [flow_filter.push(texture) for _ in range(1000)])
        assert flow_filter.frames_pushed == 0 and flow_filter.state is None
        fresh = jacoflow.FlowFilter(profile="patent")
        for k in range(3):
            frame = texture[:40, k : k + 50]
            np.testing.assert_array_equal(flow_filter.push(frame).flow, fresh.push(frame).flow)
        assert stopped(lambda: flow_filter.smooth(np.tile(texture, (3, 1, 1))))
        assert flow_filter.frames_pushed == 3
        assert stopped(lambda: [jacoflow.segment.felzenszwalb(texture) for _ in range(1000)])
        assert stopped(lambda: [jacoflow.flow(texture, texture, texture, method="instantaneous") for _ in range(1000)])
    """)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_pipes_that_nobody_writes_to_are_left(tmp_path):
    names = {"io.frames": "frames.y4m", "jacoflow.FlowField.load": "field.pfm", "io.read_image": "image.pfm", "io.read_disparity": "disparity.pfm"}
    for name in names.values():
        os.mkfifo(tmp_path / name)
    run(f"""
        calls = {{{", ".join(f"{call!r}: lambda: {call}({str(tmp_path / name)!r})" for call, name in names.items())}}}
        for name, call in calls.items():
            assert stopped(call), name
    """)


def test_threads_other_than_the_main_one_compute_as_ever():
    run("""
        found = []
        small = [texture[:40, k : k + 50] for k in range(3)]
        threads = [threading.Thread(target=lambda: found.append(jacoflow.estimate(small).flow)) for _ in range(3)]
        [thread.start() for thread in threads]
        [thread.join() for thread in threads]
        for flow in found:
            np.testing.assert_array_equal(flow, jacoflow.estimate(small).flow)
        assert len(found) == 3
    """)
