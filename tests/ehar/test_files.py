"""Files: written whole or not at all; JSON read into data classes, with one line about what is wrong."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
from annotated_types import Ge

from ehar.errors import DataError, ModelError, UsageError
from ehar.files import as_json, parse_json, read_json, replacing, write_bytes


def test_a_file_is_written_whole(tmp_path: Path) -> None:
    path = tmp_path / "new" / "file.bin"
    write_bytes(path, b"first")
    write_bytes(path, b"second")
    assert path.read_bytes() == b"second"
    assert list(path.parent.iterdir()) == [path]


def test_what_fails_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "file.txt"
    path.write_text("before")
    with pytest.raises(ZeroDivisionError), replacing(path) as temporary:
        temporary.write_text("half")
        _ = 1 / 0
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match=r"file/new\.txt: cannot be written: .*(directory|exists)"):
        write_bytes(tmp_path / "file" / "new.txt", b"")


@dataclass(frozen=True)
class Wheel:
    size: float
    spokes: Annotated[int, Ge(3)] = 20


@dataclass(frozen=True, kw_only=True)
class Bicycle:
    name: str
    wheels: tuple[Wheel, ...]
    gears: tuple[int, int]
    kind: Literal["road", "city"]
    weight: float | None
    spare: Wheel | None = None
    bell: bool = False
    parts: Mapping[str, Wheel] = field(default_factory=dict)
    price: int | str = 0
    notes: Any = None

    def __post_init__(self) -> None:
        if self.name == "":
            raise ValueError("name: expected one\nat least")
        if self.name == "unicycle":
            raise ModelError("bicycle: expected two wheels")


BICYCLE: dict[str, Any] = {
    "name": "mine",
    "wheels": [{"size": 28, "spokes": 32}, {"size": 27.5, "spokes": 3}],
    "gears": [2, 9],
    "kind": "road",
    "weight": None,
    "spare": None,
    "bell": True,
    "parts": {"front": {"size": 28.0, "spokes": 20}},
    "price": "much",
    "notes": {"of": ["any", 1, None]},
}


def read(folder: Path, content: Any, **options: Any) -> Bicycle:
    path = folder / "bicycle.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return read_json(path, Bicycle, "a bicycle", **options)


def test_a_data_class_is_read(tmp_path: Path) -> None:
    bicycle = read(tmp_path, BICYCLE)
    assert bicycle == Bicycle(
        name="mine",
        wheels=(Wheel(28, 32), Wheel(27.5, 3)),
        gears=(2, 9),
        kind="road",
        weight=None,
        bell=True,
        parts={"front": Wheel(28)},
        price="much",
        notes={"of": ["any", 1, None]},
    )
    assert type(bicycle.wheels[0].size) is float  # where the file writes a whole number
    assert as_json(asdict(bicycle)) == BICYCLE


def without(*keys: str) -> dict[str, Any]:
    return {key: value for key, value in BICYCLE.items() if key not in keys}


KEYS = "name, wheels, gears, kind, weight, spare, bell, parts, price, notes"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (BICYCLE | {"name": 3}, "name: expected text, got 3"),
        (BICYCLE | {"weight": "9"}, "weight: expected a number, got '9'"),
        (BICYCLE | {"weight": True}, "weight: expected a number, got true"),
        (BICYCLE | {"weight": float("nan")}, "weight: expected a finite number, got nan"),
        (
            json.dumps(BICYCLE).replace('"weight": null', '"weight": -1e999'),
            "weight: expected a finite number, got -inf",
        ),
        (BICYCLE | {"bell": 1}, "bell: expected true or false, got 1"),
        (BICYCLE | {"bell": None}, "bell: expected true or false, got null"),
        (BICYCLE | {"kind": "race"}, "kind: expected 'road' or 'city', got 'race'"),
        (BICYCLE | {"gears": [2, 9.0]}, "gears[1]: expected a whole number, got 9.0"),
        (BICYCLE | {"gears": [2, 9.5]}, "gears[1]: expected a whole number, got 9.5"),
        (BICYCLE | {"gears": [2]}, "gears: expected 2 items, got [2]"),
        (BICYCLE | {"gears": [2, 9, 1]}, "gears: expected at most 2 items, got [2, 9, 1]"),
        (BICYCLE | {"gears": "29"}, "gears: expected a list, got '29'"),
        (BICYCLE | {"spare": 3}, "spare: expected an object, got 3"),
        (BICYCLE | {"parts": []}, "parts: expected an object, got []"),
        (BICYCLE | {"price": [1]}, "price: expected a whole number or text, got [1]"),
        (BICYCLE | {"wheels": [{"size": 28, "spokes": 2}]}, "wheels[0].spokes: expected at least 3, got 2"),
        (BICYCLE | {"wheels": [{"size": 28}]}, "wheels[0]: missing spokes; expected size, spokes"),
        (BICYCLE | {"spare": {"spokes": 9}}, "spare: missing size; expected size, spokes"),
        (
            BICYCLE | {"parts": {"a\nb": {"size": 1, "spoke": 9}}},
            "parts.'a\\nb': unknown spoke; expected size, spokes",
        ),
        (without("gears", "weight"), f"missing gears, weight; expected {KEYS}"),
        (without("bell", "notes"), f"missing bell, notes; expected {KEYS}"),
        (without("kind") | {"sort": 1, "a\nb": 2}, f"missing kind, unknown 'a\\nb', sort; expected {KEYS}"),
        (BICYCLE | {"name": ""}, "name: expected one"),
        (BICYCLE | {"name": "unicycle"}, "bicycle: expected two wheels"),
        (BICYCLE | {"weight": "x" * 1000 + "\n"}, f"weight: expected a number, got '{'x' * 79}..."),
        ([1, 2], "expected the JSON object of a bicycle, got [1, 2]"),
        ("null", "expected the JSON object of a bicycle, got null"),
        ("", "expected the JSON of a bicycle, got EOF while parsing a value at line 1 column 0"),
        ("{", "expected the JSON of a bicycle, got EOF while parsing an object at line 1 column 1"),
        ("{'name': 1}", "expected the JSON of a bicycle, got key must be a string at line 1 column 2"),
    ],
)
def test_what_is_wrong_is_named_in_one_line(tmp_path: Path, content: Any, message: str) -> None:
    with pytest.raises(DataError) as error:
        read(tmp_path, content)
    assert str(error.value) == f"{tmp_path / 'bicycle.json'}: {message}"


def test_a_mark_of_the_byte_order_is_no_content(tmp_path: Path) -> None:
    path = tmp_path / "wheel.json"
    path.write_text('{"size": 2, "spokes": 12}', encoding="utf-8-sig")
    assert read_json(path, Wheel, "a wheel") == Wheel(2.0, 12)


def test_unknown_keys_and_defaults_are_taken_where_the_caller_says_so(tmp_path: Path) -> None:
    content = without("bell", "notes", "price") | {"wheels": [{"size": 28}], "colour": "red"}
    bicycle = read(tmp_path, content, unknown=True, defaults=True)
    assert (bicycle.bell, bicycle.price, bicycle.wheels) == (False, 0, (Wheel(28),))
    with pytest.raises(DataError, match="unknown colour; expected name, "):
        read(tmp_path, content, defaults=True)
    with pytest.raises(DataError, match="missing bell, price, notes; expected name, "):
        read(tmp_path, content, unknown=True)
    with pytest.raises(DataError, match="missing name; expected name, "):
        read(tmp_path, without("name"), defaults=True)


def test_the_caller_says_which_error_wrong_content_is(tmp_path: Path) -> None:
    for content in ("{", "[]", without("name"), without("bell"), BICYCLE | {"name": 1}, BICYCLE | {"name": "unicycle"}):
        with pytest.raises(ModelError, match=r"bicycle\.json: "):
            read(tmp_path, content, wrong=ModelError)


def test_what_is_no_text_and_what_cannot_be_opened(tmp_path: Path) -> None:
    path = tmp_path / "bicycle.json"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DataError, match=r"bicycle\.json: expected the JSON of a bicycle, got 'utf-8' codec"):
        read_json(path, Bicycle, "a bicycle")
    with pytest.raises(UsageError, match=r"absent\.json: expected a bicycle, got: No such file or directory"):
        read_json(tmp_path / "absent.json", Bicycle, "a bicycle")
    with pytest.raises(UsageError, match=r": expected a bicycle, got: Is a directory"):
        read_json(tmp_path, Bicycle, "a bicycle")


def test_text_is_read_as_a_file_is() -> None:
    assert parse_json('{"size": 1, "spokes": 3}', Wheel, "line 3", "a wheel") == Wheel(1, 3)
    with pytest.raises(DataError, match="line 3: size: expected a number, got null"):
        parse_json('{"size": null, "spokes": 3}', Wheel, "line 3", "a wheel")
