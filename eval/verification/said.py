"""Checks of what config.json says that no hash covers: who is privileged, which hashes it has, and its warnings."""

from collections.abc import Iterator
from typing import Any

from eval.records.config import CONFIG, RunConfig
from eval.verification.checks import FAILED, OK, UNCHECKED, Check
from eval.verification.inputs import Inputs
from planners.registry import is_learned, is_ours, is_privileged, needs_fixed_place, needs_gain_model

PRIVILEGED, NAMED, WARNINGS = "privileged", "weights named", "warnings"
FLAGS = ("trained_open", "trained_elsewhere", "sensor_changed")  # of the recogniser


def check_privileged(config: RunConfig) -> Check:
    """Check that planners with names of ehar are told the truth if ehar's are; this needs no weights."""
    ours = [planner for planner in config.planners if is_ours(planner.name)]
    for planner in ours:
        expected = is_privileged(planner.name)
        if planner.privileged != expected:
            got = f"got {planner.privileged}, expected {expected}"
            return Check(PRIVILEGED, FAILED, f"{CONFIG}: {planner.name}: privileged: {got}")
    own = "; your own are asked when they are made again" if len(ours) < len(config.planners) else ""
    return Check(PRIVILEGED, OK, f"{len(ours)} planners with names of ehar are as in ehar{own}")


def check_named(config: RunConfig) -> Check:
    """Check that all weights have a hash that planners of these names need; what is not named is compared with none."""
    valuing = [planner.name for planner in config.planners if needs_gain_model(planner.name)]
    held = [planner for planner in config.planners if needs_fixed_place(planner.name) or is_learned(planner.name)]
    nameless = [f"{planner.name}: weights_sha256" for planner in held if planner.weights_sha256 is None]
    if valuing and config.gain_model_sha256 is None:
        nameless.insert(0, f"gain_model_sha256, which {valuing[0]} needs")
    if nameless:
        return Check(NAMED, FAILED, f"{CONFIG}: {nameless[0]}: got none, expected the hash of its weights")
    return Check(NAMED, OK, f"hashes of the weights of {len(valuing) + len(held)} planners that need some")


def check_warnings(config: RunConfig, inputs: Inputs) -> Check | None:
    """Check what config.json says of the training of the weights that are here; None if the recogniser is not.

    Args:
        config: configuration of the run.
        inputs: its inputs. Weights that are not here, or not the run's, have a check that says so.
    """
    if inputs.reason_against is not None:
        return None
    if config.trained_lengths is None:
        return Check(WARNINGS, UNCHECKED, f"{CONFIG} is from before trained_lengths were recorded")
    for what, got, expected in _said(config, inputs):
        if got != expected:
            return Check(WARNINGS, FAILED, f"{CONFIG}: {what}: got {_text(got)}, expected {_text(expected)}")
    count = len(config.warnings)
    return Check(WARNINGS, OK, f"{count or 'no'} warning{'s' * (count != 1)}, as the weights say")


def _said(config: RunConfig, inputs: Inputs) -> Iterator[tuple[str, Any, Any]]:
    """Yield each thing that is said of the weights that are here, what config.json says, and what they say."""
    setting = inputs.setting
    assert setting is not None
    for flag in FLAGS:
        yield flag, getattr(config, flag), getattr(setting, flag)
    lengths, localisations = config.trained_lengths or {}, config.trained_localisations or {}
    trained = {"recogniser": (setting.trained_length, setting.trained_localisation), **inputs.trained}
    for name, (length, localisation) in trained.items():
        other = None if localisation == setting.world.localisation else localisation
        yield f"trained_lengths: {name}", lengths.get(name), length
        yield f"trained_localisations: {name}", localisations.get(name), other


def _text(value: Any) -> str:
    return "nothing" if value is None else str(value)
