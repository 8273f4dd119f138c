"""A recogniser that somebody brought, as the text of its file."""

OWN = """
from pathlib import Path
import numpy as np
from ehar.recogniser import Recognition
from ehar.data.skeleton import Skeleton

class State:
    def __init__(self, evidence): self.evidence = evidence
    def fork(self, forks): return State(np.repeat(self.evidence[:, None], forks, axis=1))
    def select(self, choice): return State(self.evidence[np.arange(len(choice)), choice])
    def reset(self, mask): return State(np.where(mask[:, None], 0.0, self.evidence))

class Mine:
    def __init__(self, *, class_names: tuple[str, ...], skeleton: Skeleton, persons: int, fps: float,
                 gain: float = 1.0, weights: Path | None = None):
        self.given = (class_names, skeleton, persons, fps, gain)
        self.class_names, self.embedding_size, self.gain = class_names, len(class_names), gain

    def start(self, episodes):
        return State(np.zeros((episodes, len(self.class_names))))

    def step(self, state, sensed, viewpoint):
        evidence = state.evidence - self.gain * sensed.joints_2d[..., 0, : len(self.class_names), 1] / 100
        return self.recognised(evidence), State(evidence)

    def recognised(self, evidence):
        top = evidence - evidence.max(axis=-1, keepdims=True)
        log_probs = top - np.log(np.exp(top).sum(axis=-1, keepdims=True))
        return Recognition(log_probs.astype(np.float32), evidence.astype(np.float32))

class Wide(Mine):
    def recognised(self, evidence):
        return Recognition(np.zeros((len(evidence), 5)), evidence)

class Raising(Mine):
    def recognised(self, evidence):
        raise RuntimeError("no\\nweights")

class Endless(Mine):
    def recognised(self, evidence):
        return Recognition(evidence * np.inf, evidence)

class Foreign(Mine):
    def __init__(self): self.class_names, self.embedding_size = ("wave",), 1

class Countless(Mine):
    def __init__(self): self.class_names, self.embedding_size = 4, 1

class Bodiless(Mine):
    def __init__(self, *, class_names): self.class_names = class_names

class Sized(Mine):
    def __init__(self, *, class_names): self.class_names, self.embedding_size = class_names, "large"

class Needy(Mine):
    def __init__(self, depth: int): pass

class Nothing: pass

class Together(Mine):  # looks at all rows for each
    def recognised(self, evidence):
        mixed = 0.5 * evidence + 0.5 * evidence.mean(axis=tuple(range(evidence.ndim - 1)))
        return super().recognised(mixed)

class Lists(Mine):
    def recognised(self, evidence):
        return Recognition(np.full((len(evidence), 3), -np.log(3)).tolist(), evidence)

class Logits(Mine):
    def recognised(self, evidence):
        return Recognition(np.zeros((len(evidence), 3)), evidence)
"""
