"""Hostile files and arguments for every reader and every public function: `python tests/fuzz --cases 10000`.

Deterministic by its seed: `--seed S --case K` repeats one case. It fails on a panic or another unexpected
exception, an abort, a call that does not end (nor on Ctrl-C), an OverflowError that does not name its
argument, and files that are left half written.
"""

import argparse
import contextlib
import os
import pathlib
import select
import signal
import subprocess
import sys
import time

PATIENCE = 4.0
"""Seconds after which a call is stopped as by Ctrl-C."""
GRACE = 12.0
"""Seconds that it then has to stop."""
STARTING = 120.0
"""Seconds for a worker to begin."""


class Worker:
    """A process that runs cases from `first` on."""

    def __init__(self, seed, first, count):
        here = pathlib.Path(__file__).parent
        command = [sys.executable, str(here / "worker.py"), str(seed), str(first), str(count)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        self.buffer = b""

    def line(self, seconds):
        """The next line; None: it did not come in time; "": the process has ended."""
        end = time.monotonic() + seconds
        while b"\n" not in self.buffer:
            ready, _, _ = select.select([self.process.stdout], [], [], max(0.0, end - time.monotonic()))
            if not ready:
                return None
            more = os.read(self.process.stdout.fileno(), 1 << 16)
            if not more:
                return ""
            self.buffer += more
        line, _, self.buffer = self.buffer.partition(b"\n")
        return line.decode(errors="replace")

    def end(self):
        with contextlib.suppress(ProcessLookupError):
            self.process.kill()
        self.process.wait()
        self.process.stdout.close()


def run(seed, first, count):
    """Failures by case."""
    failures, case, begun = {}, first, None
    while case < first + count:
        worker = Worker(seed, case, first + count - case)
        patience, starting = STARTING, True
        while True:
            line = worker.line(patience)
            if line is None and not starting:
                worker.process.send_signal(signal.SIGINT)
                line = worker.line(GRACE)
                if line is None:
                    failures[case] = f"{begun}: does not end, nor on Ctrl-C"
                    break
            if not line:
                code = worker.process.wait(GRACE) if line == "" else "no beginning"
                failures[case] = f"{begun}: the process ended with {code}"
                break
            word, _, rest = line.partition(" ")
            if word == "done":
                case = first + count
                break
            case, _, what = rest.partition(" ")
            case, patience, starting = int(case), PATIENCE, False
            if word == "begin":
                begun = what
            elif word == "fail":
                failures[case] = what.replace("\\n", "\n")
        worker.end()
        case += 1
    return failures


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--case", type=int, help="repeat this one")
    arguments = parser.parse_args()
    first, count = (0, arguments.cases) if arguments.case is None else (arguments.case, 1)
    failures = run(arguments.seed, first, count)
    for case, what in failures.items():
        print(f"--seed {arguments.seed} --case {case}: {what}", flush=True)
    print(f"{count} cases, {len(failures)} failures")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
