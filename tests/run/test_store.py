"""The case store: what is put is there, whole, and damage loses nothing silently."""

import sqlite3
from contextlib import closing
from math import nan

import pytest

from epsmesh.run.reading import open_to_read, read_rows
from epsmesh.run.record import Record
from epsmesh.run.store import Store, StoreError


def test_put_and_get(tmp_path):
    record = Record("k", "ok", force=1.5, force_vector=(0.0, 0.0, 1.5), provenance={"host": "here"})
    store = Store(tmp_path / "deep" / "cases.sqlite")
    store.put(record)
    store.put(Record("other", "failed", "no"))
    store.close()
    found = Store(tmp_path / "deep" / "cases.sqlite").get(["k", "unknown"])
    assert set(found) == {"k"}
    assert found["k"].force_vector == (0.0, 0.0, 1.5)
    assert found["k"].provenance == {"host": "here"}


def test_damaged_store_is_moved_aside(tmp_path):
    path = tmp_path / "cases.sqlite"
    path.write_bytes(b"this is no database, but it is somebody's file" * 100)
    store = Store(path)
    assert "damaged" in store.notice
    assert store.get(["k"]) == {}
    (aside,) = tmp_path.glob("*damaged*")
    assert aside.read_bytes().startswith(b"this is no database")


def test_damaged_stores_of_one_moment_do_not_replace_each_other(tmp_path):
    path = tmp_path / "cases.sqlite"
    for number in range(3):
        path.write_bytes(b"no database %d" % number * 100)
        Store(path).close()
    found = {name.read_bytes()[:13] for name in tmp_path.glob("*damaged*")}
    assert found == {b"no database %d" % number for number in range(3)}


def test_a_store_that_is_read_is_left_alone(tmp_path):
    path = tmp_path / "cases.sqlite"
    store = Store(path)
    store.put(Record("k", "ok", force=1.5))
    before = {file.name: (file.stat().st_mtime_ns, file.read_bytes()) for file in tmp_path.iterdir()}
    with open_to_read(path) as opened:
        assert opened.get(["k", "unknown"])["k"].force == 1.5
        store.put(Record("later", "ok", force=2.5))  # a run goes on meanwhile
        assert set(opened.get(["later"])) == {"later"}
    store.prune(older_than=0.0)
    store.close()
    assert set(before) == {file.name for file in tmp_path.iterdir()}
    path.write_bytes(b"this is no database" * 100)
    with pytest.raises(StoreError, match=r"is damaged \(.*\); `epsmesh status --prune .*` renames it"):
        open_to_read(path).__enter__()
    with pytest.raises(StoreError, match="cannot be read"):
        open_to_read(tmp_path / "absent.sqlite").__enter__()
    assert {file.name for file in tmp_path.iterdir()} == {"cases.sqlite"}


@pytest.mark.parametrize(
    "row",
    ["('k', CAST(x'ff1b0a' AS TEXT), 0)", "(x'ff', '{}', 0)", "(7, 8, 'nine')", "(CAST(x'ff' AS TEXT), x'00', x'')"],
)
def test_a_damaged_record_is_told_on_one_line_and_removed_and_costs_no_other(tmp_path, row):
    path = tmp_path / "cases.sqlite"
    store = Store(path)
    store.put(Record("sound", "ok", force=1.5))
    with closing(sqlite3.connect(path)) as database, database:
        database.execute(f"INSERT INTO records VALUES {row}")
    with open_to_read(path) as opened:
        assert opened.get(["sound"])["sound"].force == 1.5
        (problem,) = opened.problems()
        assert "cannot be read" in problem
    assert [key for key, *_ in read_rows(path)].count("sound") == 1
    assert store.prune() == 1
    assert not list(store.problems())
    assert [record.key for record in store.records()] == ["sound"]


def test_a_stored_force_that_is_no_number_is_not_relied_on(tmp_path):
    store = Store(tmp_path / "cases.sqlite")
    store.put(Record("k", "ok", force=nan))
    assert not store.get(["k"])["k"].is_ok
    assert len(list(store.problems())) == 1
    assert store.prune(failed=True) == 1


def test_locked_store_is_not_taken_for_damaged(tmp_path, monkeypatch):
    path = tmp_path / "cases.sqlite"
    Store(path).close()
    monkeypatch.setattr("epsmesh.run.store.PATIENCE", 0.05)
    other = sqlite3.connect(path, isolation_level=None)
    other.execute("BEGIN EXCLUSIVE")
    with pytest.raises(StoreError, match="locked"):
        Store(path)
    other.close()
    assert not list(tmp_path.glob("*damaged*"))


def test_prune_and_problems(tmp_path):
    store = Store(tmp_path / "cases.sqlite")
    store.put(Record("good", "ok", force=1.0))
    store.put(Record("bad", "failed", "no"))
    store.put(Record("nonsense", "ok", force=-1.0))
    store._database.execute("INSERT INTO records VALUES ('torn', '{', 0)")
    store._database.execute("INSERT INTO records SELECT 'moved', record, stored FROM records WHERE key = 'good'")
    problems = "\n".join(store.problems())
    assert len(problems.splitlines()) == 3
    assert all(word in problems for word in ("nonsense", "torn", "moved"))
    assert {record.key for record in store.records()} == {"good", "bad", "nonsense"}
    with pytest.raises(
        StoreError, match=r"record torn cannot be read; `epsmesh status --prune --yes --store .*` removes it"
    ):
        store.get(["good", "torn"])
    with pytest.raises(StoreError, match="record moved belongs to good"):
        store.get(["moved"])
    assert store.prune(failed=True) == 3
    assert {record.key for record in store.records()} == {"good", "nonsense"}
    assert store.prune(older_than=0.0) == 2
