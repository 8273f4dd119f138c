"""Benchmarks on the tiny data, and what listens to them."""

import hashlib
import json
import os
import signal
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from ehar.conditions import Conditions
from ehar.world import PAPER
from eval import benchmark
from eval.records.job_times import JOB_TIMES
from eval.records.run_files import SUMMARY
from eval.running.run import Run
from eval.scores.summary import Summary
from planners.value.belief.clips import BeliefModel
from planners.value.model import gain_model_path, save_gain_model
from tests.helpers.agents import save_untrained
from tests.helpers.fakes import FakeRecogniser, tiny_data
from tests.helpers.fixed_places import save_place
from tests.helpers.gain_models import model_of, peak_weights

TOLD = {field.name for field in fields(Conditions)}


class HashedRecogniser(FakeRecogniser):
    sha256 = "fake"
    spec = SimpleNamespace(length=None, fading=False, world=PAPER)  # trained at any length


@dataclass
class Log:
    """Remembers what a reporter hears; stops the run after so many jobs."""

    stop_after: int = 10**9
    notes: list[str] = field(default_factory=list)
    jobs: int = 0
    done: list[str] = field(default_factory=list)

    def note(self, line: str) -> None:
        self.notes.append(line)

    def begin(self, jobs: int) -> None:
        self.jobs = jobs

    def advance(self, planner: str) -> None:
        self.done.append(planner)
        if len(self.done) == self.stop_after:
            os.kill(os.getpid(), signal.SIGINT)

    def end(self) -> None:
        pass


def run(planners: Any = ("no-act", "random", "oracle"), **options: Any) -> Run:
    """Run planners; options are fields of the conditions, and the benchmark's own."""
    told = {"data": tiny_data(sequences=40), "length": 10, "starts": 4}
    told |= {name: options.pop(name) for name in list(options) if name in TOLD}
    return benchmark(planners, Conditions(**told), **{"reporter": Log(), **options})


def file_hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def bytes_of(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(out.iterdir())}


def but_times(files: dict[str, bytes]) -> dict[str, Any]:
    """Return files without the times of plans and of jobs, which workers measure."""
    summary = json.loads(files[SUMMARY])
    for planner in summary["planners"]:
        del planner["step_ms"]
    return files | {SUMMARY: summary, "table.md": None, JOB_TIMES: None}


SLOW_TO_BELIEVE = BeliefModel(noise_weights=(3.0, 0.0, 0.0, 0.0, 0.0), process_noise=0.1)


def save_models(directory: Path, *, recogniser_sha256: str) -> None:
    model = replace(model_of(peak_weights(np.array([8.0, 1.0, np.pi / 2]))), belief=SLOW_TO_BELIEVE)
    path = gain_model_path(directory, Conditions())
    save_gain_model(path, model, recogniser_sha256=recogniser_sha256, history={})
    save_place(directory, recogniser_sha256=recogniser_sha256)


def names(summary: Summary) -> tuple[str, ...]:
    return tuple(planner.name for planner in summary.planners)


def with_agents(models: Path) -> dict[str, str]:
    """Add agents of the fake recogniser to a models folder, and return their hashes by record name."""
    hashes = {}
    for name, seed in (("il", 0), ("ppo", 3), ("il-ppo", 0), ("il-ppo", 1), ("dagger", 0), ("il-ppo-no-vision", 0)):
        path = save_untrained(models, tiny_data(sequences=40), name, seed=seed)
        content = path.read_bytes() + path.with_suffix(".json").read_bytes()
        hashes[f"{name}/{seed}"] = hashlib.sha256(content).hexdigest()
    return hashes
