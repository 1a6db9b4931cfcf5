"""What the tests of rigid 3-D motion share: the scenes and scores of the benchmarks, and the usual scene."""

import sys
from pathlib import Path

from jacoflow import motion3d

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
import motion3d_claims as claims
import motion3d_coverage as coverage
import motion3d_fixed as fixed
import motion3d_honesty as honesty
import motion3d_layouts as layouts
import motion3d_rivals as rivals
import motion3d_scenes as scenes
import motion3d_scores as scores
import motion3d_six as six

__all__ = ["U", "W", "claims", "coverage", "fixed", "honesty", "layouts", "rivals", "scenes", "scores", "scene", "six", "start"]

U, W = scenes.motion("oblique")


def scene(n=300, sigma=0.01, seed=0, depth="uniform", name="oblique"):
    return scenes.differential(depth, name, n, sigma, seed)


def start(make, **options):
    return motion3d.estimate_motion(make.points, make.flow, **{"sigma": make.sigma, "placement": "start", **options})
