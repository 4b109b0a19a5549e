"""The snippets of docs/python.md, from the first to the last."""

import re
from pathlib import Path

import pytest
import tombolo

PAGE = Path(__file__).parents[3] / "docs/python.md"


def test_the_tutorial_runs(begin, tmp_path, monkeypatch, capsys):
    pytest.importorskip("pyvista")
    pytest.importorskip("pandas")
    monkeypatch.chdir(tmp_path)
    configuration = {
        "version": 1,
        "stream": {"listen": "127.0.0.1:0"},
        "pipelines": [
            {"name": "skin", "stages": [{"surface": {}}, {"stream": {}}]},
            {"name": "heat", "stages": [{"statistics": {"field": "temperature"}}]},
        ],
    }
    names = {"link": begin(configuration).link}
    try:
        text = PAGE.read_text()
        snippets = list(re.finditer(r"^```python\n(.*?)^```", text, re.S | re.M))
        assert len(snippets) > 5
        for snippet in snippets:
            line = text[: snippet.start()].count("\n") + 1
            exec(compile("\n" * line + snippet[1], str(PAGE), "exec"), names)
    finally:
        names["run"].close() if "run" in names else None
    assert "0.8 applied" in capsys.readouterr().out
    assert isinstance(names["shape"], tombolo.Shape)
