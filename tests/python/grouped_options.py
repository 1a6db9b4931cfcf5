"""Options written side by side, sorted into the groups that `estimate`, `FlowEstimator` and `FlowFilter`
take."""

from dataclasses import fields

import jacoflow

METHODS = {m.method: m for m in (jacoflow.CoarseToFine, jacoflow.Windowed, jacoflow.Instantaneous, jacoflow.LucasKanade, jacoflow.HornSchunck)}


def grouped(**options):
    """The same options as keywords of these functions: `window_sigma=3` becomes
    `method=Windowed(window_sigma=3)` and so on."""
    groups = {"grid": jacoflow.SamplingGrid, "preprocess": jacoflow.Preprocess, "temporal": jacoflow.Recursive, "profile": jacoflow.FilterProfile}
    if "profile" not in options and not {"form", "transition", "Q", "R", "x0", "P0", "alpha", "full_scale", "square_root"} & options.keys():
        del groups["profile"]
        groups["method"] = METHODS.get(options.get("method", "coarse_to_fine"))
    for group, kind in groups.items():
        names = [field.name for field in fields(kind)] if kind else []
        inner = {name: options.pop(name) for name in names if name in options}
        if inner and group == "profile" and group in options:
            inner["name"] = options[group]
        if inner:
            options[group] = kind(**inner)
    return options
