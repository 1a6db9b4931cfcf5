"""Moving pictures with exact truth: brightness, flow (px/frame) and Jacobian (1/frame) at every point and
time.

>>> from jacoflow import scenes
>>> scene = scenes.Scene("affine", width=64, height=48, u_x=0.01)
>>> scene.frames(3).shape
(3, 48, 64)
>>> float(scene.truth(1.0).u_x[24, 32])
0.01

Colour scenes with several targets, for trackers:

>>> crossing = scenes.TargetScene("people_handheld", scale=0.25, frames=5)
>>> crossing.frames().shape, crossing.boxes().shape
((5, 120, 180, 3), (5, 2, 4))
"""

from ._jacoflow import Scene, Sensor, TargetScene, _scene_carriers, _scene_names, _scene_parameters, _target_scene_names

__all__ = ["Scene", "Sensor", "TargetScene", "carriers", "names", "parameters", "target_scenes"]


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
    """Parameters of the scene or carrier `name`: for each its default (None: taken from the frame) and its
    meaning with the unit.

    ValueError for an unknown name.

    >>> parameters("affine")["u"]
    (0.3, 'flow along x at the centre, px/frame')
    """
    return _scene_parameters(name)


def target_scenes() -> dict[str, str]:
    """Names of the colour scenes of several targets, each with one line about it (no unit).

    >>> list(target_scenes())[:3]
    ['people_handheld', 'cars_handheld', 'people_static']
    """
    return _target_scene_names()
