"""Intruder detection: something moves where nothing should, separated from camera noise by the flow's own
covariance.

A fixed camera looks at a yard. From frame 6 on a person-sized patch walks through it. In every frame each
pixel's speed is put in units of its standard deviation; an alarm needs a connected patch of many significant
pixels. Light that changes over the whole picture does not matter: flow does not depend on intensity gain.
"""

from __future__ import annotations

import numpy as np

import jacoflow
from jacoflow import plot, scenes
from picture import check, save

WIDTH, HEIGHT, COUNT, ENTERS = 240, 160, 16, 6
SPEED = (1.6, -0.3)
"""Of the intruder, px/frame."""
START, HALF = (20.0, 100.0), (11.0, 20.0)


def place(t: float) -> tuple[float, float]:
    """Centre of the intruder at frame t, px."""
    return START[0] + SPEED[0] * (t - ENTERS), START[1] + SPEED[1] * (t - ENTERS)


def watch() -> np.ndarray:
    """The camera's frames, uint8 (COUNT, HEIGHT, WIDTH)."""
    still = {name: 0.0 for name in ("u_x", "u_y", "v_x", "v_y")}
    yard = scenes.Scene("affine", width=WIDTH, height=HEIGHT, random_state=4, u=0.0, v=0.0, std=25.0, **still).frame(0.0)
    person = scenes.Scene("affine", width=WIDTH, height=HEIGHT, random_state=5, u=SPEED[0], v=SPEED[1], std=30.0, mean=110.0, **still)
    camera = scenes.Sensor(noise=2.0, rounding="nearest", saturate=True, random_state=6)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    frames = []
    for t in range(COUNT):
        image = yard
        if t >= ENTERS:
            cx, cy = place(t)
            inside = (np.abs(x - cx) <= HALF[0]) & (np.abs(y - cy) <= HALF[1])
            image = np.where(inside, person.frame(t), yard)
        frames.append(camera.apply_u8(image, index=t))
    return np.array(frames)


def significance(field: jacoflow.FlowField) -> np.ndarray:
    """(u, v) P^-1 (u, v)^T per pixel (H, W): chi-squared with two degrees of freedom where nothing moves."""
    flow = np.nan_to_num(field.flow)
    covariance = np.asarray(field.covariance)[..., :2, :2]
    a, b, c = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    u, v = flow[..., 0], flow[..., 1]
    with np.errstate(invalid="ignore", divide="ignore"):
        value = (c * u * u - 2 * b * u * v + a * v * v) / (a * c - b * b)
    return np.where(np.asarray(field.valid), value, 0.0)


def largest_patch(mask: np.ndarray) -> np.ndarray | None:
    """The largest connected patch of a mask, as coordinates (N, 2) of (row, column); None for an empty
    mask."""
    left = mask.copy()
    best: list[tuple[int, int]] = []
    while left.any():
        seed = tuple(np.argwhere(left)[0])
        left[seed] = False
        patch, queue = [seed], [seed]
        while queue:
            row, column = queue.pop()
            for r, c in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)):
                if 0 <= r < left.shape[0] and 0 <= c < left.shape[1] and left[r, c]:
                    left[r, c] = False
                    patch.append((r, c))
                    queue.append((r, c))
        best = max(best, patch, key=len)
    return np.array(best) if best else None


def main() -> None:
    frames = watch()
    fields = jacoflow.estimate(frames, method=jacoflow.Windowed(window_sigma=3.0), ends="drop")
    false_alarms = detected = 0
    errors, last = [], None
    print("frame  significant px  alarm")
    for index in range(COUNT - 2):
        t = index + 1
        field = fields[index]
        speed = np.hypot(field.flow[..., 0], field.flow[..., 1])
        patch = largest_patch((significance(field) > 40) & (speed > 0.25))
        size = 0 if patch is None else len(patch)
        alarm = size > 120
        text = ""
        if alarm and patch is not None:
            cy, cx = np.median(patch, axis=0)
            u, v = (float(np.median(field.flow[patch[:, 0], patch[:, 1], k])) for k in (0, 1))
            text = f"at ({cx:.0f}, {cy:.0f}) px, moving ({u:+.2f}, {v:+.2f}) px/frame"
            if t > ENTERS + 1:
                px, py = place(t)
                errors.append(np.hypot(cx - px, cy - py))
                last = (field, frames[t], (u, v))
        inside = t > ENTERS
        false_alarms += alarm and t + 1 < ENTERS
        detected += alarm and inside
        print(f"{t:5}  {size:14}  {text or '-'}")
    present = COUNT - 2 - ENTERS
    print(f"seen in {detected} of {present} frames, {false_alarms} false alarms; mean error of place {np.mean(errors):.1f} px; true motion {SPEED}")
    check("frames in which the intruder is seen", detected, present, 1)
    check("false alarms", false_alarms, 0, 0)
    check("mean error of place, px", float(np.mean(errors)), 0.0, 6.0)
    assert last is not None
    field, frame, (u, v) = last
    check("intruder's speed, px/frame", u, SPEED[0], 0.3)

    def draw(figure):
        left, right = figure.subplots(1, 2)
        plot.quiver(field, axes=left, frame=frame)
        plot.scalar_map(np.sqrt(significance(field)), axes=right, signed=False, label="speed over its standard deviation")

    save("intruder_detection", draw)


if __name__ == "__main__":
    main()
