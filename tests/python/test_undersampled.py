"""Detail that pixels do not resolve pulls the flow aside: most of it is removed, the rest is stated."""

import numpy as np
import pytest

import jacoflow
from benchmarks.scenes.disturbed import inner, undersampled

MOVES = ((0.25, 0.3), (1.7, -0.35))


@pytest.mark.parametrize(("preset", "bar"), [("fast", 0.04), ("balanced", 0.025), ("accurate", 0.025)])
def test_error_and_intervals(preset, bar):
    errors, held = [], []
    for seed in (7, 8):
        for move in MOVES:
            field = jacoflow.flow(*undersampled(seed, move), method=jacoflow.CoarseToFine(preset=preset))
            error = inner(field.flow - np.array(move))
            std = inner(np.stack([field.std("u"), field.std("v")], axis=-1))
            errors.append(np.mean(error**2))
            held.append(np.mean(np.abs(error) <= 1.96 * std))
    print(f"{preset}: {np.sqrt(np.mean(errors)):.4f} px, {np.mean(held):.3f} held")
    assert np.sqrt(np.mean(errors)) < bar
    assert np.mean(held) > 0.85


def test_flow_does_not_depend_on_whether_its_covariance_is_wanted():
    frames = undersampled(9, MOVES[0])
    alone = jacoflow.flow(*frames, method=jacoflow.CoarseToFine(), covariance=False)
    np.testing.assert_array_equal(alone.flow, jacoflow.flow(*frames, method=jacoflow.CoarseToFine()).flow)
