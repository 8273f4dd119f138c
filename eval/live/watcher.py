"""The watcher: a pose estimator's frames in, what people do and where to look from out."""

import math
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ehar.arrays import FloatArray
from ehar.errors import DataError, EharError, ModelError, UsageError
from ehar.flight.centre import around_centre
from ehar.flight.vehicle import Vehicle, load_vehicle
from ehar.motion import heading
from ehar.planner import Context, Observation, Planner
from ehar.plugins.blame import blamed
from ehar.recogniser import Recognition
from ehar.sensors.sensor import Sensed
from ehar.viewpoint import AZIMUTH, cartesian
from ehar.world import World
from eval.live.clock import FrameClock
from eval.live.joints import JointMap
from eval.live.messages import WIDEST, Answer, Frame, Vector, read_frame
from eval.live.people import People
from eval.live.setpoints import Setpoint, Setpoints
from eval.live.views import centred, looked_from, viewpoint_of
from eval.live.weights import conditions_of, live_belief, live_planner, live_recogniser, live_world
from planners.value.belief.filters import OneStreamBelief
from planners.value.belief.streams import StreamBeliefModel
from recognition.setting import localisation_note
from recognition.streaming import StreamingRecogniser

EMPTY, NO_POSE, LEFT_OUT, PLANNER_FAILED = "empty", "no camera pose", "people left out", "planner failed"
LEAST_RATE = 25.0  # [Hz] of setpoints; a recogniser of a lower frame rate has several for each of its frames
NO_START = "camera out of the workspace"


class Watcher:
    """Watches people through a pose estimator, and says where the camera should go.

    Call `see` for each frame that comes in, and `setpoint` at `setpoint_rate`; each may have a thread of its own.
    Neither waits for the other: setpoints come from a flight that keeps the vehicle's limits whatever the planner does.

    Args:
        models: folder of weights that were trained on streams, or a recogniser. No data is needed.
        vehicle: name, file or object of the vehicle that carries the camera.
        planner: name or object of the planner, or your own: file.py:Class.
        sensor: sensor that the weights were trained through.
        views: views that the weights were trained on.
        belief: the belief, or its JSON, as `ehar study belief --out` writes it; None believes the recogniser.
        sure: least probability of an activity that is named.
        seed: seed of a planner that draws.
        world: name, file or object of a world with the localisation that is there; else as in the world of the
            weights, None takes that.
        origin: where people are taken to be in the local frame until a frame says it: east, north, up [m].

    Raises:
        EharError: weights, vehicle, planner or belief are missing, malformed or do not fit.
    """

    def __init__(
        self,
        *,
        models: str | Path | StreamingRecogniser,
        vehicle: str | Path | Vehicle = "px4-auto",
        planner: str | Planner = "h-rotate",
        sensor: str = "estimator",
        views: str = "moving",
        belief: str | Path | StreamBeliefModel | None = None,
        sure: float = 0.9,
        seed: int = 0,
        world: str | Path | World | None = None,
        origin: Vector = (0.0, 0.0, 0.0),
    ) -> None:
        """Load everything; the first frame begins."""
        if isinstance(models, StreamingRecogniser):
            self.recogniser, trained = models, None
        else:
            trained = conditions_of(models, sensor, views, vehicle)
            self.recogniser = live_recogniser(trained)
        spec = self.recogniser.spec
        if not spec.fading:
            raise ModelError(
                "models: expected weights that are trained on streams, such as solo-stream, got weights for clips"
            )
        self.fps, self.class_names = spec.fps, spec.class_names
        self.setpoint_rate = self.fps * math.ceil(LEAST_RATE / self.fps)
        self.vehicle = vehicle if isinstance(vehicle, Vehicle) else load_vehicle(vehicle)
        self.planner = live_planner(planner, self.recogniser, trained)
        if not 0 < sure <= 1:
            raise UsageError(f"sure: expected a probability above 0 and at most 1, got {sure}")
        self.belief_model = live_belief(belief, len(self.class_names))
        self._belief = OneStreamBelief(self.belief_model, fps=self.fps)
        self._sure, self._seed = sure, seed
        self._world = spec.world if world is None else live_world(world, spec.world, trained)
        self._clock = FrameClock(self.fps)
        self._people = People(spec.persons, len(spec.skeleton.joint_names))
        self._maps: dict[str, JointMap] = {}
        self.setpoints = Setpoints(
            vehicle=self.vehicle,
            workspace=self._world.workspace,
            frame_time=1 / self.setpoint_rate,
            localisation=self._world.localisation,
            origin=origin,
        )
        self.counts: Counter[str] = Counter()
        self._viewpoint: FloatArray | None = None
        self._start()
        nobody = np.zeros((spec.persons, len(spec.skeleton.joint_names), 3))
        self._watch(nobody, spec.world.workspace.origin, (1.0,))  # the first frame takes long, so here
        self._start()

    @property
    def note(self) -> str | None:
        """The line that says that the recogniser was trained with another localisation; None if it was not."""
        return localisation_note(self._world.localisation, {"recogniser": self.recogniser.spec.world.localisation})

    def see(
        self, frame: Frame | str | Mapping[str, Any], *, arrived: float | None = None, newest: bool = True
    ) -> Answer:
        """Watch one more frame, and aim the flight at what the planner wants.

        Args:
            frame: the frame, or the JSON that says it.
            arrived: when it came in, by a clock that does not stop [s]; None if nobody has to know what is late.
            newest: whether no newer frame waits; the planner is asked about no other, so that it need not keep pace.

        Raises:
            DataError: it is not a frame. Nothing has changed then.
        """
        if not isinstance(frame, Frame):
            frame = read_frame(frame)
        people = self._joints(frame)
        due = self._clock.take(frame.time, arrived)
        notes = list(due.notes)
        self.counts.update(("frames", *due.notes))
        if due.refused:
            return self._answer(frame.time, notes)
        if due.anew:
            try:
                self._start()
            except EharError as error:  # of the planner's reset
                self._fail(error, notes)
        placed = self._people.place(people, [person.id for person in frame.people], frame.time)
        if placed.left_out:
            notes.append(f"{LEFT_OUT}: {placed.left_out}")
            self.counts[LEFT_OUT] += 1
        if not (placed.joints[..., 2] > 0).any():
            notes.append(EMPTY)
            self.counts[EMPTY] += 1
        places = self._places(frame, notes)
        if places is None:
            return self._answer(frame.time, notes)
        viewpoint, looking = places
        joints = centred(placed.joints, viewpoint, looking, frame.image, self._world.camera)
        self._watch(joints, viewpoint, due.shares)
        if due.shares and newest:
            self._plan(notes)
        return self._answer(frame.time, notes, joints)

    def setpoint(self) -> Setpoint | None:
        """Return the next setpoint, 1 / `setpoint_rate` later; None until the camera was in the workspace."""
        return self.setpoints.next() if self.setpoints.begun else None

    def _start(self) -> None:
        """Forget what was seen; the flight goes on."""
        self.setpoints.settle()
        self._state = self.recogniser.start(1)
        self._recognition: Recognition | None = None
        self._belief.start()
        self._people.start()
        self._watched = self._asked = 0  # frames of the recogniser, and of the planner
        self._before: tuple[FloatArray, FloatArray] | None = None  # joints (P, J, 3) and place (3,) of the frame before
        self._sensed: Sensed | None = None
        self._target: FloatArray | None = None
        spec = self.recogniser.spec
        context = Context(
            episodes=1,
            length=None,
            frame_time=1 / self.fps,
            class_names=self.class_names,
            skeleton=spec.skeleton,
            workspace=self._world.workspace,
            track=self.vehicle.name,
            rng=np.random.default_rng(self._seed),
            vehicle=around_centre(self.vehicle),
            world=self._world,
            follows=self.setpoint_rate == self.fps,  # a path has a state for each frame
        )
        with blamed(self.planner, f"planner {self.planner.name!r}, reset"):
            self.planner.reset(context)

    def _joints(self, frame: Frame) -> list[FloatArray]:
        """Return each person's joints, (J, 3).

        Raises:
            DataError: there are too few or too many keypoints, or one is nowhere near the image.
        """
        if frame.joints not in self._maps:
            self._maps[frame.joints] = JointMap(frame.joints, self.recogniser.spec.skeleton.joint_names)
        found = []
        for person in frame.people:
            keypoints = np.array([point or (0.0, 0.0, 0.0) for point in person.keypoints])
            if not (np.abs(keypoints) <= WIDEST).all():  # networks remember what they cannot count with
                raise DataError(f"people: expected keypoints within {WIDEST:g} px, got {np.abs(keypoints).max():g}")
            found.append(self._maps[frame.joints].joints(keypoints))
        return found

    def _places(self, frame: Frame, notes: list[str]) -> tuple[FloatArray, FloatArray] | None:
        """Return the viewpoint (3,) of a frame, and one that looks as its camera does; None if nobody knows it yet."""
        moved = (0.0, 0.0, 0.0)  # from where the people's frame is taken to be to where it is said to be
        if frame.origin is not None:
            taken = self.setpoints.follow(frame.origin, frame.time)
            moved = (frame.origin[0] - taken[0], frame.origin[1] - taken[1], frame.origin[2] - taken[2])
        if frame.camera is not None:
            places = looked_from(frame.camera.moved(moved), self._viewpoint)
            if not self.setpoints.begin(places[0]):
                notes.append(f"{NO_START}: setpoints begin in {self._world.workspace}")
                self.counts[NO_START] += 1
            self._viewpoint = places[0]
            return places
        notes.append(NO_POSE)
        self.counts[NO_POSE] += 1
        if self.setpoints.begun:
            self._viewpoint = self.setpoints.state().viewpoint[0]  # where it was told to be
        return None if self._viewpoint is None else (self._viewpoint, self._viewpoint)

    def _watch(self, joints: FloatArray, viewpoint: FloatArray, shares: tuple[float, ...]) -> None:
        """Show the recogniser and the belief the frames that are due, up to one with joints (P, J, 3)."""
        place = cartesian(viewpoint)
        for share in shares:
            between, where = joints, viewpoint
            if share < 1 and self._before is not None:
                before, from_there = self._before
                between = before + share * (joints - before)
                between[..., 2] = np.minimum(before[..., 2], joints[..., 2])
                where = viewpoint_of(from_there + share * (place - from_there), viewpoint[AZIMUTH])
            middle = (self._world.camera.width / 2, self._world.camera.height / 2)  # where missing joints are put
            seen = between[..., 2:] > 0
            self._sensed = Sensed(
                np.where(seen, between[..., :2], middle)[None].astype(np.float32),
                between[None, ..., 2].astype(np.float32),
            )
            self._recognition, self._state = self.recogniser.step(self._state, self._sensed, where[None])
            self._belief.update(self._recognition.log_probs[0], where)
            self._watched += 1
        self._before = joints, place

    def _plan(self, notes: list[str]) -> None:
        """Ask the planner, and aim at what it wants; if it fails, brake."""
        if not self.setpoints.begun:
            return
        assert self._sensed is not None and self._recognition is not None
        state = self.setpoints.state()
        observation = Observation(
            frame=self._asked,  # planners count on seeing every number, from 0 on, and may not be asked every time
            length=None,
            joints_2d=self._sensed.joints_2d,
            confidence=self._sensed.confidence,
            viewpoint=state.viewpoint,
            log_probs=self._recognition.log_probs,
            embedding=self._recognition.embedding,
            velocity=state.velocity,
            acceleration=state.acceleration,
            time=(self._watched - 1) / self.fps,
        )
        self._asked += 1
        try:
            with blamed(self.planner, f"planner {self.planner.name!r}"):
                wanted = np.array(self.planner.act(observation), dtype=np.float64)
            target = heading(wanted)
            if target.shape != (1, 3) or not np.isfinite(wanted).all():
                raise UsageError(f"planner {self.planner.name!r}: expected a finite target (1, 3), got {target}")
        except EharError as error:
            self._fail(error, notes)
        else:
            self._target = self._world.workspace.clip(target[0])
            self.setpoints.aim(self._target, wanted if wanted.ndim > target.ndim else None)

    def _fail(self, error: EharError, notes: list[str]) -> None:
        """Say that the planner fails, and brake: a flight does not end because of a planner."""
        notes.append(f"{PLANNER_FAILED}: {error}")
        self.counts[PLANNER_FAILED] += 1
        self._target = None
        self.setpoints.brake()

    def _answer(self, time: float, notes: list[str], joints: FloatArray | None = None) -> Answer:
        belief = dict(zip(self.class_names, self._belief.probabilities.tolist(), strict=True))
        name = max(belief, key=lambda one: belief[one])
        named = belief[name] >= self._sure and name != self.class_names[-1]
        return Answer(
            time=time,
            belief=belief,
            decision=name if named else None,
            viewpoint=_vector(self._viewpoint),
            target=_vector(self._target),
            joints=joints,
            notes=tuple(notes),
        )


def _vector(array: FloatArray | None) -> Vector | None:
    if array is None:
        return None
    x, y, z = array.tolist()
    return x, y, z
