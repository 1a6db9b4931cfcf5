"""A server's application: it computes as it is loaded, and again in each worker that is forked from it."""

import json
import os

from fork_support import results

LOADED = results(2)
LOADED_IN = os.getpid()


def application(environ, start_response):
    """What the worker computes with one and with two threads, and whether it is another process."""
    start_response("200 OK", [("Content-Type", "application/json")])
    answer = {"results": [results(1).hex(), results(2).hex()], "loaded": LOADED.hex(), "is_forked": os.getpid() != LOADED_IN}
    return [json.dumps(answer).encode()]
