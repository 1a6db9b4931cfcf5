"""Runs cases, one line on standard output before and after each; whoever started it watches them."""

import contextlib
import io as streams
import os
import random
import re
import resource
import signal
import sys
import tempfile
import traceback
import warnings

MEMORY = 12 << 30
"""Address space, bytes: a larger request must say so instead of ending the process."""
PLACES = re.compile(r"(^|[\s.(\[\"'])(?P<name>[A-Za-z_]\w*)[:=' ]")


def prepare():
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.environ.setdefault("MPLBACKEND", "Agg")
    os.environ["JACOFLOW_THREADS"] = "2"
    warnings.simplefilter("ignore")


def is_named(error, names):
    """Whether a message, or what was noted with it, names one of the arguments."""
    text = "\n".join([str(error), *getattr(error, "__notes__", ())])
    return any(match["name"] in names for match in PLACES.finditer(text))


def judge(call, names):
    """What is wrong with how a call ended, in words; None: nothing."""
    import jacoflow

    allowed = (TypeError, ValueError, OSError, MemoryError, jacoflow.JacoflowError, KeyError, ModuleNotFoundError)
    try:
        with contextlib.redirect_stderr(streams.StringIO()):
            call()
    except KeyboardInterrupt:
        return None
    except OverflowError as error:
        return None if is_named(error, names) else f"OverflowError without the argument's name: {error}"
    except allowed:
        return None
    except BaseException as error:  # noqa: BLE001: a panic is one, too
        last = traceback.extract_tb(error.__traceback__)[-1]
        # What an argument of the fuzzer itself raises is its own.
        return None if last.filename.endswith("values.py") else f"{type(error).__name__}: {error}\n{traceback.format_exc(limit=-4)}"
    return None


def main(seed, first, count, folder):
    prepare()
    import calls
    import files

    made = os.path.join(folder, "made")
    os.makedirs(made, exist_ok=True)
    # Some calls write to the current folder.
    os.chdir(made)
    recipes, samples = calls.Recipes(made), files.Samples(folder)
    for case in range(first, first + count):
        rng = random.Random(f"{seed}/{case}")
        if rng.random() < 0.5:
            name, function, given = recipes.pick(rng)
            show(f"begin {case} {name} {shortened(given)}")
            before = set(os.listdir(made))
            wrong = judge(lambda function=function, given=given: function(**given), {*given, "threads"})
            left = [each for each in files.leftovers(made, before) if "." in each and each.startswith((".", "tmp"))]
            wrong = wrong or (f"left {left}" if left else None)
        else:
            name, path, readers = samples.pick(rng)
            show(f"begin {case} {name}")
            wrong = next(filter(None, (judge(reader, ()) for reader in readers)), None)
            if wrong is None:
                path.unlink()
        if "matplotlib.pyplot" in sys.modules:
            sys.modules["matplotlib.pyplot"].close("all")
        show(f"fail {case} {name}: {wrong}".replace("\n", "\\n") if wrong else f"end {case}")
    show("done")


def shortened(given):
    with contextlib.suppress(BaseException):
        return repr({key: value if not hasattr(value, "shape") else f"<{value.shape} {value.dtype}>" for key, value in given.items()})[:300].replace("\n", " ")
    return "?"


def show(line):
    os.write(REPORT, f"{line}\n".encode(errors="replace"))


if __name__ == "__main__":
    # What the library prints goes elsewhere.
    REPORT = os.dup(1)
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with contextlib.suppress(KeyboardInterrupt), tempfile.TemporaryDirectory() as place:
        main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), place)
