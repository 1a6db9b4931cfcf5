"""How far ahead of Farneback's flow the estimate is on scenes with exact truth, and what motions it finds."""

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import jacoflow

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))

import contestants
import controlled

FARNEBACK = {
    controlled.Case(64.0, 1.0, 3.0): (0.0723, 0.0114),
    controlled.Case(64.0, 8.0, 0.0): (0.556, 0.0879),
    controlled.Case(256.0, 1.0, 3.0): (0.0311, 0.00534),
    controlled.Case(256.0, 4.0, 0.0): (0.0708, 0.0138),
}
"""Mean end-point error (px) and error of the Jacobian (1/frame) of OpenCV's Farneback with its defaults and `numpy.gradient`, as `benchmarks/controlled.py` prints them."""


@pytest.mark.parametrize("case", FARNEBACK, ids=lambda case: f"{case.wavelength:g}-{case.speed:g}-{case.noise:g}")
def test_three_frames_are_four_times_as_accurate(case):
    balanced = next(each for each in contestants.CONTROLLED if each.name == "coarse to fine, balanced")
    flow, share, jacobian = controlled.Contestant.of(balanced).errors(case)
    theirs = FARNEBACK[case]
    assert share == 1.0 and flow < theirs[0] / 4 and jacobian < theirs[1] / 4


@pytest.mark.parametrize("size", [(120, 160), (160, 200)])
def test_small_frames_find_motion_of_a_tenth_of_their_side(size):
    """Texture of 2 px shifted by sixteen."""
    shift, rng = 16, np.random.default_rng(4)
    texture = gaussian_filter(rng.standard_normal((size[0], size[1] + shift)), 2)
    texture = 128 + 40 * texture / texture.std()
    field = jacoflow.estimate([texture[:, shift:], texture[:, :-shift]], time_scheme="pair")
    assert np.abs(field.u - shift)[8:-8, 8 : -2 * shift].mean() < 0.02
