"""A user's own planners: from a file, a module, or an entry point of an installed package."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING, Any

from ehar.errors import UsageError
from ehar.planner import Planner
from ehar.plugins.class_spec import ClassSpec, arguments_text, parse_spec
from ehar.plugins.constructor import construct, parameters_of
from ehar.plugins.loading import failure, load_class, source_sha256

if TYPE_CHECKING:
    from planners.value.model import GainModel

GROUP = "ehar.planners"  # the group of entry points; their names are the planners' names
_GAIN_MODEL = "planners.value.model.GainModel"


@dataclass(frozen=True)
class Origin:
    """The origin of a user's own planner; recorded beside results.

    Args:
        place: the name that was asked for, without arguments.
        arguments: the arguments of its constructor, converted.
    """

    place: str
    arguments: dict[str, Any] = field(default_factory=dict)


@cache
def entry_point_names() -> tuple[str, ...]:
    """Return the names of the planners that installed packages bring."""
    return tuple(sorted({point.name for point in entry_points(group=GROUP)}))


def own_spec(text: str) -> ClassSpec | None:
    """Return the spec of the user's own planner that a text names; None if it cannot name one.

    Raises:
        UsageError: the text in brackets is not a list of arguments.
    """
    spec = parse_spec(text)
    return spec if spec is not None and (spec.place or spec.name in entry_point_names()) else None


def load_own_class(spec: ClassSpec) -> type[Any]:
    """Return the class of a spec; this runs the file of the class.

    Args:
        spec: a result of `own_spec`.

    Raises:
        UsageError: the class cannot be loaded.
    """
    return load_class(spec, "planner") if spec.place else _installed(spec.name)


def make_own_planner(spec: ClassSpec, load_model: "Callable[[], GainModel] | None" = None) -> tuple[Planner, Origin]:
    """Make a user's own planner; return it and its origin.

    The name of a planner that is made with arguments includes them, `spiral(radius=5)`, unless `name` is one of them.
    So two settings of one class can run side by side. A planner from an entry point has the name of the entry point.

    Args:
        spec: a result of `own_spec`.
        load_model: loads the trained gain model, for a constructor with an argument annotated `GainModel`.

    Raises:
        UsageError: the planner cannot be loaded or made, or the object is not a planner.
        ModelError: `load_model` raises it.
    """
    cls = load_own_class(spec)
    what = f"planner {spec.title}"
    missing = [part for part in ("reset", "act") if not callable(getattr(cls, part, None))]
    if missing or getattr(cls, "act", None) is Planner.act:
        raise UsageError(_no_planner(what, missing or ["act"]))
    handed: dict[str, Any] = {}
    for argument, parameter in parameters_of(cls, what).items():
        if _qualified(parameter.annotation) == _GAIN_MODEL and argument not in spec.arguments:
            if load_model is None:
                raise UsageError(f"{what}: expected a gain model for its argument {argument!r}, got none")
            handed[argument] = load_model()
    planner, given = construct(cls, spec, what, handed)
    name: Any = _part(planner, "name", what) if spec.place else spec.name
    if given and "name" not in given:
        name = f"{name}({arguments_text(given)})"
    check_planner_contract(planner, what, name=name)
    if planner.name != name:
        try:
            planner.name = name
        except AttributeError as error:
            raise UsageError(f"{what}: expected a name that can be set to {name!r}: {failure(error)}") from error
    return planner, Origin(spec.title, given)


def check_planner_contract(planner: Any, what: str, *, name: Any = None) -> None:
    """Raise a UsageError unless an object has all parts of `ehar.planner.Planner`.

    Args:
        planner: the object to check.
        what: its name in errors.
        name: the name that it will get; None if it keeps its own.
    """
    if isinstance(planner, type):
        raise UsageError(
            f"{what}: expected a planner, got the class {planner.__name__}; make one: {planner.__name__}()"
        )
    missing = [part for part in ("name", "privileged", "reset", "act") if _part(planner, part, what) is None]
    if missing:
        raise UsageError(_no_planner(what, missing))
    name = planner.name if name is None else name
    if not isinstance(name, str) or not name.strip() or not name.isprintable():
        raise UsageError(f"{what}: name: expected a line of text, got {name!r}")


def _part(planner: Any, part: str, what: str) -> Any:
    """Return a part of a planner, which a property may compute; None if it has no such part.

    Raises:
        UsageError: the property raised an error; it is named with its file and line.
    """
    try:
        return getattr(planner, part, None)
    except Exception as error:
        raise UsageError(f"{what}: {part}: {failure(error, type(planner))}") from error


def origin_of(planner: Planner) -> Origin | None:
    """Return the origin of a planner object; None for a planner of ehar."""
    cls = type(planner)
    return None if cls.__module__.partition(".")[0] == "planners" else Origin(f"{cls.__module__}.{cls.__qualname__}")


def planner_source_sha256(planner: Planner) -> str | None:
    """Return the hash of the file of a planner's class, as `source_sha256` does; None where there is no file."""
    return source_sha256(type(planner))


def _no_planner(what: str, missing: list[str]) -> str:
    advice = "" if missing == ["act"] else "; a class that derives from ehar.Planner has all but act"
    return f"{what}: expected what ehar.planner.Planner has, missing: {', '.join(missing)}{advice}"


def _qualified(annotation: Any) -> str:
    return f"{getattr(annotation, '__module__', '')}.{getattr(annotation, '__qualname__', '')}"


def _installed(name: str) -> type[Any]:
    """Load the class that an installed package brings under a name."""
    points = entry_points(group=GROUP, name=name)
    brought = {point.value: point for point in points}
    if len(brought) > 1:
        raise UsageError(f"planner {name!r}: expected one package to bring it, got {', '.join(map(_package, points))}")
    point = next(iter(brought.values()))
    module, _, attribute = point.value.partition(":")
    return load_class(ClassSpec(module.strip(), attribute.strip()), f"planner {name!r} of {_package(point)}:")


def _package(point: EntryPoint) -> str:
    return f"{point.value} of {point.dist.name}" if point.dist is not None else point.value
