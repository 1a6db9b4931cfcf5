"""Fluids: turbulence statistics from a tracer's pictures.

A random solenoidal velocity field carries a dye. From three frames: fluctuating speed, enstrophy and strain
(their means are equal in incompressible isotropic turbulence), the residual divergence as a check on the
measurement, and the Taylor length, all without differencing a flow.
"""

from __future__ import annotations

import numpy as np

import jacoflow
from jacoflow import plot, scenes
from picture import check, save

WIDTH, HEIGHT = 256, 192
SPEED, LONGEST = 0.8, 320.0
"""Root-mean-square speed, px/frame; longest wave, px."""


def statistics(flow: np.ndarray, jacobian: np.ndarray) -> dict[str, float]:
    """Means over the pixels of flow (N, 2) and Jacobian (N, 2, 2)."""
    u_x, u_y, v_x, v_y = (jacobian[:, i, j] for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)))
    strain = 2 * (u_x**2 + v_y**2) + (u_y + v_x) ** 2
    velocity = flow - flow.mean(axis=0)
    return {
        "rms speed, px/frame": float(np.sqrt((velocity**2).sum(axis=1).mean())),
        "enstrophy, 1/frame^2": float(((v_x - u_y) ** 2).mean()),
        "strain^2, 1/frame^2": float(strain.mean()),
        "rms divergence, 1/frame": float(np.sqrt(((u_x + v_y) ** 2).mean())),
        "Taylor length, px": float(np.sqrt((velocity[:, 0] ** 2).mean() / (u_x**2).mean())),
    }


def main() -> None:
    scene = scenes.Scene("turbulence", width=WIDTH, height=HEIGHT, random_state=14, speed=SPEED, longest=LONGEST)
    camera = scenes.Sensor(noise=1.0, rounding="nearest", saturate=True, random_state=1)
    frames = [camera.apply_u8(scene.frame(t), index=k) for k, t in enumerate((-1.0, 0.0, 1.0))]
    # A narrow window for the short waves, and less smoothing than usual: smoothing takes away strain of a
    # fine tracer.
    field = jacoflow.flow(*frames, method=jacoflow.Windowed(window_sigma=2.5), preprocess=jacoflow.Preprocess(smooth=1.0))
    truth = scene.truth(0.0)
    inside = np.zeros((HEIGHT, WIDTH), dtype=bool)
    inside[16:-16, 16:-16] = True
    inside &= np.asarray(field.valid)
    measured = statistics(np.asarray(field.flow, dtype=float)[inside], np.asarray(field.jacobian, dtype=float)[inside])
    true = statistics(np.asarray(truth.flow)[inside], np.asarray(truth.jacobian)[inside])
    print(f"{'':26} {'measured':>10} {'truth':>10}")
    for name, value in measured.items():
        print(f"{name:26} {value:10.4f} {true[name]:10.4f}")
    for name in ("rms speed, px/frame", "enstrophy, 1/frame^2", "strain^2, 1/frame^2", "Taylor length, px"):
        check(name, measured[name], true[name], 0.2 * true[name])
    check("rms divergence", measured["rms divergence, 1/frame"], 0.0, 0.4 * np.sqrt(true["enstrophy, 1/frame^2"]))

    def draw(figure):
        panels = figure.subplots(1, 3)
        plot.quiver(field, axes=panels[0], frame=frames[1])
        limit = 3 * np.sqrt(true["enstrophy, 1/frame^2"])
        plot.curl(field, axes=panels[1], limit=limit)
        plot.curl(truth, axes=panels[2], limit=limit).set_title("curl, truth")

    save("turbulence", draw, (15, 3.8))


if __name__ == "__main__":
    main()
