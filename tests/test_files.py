"""Files appear whole or not at all."""

import os

import pytest

from pipeline.files import atomic, write_new


@pytest.mark.parametrize("name", ["a.nc", "a.b.svg", "plain"])
def test_a_file_is_whole_or_as_it_was(tmp_path, name):
    path = tmp_path / "deep" / name
    for text in ("first", "second"):
        with atomic(path) as temporary:
            temporary.write_text(text)
            assert temporary.suffix == path.suffix
            assert temporary.parent == path.parent
            assert path.exists() == (text == "second")
        assert path.read_text() == text
    with pytest.raises(ValueError, match="torn"), atomic(path) as temporary:
        temporary.write_text("half")
        raise ValueError("torn")
    assert path.read_text() == "second"
    assert [file.name for file in path.parent.iterdir()] == [name]


def test_two_who_write_at_once_write_two_files(tmp_path):
    """On two machines, too, where both may be the process of one number."""
    with atomic(tmp_path / "a") as mine, atomic(tmp_path / "a") as yours:
        mine.write_text("mine")
        yours.write_text("yours")
    assert (tmp_path / "a").read_text() == "mine"
    assert [file.name for file in tmp_path.iterdir()] == ["a"]


def test_it_is_on_disk_before_it_takes_the_place_of_another(tmp_path, monkeypatch):
    done = []
    for name in ("fsync", "replace"):
        call = getattr(os, name)
        monkeypatch.setattr(os, name, lambda *args, name=name, call=call: (done.append(name), call(*args))[1])
    with atomic(tmp_path / "a") as temporary:
        temporary.write_text("text")
    assert done == ["fsync", "replace"]


def test_what_was_not_written_replaces_nothing(tmp_path):
    (tmp_path / "a").write_text("kept")
    with pytest.raises(FileNotFoundError), atomic(tmp_path / "a"):
        pass
    assert (tmp_path / "a").read_text() == "kept"


def test_a_new_file_leaves_an_existing_one_alone(tmp_path):
    write_new(tmp_path / "deep" / "a.toml", "first")
    with pytest.raises(FileExistsError):
        write_new(tmp_path / "deep" / "a.toml", "second")
    assert {file.name: file.read_text() for file in (tmp_path / "deep").iterdir()} == {"a.toml": "first"}
