"""Rotation speed of a machine from a patch of its surface that does not contain the axis.

The curl of a turning surface is twice its angular velocity at every point of it, so any patch will do; the
axis itself, p - M^-1 (u, v), may lie outside the picture.
"""

from __future__ import annotations

import numpy as np

import jacoflow
from jacoflow import plot, scenes
from picture import check, save

RPM, FPS, RADIUS = 45.0, 500.0, 150.0
AXIS = (20.0, 130.0)
"""Of the disc, in px of the camera's picture: left of and below the patch that is looked at."""
PATCH = (96, 72)
"""Width and height of the picture, px."""
CORNER = (90.0, 20.0)
"""Where the camera's picture lies on the machine, px."""


def main() -> None:
    disc = scenes.Scene(
        "disc", width=PATCH[0], height=PATCH[1], origin=CORNER, random_state=8, sigma=3.0, rpm=RPM, fps=FPS, centre_x=AXIS[0], centre_y=AXIS[1], disc_radius=RADIUS
    )
    camera = scenes.Sensor(noise=1.5, rounding="nearest", saturate=True, random_state=2)
    frames = np.array([camera.apply_u8(frame, index=k) for k, frame in enumerate(disc.frames(12))])
    fields = jacoflow.estimate(frames, method=jacoflow.Windowed(window_sigma=5.0), fps=FPS, ends="drop")
    # The part of the picture well inside the disc.
    disc_region = (AXIS[0] - CORNER[0], AXIS[1] - CORNER[1], RADIUS - 15)
    found = fields.measure("rpm", disc_region)
    centre = [fields.measure(f"rotation_centre_{axis}", disc_region) for axis in "xy"]
    readings = found.value
    axis = [float(along.value.mean()) + corner for along, corner in zip(centre, CORNER, strict=True)]
    print("frame      rpm      sd     axis, px")
    for k, (rpm, std) in enumerate(zip(found.value, found.std, strict=True)):
        print(f"{k + 1:5}  {rpm:7.3f}  {std:6.3f}      ({centre[0].value[k] + CORNER[0]:6.1f}, {centre[1].value[k] + CORNER[1]:6.1f})")
    mean, error = np.mean(readings), np.std(readings, ddof=1) / np.sqrt(len(readings))
    print(f"rotation speed {mean:.3f} +- {error:.3f} rpm, truth {RPM} rpm; axis ({axis[0]:.1f}, {axis[1]:.1f}), truth {AXIS}")
    check("rpm", float(mean), RPM, 0.02 * RPM)
    check("axis x", axis[0], AXIS[0], 5.0)
    check("axis y", axis[1], AXIS[1], 5.0)

    def draw(figure):
        left, right = figure.subplots(1, 2)
        plot.quiver(fields[4], axes=left, frame=frames[5])
        plot.scalar_map(fields[4].rpm, axes=right, signed=False, limit=1.5 * RPM, label="rotation speed", unit="rpm")

    save("rotation_speed", draw)


if __name__ == "__main__":
    main()
