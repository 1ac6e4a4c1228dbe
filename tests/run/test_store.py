"""The case store: what is put is there, whole, and damage loses nothing silently."""

import sqlite3

import pytest

from pipeline.run.record import Record
from pipeline.run.store import Store, StoreError


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


def test_locked_store_is_not_taken_for_damaged(tmp_path, monkeypatch):
    path = tmp_path / "cases.sqlite"
    Store(path).close()
    monkeypatch.setattr("pipeline.run.store.PATIENCE", 0.05)
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
    assert store.prune(failed=True) == 2
    assert {record.key for record in store.records()} == {"good", "nonsense"}
    assert store.prune(older_than=0.0) == 3
