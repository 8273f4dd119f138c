"""Records of episodes that never ran, and what is made of them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ehar.rollout import Record
from eval.records.episodes import DIGITS, EpisodeRecords, record_episodes
from eval.records.flights import FlightRecords
from eval.records.run_files import RunConfig, write_run
from eval.scores.summary import Conditions, Summary, summarise

CONDITIONS = Conditions(
    data="tiny (synthetic)", sensor="perfect", views="moving", track="ideal", form="causal", readout="recogniser"
)


CONFIG_OF_RUN = RunConfig(
    source="tiny",
    data="tiny (synthetic)",
    data_sha256="0",
    models=None,
    recogniser_sha256="1",
    sensor="perfect",
    views="moving",
    form="causal",
    track="ideal",
    vehicle=None,
    readout="recogniser",
    part="test",
    gain_model_sha256=None,
    starts=1,
    seed=0,
    length=4,
    fps=None,
    planners=(),
    versions={},
)


def make_records(seed: int, *, skill: float = 0.0, episodes: int = 9, length: int = 4) -> EpisodeRecords:
    rng = np.random.default_rng(seed)
    fixed = np.random.default_rng(0)
    label = fixed.integers(0, 3, episodes)
    logits = rng.normal(size=(episodes, length, 3)) + skill * np.eye(3)[label][:, None]
    log_probs = logits - np.log(np.exp(logits).sum(axis=-1, keepdims=True))
    record = Record(fixed.uniform([5, 0, 0], [15, 6, 1.5], (episodes, length, 3)), log_probs.astype(np.float32), 0.1)
    return record_episodes(
        record,
        sequence=[f"séquence {index // 2}" for index in range(episodes)],
        first=np.arange(episodes),
        start=record.viewpoints[:, 0],
        label=label,
    )


def three_planners() -> dict[str, EpisodeRecords]:
    return {"no-act": make_records(1), "mine": make_records(2, skill=1.0), "oracle": make_records(3, skill=2.0)}


def summary_of(records: dict[str, EpisodeRecords], **options: Any) -> Summary:
    return summarise(
        records,
        CONDITIONS,
        privileged={name: name == "oracle" for name in records},
        step_ms=dict.fromkeys(records, 0.25),
        **options,
    )


def write_finished(directory: Path, records: dict[str, EpisodeRecords], **options: Any) -> Path:
    """Write a run with a summary, under the conditions of `CONFIG_OF_RUN` but for the options."""
    write_run(directory, replace(CONFIG_OF_RUN, **options), records, summary_of(records))
    return directory


def flown(records: EpisodeRecords, seed: int = 0) -> EpisodeRecords:
    numbers = np.random.default_rng(seed).random((5, len(records))).round(DIGITS)
    return replace(records, flight=FlightRecords(*numbers))
