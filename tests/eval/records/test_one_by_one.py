"""Test records that are held one at a time, and put aside on the disk."""

import errno
from typing import Any

import pytest

from ehar.errors import UsageError
from eval.records.one_by_one import OneByOne, put_aside


def test_only_the_last_value_is_kept() -> None:
    made: list[str] = []

    def make(name: str) -> str:
        made.append(name)
        return name.upper()

    one_by_one = OneByOne(["a", "b"], make)
    assert dict(one_by_one) == {"a": "A", "b": "B"}
    assert one_by_one["b"] + one_by_one["b"] + one_by_one["a"] == "BBA"
    assert made == ["a", "b", "a"]
    with pytest.raises(KeyError):
        one_by_one["c"]


def test_a_full_disk_where_values_are_put_aside_ends_in_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any, **__: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    held = put_aside(str.upper)
    assert held("a") + held("a") + held("b") == "AAB"
    monkeypatch.setattr("eval.records.one_by_one.pickle.dump", full)
    with pytest.raises(UsageError, match=r": cannot be written: No space left on device$"):
        held("c")
