"""What an accuracy gives: scenes are those of the tool, and errors are below the bars."""

from benchmarks import asked


def test_an_accuracy_of_a_ball_gives_a_bar_below_it_and_an_error_below_the_bar(tmp_path, monkeypatch):
    """Bars are those of 95 %: of twenty errors, one may exceed its bar."""
    monkeypatch.setattr(asked, "ASKED", (1e-2,))
    assert asked.main(["--tools", "ball", "--count", "20", "--output", str(tmp_path)]) == 0
    _, _, *rows = [line for line in (tmp_path / "asked.md").read_text().splitlines() if line.startswith("|")]
    assert [row.split(" | ")[1] for row in rows] == ["20", "20"]  # the tool, and the accuracy
    assert all(row.split(" | ")[5] == "20" for row in rows)  # each bar is below the accuracy


def test_scenes_are_those_of_the_tool():
    for tool in asked.TOOLS.values():
        (scene,) = asked._scenes(tool, 1, asked.np.random.default_rng(1))
        assert scene["probe"]["shape"] == tool.shape
        assert tool.picks(scene)
