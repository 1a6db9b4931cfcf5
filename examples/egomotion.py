"""A camera's own motion: where it heads, how it turns, how far everything is, and what moves by itself.

Flow at 400 points of a scene in depth is measured with 0.3 px of noise; a fifth of the points lie on
something that moves by itself. Before anything is measured the bound says how many points the direction
needs.
"""

from __future__ import annotations

import numpy as np

from jacoflow import motion3d
from picture import check

K = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]])
TRANSLATION, ROTATION = np.array([0.1, -0.05, -1.0]), np.array([0.002, -0.004, 0.001])
"""The scene's motion relative to a camera that drives forward and turns a little."""
NOISE = 0.3
"""Standard deviation of the flow, px."""


def scene(count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Pixels, and inverse depths of a ground that rises to a wall."""
    points = rng.uniform([0, 0], [640, 480], (count, 2))
    below = np.maximum((points[:, 1] - 240) / 240, 0)
    return points, 0.01 + 0.04 * below


def design(rng: np.random.Generator) -> int:
    """Points that it takes to know the direction to half a degree."""
    for count in (50, 100, 200, 400, 800, 1600):
        points, depths = scene(count, rng)
        bound = motion3d.motion_bound(points, TRANSLATION, ROTATION, depths, K, noise_std=NOISE)
        print(f"{count:5d} points: direction to {bound.direction_std[0]:.2f} deg at best, maximum likelihood {bound.direction_std[1]:.2f}")
        if bound.direction_std[0] < 0.5:
            return count
    raise SystemExit("no number of points was enough")


def main() -> None:
    rng = np.random.default_rng(3)
    count = design(rng)
    points, depths = scene(count, rng)
    flow = motion3d.predict_flow(points, TRANSLATION / np.linalg.norm(TRANSLATION), ROTATION, depths, K)
    mover = (np.abs(points - [200, 300]) < 110).all(axis=1)
    flow[mover] += [6.0, -2.0]
    flow += rng.normal(0, NOISE, flow.shape)
    found = motion3d.estimate_motion(points, flow, K, robust=True)
    heading = -TRANSLATION / np.linalg.norm(TRANSLATION)
    error = np.degrees(np.arccos(np.clip(found.camera_translation @ heading, -1, 1)))
    focus = motion3d.focus_of_expansion(found, K)
    assert focus is not None
    print(f"status {found.status}, noise {found.noise_std:.2f} px, {found.inliers.sum()} of {count} points are inliers ({mover.sum()} move by themselves)")
    print(f"heading off by {error:.2f} deg, standard deviation {found.direction_std:.2f}; focus of expansion {focus[0].round(1)} px")
    print(f"rotation {found.rotation.round(5)} rad/frame, told to {found.rotation_std.round(5)}")
    contact = motion3d.time_to_contact(found)
    near = np.argmax(np.where(found.inliers, found.inv_depth_smooth, 0))
    print(f"nearest point in {contact[near]:.1f} +- {motion3d.time_to_contact_std(found)[near]:.1f} frames")
    check("heading, deg", error, 0.0, 4 * found.direction_std)
    check("noise, px", found.noise_std, NOISE, 0.05)
    check("share of movers told", np.mean(~found.inliers[mover]), 1.0, 0.1)
    check("rotation, mrad/frame", 1e3 * np.linalg.norm(found.rotation - ROTATION), 0.0, 4e3 * np.linalg.norm(found.rotation_std))


if __name__ == "__main__":
    main()
