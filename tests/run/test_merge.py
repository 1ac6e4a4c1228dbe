"""Merged stores: nothing is lost, a force beats a failure, and neither order nor repetition matters."""

import itertools
import shutil
import sqlite3

import pytest

from epsmesh.run.begun import Begun
from epsmesh.run.merge import merge
from epsmesh.run.reading import read_rows
from epsmesh.run.record import Record
from epsmesh.run.store import Store, StoreError


def store_of(path, *rows):
    """Make a store of (record, time at which it was stored)."""
    store = Store(path)
    store.put_rows([(record.key, record.to_json(), stored) for record, stored in rows])
    store.close()
    return path


def merged(path, *sources):
    store = Store(path)
    found = merge(sources, store)
    rows = store.rows()
    store.close()
    return found, rows


@pytest.fixture
def sources(tmp_path):
    return [
        store_of(
            tmp_path / "one.sqlite",
            (Record("both", "ok", force=1.0), 10.0),
            (Record("mended", "failed", "no memory"), 30.0),
            (Record("failed", "failed", "old"), 1.0),
            (Record("one", "ok", force=1.0), 5.0),
        ),
        store_of(
            tmp_path / "two.sqlite",
            (Record("both", "ok", force=2.0), 20.0),
            (Record("mended", "ok", force=3.0), 20.0),
            (Record("failed", "failed", "new"), 2.0),
        ),
        store_of(tmp_path / "three.sqlite", (Record("both", "ok", force=4.0), 20.0), (Record("three", "ok"), 1.0)),
    ]


def test_order_and_repetition_make_no_difference(tmp_path, sources):
    results = []
    for number, order in enumerate(itertools.permutations(sources)):
        path = tmp_path / f"main{number}.sqlite"
        found, rows = merged(path, *order)
        assert sum(source.taken for source in found) >= len(rows)
        again, same = merged(path, *order, *sources)
        assert same == rows
        assert not any(source.taken for source in again)
        results.append(rows)
    assert all(rows == results[0] for rows in results)
    kept = {key: (Record.from_json(text), stored) for key, text, stored in results[0]}
    assert set(kept) == {"both", "mended", "failed", "one", "three"}
    assert kept["mended"][0].force == 3.0
    assert kept["failed"][0].message == "new"
    assert kept["both"][0].force in (2.0, 4.0)
    assert kept["one"][1] == 5.0


def test_what_the_main_store_knows_stays(tmp_path, sources):
    main = store_of(tmp_path / "main.sqlite", (Record("failed", "ok", force=9.0), 0.0), (Record("own", "ok"), 0.0))
    _, rows = merged(main, *sources)
    kept = {key: Record.from_json(text) for key, text, _ in rows}
    assert kept["failed"].force == 9.0
    assert "own" in kept


def test_damaged_store_is_named_and_left_as_it_is(tmp_path, sources):
    damaged = tmp_path / "damaged.sqlite"
    damaged.write_bytes(b"this is no database" * 100)
    torn = tmp_path / "torn.sqlite"
    torn.write_bytes(sources[0].read_bytes()[:6000])
    before = {path: path.read_bytes() for path in (damaged, torn)}
    found, rows = merged(tmp_path / "main.sqlite", damaged, sources[0], torn)
    assert [bool(source.problems) for source in found] == [True, False, True]
    assert "damaged.sqlite: damaged" in found[0].problems[0]
    assert len(rows) == 4
    assert {path: path.read_bytes() for path in before} == before


def test_what_is_wrong_with_many_pages_of_a_store_is_told_on_one_line(tmp_path, sources):
    file = sources[0]
    data = bytearray(file.read_bytes())
    data[4096 + 3] ^= 1  # of the second page: 256 records more than there are
    file.write_bytes(data)
    (found,), _ = merged(tmp_path / "main.sqlite", file)
    (told,) = found.problems
    assert "damaged, left out" in told
    assert "\n" not in told
    assert len(told) < 500


def test_records_that_cannot_be_read_are_left_out(tmp_path, sources):
    database = sqlite3.connect(sources[0])
    database.execute("INSERT INTO records VALUES ('torn', '{', 0), ('nothing', 'null', 0)")
    database.execute("INSERT INTO records SELECT 'moved', record, stored FROM records WHERE key = 'one'")
    database.commit()
    database.close()
    (found,), rows = merged(tmp_path / "main.sqlite", sources[0])
    assert "3 of 7 records" in found.problems[0]
    assert {key for key, _, _ in rows} == {"both", "mended", "failed", "one"}


def test_store_of_a_run_killed_while_it_wrote(tmp_path, sources):
    """The file holds half of a change, the journal what was there before."""
    before = read_rows(sources[0])
    database = sqlite3.connect(sources[0], isolation_level=None)
    database.execute("PRAGMA cache_size = 1")
    database.execute("BEGIN")
    database.executemany("INSERT INTO records VALUES (?, ?, 0)", [(f"half {i}", "x" * 500) for i in range(200)])
    killed = tmp_path / "killed.sqlite"
    for suffix in ("", "-journal"):
        shutil.copy(f"{sources[0]}{suffix}", f"{killed}{suffix}")
    database.close()
    assert killed.read_bytes() != sources[0].read_bytes()
    assert read_rows(killed) == before


def test_store_that_is_begun_only(tmp_path):
    (tmp_path / "empty.sqlite").touch()
    assert read_rows(tmp_path / "empty.sqlite") == []
    with pytest.raises(StoreError):
        read_rows(tmp_path / "absent.sqlite")


def test_all_or_nothing(tmp_path, sources, monkeypatch):
    monkeypatch.setattr("epsmesh.run.store.PATIENCE", 0.05)
    main = store_of(tmp_path / "main.sqlite", (Record("own", "ok"), 0.0))
    store = Store(main)
    other = sqlite3.connect(main, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    with pytest.raises(StoreError, match="locked"):
        merge(sources, store)
    other.execute("ROLLBACK")
    with pytest.raises(KeyboardInterrupt), store.transaction():
        store.put_rows([("half", "{}", 0.0)])
        raise KeyboardInterrupt
    assert [key for key, _, _ in store.rows()] == ["own"]
    store.close()


def test_what_a_killed_process_has_left_beside_a_store_is_merged_once(tmp_path, sources):
    begun = Begun(sources[0])
    begun.done(Record("left", "ok", force=4.0))
    begun.done(Record("both", "ok", force=1.0))
    for repeated in range(2):
        found, rows = merged(tmp_path / "whole.sqlite", sources[0])
        assert (found[0].records, found[0].taken) == (5, 0 if repeated else 5)
        assert "left" in {row[0] for row in rows}
