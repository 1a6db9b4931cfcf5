"""The stereo tracker on synthetic scenes with exact truth: the specification's figures, identities,
exposure."""

from dataclasses import replace
from functools import cache, lru_cache

import numpy as np
import pytest

from benchmarks.scenes.stereo import Layer, Scene, cart, crossing, curved, pillar, small, tiny, wall
from benchmarks.scenes.stereo_chance import crossing_by_chance, labels, passing_by_chance
from benchmarks.scores.stereo_tracking import gross
from benchmarks.tables.stereo_tracking import follow
from benchmarks.tables.stereo_tracking_chance import comings_back
from benchmarks.tables.stereo_tracking_chance import scored as chance
from jacoflow.track import StereoTracker


@pytest.mark.parametrize(("seed", "label"), [(101, 2), (103, 1)])
def test_who_is_taken_over_by_a_component_at_its_rim_keeps_its_track(seed, label):
    scores = scored(replace(small(), seed=seed), "improved")
    assert scores.id_kept(label) == scores.index_kept(label) == scores.path(label) == 6


def scored(scene, mode, sequence=None, **options):
    tracker = StereoTracker(mode, disparity_range=scene.disparity_range, **options)
    return follow(scene, sequence or drawn(scene), tracker, False)[0]


@lru_cache(maxsize=1)
def drawn(scene):
    """Its sequence. Drawing takes longer than following: tests of one scene stand together."""
    return scene.sequence()


def crossing_sequence(seed):
    return drawn(replace(crossing(), seed=seed))


class Matched:
    """A tracker that keeps the disparities of a sequence in `found`, or takes those that another one kept
    there: matching takes longer than all else."""

    def __init__(self, tracker, found):
        self.tracker, self.found, self.given = tracker, found, iter([*found])

    @property
    def graph(self):
        return self.tracker.graph

    def update(self, left, right):
        given = next(self.given, None)
        if given is not None:
            return self.tracker.update_disparity(left, given)
        step = self.tracker.update(left, right)
        disparity = np.full(left.shape, np.nan, np.float32)
        disparity[step.rows, step.cols] = step.values
        self.found.append(disparity)
        return step


@cache
def crossing_on_paper(seed):
    """Purity, recalls and paths of the paper's mode on a texture of the crossing, means over three starts of
    the mixture."""
    scene, found = crossing(), []
    trackers = [Matched(StereoTracker("paper", disparity_range=scene.disparity_range, random_state=start), found) for start in range(3)]
    each = [follow(scene, crossing_sequence(seed), tracker, False)[0] for tracker in trackers]
    return np.mean([[scores.purity(), *(scores.recall(label) for label in (1, 2, 3)), *(scores.path(label) for label in (1, 2, 3))] for scores in each], axis=0)


CROSSINGS = (1, 22)


@pytest.mark.parametrize(
    ("mode", "purity", "recalls", "errors"),
    [("improved", 0.966, (0.971, 0.967), ((0.004, 0.002, 0.019), (0.004, 0.004, 0.009))), ("paper", 0.949, (0.951, 0.934), ((1.0, 0.0, 0.0), (1.6, 0.08, 0.30)))],
)
def test_the_specifications_figures_on_the_small_scene(mode, purity, recalls, errors):
    scores = scored(small(), mode)
    assert scores.purity() >= purity - 0.02
    for label, (recall, error) in enumerate(zip(recalls, errors, strict=True), 1):
        assert scores.recall(label) >= recall - 0.02
        assert scores.path(label) == 6
        # What cells allow is the paper's; the improved errors are bounded by twice those asked, or 0.02.
        bound = np.maximum(2 * np.array(error), 0.02 if mode == "improved" else 0.5)
        assert (np.median(scores.motion_errors()[label], axis=0) <= bound).all()
    if mode == "improved":
        assert scores.index_kept(2) == 6


EXPOSURES = {
    "darker by a twentieth a step": lambda t: (0.95**t, 0.0),
    "a third less at every other step": lambda t: (1.0 - 0.35 * (t % 2), 0.0),
    "15 grey levels more at every other step": lambda t: (0.9, 15.0 * (t % 2)),
}
"""Gain and offset of both cameras at a step."""


@pytest.mark.parametrize("exposure", EXPOSURES.values(), ids=EXPOSURES)
def test_another_exposure_is_no_motion(exposure):
    def exposed(t, view):
        gain, offset = exposure(t)
        return np.rint(np.clip(gain * view + offset, 0, 255)).astype(np.uint8)

    sequence = [replace(shown, left=exposed(t, shown.left), right=exposed(t, shown.right)) for t, shown in enumerate(drawn(small()))]
    scores = scored(small(), "improved", sequence)
    assert [scores.id_kept(label) for label in (1, 2)] == [6, 6]
    # Some pieces of the wall have just come to light.
    for label, errors in scores.motion_errors().items():
        assert (np.median(errors, axis=0) <= (0.02 if label else 0.03)).all()


@pytest.mark.parametrize(("disparity", "approach", "speed"), [(2.0, -0.1, 0.0), (3.0, 0.12, 2.6), (2.5, 0.0, 2.6), (2.3, 0.05, 6.0)])
def test_what_drifts_through_layers_of_depth_keeps_its_track(disparity, approach, speed):
    layers = (wall(160, 120, 0, -14, 0, 28), Layer("box", 1, (100, 120), (speed, 0.2), disparity, approach, (36, 50), 14))
    drifting = Scene("drifting", layers, 12, 0.0, 21, (320, 240), (-20, 12))
    scores = scored(drifting, "improved", drifting.sequence())
    assert scores.id_share(1) == 1.0 and scores.recall(1) > 0.98
    assert (np.median(scores.motion_errors("velocity")[1], axis=0) <= (0.02, 0.02, 0.03)).all()


@pytest.mark.parametrize("seed", CROSSINGS[1:])
def test_other_textures_of_the_crossing_are_followed_as_well(seed):
    scores = scored(crossing(), "improved", crossing_sequence(seed))
    assert crossing_on_paper(seed)[0] > 0.9
    assert scores.purity() >= 0.958
    assert [scores.path(label) for label in (1, 2, 3)] == [9, 11, 16] == [scores.id_kept(label) for label in (1, 2, 3)]
    assert scores.recognised(2)
    # One of the pair is half of it: what is one object is one group.
    _, share, precision = scores.grouped(3)
    assert share >= 0.96 and precision >= 0.93 and scores.groups() <= 7


def test_who_was_hidden_is_recognised():
    scores = scored(crossing(), "improved", crossing_sequence(1))
    assert crossing_on_paper(1)[0] > 0.9
    assert scores.recognised(2)
    assert scores.purity() >= 0.958
    assert all(scores.recall(label) >= recall - 0.02 for label, recall in zip((1, 2, 3), (0.912, 0.951, 0.992), strict=True))
    assert [scores.path(label) for label in (1, 2, 3)] == [9, 11, 16] == [scores.index_kept(label) for label in (1, 2, 3)]
    # Whose pixels are nearly all hidden at once is still who is left, as long as that is where it went.
    assert [scores.id_kept(label) for label in (1, 2, 3)] == [9, 11, 16]
    # Of the wall much is being covered, or has just come to light.
    errors = scores.motion_errors()
    assert gross(errors[0]) <= 0.011 and len(errors[0]) > 100 and gross(errors[3]) == 0
    assert (np.median(errors[0], axis=0) <= (0.02, 0.02, 0.022)).all()
    assert (np.median(errors[3], axis=0) <= (0.028, 0.02, 0.024)).all()


def test_the_papers_mode_on_the_crossing_is_the_specifications_in_the_mean():
    """Single starts of the mixture differ by steps of a path; means over starts and textures do not."""
    purity, *recalls, first, second, pair = np.mean([crossing_on_paper(seed) for seed in CROSSINGS], axis=0)
    assert purity >= 0.946 - 0.02
    assert all(recall >= asked - 0.02 for recall, asked in zip(recalls, (0.685, 0.857, 0.942), strict=True))
    assert first >= 6 and second >= 10 and pair == 16


@pytest.mark.parametrize("scene", [crossing, cart])
def test_a_missing_pair_changes_no_name(scene):
    """Twice the time went by without `dt`: the cart recedes by 6 px of disparity at once, which is a jump but
    for all of it being seen there."""
    sequence = drawn(scene())[:9]
    scores = scored(scene(), "improved", [*sequence[:4], *sequence[5:]])
    assert scores.id_share(1) == 1.0 and scores.id_share(2) == 1.0


def test_who_goes_away_among_objects_at_rest_is_followed():
    """The cart, which recedes by three disparities a step."""
    scores = scored(cart(), "improved")
    assert scores.purity() >= 0.952
    assert scores.recall(1) >= 0.956 and scores.recall(2) >= 0.959
    assert scores.path(1) == 8 and scores.id_kept(1) == 10
    for kind in ("affine", "velocity"):
        assert (np.median(scores.motion_errors(kind)[1], axis=0) <= (0.02, 0.02, 0.022)).all()
    # Beside the median of the truth, as 5.2 words it, by which one row of its outline too many makes 0.065
    # along y.
    u, v, w = np.median(scores.motion_errors("median")[1], axis=0)
    assert u <= 0.02 and v < 0.065 and w <= 0.022


def test_a_pair_that_comes_twice_stands_still_and_changes_no_name():
    """The cart recedes by 3 px of disparity a step: a standstill would be a jump."""
    sequence = drawn(cart())
    tracker = StereoTracker()
    of_cart = []
    for shown in [*sequence[:4], sequence[3], *sequence[4:7]]:
        step = tracker.update(shown.left, shown.right)
        indices, counts = np.unique(step.cluster_of_pixel[shown.label[step.rows, step.cols] == 1], return_counts=True)
        of_cart.append(next(cluster for cluster in step.clusters if cluster.index == indices[counts.argmax()]))
    assert len({cluster.track_id for cluster in of_cart}) == 1
    assert not any(cluster.coasting for cluster in of_cart)
    np.testing.assert_array_equal(of_cart[4].velocity, 0)
    assert all(cluster.velocity[2] == pytest.approx(-3, abs=0.05) for cluster in [*of_cart[1:4], *of_cart[5:]])


@pytest.mark.parametrize(("scene", "purity", "recalls", "paths"), [(cart, 0.933, (0.952, 0.929), (8,)), (curved, 0.968, (0.979, 0.947), (10, 10))])
def test_the_papers_mode_has_the_specifications_figures(scene, purity, recalls, paths):
    scores = scored(scene(), "paper", n_components=12)
    assert scores.purity() >= purity - 0.02
    assert all(scores.recall(label) >= recall - 0.02 for label, recall in enumerate(recalls, 1))
    assert tuple(scores.path(label) for label in range(1, 1 + len(paths))) == paths


def test_what_comes_nearer_is_one_group_and_its_parts_show_their_motion():
    scores = scored(curved(), "improved")
    single, share, precision = scores.grouped(1)
    assert single < 0.5 and share >= 0.96 and precision >= 0.93
    for kind in ("affine", "velocity", "median"):
        assert (np.median(scores.motion_errors(kind)[1], axis=0) <= 0.02).all()
    assert scores.purity() >= 0.962 and scores.recall(1) >= 0.979 and scores.recall(2) >= 0.959


def test_who_is_hidden_for_long_is_recognised_from_parts():
    scores = scored(pillar(), "improved")
    assert scores.id_share(1) == scores.id_share(2) == 1.0
    assert scores.recognised(1) is not False


def test_who_was_hidden_is_recognised_in_sequences_by_chance():
    """In the first two come back, in the other one, who was hidden by somebody else."""
    back = []
    for scene, seed in ((crossing_by_chance, 3), (passing_by_chance, 0)):
        drawn = scene(seed)
        scores = chance(drawn, seed)
        back += list(comings_back(scores, drawn).values())
        assert scores.purity() >= 0.96
        assert np.mean([scores.id_share(label) for label in labels(drawn)]) >= 0.9
    # Now and then a track goes to a part of who comes to light.
    assert len(back) >= 2 and sum(map(bool, back)) >= 0.75 * len(back)


def test_small_objects_are_found_and_keep_their_tracks():
    scores = scored(tiny(), "improved")
    for label in (1, 2, 3):
        assert scores.recall(label) >= 0.98 and scores.id_kept(label) == 10
    assert scores.short_tracks() <= 0.3


