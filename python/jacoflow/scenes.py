"""Moving pictures with exact truth: brightness, flow (px/frame) and Jacobian (1/frame) at every point and time.

>>> from jacoflow import scenes
>>> scene = scenes.Scene("affine", width=64, height=48, u_x=0.01)
>>> scene.frames(3).shape
(3, 48, 64)
>>> float(scene.truth(1.0).u_x[24, 32])
0.01
"""

from ._jacoflow import Scene, Sensor, _scene_carriers, _scene_names, _scene_parameters

__all__ = ["Scene", "Sensor", "carriers", "names", "parameters"]


def names() -> dict[str, str]:
    """Names of the scenes, each with one line about it (no unit).

    >>> "ramp" in names()
    True
    """
    return _scene_names()


def carriers() -> dict[str, str]:
    """Names of what a motion can carry, each with one line about it (no unit). The first is the default.

    >>> "speckle" in carriers()
    True
    """
    return _scene_carriers()


def parameters(name: str) -> dict[str, tuple[float | None, str]]:
    """Parameters of the scene or carrier `name`: for each its default (None: taken from the frame) and its meaning with the unit.

    ValueError for an unknown name.

    >>> parameters("affine")["u"]
    (0.3, 'flow along x at the centre, px/frame')
    """
    return _scene_parameters(name)
