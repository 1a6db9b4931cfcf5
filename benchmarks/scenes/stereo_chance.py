"""Random stereo sequences: people who cross each other, or who are hidden for some steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.scenes.stereo import Layer, Scene, wall


def crossing_by_chance(seed: int) -> Scene:
    """A person far away, one who hurries behind two that come the other way, side by side."""
    rng = np.random.default_rng(7000 + seed)
    u = rng.uniform
    side = rng.choice([-1, 1])
    height, disparity, speed, x = u(125, 165), u(2, 12), u(16, 24), u(490, 560)
    near = Layer(
        "person",
        3,
        (_mirrored(side, x), u(270, 300)),
        (-side * speed, 0),
        disparity,
        u(-0.3, 0.5),
        (0.4 * height, height),
    )
    middle, far = u(100, 130), u(80, 105)
    layers = (
        wall(u(250, 330), 240, u(-6, 6), u(-34, -28), u(8, 16), u(45, 65)),
        Layer(
            "person",
            1,
            (_mirrored(side, u(230, 320)), u(235, 255)),
            (side * u(-4, 5), 0),
            u(-24, -16),
            0,
            (0.42 * far, far),
            u(14, 20),
        ),
        Layer(
            "person",
            2,
            (_mirrored(side, u(70, 130)), u(255, 285)),
            (side * u(11, 19), 0),
            u(-11, -3),
            u(-0.1, 0.1),
            (0.42 * middle, middle),
            u(16, 24),
        ),
        near,
        replace(
            near,
            position=(_mirrored(side, x + u(60, 95)), near.position[1] + u(-8, 8)),
            disparity=disparity - u(0.5, 2),
        ),
    )
    return Scene("crossing by chance", layers, 16, float(rng.integers(-3, 4)), seed + 900)


def _mirrored(side: int, x: float) -> float:
    """The place x, or its mirror image in a view of 640 px."""
    return 320 + side * (x - 320)


def passing_by_chance(seed: int) -> Scene:
    """A person goes behind a pillar, a person or two."""
    rng = np.random.default_rng(4000 + seed)
    u = rng.uniform
    kind, meeting, place, way = rng.integers(3), u(6, 8.5), u(220, 420), rng.choice([-1, 1])
    far = u(-26, -4)
    near = far + u(4, 20)
    height, speed = u(60, 115), way * u(4, 20)
    against = -way * u(0, 16) if kind else 0.0
    hidden = Layer(
        "person",
        1,
        (place - speed * meeting, 240 + u(-20, 40)),
        (speed, u(-1, 1)),
        far,
        u(-0.2, 0.2),
        (0.42 * height, height),
        u(8, 26),
    )
    layers = [wall(u(250, 350), 240, u(-6, 6), -34, u(4, 16), u(30, 70)), hidden]
    if kind == 0:
        layers.append(Layer("box", 2, (place, 240), (0, 0), near, 0, (u(50, 90), 230), u(14, 30)))
    else:
        tall = height * u(1.1, 1.6)
        apart = 0 if kind == 1 else 35
        person = Layer(
            "person",
            2,
            (place - against * meeting - apart, 250 + u(0, 40)),
            (against, 0),
            near,
            u(-0.2, 0.4),
            (0.42 * tall, tall),
            u(10, 30),
        )
        layers.append(person)
        if kind == 2:
            layers.append(
                replace(
                    person,
                    position=(person.position[0] + u(60, 90), person.position[1] + u(-10, 10)),
                    disparity=near - 1,
                )
            )
    if rng.random() < 0.5:
        layers.insert(
            2,
            Layer(
                "ellipse",
                3,
                (u(60, 580), u(100, 380)),
                (u(-8, 8), u(-4, 4)),
                u(-28, 0),
                0,
                (u(25, 60), u(25, 60)),
                u(8, 20),
            ),
        )
    return Scene(
        "passing by chance", tuple(layers), 16, float(rng.integers(-3, 4)), seed + 1300, noise=u(1, 4)
    )


KINDS: dict[str, Callable[[int], Scene]] = {"crossing": crossing_by_chance, "passing": passing_by_chance}


def labels(scene: Scene) -> list[int]:
    """Those of the objects before the wall."""
    return sorted({layer.label for layer in scene.layers} - {0})
