"""Sensors and motions that somebody brought, as the text of their file."""

OWN = """
import numpy as np
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import VEHICLES
from ehar.motion import GridMotion
from ehar.sensors.perfect import PerfectSensor
from ehar.viewpoint import Workspace

class Blurred(PerfectSensor):
    name = "blurred joints"

    def __init__(self, *, pixels: float = 5.0, persons: int = 0, skeleton=None, fps=None, class_names=()):
        super().__init__()
        self.pixels, self.given = pixels, (persons, skeleton, fps, class_names)

    def sense(self, positions, viewpoint, noise):
        exact = super().sense(positions, viewpoint, noise)
        return exact._replace(joints_2d=exact.joints_2d + self.pixels * noise.localisation)

class Slow(GridMotion):
    def __init__(self, *, every: int = 2):
        super().__init__()
        self.every = every

    def reset(self, viewpoint, frame_time):
        super().reset(viewpoint, frame_time)
        self.frame, self.here = 0, viewpoint

    def advance(self, target):
        self.frame += 1
        self.here = super().advance(target if self.frame % self.every == 0 else self.here)
        return self.here

class Drone(FlightMotion):
    name = "drone"
    def __init__(self): super().__init__(vehicle=VEHICLES["px4-auto"])

class Blind:
    name = "blind"

class Unnamed(Blurred):
    name = "a/b"

class Lensless(Blurred):
    def __init__(self):
        self.pixels, self.camera = 1.0, "wide"

class Broken(Blurred):
    def __init__(self): raise RuntimeError("no\\nlens")

class Raising(Blurred):
    def sense(self, positions, viewpoint, noise): raise RuntimeError("no\\nlight")

class Narrow(Blurred):
    def sense(self, positions, viewpoint, noise):
        exact = super().sense(positions, viewpoint, noise)
        return exact._replace(confidence=exact.confidence[..., :2])

class Endless(Blurred):
    def sense(self, positions, viewpoint, noise):
        exact = super().sense(positions, viewpoint, noise)
        return exact._replace(joints_2d=exact.joints_2d * np.inf)

class Whole(Blurred):
    def sense(self, positions, viewpoint, noise):
        return tuple(array.astype(int) for array in super().sense(positions, viewpoint, noise))

class Sure(Blurred):
    def sense(self, positions, viewpoint, noise):
        exact = super().sense(positions, viewpoint, noise)
        exact.confidence[0, 0, 0] = 0
        return exact._replace(confidence=exact.confidence * 2)

class Nothing(Blurred):
    def sense(self, positions, viewpoint, noise): return None

class Still:
    workspace, velocity, acceleration = Workspace(), 0, 0
    def reset(self, viewpoint, frame_time): self.here = viewpoint

class Rateless:
    workspace = Workspace()
    def reset(self, viewpoint, frame_time): self.here = viewpoint
    def advance(self, target): return self.here

class Boundless(Slow):
    def __init__(self): self.workspace = "everywhere"

class Ideal(Slow):
    name = "ideal"

class Unborn(Slow):
    def __init__(self): raise RuntimeError("no\\nbattery")

class Stalling(Slow):
    def advance(self, target): raise RuntimeError("no\\npower")

class Flat(Slow):
    def advance(self, target): return target[:, :2]

class Lost(Slow):
    def advance(self, target): return target * np.nan

class Rushing(Slow):
    velocity = np.zeros(3)

class Hovering(Slow):
    velocity, acceleration = 0, 0.0

class Ragged(Slow):
    def advance(self, target): return [[1.0], [2.0, 3.0]]

class Nameless(Slow):
    name = " "

class Single(Slow):
    made = []
    def __init__(self):
        super().__init__()
        if self.made: raise RuntimeError("one\\nis enough")
        self.made.append(self)
"""
