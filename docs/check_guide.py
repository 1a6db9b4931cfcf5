"""Follow CONTRIBUTING.md's "Add a motion model in one place" literally, in a scratch copy: no other file has
to change.

Usage: python docs/check_guide.py
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
COPY = ROOT / "target" / "guide"


def guide_block(text: str, marker: str) -> str:
    """The code block that follows the comment `<!-- marker -->`."""
    found = re.search(rf"<!-- {re.escape(marker)} -->\n```rust\n(.*?)```", text, re.S)
    if not found:
        sys.exit(f"CONTRIBUTING.md: no code block marked {marker!r}")
    return found.group(1)


def main() -> int:
    text = (ROOT / "CONTRIBUTING.md").read_text()
    shutil.rmtree(COPY, ignore_errors=True)
    COPY.mkdir(parents=True)
    for name in ("Cargo.toml", "Cargo.lock", "README.md"):
        shutil.copy(ROOT / name, COPY / name)
    shutil.copytree(ROOT / "src", COPY / "src")
    # Benches and the binding stay behind, and so must their declarations.
    manifest = re.sub(r"\[\[bench\]\]\n(?:[^\[\n].*\n|\n)*", "", (COPY / "Cargo.toml").read_text())
    (COPY / "Cargo.toml").write_text(manifest.replace('members = ["python"]\n', ""))

    (COPY / "src/flow/model/axial.rs").write_text(guide_block(text, "guide: src/flow/model/axial.rs"))
    line = guide_block(text, "guide line: src/flow/model/mod.rs motion_models!")
    registry = COPY / "src/flow/model/mod.rs"
    # The macro is declared first and used second.
    before, call = registry.read_text().rsplit("motion_models! {\n", 1)
    registry.write_text(before + "motion_models! {\n" + line + call)

    command = ["cargo", "check", "-q", "--no-default-features", "--features", "temporal"]
    environment = {**os.environ, "CARGO_TARGET_DIR": str(ROOT / "target")}
    return subprocess.run(command, cwd=COPY, env=environment).returncode


if __name__ == "__main__":
    sys.exit(main())
