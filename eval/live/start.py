"""`ehar live`: frames from somewhere, setpoints to somewhere, or a rehearsal of both."""

import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from ehar.conditions import Conditions
from ehar.errors import UsageError
from ehar.flight.vehicle import load_vehicle
from ehar.planner import Planner
from eval.live import rehearsal
from eval.live.figures import LoopFigures
from eval.live.loop import Loop, Said
from eval.live.mavlink import Mavlink
from eval.live.messages import Vector
from eval.live.page import Page
from eval.live.transports import Outbox, lines_of
from eval.live.watcher import Watcher
from recognition.torch_threads import one_torch_thread

STANDARD_INPUT, HERE, MINUTES, LOSS = "-", (0.0, 0.0, 0.0), 1.0, 0.05  # defaults


def live(
    *,
    models: str | Path | None = None,
    vehicle: str = "px4-auto",
    planner: str | Planner = "h-rotate",
    source: str = STANDARD_INPUT,
    sensor: str = "estimator",
    views: str = "moving",
    belief: Path | None = None,
    sure: float = 0.9,
    mavlink: str | None = None,
    origin: Vector = HERE,
    page: int | None = None,
    rehearse: str | None = None,
    minutes: float = MINUTES,
    loss: float = LOSS,
    world: str | None = None,
) -> LoopFigures | rehearsal.Rehearsal:
    """Watch people through a pose estimator, and say where the camera should fly, until there are no more frames.

    Args:
        models: folder of weights that were trained on streams; only a rehearsal of a built-in set does without.
        vehicle: px4-auto, px4-max, tracking-drone, ground-robot, or a vehicle file (.json).
        planner: name of the planner, or your own: file.py:Class.
        source: - for standard input, a file, or udp:HOST:PORT.
        sensor: sensor that the weights were trained through.
        views: views that the weights were trained on: moving or paper.
        belief: JSON of the belief, as study belief writes it.
        sure: least probability of an activity that is named.
        mavlink: send setpoints there too, such as udpout:127.0.0.1:14540.
        origin: where people are in the vehicle's local frame, if frames do not say it: east, north, up [m].
        page: port on 127.0.0.1 of a page to look at.
        rehearse: play these streams in real time instead, through the sensor: an .npz, or a built-in set.
        minutes: how long to rehearse.
        loss: share of frames that a rehearsal loses, and that come late, in every second stream.
        world: a world .json whose localisation is that of the place; else as the weights' world.

    Raises:
        EharError: something is missing or malformed, or does not fit.
    """
    if not np.isfinite(origin).all():
        raise UsageError(f"origin: expected three finite numbers, got {' '.join(map(str, origin))}")
    _check_used(rehearse, mavlink, source=source, minutes=minutes, loss=loss, origin=origin)
    flown = load_vehicle(vehicle)
    with ExitStack() as stack:
        stack.enter_context(one_torch_thread())

        def outputs(watcher: Watcher) -> Sequence[Callable[[Said], None]]:
            """Return what takes what goes out, besides lines."""
            found: list[Callable[[Said], None]] = []
            if mavlink is not None:
                link = Mavlink(mavlink, origin=origin)
                stack.callback(link.close)
                found.append(link.send)
            if page is not None:
                spec = watcher.recogniser.spec
                shown = Page(page, class_names=spec.class_names, skeleton=spec.skeleton, world=spec.world)
                stack.callback(shown.close)
                _note(f"page: {shown.address}")
                found.append(lambda said: shown.show(said, time.monotonic()))
            return found

        if rehearse is not None:
            return rehearsal.rehearse(
                Conditions(data=rehearse, models=models, sensor=sensor, views=views, track=flown),
                planner=planner,
                belief=belief,
                sure=sure,
                minutes=minutes,
                loss=loss,
                world=world,
                outputs=lambda watcher: [lambda said: _discard(said.line()), *outputs(watcher)],
                note=_note,
            )
        if models is None:
            raise UsageError("--models: expected a folder of weights, got none; a built-in set is rehearsed without")
        watcher = Watcher(
            models=models,
            vehicle=flown,
            planner=planner,
            sensor=sensor,
            views=views,
            belief=belief,
            sure=sure,
            world=world,
            origin=origin,
        )
        if watcher.note is not None:
            _note(f"warning: {watcher.note}")
        box = Outbox(sys.stdout)
        stack.callback(box.close)
        # The autopilot first: a line on standard output can wait.
        loop = Loop(watcher, [*outputs(watcher), lambda said: box.put(said.line())])
        box.when_broken = loop.end
        return loop.run(lines_of(source, loop.going))


def _discard(line: str) -> None:
    """Take a line that nobody reads: a rehearsal makes lines as the loop does, so that it takes as long."""


def _note(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _check_used(
    rehearse: str | None, mavlink: str | None, *, source: str, minutes: float, loss: float, origin: Vector
) -> None:
    """Raise a UsageError for an option that nothing would come of."""
    for option, told, needs in (
        ("--source", rehearse is not None and source != STANDARD_INPUT, "no --rehearse, which plays streams instead"),
        ("--minutes", rehearse is None and minutes != MINUTES, "--rehearse"),
        ("--loss", rehearse is None and loss != LOSS, "--rehearse"),
        ("--origin", mavlink is None and tuple(origin) != HERE, "--mavlink, whose frame it is in"),
    ):
        if told:
            raise UsageError(f"{option}: expected {needs} beside it")
