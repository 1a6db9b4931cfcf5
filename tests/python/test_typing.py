"""Uses of the public interface that are type-checked (mypy --strict) and run."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, assert_type

import numpy as np
import pytest
from numpy.typing import NDArray

import jacoflow
from jacoflow import FlowEstimator, FlowField, FlowFilter, Status, filters, io, scenes, track


def frames() -> NDArray[np.float64]:
    return scenes.Scene("affine", width=32, height=24, u=0.2).frames(4)


def test_estimate() -> None:
    stack = frames()
    field = jacoflow.flow(*stack[:3], method="windowed", fps=25.0, grid=jacoflow.SamplingGrid(region=(2, 2, 20, 20), stride=2))
    assert_type(field, FlowField)
    assert_type(field.frame_index, int)
    assert_type(field.status, NDArray[np.uint8])
    assert_type(field.divergence, NDArray[np.float64])
    assert_type(field.rpm, NDArray[np.float64])
    assert_type(field.region_mean("curl"), tuple[float, float, int])
    assert_type(field[0] if field.shape[0] < 0 else field, FlowField)
    assert_type(field.advect([[5.0, 6.0]]), NDArray[np.float64])
    assert_type(field.advect([[5.0, 6.0]], np.eye(2)), tuple[NDArray[np.float64], NDArray[np.float64]])
    covariance = field.covariance
    assert covariance is not None and covariance.shape[-2:] == (6, 6)
    assert Status(int(field.status[5, 5])) is Status.OK
    points = jacoflow.estimate(stack, method=jacoflow.Windowed(neighbourhood=[(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1)]), grid=jacoflow.SamplingGrid(points=[(3, 4), (5, 6)]), ends="drop")
    assert points.shape == (2, 2)


def test_counts_of_frames_are_checked() -> None:
    """Each call is an error for mypy, which reports an `ignore` that is not needed, and raises."""
    scene = scenes.Scene("affine", width=32, height=24, u=0.2)
    a, b, c, d = scene.frame(0.0), scene.frame(1.0), scene.frame(2.0), scene.frame(3.0)
    with pytest.raises(TypeError, match="two or three frames"):
        jacoflow.flow(a)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match="two or three frames"):
        jacoflow.flow(a, b, c, d)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="one stack or list of frames"):
        jacoflow.estimate(a, b)  # type: ignore[arg-type]
    assert_type(jacoflow.flow(a, b), FlowField)
    assert_type(jacoflow.flow(a, b, c), FlowField)


def test_streams(tmp_path: Path) -> None:
    assert_type(FlowEstimator(temporal=jacoflow.Recursive(forgetting=0.9)).frames_needed, int)
    estimator = FlowEstimator(method=jacoflow.LucasKanade(window_sigma=3.0))
    results = [estimator.push(frame) for frame in frames()]
    assert_type(results, list[FlowField | None])
    flow_filter = FlowFilter(profile=jacoflow.FilterProfile("measured", Q=np.full(12, 1e-4), form="fast"))
    fields = [flow_filter.push(frame) for frame in frames()]
    assert_type(fields, list[FlowField])
    assert_type(flow_filter.repairs, int)
    state = flow_filter.state
    assert state is not None and state.shape == (24, 32, 12)
    fields[-1].save(tmp_path / "field.npz")
    assert_type(FlowField.load(tmp_path / "field.npz"), FlowField)


def test_frames_and_files(tmp_path: Path) -> None:
    assert_type(io.write_frames(tmp_path / "a.npy", frames()), int)
    reader = io.frames(tmp_path / "a.npy")
    iterator: Iterator[NDArray[Any]] = iter(reader)
    assert sum(1 for _ in iterator) == 4
    io.write_flo(str(tmp_path / "a.flo"), np.zeros((3, 4, 2)))
    assert_type(io.read_flo(tmp_path / "a.flo"), NDArray[np.float32])


def test_filters() -> None:
    def fx(points: NDArray[np.float64], dt: float) -> NDArray[np.float64]:
        return points * (1 - dt)

    def hx(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return points[..., :1]

    ukf = filters.UnscentedKalmanFilter(2, 1, 0.1, hx, fx, filters.MerweScaledSigmaPoints(2), batch=3)
    ukf.x = np.ones((3, 2))
    ukf.P *= 2
    ukf.R = 0.5
    ukf.predict()
    ukf.update(np.zeros((3, 1)))
    assert_type(ukf.x, NDArray[np.float64])


def test_particle_filter() -> None:
    def speed(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return -np.square(x[..., 1])

    made = filters.ParticleFilter(2, 40, batch=3, random_state=1, ids=[4, 5, 6])
    made.sample_gaussian([0.0, 0.0], 1.0)
    made.predict(F=np.eye(2), Q=0.1)
    made.predict(lambda x: 0.9 * x)
    made.update(speed)
    made.update(np.zeros((3, 40)))
    assert_type(made.resample("residual", threshold=0.5, n_particles=20), NDArray[np.bool_])
    assert_type(made.log_weights, NDArray[np.float64])
    assert_type(made.quantile([0.1, 0.9]), NDArray[np.float64])
    assert_type(filters.resample([0.5, 0.5], 4, "stratified", uniforms=np.full(4, 0.5)), NDArray[np.int64])


def test_particle_tracker() -> None:
    scene = scenes.TargetScene("people_static", scale=0.25)
    tracker = track.ParticleTracker(scene.frame(0), {4: scene.boxes()[0, 0]}, n_particles=20, n_near=20, segmentation={"scale": 100})
    step = tracker.update(scene.frame(1), camera=np.eye(2, 3))
    assert_type(step, track.ParticleStep)
    assert_type(step.foreground, NDArray[np.float32])
    assert_type(step.segments, NDArray[np.int32])
    assert_type(step.tracks.owner, NDArray[np.int64])
    assert_type(step.particles(4), tuple[NDArray[np.float64], NDArray[np.float64]])
    assert_type(tracker.add(scene.boxes()[1, 1]), int)
    tracks = track.track_particles(scene.frames()[:3], {0: {1: scene.boxes()[0, 0]}, 1: {2: scene.boxes()[1, 1]}}, n_particles=20, n_near=20, threads=1)
    assert_type(tracks[0], track.ParticleStep)
    assert_type(tracks[1:], tuple[track.ParticleStep, ...])
    assert_type(tracks.track(2).status, tuple[str, ...])


def test_observability() -> None:
    found = jacoflow.observability(frames()[:3])
    assert_type(found.observable, NDArray[np.bool_])
    assert found.rank.max() == 6


def test_names() -> None:
    assert_type(jacoflow.quantities(), dict[str, tuple[str, str]])
    assert_type(scenes.parameters("affine")["u"], tuple[float | None, str])
