"""What the tests of rigid 3-D motion share: the scenes and scores of the benchmarks, and the usual scene."""


from benchmarks.scenes import motion3d as scenes
from benchmarks.tables import motion3d_claims as claims
from benchmarks.tables import motion3d_coverage as coverage
from benchmarks.tables import motion3d_fixed as fixed
from benchmarks.tables import motion3d_honesty as honesty
from benchmarks.tables import motion3d_layouts as layouts
from benchmarks.tables import motion3d_published as scores
from benchmarks.tables import motion3d_six as six
from jacoflow import motion3d

__all__ = ["U", "W", "claims", "coverage", "fixed", "honesty", "layouts", "scenes", "scores", "scene", "six", "start"]

U, W = scenes.motion("oblique")


def scene(n=300, noise_std=0.01, seed=0, depth="uniform", name="oblique"):
    return scenes.differential(depth, name, n, noise_std, seed)


def start(make, **options):
    return motion3d.estimate_motion(make.points, make.flow, **{"noise_std": make.noise_std, "placement": "start", **options})
