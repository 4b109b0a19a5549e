"""The snippets of docs/python.md and README.md, and the examples of docstrings that need a run."""

import ast
import asyncio
import io
import re
import sys
import textwrap
import types
from pathlib import Path

import conftest
import numpy as np
import pytest
import tombolo
from conftest import box, ends

PAGE = Path(__file__).parents[3] / "docs/python.md"
FRONT = Path(__file__).parents[3] / "README.md"
PACKAGE = Path(tombolo.__file__).parent
LINK = "http://127.0.0.1:7070/?token=..."


def carry_out(page, link, names_at):
    """Run the snippets of a page, from the first to the last, each with the names that there are at its place."""
    text = page.read_text()
    snippets = list(re.finditer(r"^```python\n(.*?)^```", text, re.S | re.M))
    for snippet in snippets:
        line, names = text[: snippet.start()].count("\n") + 1, names_at(text[: snippet.start()])
        exec(compile("\n" * line + snippet[1].replace(LINK, link), str(page), "exec"), names)
    return len(snippets)


def test_the_tutorial_runs(begin, tmp_path, monkeypatch, capsys):
    pytest.importorskip("pyvista")
    pytest.importorskip("pandas")
    monkeypatch.chdir(tmp_path)
    # Somebody presses Enter.
    monkeypatch.setattr(sys, "stdin", io.StringIO("\n"))
    configuration = {
        "version": 1,
        "stream": {"listen": "127.0.0.1:0"},
        "pipelines": [
            {"name": "skin", "stages": [{"surface": {}}, {"stream": {}}]},
            {"name": "heat", "stages": [{"statistics": {"field": "temperature"}}]},
        ],
    }
    # The client is another program than the solver, and has none of its names.
    solver, client = {}, {}

    def names_at(before):
        return client if "\n## From outside" in before and "\n## Without a run" not in before else solver

    try:
        assert carry_out(PAGE, begin(configuration).link, names_at) > 5
    finally:
        client["run"].close() if "run" in client else None
    assert "0.8 applied" in capsys.readouterr().out
    assert isinstance(solver["shape"], tombolo.Shape)


def test_the_lines_of_the_front_page_run(begin, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(conftest, "ends", parts_of_a_channel)
    (tmp_path / "pipelines.json").write_text('{"version": 1}')
    points, tets = box(2)
    names = {"tombolo": tombolo, "points": points, "tets": tets, "temperature": np.zeros(len(points)), "steps": 3}
    names |= {"time": 0.0, "time_step": 0.1}
    try:
        assert carry_out(FRONT, begin().link, lambda before: names) == 1
    finally:
        names["run"].close() if "run" in names else None


def examples():
    """The blocks behind `::` in docstrings: those that doctest cannot run by itself."""
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    for file in sorted(PACKAGE.glob("*.py")):
        for node in ast.walk(ast.parse(file.read_text())):
            text = ast.get_docstring(node) if isinstance(node, kinds) else None
            for block in re.findall(r"::\n\n((?: {4}.*\n?|\n)+)", text or ""):
                yield pytest.param(textwrap.dedent(block), id=f"{file.stem}.{getattr(node, 'name', '')}")


def parts_of_a_channel(points, tets):
    """The ends of the box, by the names that examples have for parts of a channel."""
    parts = ends(points, tets)
    return {"throat": parts["top"], "inlet": parts["bottom"]}


EXAMPLES = list(examples())


def test_the_examples_are_found():
    assert {it.id for it in EXAMPLES} >= {
        "run.connect",
        "run.order",
        "_watched.wait_for",
        "aio.AsyncRun",
        "aio.connect",
        "jupyter.Plot",
    }


@pytest.mark.parametrize("example", EXAMPLES)
def test_an_example_runs(example, begin, monkeypatch):
    monkeypatch.setattr(conftest, "ends", parts_of_a_channel)
    difference = {"name": "flow", "of": "material.max", "minus": "material.min"}
    flow = [{"statistics": {"field": "material"}}, {"difference": difference}]
    pipelines = [{"name": "health", "stages": [{"quality": {}}]}, {"name": "outlet", "stages": flow}]
    running = begin(conftest.study.configuration(*pipelines))
    told = []

    def tell(*values):
        # Some examples go on until the run ends.
        told.append(values)
        if len(told) == 3:
            running.adaptor.stop()

    handle = types.SimpleNamespace(update=tell)
    notebook = types.SimpleNamespace(display=lambda shown, display_id: handle)
    monkeypatch.setitem(sys.modules, "IPython.display", notebook)
    with tombolo.connect(running.link) as run:
        run.wait_for(lambda: run.features, 30)
        names = {"run": run, "tombolo": tombolo, "np": np, "print": tell}
        names["edits"] = [{"translate": {"features": ["throat"], "fixed": ["inlet"], "by": [0, 0, 0.1]}}]
        if LINK in example:
            # Whoever connects first has the wheel.
            run.close()
        exec(compile(example.replace(LINK, running.link), "example", "exec"), names)
        for name, given in (("squeeze", [run]), ("watch", [])):
            if name in names:
                asyncio.run(asyncio.wait_for(names[name](*given), 60))
