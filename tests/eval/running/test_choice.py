"""Which planners run, and which trainings of the learned ones."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.conditions import Conditions, Form
from ehar.errors import DataError, ModelError, UsageError
from ehar.planner import Planner
from eval.running.choice import ModelPlace, choose_planners, listed, make_planners
from planners.agents.agent import Agent
from planners.heuristic import NoAct
from planners.own_planner import Origin
from planners.registry import planner_names
from planners.value.model import GainModel, gain_model_path, save_gain_model
from tests.helpers.agents import save_untrained, untrained_agent
from tests.helpers.fakes import tiny_data
from tests.helpers.fixed_places import save_place
from tests.helpers.gain_models import model_of, peak_weights

DATA = tiny_data()


def place_of(models: Path | None, **options: Any) -> ModelPlace:
    told = ("form", "recogniser_sha256", "trained_elsewhere")
    own: dict[str, Any] = {name: options.pop(name) for name in told if name in options}
    conditions = Conditions(
        data="tiny.npz", models=models, form="ctrgcn" if own.get("form") == "ctrgcn" else "causal", **options
    )
    return ModelPlace(conditions, DATA, **{"form": "causal", "recogniser_sha256": "fake", **own})


def save_field(models: Path, *, recogniser: str = "fake", **history: str) -> None:
    path, model = gain_model_path(models, Conditions()), model_of(peak_weights(np.array([8.0, 1.0, 1.0])))
    save_gain_model(path, model, recogniser_sha256=recogniser, history=history)


def save_agents(models: Path, *names: str, form: Form = "causal") -> None:
    for record in names:
        name, _, seed = record.partition("/")
        save_untrained(models, DATA, name, seed=int(seed), form=form)


def chosen(
    planners: Any, place: ModelPlace, *, readout: str = "recogniser"
) -> tuple[list[str], GainModel | None, list[str]]:
    """Return the names of those that run, the gain model, and the notes."""
    notes: list[str] = []
    made, _, model = choose_planners(planners, place, readout=readout, note=notes.append)
    return [planner.name for planner in made], model, notes


def test_a_learned_planner_is_each_of_its_trainings(tmp_path: Path) -> None:
    save_agents(tmp_path, "il-ppo/10", "il-ppo/2", "il/0", "il-ppo-no-vision/1")
    place = place_of(tmp_path)
    assert place.seeds("il-ppo") == (2, 10)
    assert place.expanded("il-ppo") == ("il-ppo/2", "il-ppo/10")
    assert place.expanded("il-ppo/10") == ("il-ppo/10",)
    assert place.expanded("ppo") == ("ppo/0",), "which says what is missing when it is loaded"
    names, model, notes = chosen(["no-act", "il-ppo", "il/0", "il-ppo-no-vision"], place)
    assert names == ["no-act", "il-ppo/2", "il-ppo/10", "il/0", "il-ppo-no-vision/1"]
    assert (model, notes) == (None, [])


def test_each_training_is_loaded_from_its_own_file(tmp_path: Path) -> None:
    save_agents(tmp_path, "il-ppo/2", "il-ppo/5", "il-ppo-no-vision/2")
    place = place_of(tmp_path)
    for spec, saved in (
        ("il-ppo/2", "il-ppo/2"),
        ("il-ppo/5", "il-ppo/5"),
        ("il-ppo", "il-ppo/2"),  # the first
        ("il-ppo-no-vision", "il-ppo-no-vision/2"),
    ):
        agent = place.load_agent(spec)
        assert agent.name == spec
        expected = untrained_agent(saved).network
        assert agent.network.spec == expected.spec
        assert bool((agent.network.actor.weight == expected.actor.weight).all())
    hashes = {place.load_agent(spec).sha256 for spec in ("il-ppo/2", "il-ppo/5", "il-ppo-no-vision/2")}
    assert len(hashes) == 3


def test_without_names_all_run_for_whom_something_was_trained(tmp_path: Path) -> None:
    save_agents(tmp_path, "il/0", "il/1", "il-ppo-no-vision/0")
    names, model, notes = chosen(None, place_of(tmp_path))
    left_out = {"fixed-best", "nbv-greedy", "nbv-search", "nbv", "ppo", "il-ppo", "dagger"}
    expected = [name for name in planner_names() if name not in left_out]
    at = expected.index("il")
    assert names == [*expected[:at], "il/0", "il/1", *expected[at + 1 :]], "ablations run where they are named only"
    assert model is None
    place, field, agents = notes
    assert place.startswith("left out: fixed-best: ")
    command = f"`ehar train fixed-best --data X.npz --sensor perfect --views moving --models {tmp_path}`"
    assert place.endswith(f"no such file: expected a fixed place, as made by {command}")
    assert field.startswith("left out: nbv-greedy, nbv-search, nbv: ")
    assert agents.startswith(
        "left out: ppo, il-ppo, dagger: no agent was trained for this recogniser: expected those of "
    )
    assert f"`ehar train agent --data X.npz --sensor perfect --views moving --models {tmp_path}`" in agents
    save_field(tmp_path)
    save_place(tmp_path)
    save_agents(tmp_path, "ppo/0", "il-ppo/0", "dagger/0")
    names, model, notes = chosen(None, place_of(tmp_path))
    assert [name.partition("/")[0] for name in names if name != "il/1"] == list(planner_names())
    assert model is not None
    assert notes == []


def test_the_published_recogniser_has_agents_of_its_own(tmp_path: Path) -> None:
    save_agents(tmp_path, "il/0")  # for the causal one
    place = place_of(tmp_path, form="ctrgcn")
    names, _, notes = chosen(None, place)
    assert not [name for name in names if name.startswith(("il", "ppo", "dagger"))]
    assert "`ehar train agent --data X.npz --sensor perfect --views moving --form ctrgcn --models " in notes[-1]
    with pytest.raises(ModelError, match=r"agent-il-ctrgcn-perfect-moving-seed0\.safetensors: no such file"):
        chosen(["no-act", "il"], place)
    save_agents(tmp_path, "il/0", form="ctrgcn")
    names, _, _ = chosen(None, place)
    assert [name for name in names if name.startswith("il")] == ["il/0"]


def test_what_was_trained_for_another_recogniser_is_left_out_beside_your_own(tmp_path: Path) -> None:
    save_field(tmp_path)
    save_place(tmp_path)
    save_agents(tmp_path, "il/0")
    place = place_of(tmp_path, form="Mine(gain=2)", recogniser="mine.py:Mine(gain=2)", recogniser_sha256="mine")
    names, model, (fixed, field, agent, others) = chosen(None, place)
    assert not [name for name in names if name.startswith(("fixed-best", "nbv", "il", "ppo", "dagger"))]
    assert model is None
    assert "trained for another recogniser: its sha256 was fake..., this one's is mine...; fit it again" in fixed
    assert "trained for another recogniser: its sha256 was fake..., this one's is mine..." in field
    assert "trained for another recogniser: its sha256 was fake..., this one's is mine..." in agent
    assert "no agent was trained for this recogniser: expected those of `ehar train agent " in others
    for planners in (["il"], ["nbv"], ["fixed-best"]):
        with pytest.raises(ModelError, match=r"(trained|fitted) for another recogniser"):
            chosen(planners, place)


def test_what_was_trained_on_another_fold_is_refused_unless_readers_are_warned(tmp_path: Path) -> None:
    other = "0" * 64
    save_place(tmp_path, data_sha256=other)
    with pytest.raises(
        ModelError, match=r"fixed-best-perfect-moving\.json: trained for another data set, or fold of it"
    ):
        chosen(["no-act", "fixed-best"], place_of(tmp_path))
    save_field(tmp_path, data_sha256=other)
    with pytest.raises(ModelError, match=r"trained for another data set, or fold of it: .*train the gain field again"):
        chosen(["no-act", "nbv"], place_of(tmp_path))
    with pytest.raises(ModelError, match="trained for another data set, or fold of it"):
        chosen(None, place_of(tmp_path))
    warned = place_of(tmp_path, trained_elsewhere=True)
    assert chosen(["fixed-best", "nbv"], warned)[0] == ["fixed-best", "nbv"]
    save_place(tmp_path, data_sha256=DATA.sha256)
    save_field(tmp_path, data_sha256=DATA.sha256)
    assert chosen(["fixed-best", "nbv"], place_of(tmp_path))[0] == ["fixed-best", "nbv"]


@pytest.mark.parametrize("planners", [None, ["fixed-best"]])
def test_a_place_of_another_recogniser_is_never_passed_over(tmp_path: Path, planners: list[str] | None) -> None:
    save_place(tmp_path, recogniser_sha256="another")
    with pytest.raises(ModelError, match=r"fixed-best-perfect-moving\.json: trained for another recogniser"):
        chosen(planners, place_of(tmp_path))


def test_what_was_trained_for_a_recogniser_of_your_own_runs(tmp_path: Path) -> None:
    save_field(tmp_path, recogniser="fake")
    save_place(tmp_path)
    save_agents(tmp_path, "il/0", "ppo/1")
    names, model, (agents,) = chosen(None, place_of(tmp_path, form="Mine", recogniser="mine.py:Mine"))
    assert {"fixed-best", "nbv", "nbv-greedy", "nbv-search", "il/0", "ppo/1"} <= {*names}
    assert model is not None
    assert agents.startswith("left out: il-ppo, dagger: ")
    names, _, notes = chosen(None, place_of(None, form="Mine", recogniser="mine.py:Mine"))
    assert not [name for name in names if name.startswith(("fixed-best", "nbv", "il", "ppo", "dagger"))]
    assert [note.partition(" for this recogniser: expected th")[0].rpartition(": ")[2] for note in notes] == [
        "no fixed place was fitted",
        "no gain field was trained",
        "no agent was trained",
    ]
    assert all("--models DIR" in note for note in notes)


def test_who_is_named_has_to_be_trained(tmp_path: Path) -> None:
    save_agents(tmp_path, "il/0")
    for planners in (["il", "ppo"], ["il/1"], ["il-no-vision"]):
        with pytest.raises(ModelError, match=r"agent-.*\.safetensors: no such file: .*`ehar train agent --data X.npz"):
            chosen(planners, place_of(tmp_path))
    for options in ({"sensor": "estimator"}, {"views": "paper"}):
        with pytest.raises(ModelError, match=f"-{next(iter(options.values()))}-.*no such file"):
            chosen(["il"], place_of(tmp_path, **options))


@pytest.mark.parametrize("planners", [None, ["il"], ["il/0"]])
def test_an_agent_of_another_recogniser_is_never_passed_over(tmp_path: Path, planners: list[str] | None) -> None:
    save_agents(tmp_path, "il/0")
    with pytest.raises(ModelError, match="trained for another recogniser"):
        chosen(planners, place_of(tmp_path, recogniser_sha256="another"))


def test_the_belief_needs_a_gain_model_and_says_so_before_anything_else(tmp_path: Path) -> None:
    for planners in (None, ["no-act"]):
        notes: list[str] = []
        with pytest.raises(ModelError, match="expected a gain field"):
            choose_planners(planners, place_of(tmp_path), readout="belief", note=notes.append)
        assert notes == []
    save_field(tmp_path)
    names, model, _ = chosen(["no-act"], place_of(tmp_path), readout="belief")
    assert names == ["no-act"]
    assert model is not None
    save_field(tmp_path, recogniser="another")
    with pytest.raises(ModelError, match="trained for another recogniser"):
        chosen(["no-act"], place_of(tmp_path), readout="belief")


def test_a_gain_model_is_loaded_once_and_for_those_who_need_it_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_field(tmp_path)
    save_agents(tmp_path, "il/0")
    loaded: list[ModelPlace] = []
    original = ModelPlace.load_gain_model

    def load(place: ModelPlace) -> GainModel:
        loaded.append(place)
        return original(place)

    monkeypatch.setattr(ModelPlace, "load_gain_model", load)
    assert chosen(["no-act", "il", "oracle"], place_of(tmp_path))[1] is None
    assert loaded == []
    names, model, _ = chosen(["nbv", "nbv-greedy"], place_of(tmp_path), readout="belief")
    assert names == ["nbv", "nbv-greedy"]
    assert model is not None
    assert len(loaded) == 1


class Mine(NoAct):
    name = "il-ppo"


def own_agent(name: str) -> Agent:
    return Agent(name=name, network=untrained_agent().network)


@pytest.mark.parametrize(
    ("planners", "error", "message"),
    [
        (["il", "il/0"], UsageError, "expected each once, got 'il/0' twice"),
        (["il", "il"], UsageError, "'il/0' twice"),
        (["il", own_agent("il/1")], UsageError, "'il/1' twice"),
        (
            ["il/1", own_agent("il")],
            DataError,
            "'il': expected every record name with a training seed, or none",
        ),
        ([], UsageError, "got none"),
    ],
)
def test_two_planners_of_one_name_do_not_run(
    tmp_path: Path, planners: list[str | Planner], error: type[Exception], message: str
) -> None:
    save_agents(tmp_path, "il/0", "il/1")
    with pytest.raises(error, match=message):
        chosen(planners, place_of(tmp_path))


def test_instances_run_as_they_are(tmp_path: Path) -> None:
    mine, own = Mine(), own_agent("il/7")
    made, origins, _ = make_planners([mine, own, "no-act"], None, place_of(tmp_path))
    assert made[0] is mine
    assert made[1] is own, "its name is not taken for that of an agent to load"
    assert origins == {"il-ppo": Origin(f"{__name__}.Mine")}


def test_a_name_that_stands_for_a_shared_training_is_refused() -> None:
    mine = Mine()
    mine.name = "mine@2"
    with pytest.raises(UsageError, match=r"^planner 'mine@2': expected a name that does not end in @ and a number"):
        make_planners([mine, "no-act"])
    mine.name = "mine@2 m"
    assert make_planners([mine])[0][0] is mine


def test_learned_planners_without_a_place_are_refused() -> None:
    with pytest.raises(UsageError, match="planner 'il': expected a trained agent, got none"):
        make_planners(["no-act", "il"])


def test_names_are_checked_before_anything_is_loaded() -> None:
    assert listed(None) is None
    several = ["no-act", "nbv", "il", "il-ppo/3", "il-no-position", "own.py:Mine", Mine()]
    assert listed(several) == several
    assert listed("nbv") == ["nbv"]
    assert listed(several[-1]) == several[-1:], "one alone needs no list"
    for bad in ("il/x", "il-no-sound", "nbv/0"):
        with pytest.raises(UsageError, match=f"unknown planner '{bad}'"):
            listed(["no-act", bad])
    with pytest.raises(
        UsageError, match=r"expected what ehar.planner.Planner has, missing: name, privileged, reset, act"
    ):
        listed([object()])  # type: ignore[arg-type]
    with pytest.raises(UsageError, match=r"expected a planner, got the class Mine; make one: Mine\(\)$"):
        listed([Mine])  # type: ignore[list-item]
    with pytest.raises(UsageError, match=r"expected arguments as \(radius=5, turn='left'\)"):
        listed(["own.py:Mine(5)"])
