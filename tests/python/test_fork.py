"""A process that was forked, or begun in another way, computes as its parent does: nothing waits for threads
or locks that stayed behind."""

import concurrent.futures
import functools
import http.client
import json
import multiprocessing
import multiprocessing.pool
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import traceback
import warnings

import numpy as np
import pytest

import jacoflow
from benchmarks.scenes import motion3d as motion3d_scenes
from benchmarks.scenes import stereo as stereo_scenes
from conftest import METHODS
from fork_support import digest, field, report, results, sequence
import jacoflow.reference
from jacoflow import motion3d, scenes, stereo, track

PATIENCE = 100.0
"""Seconds after which a child that has not answered is ended: a test that fails must end, too."""

needs_fork = pytest.mark.skipif(not hasattr(os, "fork"), reason="the system cannot fork")


def quietly(begin):
    """What `begin()` returns. Python warns of a fork beside threads; here that is the point."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        return begin()


def in_child(work):
    """What `work()`, a few bytes, is in a forked child."""
    reader, writer = os.pipe()
    child = quietly(os.fork)
    if child == 0:
        code = 1
        try:
            os.write(writer, work())
            code = 0
        except BaseException:
            traceback.print_exc()
        finally:
            # Without the clean-up that is the parent's.
            os._exit(code)
    os.close(writer)
    answered = bool(select.select([reader], [], [], PATIENCE)[0])
    answer = os.read(reader, 1 << 12) if answered else b""
    os.close(reader)
    if not answered:
        os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    assert answered, "the child does not answer"
    assert status == 0
    return answer


@needs_fork
@pytest.mark.parametrize("threads", [1, 2, None])
def test_a_forked_child_goes_on(threads):
    before = results(threads)
    assert in_child(lambda: results(threads)) == before
    # Nor does it do the parent any harm.
    assert results(threads) == before


@needs_fork
def test_a_child_of_a_child_goes_on_whether_or_not_its_parent_computed():
    before = results(2)
    assert in_child(lambda: in_child(lambda: results(2))) == before
    assert in_child(lambda: results(2) + in_child(lambda: results(2))) == 2 * before


@needs_fork
def test_a_fork_amid_the_work_of_another_thread():
    before, stop, wrong = results(2), threading.Event(), []

    def work():
        while not stop.is_set():
            if results(2) != before:
                wrong.append("busy")

    def fork():
        wrong.extend("child" for _ in range(8) if in_child(lambda: results(2)) != before)

    busy, forking = threading.Thread(target=work), threading.Thread(target=fork)
    try:
        busy.start()
        forking.start()
        forking.join()
    finally:
        stop.set()
        busy.join()
    assert not wrong


@needs_fork
def test_an_estimator_is_carried_on_in_a_child():
    frames = sequence(4)
    for make in (lambda: jacoflow.FlowEstimator(method="windowed"), jacoflow.FlowFilter):
        estimator = make()
        for frame in frames[:3]:
            estimator.push(frame)

        def rest(estimator=estimator):
            return digest(*(estimator.push(frame).flow for frame in frames[3:]))

        assert in_child(rest) == rest()


def tracked():
    found = track.track(sequence(8), (100, 80, 60, 50))
    return found.box, found.displacement


@functools.cache
def stereo_steps():
    return stereo_scenes.small().sequence(range(3))


@functools.cache
def windowed_field():
    """What others are derived from."""
    return field("windowed")[0]


def stereo_tracked():
    tracker = track.StereoTracker(disparity_range=(-20, 12))
    for step in stereo_steps():
        tracker.update(step.left, step.right)
    return (np.frombuffer(tracker.graph.to_json().encode(), np.uint8),)


def people(mode):
    scene = scenes.TargetScene("people_static", scale=0.25)
    options = {"mode": mode, "n_particles": 100, "n_near": 200}
    found = track.track_particles([scene.frame(t) for t in range(4)], scene.boxes()[0], keep_frames=True, **options)
    return found[-1].boxes, found[-1].covariance, found[-1].foreground


def matched(method):
    step = stereo_steps()[0]
    found = stereo.edge_disparity(step.left, step.right, disparity_range=(-20, 12), row_range=(-2, 2), method=method)
    return found.disparity, found.values


def row_offset():
    step = stereo_steps()[0]
    return (np.array(stereo.estimate_row_offset(step.left, step.right, disparity_range=(-20, 12))),)


def moved(robust):
    scene = motion3d_scenes.differential("smooth", "oblique", 3000, 0.01, 0)
    found = motion3d.estimate_motion(scene.points, scene.flow, noise_std=scene.noise_std, robust=robust)
    return found.translation, found.rotation, found.inv_depth


def bound():
    scene = motion3d_scenes.differential("smooth", "oblique", 3000, 0.01, 0)
    return (motion3d.motion_bound(scene.points, scene.u, scene.w, scene.depths, noise_std=scene.noise_std).crlb,)


def moved_before_a_field(patches):
    camera = np.array([[300.0, 0, 160], [0, 300, 120], [0, 0, 1]])
    windowed = windowed_field()
    found, points = motion3d.estimate_field_motion(windowed, camera, patches=patches)
    return found.rotation, points, *motion3d.time_to_contact_map(windowed, found, camera)


def mixed():
    points = np.random.default_rng(1).normal(size=(20000, 3)) + np.arange(20000)[:, None] % 3 * 5
    fitted = jacoflow.mixture.VariationalGaussianMixture(4, max_iter=20, random_state=1).fit(points)
    return fitted.means_, fitted.score_samples(points)


def derived():
    windowed = windowed_field()
    values = [windowed.value(name) for name in ("divergence", "shear_magnitude", "rotation_centre_x")]
    return *values, windowed.std("divergence"), windowed.advect([[50.0, 60.0]])


def scene(carrier):
    made = scenes.Scene("vortex", carrier=carrier, width=320, height=240)
    return made.frame(1.0), made.truth(1.0).flow


def dirichlet():
    points = np.random.default_rng(1).normal(size=(20000, 3)) + np.arange(20000)[:, None] % 3 * 5
    fitted = jacoflow.mixture.DirichletProcessGaussianMixture(4, max_iter=10, random_state=1).fit(points)
    return fitted.means_, fitted.score_samples(points)


def points_moved():
    first, second, _ = sequence()
    corners = jacoflow.corners(first)
    return corners, *jacoflow.point_flow(first, second, corners)


def particles():
    made = jacoflow.filters.ParticleFilter(2, 50_000, batch=4, random_state=1)
    made.predict(F=np.eye(2), Q=np.eye(2))
    made.update(-0.5 * (made.x**2).sum(-1))
    made.resample()
    return (made.x,)


def segmented():
    return (jacoflow.segment.felzenszwalb(sequence()[0], 20.0),)


def fused():
    return field("windowed", temporal="recursive").flow, field("instantaneous", temporal="recursive").flow


def filtered():
    made = jacoflow.FlowFilter()
    return [made.push(frame).flow for frame in sequence()]


def observable():
    # Fewer rows, that many threads still share.
    found = jacoflow.observability(sequence()[:, :96])
    return (found.condition, found.condition_number)


CALLS = {
    **{method: lambda method=method: (field(method).flow,) for method in METHODS},
    "smoothed": lambda: (field("windowed", preprocess=jacoflow.Preprocess(smooth=1.0)).flow,),
    "derived": derived,
    "observability": observable,
    **{f"scene {name}": lambda name=name: scene(name) for name in ("noise", "particles")},
    "track": tracked,
    **{f"stereo {method}": lambda method=method: matched(method) for method in ("classes", "sgm")},
    "row offset": row_offset,
    "edge pixels": lambda: stereo.edge_pixels(sequence()[0]),
    "stereo tracker": stereo_tracked,
    **{f"particle tracker, {mode}": lambda mode=mode: people(mode) for mode in ("improved", "paper")},
    **{f"motion3d {robust}": lambda robust=robust: moved(robust) for robust in (True, False)},
    **{f"motion3d field {patches}": lambda patches=patches: moved_before_a_field(patches) for patches in (None, 24)},
    "motion3d bound": bound,
    "mixture": mixed,
    "Dirichlet mixture": dirichlet,
    "points": points_moved,
    "particle filter": particles,
    "segments": segmented,
    "fusion": fused,
    "flow filter": filtered,
    "reference tracker": lambda: [jacoflow.reference.local_flow(*sequence(2)).flow],
}
"""What computes, with so much to do that threads share it: none may use threads that a child cannot have
anew."""


@needs_fork
@pytest.mark.parametrize("name", CALLS)
def test_everything_that_computes_does_so_in_a_child(name):
    before = digest(*CALLS[name]())
    assert in_child(lambda: digest(*CALLS[name]())) == before


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("method", multiprocessing.get_all_start_methods())
def test_processes_of_multiprocessing_compute_the_same(method, threads):
    before = results(threads)
    context = multiprocessing.get_context(method)
    mine, theirs = context.Pipe()
    process = context.Process(target=report, args=(theirs, threads), daemon=True)
    quietly(process.start)
    try:
        assert mine.poll(PATIENCE), "the process does not answer"
        assert mine.recv() == before
        process.join(PATIENCE)
        assert process.exitcode == 0
    finally:
        process.kill()
        process.join()


@pytest.mark.parametrize("method", multiprocessing.get_all_start_methods())
def test_executors_of_processes_compute_the_same(method):
    before = [results(1), results(2)]
    with concurrent.futures.ProcessPoolExecutor(2, multiprocessing.get_context(method)) as executor:
        found = [quietly(lambda threads=threads: executor.submit(results, threads)) for threads in (1, 2)]
        assert [each.result(PATIENCE) for each in found] == before


def test_executors_of_threads_compute_the_same():
    before = [results(1), results(2)] * 2
    with concurrent.futures.ThreadPoolExecutor(3) as executor:
        assert list(executor.map(results, [1, 2] * 2)) == before
    with multiprocessing.pool.ThreadPool(3) as pool:
        assert pool.map(results, [1, 2] * 2) == before


def test_workers_of_joblib_compute_the_same():
    joblib = pytest.importorskip("joblib")
    before = [results(1), results(2)]
    for backend in ("loky", "multiprocessing", "threading"):
        work = (joblib.delayed(results)(threads) for threads in (1, 2))
        assert quietly(lambda work=work, backend=backend: joblib.Parallel(2, backend=backend, timeout=PATIENCE)(work)) == before, backend


class UnixConnection(http.client.HTTPConnection):
    """A connection to a server that listens on a path."""

    def __init__(self, path):
        super().__init__("localhost", timeout=PATIENCE)
        self.path = str(path)

    def connect(self):
        self.sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.sock.settimeout(self.timeout)
        self.sock.connect(self.path)


@needs_fork
def test_workers_of_a_server_compute_the_same(tmp_path):
    pytest.importorskip("gunicorn")
    path, folder = tmp_path / "socket", os.path.dirname(__file__)
    command = [sys.executable, "-m", "gunicorn", "--preload", "--workers", "2", "--bind", f"unix:{path}", "--chdir", folder]
    server = subprocess.Popen([*command, "--timeout", str(int(PATIENCE)), "fork_server:application"])
    try:
        end = time.monotonic() + PATIENCE
        while not path.exists():
            assert server.poll() is None, "the server has ended"
            assert time.monotonic() < end, "the server does not listen"
            time.sleep(0.05)
        expected = [results(1).hex(), results(2).hex()]
        for _ in range(4):
            connection = UnixConnection(path)
            connection.request("GET", "/")
            answer = json.loads(connection.getresponse().read())
            connection.close()
            assert answer == {"results": expected, "loaded": expected[1], "is_forked": True}
    finally:
        server.terminate()
        server.wait(PATIENCE)
