"""What can be read is there, true and alike in the compiled module and its stub; examples in it run."""

import ast
import doctest
import importlib
import inspect
import pkgutil
import re
from pathlib import Path

import pytest

import jacoflow
from benchmarks import readme, report
from jacoflow import _jacoflow

ROOT = Path(__file__).parents[2]
PACKAGE = Path(jacoflow.__file__).parent
MODULES = ["jacoflow", *(f"jacoflow.{module.name}" for module in pkgutil.iter_modules([str(PACKAGE)]))]
SHAPES_OR_UNITS = re.compile(r"\((\.\.\.|H|N|T|B|n|m|2 n|6|12|count)\b|\(\.\.\.,|/frame|/s\b|\bpx\b|\bunits?\b|grey level|rad\b|frames", re.IGNORECASE)
"""An array's shape or a number's unit, or the word that there is none."""
NOTHING_TO_MEASURE = {
    "jacoflow.video.Video.close",
    # Groups of options: each field states its unit.
    "jacoflow.CoarseToFine",
    "jacoflow.HornSchunck",
    "jacoflow.Instantaneous",
    "jacoflow.LucasKanade",
    "jacoflow.Preprocess",
    "jacoflow.SamplingGrid",
    "jacoflow.Windowed",
    "jacoflow.track.StereoCamera",
}


def public():
    """(name, object) of everything public, members of classes included."""
    for module_name in MODULES:
        if module_name.rsplit(".", 1)[-1].startswith("_"):
            continue
        module = importlib.import_module(module_name)
        for name in module.__all__:
            thing = getattr(module, name)
            if name == "__version__" or inspect.ismodule(thing):
                continue
            yield f"{module_name}.{name}", thing
            if inspect.isclass(thing) and thing.__module__.startswith("jacoflow") and not issubclass(thing, Exception):
                for member, value in vars(thing).items():
                    described = inspect.isroutine(value) or inspect.isdatadescriptor(value) or isinstance(value, property)
                    borrowed = type(value).__module__.startswith("sklearn")
                    if not member.startswith("_") and described and not borrowed:
                        yield f"{module_name}.{name}.{member}", getattr(thing, member)


@pytest.mark.parametrize(("name", "thing"), sorted(public(), key=lambda pair: pair[0]), ids=lambda value: value if isinstance(value, str) else "")
def test_every_public_name_shows_shapes_or_units(name, thing):
    if isinstance(thing, type) and issubclass(thing, BaseException):
        assert thing.__doc__
        return
    text = inspect.getdoc(thing)
    assert text, f"{name} has no docstring"
    if name not in NOTHING_TO_MEASURE:
        assert SHAPES_OR_UNITS.search(text), f"{name} tells neither shapes nor units: {text!r}"


def stub_docstrings():
    tree = ast.parse((PACKAGE / "_jacoflow.pyi").read_text())
    for node in tree.body:
        if not isinstance(node, ast.ClassDef | ast.FunctionDef):
            continue
        if not node.name.startswith("_"):
            yield node.name, ast.get_docstring(node), getattr(_jacoflow, node.name).__doc__
        if isinstance(node, ast.ClassDef):
            for member in node.body:
                setter = isinstance(member, ast.FunctionDef) and any(isinstance(d, ast.Attribute) for d in member.decorator_list)
                if isinstance(member, ast.FunctionDef) and not member.name.startswith("__") and not setter:
                    compiled = getattr(getattr(_jacoflow, node.name), member.name).__doc__
                    yield f"{node.name}.{member.name}", ast.get_docstring(member), compiled


@pytest.mark.parametrize(("name", "stub", "compiled"), list(stub_docstrings()))
def test_stub_and_compiled_module_say_the_same(name, stub, compiled):
    # Lines end elsewhere: methods are indented in the stub.
    assert stub.split() == compiled.split(), name


def test_the_stub_of_flow_has_the_options_of_estimate():
    """stubtest leaves out `flow`, whose second frame only the stub requires."""
    functions = {node.name: node for node in ast.parse((PACKAGE / "_jacoflow.pyi").read_text()).body if isinstance(node, ast.FunctionDef)}
    flow, estimate = ({a.arg: ast.unparse(a.annotation) for a in functions[name].args.kwonlyargs} for name in ("flow", "estimate"))
    assert {**flow, **{name: estimate[name] for name in ("ends", "pairs", "progress")}} == estimate
    assert [*inspect.signature(_jacoflow.flow).parameters] == ["first", "second", "third", "more", *flow]


@pytest.mark.parametrize("name", [name for name in MODULES if name not in ("jacoflow.__main__", "jacoflow._jacoflow")])
def test_examples_in_docstrings_run(name):
    failures, _ = doctest.testmod(importlib.import_module(name), optionflags=doctest.ELLIPSIS)
    assert failures == 0


@pytest.mark.parametrize("name", ["README.md"])
def test_python_in_the_readme_runs(name, tmp_path, monkeypatch):
    """Every ```python block of the README, one after another in one namespace."""
    path = ROOT / name
    blocks = re.findall(r"^```python\n(.*?)^```", path.read_text(), re.DOTALL | re.MULTILINE)
    monkeypatch.chdir(tmp_path)
    namespace: dict[str, object] = {}
    for block in blocks:
        if "# not run" not in block:
            exec(compile(block, str(path), "exec"), namespace)


def test_tables_of_the_readme_are_those_of_the_kept_results():
    record = report.newest()
    assert record is not None
    texts = [document.read_text() for document in readme.DOCUMENTS]
    for text in texts:
        assert text == readme.written(text, record), "make readme"
    # Every table is in a document, and the text file of the results is short.
    assert set(re.findall(r"<!-- table: (\w+) -->", "".join(texts))) == set(readme.TABLES)
    summary = report.RESULTS / f"{record.date}.md"
    assert summary.read_text() == record.markdown() and len(summary.read_text().splitlines()) <= report.SUMMARY_LINES


PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "benchmarks").glob("*.md")]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_of_pages_lead_somewhere(page):
    targets = re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text())
    missing = [target for target in targets if "://" not in target and not (page.parent / target).exists()]
    assert not missing


def test_defaults_are_the_cores(tmp_path):
    """What the signature promises as a default gives the same as leaving it to the core."""
    frames = list(jacoflow.scenes.Scene("affine", width=32, height=32).frames(3))
    plain = jacoflow.flow(*frames, method="windowed")
    told = jacoflow.flow(*frames, method=jacoflow.Windowed(time_scheme="central", neighbourhood=(3, 3), window_sigma=4.0), preprocess=jacoflow.Preprocess(colour="error"), grid=jacoflow.SamplingGrid(stride=1), precision="float64", pixel_pitch=1.0)
    assert (plain.flow == told.flow)[plain.valid].all()
    assert pytest.approx(plain.covariance[16, 16]) == told.covariance[16, 16]
