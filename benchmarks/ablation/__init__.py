"""What each heuristic buys: one module for each system, and the driver in `__main__.py`.

A module is named like the first part of its heuristics' names (`edges.contrast` -> `edges.py`) and has

- `rows() -> dict[str, list[float]]`: name of a figure -> its value for each scene, recording or seed, always
  in the same order and number, NaN where there is none. Values with and without a heuristic are compared pair
  by pair.
- `LARGER_IS_BETTER`: names of the rows in which larger values are better; in all others smaller ones are
  (errors, shares of wrong answers, |coverage - .95|, milliseconds).
"""
