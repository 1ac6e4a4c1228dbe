"""Results are made again if what they show, or what made them, has changed, and only then."""

from dataclasses import replace
from pathlib import Path

import pytest

from epsmesh.plan.plan import leave_out_stored
from epsmesh.report import made
from epsmesh.report.publish import publish
from tests.report.synthetic import planned

RUN = {"start": "2026-01-01", "end": "2026-01-01"}


def test_what_a_run_left_is_made_again_only_where_it_was_lost_or_changed(tmp_path):
    plan, records = planned(mesh={"epsilon": ["6 mm", "full"]})
    first = publish(plan, records, RUN, tmp_path)
    assert first.unchanged == ()
    before = [file.read_bytes() for file in first.files]
    stored = leave_out_stored(plan, records)
    again = publish(stored, records, RUN | {"start": "2027-01-01"}, tmp_path)
    assert (again.written, again.unchanged) == ((), first.files)
    assert [file.read_bytes() for file in first.files] == before
    first.files[1].unlink()
    assert publish(stored, records, RUN, tmp_path).written == first.files
    assert first.files[1].read_bytes() == before[1]
    inputs = made.inputs_of(plan, records)
    for file, content in zip(first.files, map(Path.read_bytes, first.files), strict=True):
        file.write_bytes(content[:-1])
        assert made.made_from(inputs, first.files[0]) == ()
        file.write_bytes(content)
        assert made.made_from(inputs, first.files[0]) == first.files


@pytest.mark.parametrize("noted", ["", "[]", "{", "7", '{"inputs": 1}', '{"inputs": "same", "../small.nc": ""}'])
def test_a_damaged_note_tells_nothing(noted, tmp_path):
    files = (tmp_path / "small.nc",)
    files[0].write_bytes(b"numbers")
    made.note_made(files, "same")
    assert made.made_from("same", files[0]) == files
    (note,) = tmp_path.glob(".*")
    note.write_text(noted)
    assert made.made_from("same", files[0]) == ()


def test_another_record_study_or_reduction_makes_other_results():
    plan, records = planned()
    (key, record), *_ = records.items()
    other = replace(plan.study, text=f"{plan.study.text}\n# of tissue at rest")
    found = {
        made.inputs_of(*one)
        for one in (
            (plan, records),
            (plan, records | {key: replace(record, force=2 * record.force)}),
            (plan, records | {key: replace(record, provenance={"host": "there", "ranks": 1})}),
            (plan, {}),
            (replace(plan, study=other), records),
            (replace(plan, study=replace(plan.study, warnings=("too thin",))), records),
            (plan.skipping("mirrored", 1, "the same"), records),
        )
    }
    assert len(found) == 7


def test_the_code_is_part_of_what_results_are_made_from(tmp_path):
    module = tmp_path / "figures" / "style.py"
    module.parent.mkdir()
    found = []
    for text in ("WIDTH = 1", "WIDTH = 2"):
        module.write_text(text)
        made.code_in.cache_clear()
        found.append(made.code_in(tmp_path))
    assert found[0] != found[1]
