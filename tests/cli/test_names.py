"""Studies are found by the names that `epsmesh new` took; files of another kind are told with what they are for."""

import pytest


@pytest.mark.parametrize("words", [("plan",), ("status",)])
def test_a_study_is_found_by_its_name(epsmesh, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    assert epsmesh("new", "mine").exit_code == 0
    by_path, by_name = (epsmesh(*words, file) for file in ("studies/mine.toml", "mine"))
    assert (by_name.exit_code, by_name.stdout) == (0, by_path.stdout)
    asked = epsmesh("guide", "mine", "--accuracy", "5%")
    assert "make it with `epsmesh run studies/mine.toml`" in asked.stderr


def test_a_file_of_that_name_comes_first(epsmesh, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert epsmesh("new", "mine").exit_code == 0
    (tmp_path / "mine").write_text("title = 1")
    assert epsmesh("plan", "mine").exit_code == 2


@pytest.mark.parametrize("word", ["mine", "studies/mine.toml"])
def test_the_model_of_a_study_is_found_by_the_study(epsmesh, tmp_path, monkeypatch, word):
    monkeypatch.chdir(tmp_path)
    assert epsmesh("new", "mine").exit_code == 0
    without = epsmesh("touch", word)
    assert "`epsmesh export studies/mine.toml` makes one" in without.stderr
    (tmp_path / "results").mkdir(exist_ok=True)
    (tmp_path / "results" / "mine.epsm").write_bytes(b"cut short")
    assert epsmesh("touch", word).stderr.startswith("results/mine.epsm: ")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("run", "known.nc"), "a dataset is for `report` and `guide`, a model for `touch`"),
        (("plan", "small.toml", "0", "1"), "put the labels of a case into one pair of quotes"),
        (("touch", "small.toml"), "a model ends in .epsm: `epsmesh export small.toml` makes one"),
        (("touch", "known.nc"), "a model ends in .epsm: `epsmesh export known.toml` makes one"),
    ],
)
def test_a_file_of_another_kind_is_told_with_what_it_is_for(epsmesh, small, tmp_path, monkeypatch, words, told):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "known.nc").write_bytes(b"\x89HDF\r\n")
    done = epsmesh(*words)
    assert done.exit_code == 2
    assert told in done.stderr
