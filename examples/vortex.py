"""Fluids: centre, circulation and core of a vortex from particle images.

Tracer particles swirl in a drifting Lamb-Oseen vortex. The vorticity v_x - u_y comes straight from the
estimator, without differencing a flow: its peak is the centre's, its sum over a disc the circulation, its
width the core's.
"""

from __future__ import annotations

import numpy as np

import jacoflow
from jacoflow import plot, scenes
from picture import check, save

SIZE = 192
CIRCULATION, CORE = 320.0, 26.0
"""px^2/frame, px."""
CENTRE, DRIFT = (90.0, 101.0), (0.3, -0.2)
"""At time 0, px; px/frame."""


def main() -> None:
    scene = scenes.Scene(
        "vortex",
        width=SIZE,
        height=SIZE,
        random_state=21,
        carrier="particles",
        circulation=CIRCULATION,
        core=CORE,
        centre_x=CENTRE[0],
        centre_y=CENTRE[1],
        drift_x=DRIFT[0],
        drift_y=DRIFT[1],
        density=0.08,
        diameter=4.0,
    )
    camera = scenes.Sensor(noise=1.0, rounding="nearest", saturate=True, random_state=1)
    frames = np.array([camera.apply_u8(frame, index=k) for k, frame in enumerate(scene.frames(5))])
    fields = jacoflow.estimate(frames, method=jacoflow.Windowed(window_sigma=6.0), ends="drop")
    rows = []
    for k in range(len(frames) - 2):
        curl = np.asarray(fields[k].curl, dtype=float)
        x, y = centre_of(curl)
        circulation = sum_inside(curl, (x, y), 2.5 * CORE) / (1 - np.exp(-(2.5**2)))
        peak = float(np.nanpercentile(curl[np.hypot(*offsets((x, y))) < 6], 50))
        core = float(np.sqrt(circulation / (np.pi * peak)))
        true = CENTRE[0] + DRIFT[0] * (k + 1), CENTRE[1] + DRIFT[1] * (k + 1)
        rows.append((x, y, circulation, core))
        print(f"frame {k + 1}: centre ({x:.1f}, {y:.1f}) px, truth ({true[0]:.1f}, {true[1]:.1f}); circulation {circulation:.0f} px^2/frame; core {core:.1f} px")
        check("centre x", x, true[0], 2.0)
        check("centre y", y, true[1], 2.0)
    mean = np.mean(rows, axis=0)
    print(f"circulation {mean[2]:.0f} px^2/frame, truth {CIRCULATION:.0f}; core {mean[3]:.1f} px, truth {CORE:.1f}")
    check("circulation", float(mean[2]), CIRCULATION, 0.1 * CIRCULATION)
    check("core", float(mean[3]), CORE, 0.15 * CORE)
    truth = scene.truth(2.0)
    wrong = np.asarray(fields[1].flow)[20:-20, 20:-20] - np.asarray(truth.flow)[20:-20, 20:-20]
    curl_error = (np.asarray(fields[1].curl) - np.asarray(truth.curl))[20:-20, 20:-20]
    flow_rms, curl_rms = np.sqrt(np.nanmean(wrong**2)), np.sqrt(np.nanmean(curl_error**2))
    print(f"rms errors: flow {flow_rms:.3f} px/frame, curl {curl_rms:.4f} 1/frame (peak {CIRCULATION / np.pi / CORE**2:.3f})")

    def draw(figure):
        panels = figure.subplots(1, 3)
        plot.quiver(fields[1], axes=panels[0], frame=frames[2])
        plot.curl(fields[1], axes=panels[1], limit=0.16)
        plot.curl(truth, axes=panels[2], limit=0.16).set_title("curl, truth")

    save("vortex", draw, (15, 4.2))


def offsets(centre: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    y, x = np.mgrid[0:SIZE, 0:SIZE]
    return x - centre[0], y - centre[1]


def centre_of(curl: np.ndarray) -> tuple[float, float]:
    """Centre of gravity of the strong half of the vorticity."""
    curl = np.nan_to_num(curl)
    strong = np.clip(curl - 0.5 * np.percentile(curl, 99.5), 0, None)
    y, x = np.mgrid[0:SIZE, 0:SIZE]
    return float((strong * x).sum() / strong.sum()), float((strong * y).sum() / strong.sum())


def sum_inside(curl: np.ndarray, centre: tuple[float, float], radius: float) -> float:
    """Vorticity summed over a disc, px^2/frame: the circulation around it."""
    inside = np.hypot(*offsets(centre)) < radius
    return float(np.nanmean(curl[inside]) * np.pi * radius**2)


if __name__ == "__main__":
    main()
