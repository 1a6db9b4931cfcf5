"""How the numbers of other programs are kept here."""

from __future__ import annotations

import json
import re
from pathlib import Path


def write(path: Path, record: object) -> None:
    """Writes a record as JSON, each innermost list on one line; numbers keep all their digits."""
    text = json.dumps(record, indent=1)
    lists = re.sub(r"\[[^][{}]*\]", lambda found: " ".join(found[0].split()), text)
    path.write_text(lists + "\n")
