"""Records of episodes that never ran, and what is made of them."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.conditions import Conditions
from ehar.rollout import Record
from eval.records.config import RunConfig
from eval.records.episodes import DIGITS, EpisodeRecords, record_episodes
from eval.records.flights import FlightRecords
from eval.running.run import write_records
from eval.scores.summarise import summarise
from eval.scores.summary import Summary

CONFIG_OF_RUN = RunConfig(
    conditions=Conditions(data="tiny", length=4),
    data="tiny (synthetic)",
    data_sha256="0",
    recogniser_sha256="1",
    form="causal",
    vehicle=None,
    readout="recogniser",
    gain_model_sha256=None,
    planners=(),
    versions={},
)
TOLD = {field.name for field in fields(Conditions)} - {"data"}  # a configuration's data is its title


def config_of_run(**options: Any) -> RunConfig:
    """Return a configuration; options are its own fields, and those of the conditions but for the data."""
    told = {name: options.pop(name) for name in list(options) if name in TOLD}
    if "form" in told:
        options["form"] = told["form"]
    if "source" in options:
        told["data"] = options.pop("source")
    return replace(CONFIG_OF_RUN, conditions=replace(CONFIG_OF_RUN.conditions, **told), **options)


def make_records(
    seed: int, *, skill: float = 0.0, episodes: int = 9, length: int = 4, people: int = 0
) -> EpisodeRecords:
    """Return records of sequences of two episodes; as many people take turns, or nobody is named."""
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
        subjects=np.array([[index // 2 % people if people else -1] for index in range(episodes)]),
    )


def three_planners() -> dict[str, EpisodeRecords]:
    return {"no-act": make_records(1), "mine": make_records(2, skill=1.0), "oracle": make_records(3, skill=2.0)}


def summary_of(records: dict[str, EpisodeRecords], config: RunConfig | None = None, **options: Any) -> Summary:
    return summarise(
        records,
        config_of_run(length=next(iter(records.values())).predicted.shape[1]) if config is None else config,
        privileged={name: name == "oracle" for name in records},
        step_ms=dict.fromkeys(records, 0.25),
        **options,
    )


def write_finished(directory: Path, records: dict[str, EpisodeRecords], **options: Any) -> Path:
    """Write a run with a summary, under the conditions of `CONFIG_OF_RUN` but for the options."""
    config = config_of_run(**options)
    write_records(directory, config, records, summary_of(records, config))
    return directory


def flown(records: EpisodeRecords, seed: int = 0) -> EpisodeRecords:
    numbers = np.random.default_rng(seed).random((8, len(records))).round(DIGITS)
    return replace(records, flight=FlightRecords(*numbers))


def make_stream_records(
    labels: IntArray, answers: IntArray, *, top_probability: FloatArray | None = None
) -> EpisodeRecords:
    """Return records of streams with labels and answers (N, L); numbers count the frames where none are given."""
    episodes, length = labels.shape
    frames = np.arange(episodes * length, dtype=float).reshape(episodes, length)
    return EpisodeRecords(
        sequence=tuple(f"stream-{index}" for index in range(episodes)),
        first=np.full(episodes, 7),
        start=np.ones((episodes, 3)),
        label=labels,
        subjects=np.arange(episodes)[:, None],
        viewpoint=np.repeat(frames[..., None], 3, axis=2),
        predicted=answers,
        true_probability=frames / frames.size,
        top_probability=frames / frames.size if top_probability is None else top_probability,
    )
