"""Results print in a few lines, come as tables, and trackers pickle in mid-stream."""

import pickle

import numpy as np
import pytest

import jacoflow.reference
from benchmarks.scenes import motion3d as motion3d_scenes
from benchmarks.scenes import stereo as stereo_scenes
from jacoflow import mixture, motion3d, scenes, stereo, track

LONGEST = 1200
"""Characters of the longest representation."""


def moving(count=8):
    """A textured square that moves by two pixels a frame."""
    rng = np.random.default_rng(3)
    ground, square = rng.integers(40, 120, (72, 96)), rng.integers(120, 250, (24, 24))
    frames = np.repeat(ground[None], count, 0).astype(np.uint8)
    for t in range(count):
        frames[t, 24:48, 20 + 2 * t : 44 + 2 * t] = square
    return frames


@pytest.fixture(scope="module")
def results():
    scene = motion3d_scenes.differential("uniform", "oblique", 300, 0.01, 0)
    frames, people = moving(), scenes.TargetScene("people_static", scale=0.25, frames=4)
    views = stereo_scenes.small().sequence()[:2]
    tracker = track.StereoTracker(disparity_range=(-20, 12))
    steps = [tracker.update(view.left, view.right) for view in views]
    particles = track.track_particles(people.frames(), people.boxes()[0], n_particles=30, n_near=30)
    estimate = motion3d.estimate_motion(scene.points, scene.flow, noise_std=0.01)
    return {
        "estimate": estimate,
        "solution": estimate.ml,
        "common": estimate.systematic_errors,
        "bound": motion3d.motion_bound(scene.points, scene.u, scene.w, scene.depths, noise_std=0.01),
        "lateral": motion3d.estimate_lateral(scene.flow),
        "track": track.track(frames, (19.5, 23.5, 24, 24)),
        "result": track.track(frames, (19.5, 23.5, 24, 24)).results[-1],
        "step": steps[-1],
        "cluster": steps[-1].clusters[0],
        "graph": tracker.graph,
        "stereo track": next(iter(tracker.tracks.values())),
        "particles": particles,
        "particle step": particles[-1],
        "particle track": particles.track(0),
        "corners": particles[-1].tracks,
        "disparity": stereo.edge_disparity(views[0].left, views[0].right, disparity_range=(-20, 12)),
        "observability": jacoflow.observability(list(frames[:3])),
        "flow of pixels": jacoflow.reference.local_flow(frames[0], frames[1]),
        "mixture": mixture.VariationalGaussianMixture(3, mean_prior=np.zeros(2)).fit(np.random.default_rng(0).normal(size=(500, 2))),
        "Dirichlet mixture": mixture.DirichletProcessGaussianMixture(3).fit(np.random.default_rng(0).normal(size=(500, 2))),
    }


NAMES = ["estimate", "solution", "common", "bound", "lateral", "track", "result", "step", "cluster", "graph", "stereo track", "particles", "particle step", "particle track", "corners", "disparity", "observability", "flow of pixels", "mixture", "Dirichlet mixture"]  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_results_print_in_a_few_lines(name, results):
    text = repr(results[name])
    assert len(text) < LONGEST and text.startswith(type(results[name]).__name__ + "("), text
    assert " at 0x" not in text


def test_what_is_printed(results):
    text = repr(results["estimate"])
    assert "status='ok'" in text and "inv_depth=<(300,) float64>" in text and "ml=MotionSolution(...)" in text
    assert repr(results["track"]) == "Track(results=<8 TrackResult>)"
    assert repr(results["particles"]) == "ParticleTracks(steps=<4 ParticleStep>)"
    assert repr(results["graph"]).endswith("arcs)")


@pytest.mark.parametrize(
    ("name", "count", "columns"),
    [
        ("estimate", lambda found: len(found.inv_depth), ["inv_depth", "residuals", "inliers"]),
        ("track", len, ["frame", "position_0", "position_1", "covariance_1_2_2", "status"]),
        ("step", lambda found: len(found.rows), ["rows", "values"]),
        ("stereo track", lambda found: len(found.times), ["positions_2", "clock"]),
        ("particle step", len, ["boxes_3", "status"]),
        ("particle track", len, ["present", "boxes_0", "reason"]),
        ("corners", len, ["positions_1", "owner"]),
        ("disparity", lambda found: len(found.rows), ["rows", "cols", "values", "score"]),
    ],
)
def test_tables_have_a_column_for_each_number(name, count, columns, results):
    table = results[name].table()
    assert set(columns) <= set(table) and {len(column) for column in table.values()} == {count(results[name])}
    assert all(column.ndim == 1 for column in table.values())
    if name == "track":
        np.testing.assert_array_equal(table["position_1"], results[name].position[:, 1])


def same(one, other):
    """Whether two results hold the same numbers."""
    for name in vars(one):
        mine, theirs = getattr(one, name), getattr(other, name)
        if isinstance(mine, np.ndarray):
            np.testing.assert_array_equal(mine, theirs)
        elif isinstance(mine, (str, int, bool)):
            assert mine == theirs, name


@pytest.mark.parametrize(
    "make",
    [
        lambda frame: track.GradientTracker(frame, (19.5, 23.5, 24, 24)),
        lambda frame: track.GradientTracker(frame, model="affine", camera="none", center=(32, 36)),
        lambda frame: jacoflow.reference.ReferenceTracker(frame, (19.5, 23.5, 24, 24)),
    ],
)
def test_gradient_trackers_go_on_from_a_pickle(make):
    frames = [*moving(10)]
    frames[5] = np.zeros_like(frames[5])
    tracker = make(frames[0])
    copies = [pickle.loads(pickle.dumps(tracker))]
    for frame in frames[1:]:
        result = tracker.update(frame)
        for copy in copies:
            same(result, copy.update(frame))
        copies.append(pickle.loads(pickle.dumps(tracker)))
        same(result, copies[-1].result)


def test_floats_keep_their_scale_in_a_pickle():
    frames = moving(4) / 255
    tracker = track.GradientTracker(frames[0] * 0.001, (19.5, 23.5, 24, 24))
    copy = pickle.loads(pickle.dumps(tracker))
    for frame in frames[1:]:
        same(tracker.update(frame), copy.update(frame))


@pytest.mark.parametrize("mode", ["improved", "paper"])
def test_stereo_trackers_go_on_from_a_pickle(mode):
    tracker = track.StereoTracker(mode, disparity_range=(-20, 12), n_components=6)
    copies = [pickle.loads(pickle.dumps(tracker))]
    for view in stereo_scenes.small().sequence()[:3]:
        step = tracker.update(view.left, view.right)
        for copy in copies:
            same(step, copy.update(view.left, view.right))
        copies.append(pickle.loads(pickle.dumps(tracker)))
        assert all(copy.graph == tracker.graph for copy in copies)


def test_particle_trackers_and_mixtures_go_on_from_a_pickle():
    people = scenes.TargetScene("people_static", scale=0.25, frames=5)
    tracker = track.ParticleTracker(people.frame(0), people.boxes()[0], n_particles=30, n_near=30)
    for t in range(1, 5):
        copy = pickle.loads(pickle.dumps(tracker))
        same(tracker.update(people.frame(t)), copy.update(people.frame(t)))
        assert copy.step.reason == tracker.step.reason
    points = np.random.default_rng(0).normal(size=(300, 2))
    one = mixture.VariationalGaussianMixture(3, random_state=0).partial_fit(points)
    other = pickle.loads(pickle.dumps(one))
    np.testing.assert_array_equal(one.partial_fit(points + 1).means_, other.partial_fit(points + 1).means_)
    fitted = mixture.DirichletProcessGaussianMixture(3, random_state=0).fit(points)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(fitted)).score_samples(points), fitted.score_samples(points))


def test_damaged_pickles_are_refused():
    from jacoflow._jacoflow import _restore_gradient_tracker, _restore_stereo_tracker

    for restore in (_restore_gradient_tracker, _restore_stereo_tracker):
        with pytest.raises(ValueError, match="^state: expected the bytes of a pickled"):
            restore(b"JF" + bytes(40), 1.0)
