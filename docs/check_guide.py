"""Follow CONTRIBUTING.md's "Add a motion model in one place" literally, in a scratch copy, and run the tests it promises.

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
        if (ROOT / name).exists():
            shutil.copy(ROOT / name, COPY / name)
    shutil.copytree(ROOT / "src", COPY / "src")
    shutil.copytree(ROOT / "tests" / "affine_flow", COPY / "tests" / "affine_flow")
    (COPY / "tests" / "systems.rs").write_text("mod affine_flow;\n")
    # Benches stay behind, and so must their declarations. Compiling takes longer than the tests: not optimised.
    manifest = re.sub(r"\[\[bench\]\]\n(?:[^\[].*\n|\n)*", "", (COPY / "Cargo.toml").read_text())
    # Nor does the binding come along.
    manifest = manifest.replace('members = ["python"]\n', "")
    (COPY / "Cargo.toml").write_text(manifest + "\n[profile.ci.package.jacoflow]\nopt-level = 0\n")

    (COPY / "src/flow/model/axial.rs").write_text(guide_block(text, "guide: src/flow/model/axial.rs"))
    line = guide_block(text, "guide line: src/flow/model/mod.rs motion_models!")
    registry = COPY / "src/flow/model/mod.rs"
    # The macro is declared first and used second.
    before, call = registry.read_text().rsplit("motion_models! {\n", 1)
    registry.write_text(before + "motion_models! {\n" + line + call)

    environment = {**os.environ, "CARGO_TARGET_DIR": str(ROOT / "target")}
    run = subprocess.run(
        ["cargo", "test", "--profile", "ci", "--no-default-features", "--features", "flow,synth", "--test", "systems", "affine_flow::model", "--", "--nocapture"],
        cwd=COPY,
        env=environment,
        capture_output=True,
        text=True,
    )
    passed = re.findall(r"axial passes \w+", run.stdout)
    if run.returncode or not passed:
        print(run.stdout, run.stderr, sep="\n")
        return 1
    print(f"the guide works: {len(passed)} conformance tests of the added model passed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
