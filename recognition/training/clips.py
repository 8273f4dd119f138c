"""Training clips: windows of motion, seen by a sensor from training viewpoints, as network features."""

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.conditions import Form
from ehar.data.motion_data import MotionData
from ehar.data.scenario import Scenarios, draw_scenarios, localised, scenarios_at
from ehar.data.skeleton_tree import parents
from ehar.data.streams.data import StreamData
from ehar.data.streams.scenario import StreamScenarios
from ehar.data.surroundings import surroundings_of
from ehar.errors import DataError
from ehar.sensors.sensing import sense
from ehar.sensors.sensor import Sensor, draw_noise
from ehar.world import PAPER, World
from recognition.networks.features import features, with_view
from recognition.training.in_the_way import hide
from recognition.training.planned_views import PlannedViews
from recognition.training.views import recorded_viewpoints, training_viewpoints

RECORDED = "recorded"  # the regime of the cameras that recorded the data
CUT = ("sequence", "first")  # where a window is cut from
BODY_SCALE = 0.1  # training bodies are scaled by a random factor from 1 - this to 1 + this: actors differ in size


class Clips(NamedTuple):
    """A batch for training or validation."""

    features: Tensor  # (B, L, P, J, C)
    labels: Tensor  # (B,); of streams (B, L), for each frame its own
    sequences: IntArray  # (B,) the sequence that each is cut from
    viewpoints: FloatArray  # (B, L, 3) of the cameras

    @property
    def frame_labels(self) -> Tensor:
        """The label of every frame, (B, L)."""
        return self.labels if self.labels.dim() == 2 else self.labels[:, None].expand(self.features.shape[:2])


class ClipSource:
    """Draws clips from some sequences.

    Clips are drawn by `ehar.data.scenario.draw_scenarios`, so they have the distribution of test windows. With planned
    views, half of them are windows of those episodes, and seen from there.

    Args:
        data: the motion, trimmed or in streams.
        sequences: the sequences of one part.
        length: number L of frames of a clip.
        sensor: the sensor that sees the clips.
        views: the training regime.
        form: form of the network; the causal one is told where the camera is.
        augment: whether bodies are scaled.
        world: the world that cameras are in, and in which people are localised.
        planned: views that planners chose in episodes of these sequences.
        in_the_way: whether things are drawn between people and cameras, in half of the clips.
    """

    def __init__(
        self,
        *,
        data: MotionData | StreamData,
        sequences: IntArray,
        length: int,
        sensor: Sensor,
        views: str,
        form: Form,
        augment: bool,
        world: World = PAPER,
        planned: PlannedViews | None = None,
        in_the_way: bool = False,
    ) -> None:
        """Collect the sequences that are long enough.

        Raises:
            DataError: no sequence is long enough, or no camera recorded the data and `views` are the recorded ones.
        """
        if views == RECORDED and (isinstance(data, StreamData) or data.views is None):
            raise DataError(f"{data.name}: expected `views`, the cameras that recorded each sequence; it has none")
        long_enough = sequences[data.lengths[sequences] >= length]
        if len(long_enough) == 0:
            longest = int(data.lengths[sequences].max(initial=0))
            raise DataError(
                f"{data.name}: expected a training sequence of at least {length} frames, the longest has {longest}"
            )
        self._data, self._sequences, self._length = data, long_enough, length
        self._sensor, self._views, self._form, self._augment, self._world = sensor, views, form, augment, world
        self._planned, self._in_the_way = planned, in_the_way
        self._parents = torch.from_numpy(parents(data.skeleton))

    def draw(self, rng: np.random.Generator, clips: int) -> Clips:
        """Draw B clips from random viewpoints of the regime; with planned views, half of them from these."""
        usual = clips if self._planned is None else clips - clips // 2
        scenarios = draw_scenarios(self._data, self._sequences, self._length, rng, usual)
        if self._planned is not None:
            chosen = self._planned.draw(rng, clips - usual, self._length)
            sequence, first = (np.concatenate([getattr(part, name) for part in (scenarios, chosen)]) for name in CUT)
            scenarios = scenarios_at(self._data, self._length, sequence, first)
        scenarios = localised(scenarios, self._world)
        every = np.arange(clips)
        positions = scenarios.positions(every)
        if self._augment:
            scale = rng.uniform(1 - BODY_SCALE, 1 + BODY_SCALE, size=(clips, 1, 1, 1, 1))
            positions = positions * scale.astype(np.float32)
        if self._views == RECORDED:
            viewpoints = recorded_viewpoints(scenarios.centres(every[:usual]), self._length)
        else:
            viewpoints = training_viewpoints(self._views, self._world, rng, usual, self._length)
        if self._planned is not None:
            viewpoints = np.concatenate([viewpoints, chosen.viewpoints])
        hidden = self._hidden(scenarios, positions, viewpoints, rng)
        seen = self._see(positions, viewpoints, rng, hidden)
        return Clips(seen, torch.from_numpy(scenarios.labels.astype(np.int64)), scenarios.sequence, viewpoints)

    def _hidden(
        self,
        scenarios: Scenarios | StreamScenarios,
        positions: FloatArray,
        viewpoints: FloatArray,
        rng: np.random.Generator,
    ) -> BoolArray | None:
        """Return which joints are hidden by what is in the way, (B, L, P, J); None if nothing is."""
        if self._in_the_way:
            return hide(scenarios, self._world, viewpoints, positions, rng)
        around = surroundings_of(scenarios, np.arange(len(positions)), self._world, rng)
        return None if around is None else around.hide(viewpoints, positions, slice(None))

    def _see(
        self, positions: FloatArray, viewpoints: FloatArray, rng: np.random.Generator, hidden: BoolArray | None
    ) -> Tensor:
        """Return the features (B, L, P, J, C) of the clips as the sensor sees them."""
        noise = draw_noise(rng, positions.shape[:2], *positions.shape[2:4])
        sensed = sense(self._sensor, positions, viewpoints, noise, hidden=hidden)
        cameras = torch.from_numpy(viewpoints.astype(np.float32))
        seen = features(
            torch.from_numpy(sensed.joints_2d.astype(np.float32, copy=False)),
            torch.from_numpy(sensed.confidence.astype(np.float32, copy=False)),
            cameras[..., 0],
            self._parents,
            self._sensor.camera,
        )
        return with_view(seen, cameras) if self._form == "causal" else seen
