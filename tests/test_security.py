"""Nothing that stands in a file is run: the code has no means to."""

import ast
from pathlib import Path

import pytest

FILES = sorted(Path("pipeline").rglob("*.py"))
UNPICKLERS = {"pickle", "cPickle", "dill", "marshal", "shelve", "joblib", "yaml"}
RUNNERS = {"eval", "exec", "compile", "__import__", "system", "popen"}


@pytest.mark.parametrize("name", ["../mine", "a/b", "/tmp/mine"])
def test_a_new_study_stays_where_studies_are(name, epsmesh, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = epsmesh("new", name)
    assert done.exit_code == 2
    assert "a name has no folders" in done.stderr
    assert not list(tmp_path.rglob("*.toml"))


def test_no_module_unpickles_evaluates_or_starts_a_shell():
    assert len(FILES) > 300
    for file in FILES:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                assert not UNPICKLERS & {alias.name.split(".")[0] for alias in node.names}, file
            if isinstance(node, ast.ImportFrom):
                assert (node.module or "").split(".")[0] not in UNPICKLERS, file
            if isinstance(node, ast.Call):
                check(node, f"{file}:{node.lineno}")


def check(call: ast.Call, where: str) -> None:
    """Assert that a call neither evaluates text, nor starts a shell, nor unpickles arrays."""
    name = call.func.id if isinstance(call.func, ast.Name) else ""
    attribute = call.func.attr if isinstance(call.func, ast.Attribute) else ""
    owner = call.func.value.id if isinstance(call.func, ast.Attribute) and isinstance(call.func.value, ast.Name) else ""
    assert name not in RUNNERS, where
    assert (owner, attribute) not in {("os", "system"), ("os", "popen")}, where
    given = {keyword.arg: keyword.value for keyword in call.keywords}
    assert not (isinstance(shell := given.get("shell"), ast.Constant) and shell.value), where
    if (owner, attribute) == ("np", "load"):
        assert isinstance(given.get("allow_pickle"), ast.Constant) and not given["allow_pickle"].value, where
