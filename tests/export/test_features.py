"""The table of features that end in a real-time model is that of the code."""

from tests.pairs import FEATURES, write_bodies
from tests.realtime_features import TABLE, find, table


def test_the_table_is_what_the_export_decides(tmp_path):
    write_bodies(tmp_path)
    found = find(tmp_path)
    assert {one.feature for one in found} == {feature.name for feature in FEATURES}
    assert all(one.tools or one.reason for one in found)
    told = "the table is an earlier one: run `python -m tests.realtime_features`"
    assert table(found) == TABLE.read_text(encoding="utf-8"), told
