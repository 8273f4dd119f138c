"""The settings of agents' training; there is no torch in this module, so the command line can show them at once."""

import importlib.util
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, get_args

from ehar.conditions import Conditions, Form
from ehar.errors import UsageError
from ehar.files import check_folder
from ehar.processes import cores
from ehar.track import IDEAL
from recognition.devices import check_device

Stage = Literal["il", "ppo", "il-ppo", "dagger"]
Teacher = Literal["oracle", "oracle-lookahead"]
Labels = Literal["best", "soft"]
Scale = Literal["quick", "paper"]
Left = Literal["none", "recognition", "vision", "position", "embedding", "log-probs", "time"]
STAGES: tuple[Stage, ...] = get_args(Stage)
PAPER_STAGES: tuple[Stage, ...] = ("il", "ppo", "il-ppo")  # Tables 1 and 2: IL only, PPO only, ours
LEAST_LENGTH = 3  # least frames of an episode
LEAST_LOOKAHEAD = 5  # least frames of an episode with the look-ahead teacher, which is not asked in shorter ones


@dataclass(frozen=True, kw_only=True)
class ImitationSetting:
    """The settings of imitation; the defaults are the paper's, except for the number of episodes.

    Args:
        teacher: oracle tries the 7 moves on the next frame; oracle-lookahead repeats each of them for 15 frames.
        labels: best is the teacher's best move; soft is the worth of each of the 7 moves according to the teacher.
        episodes: number of demonstrated episodes, in all rounds together.
        rounds: number of rounds. In the first the teacher acts, or a wanderer if the teacher only tries moves. In later
            rounds the agent cloned so far acts, and the teacher says what it should have done (DAgger). 1 is plain
            cloning.
        epochs: number of passes over the demonstrations, at most.
        patience: number of epochs without a smaller loss on held-out demonstrations after which it ends.
        batch: number of frames of a gradient step.
        learning_rate: learning rate at the start; it falls linearly.
        entropy: weight of the policy's entropy with soft labels, in standard deviations of a move's worth.
        per_seed: whether each training seed draws demonstrations of its own.
    """

    teacher: Teacher = "oracle"
    labels: Labels = "best"
    episodes: int = 1536
    rounds: int = 1
    epochs: int = 20
    patience: int = 5
    batch: int = 256
    learning_rate: float = 1e-3
    entropy: float = 0.2
    per_seed: bool = False


DAGGER = ImitationSetting(teacher="oracle-lookahead", labels="soft", rounds=2)
PAPER_IMITATION = ImitationSetting(
    episodes=10_000,  # Sec. 4.2: "10k trajectories of oracle"
    per_seed=True,  # Table 1: "5 independent training runs with different seeds"
    epochs=20,  # a guess: the most
    patience=5,  # a guess
    batch=256,  # a guess
    learning_rate=1e-3,  # a guess
)
VARIATIONS = 3  # variations of each sequence of the policy part, in the quick setting
STREAM_EPISODES = 384  # demonstrated episodes of streams, each several times as long as a clip


@dataclass(frozen=True, kw_only=True)
class PPOSetting:
    """The settings of policy optimisation; the defaults were chosen by comparison on validation scenarios.

    Args:
        frames: number of environment frames, at most.
        evaluate_every: number of frames from one evaluation on held-out episodes to the next.
        patience: number of evaluations without a better one after which it ends.
        num_envs: number of episodes of a rollout.
        epochs: number of passes over each rollout.
        minibatches: number of minibatches of each pass.
        learning_rate: learning rate at the start; it falls linearly.
        clip: clip range of the probability ratio.
        entropy: weight of the entropy bonus.
        gamma: discount of one decision, which is held for `hold` frames.
        gae_lambda: lambda of the generalised advantage estimate.
        critic_rollouts: number of rollouts at the beginning of a fine-tuning in which only the critic learns.
        hindsight: whether the critic sees the label in training; the actor never does.
        hold: number of frames for which a drawn move is repeated. The move of a single frame changes too little for a
            reward to tell which move was good.
        hold_s: how long a drawn move is repeated instead [s]; None counts frames.
        copies: number of episodes that differ only in the moves, and are rewarded relative to each other.
    """

    frames: int = 600_000
    evaluate_every: int = 30_000
    patience: int = 5
    num_envs: int = 256
    epochs: int = 4
    minibatches: int = 8
    learning_rate: float = 5e-4
    clip: float = 0.2
    entropy: float = 0.005
    gamma: float = 0.8
    gae_lambda: float = 0.9
    critic_rollouts: int = 0
    hindsight: bool = True
    hold: int = 5
    hold_s: float | None = None
    copies: int = 8

    def at(self, fps: float) -> "PPOSetting":
        """Return the setting with all holds in frames, at so many frames per second."""
        return self if self.hold_s is None else replace(self, hold=max(1, round(self.hold_s * fps)), hold_s=None)


# In streams an episode is several times as long as a clip, and shows several activities.
STREAM_PPO = PPOSetting(frames=2_400_000, evaluate_every=120_000, num_envs=128)
# A vehicle takes a second to get anywhere. So there are fewer decisions, and each update has to learn more of them.
FLOWN_PPO = replace(STREAM_PPO, evaluate_every=60_000, learning_rate=2e-3, hold_s=1.0)
PAPER_PPO = PPOSetting(
    frames=10_000_000,  # a guess: the most
    evaluate_every=250_000,  # a guess
    patience=8,  # a guess
    num_envs=64,  # a guess
    epochs=4,  # a guess
    minibatches=4,  # a guess
    learning_rate=5e-4,  # a guess
    clip=0.2,  # a guess
    entropy=0.005,  # a guess: Sec. 4.2 names an "action entropy loss", without its weight
    gamma=0.99,  # a guess
    gae_lambda=0.95,  # a guess
    critic_rollouts=3,  # a guess
    hindsight=False,  # Fig. 4: actor and critic see the same state s_t
    hold=1,  # Sec. 3: "at each time step, the agent chooses"
    copies=1,  # Sec. 4.2: the rewards of Eq. 1 as they are
)
PAPER_VIEWS = "paper"  # Sec. 4.2: 32 static positions
PAPER_FORM: Form = "ctrgcn"  # Sec. 4.1


def check_seeds(seeds: Sequence[int]) -> None:
    """Raise a UsageError unless these are the names of training seeds, each once."""
    named = isinstance(seeds, Sequence) and all(type(seed) is int and seed >= 0 for seed in seeds)
    if not named or not seeds or len(set(seeds)) < len(seeds):
        got = " ".join(map(str, seeds)) if isinstance(seeds, Sequence) else repr(seeds)
        raise UsageError(f"--seeds: got {got or 'none'}, expected whole numbers of at least 0, each once")


@dataclass(frozen=True, kw_only=True)
class AgentTrainingConfig:
    """The settings of agents' training.

    Stages: il clones the oracle, ppo starts from scratch, and il-ppo starts from the agent of il. dagger clones the
    worth of moves, in states that the agent reaches itself. All train on recorded motion and on variations of it:
    mirrored, or with another pace and size. Training seeds share the demonstrations. `paper` is the paper: agents that
    see the published network, trained on 32 static views; 10,000 demonstrations drawn for each seed; no variations, no
    held moves, no copies, and a critic that sees what the actor sees. What the paper does not say is marked a guess.

    In streams, episodes are windows of 8 s, or as long as the conditions say, and no agent is told the time. With a
    vehicle as the conditions' track, teachers and agents fly.

    Args:
        conditions: conditions of the episodes, and the recogniser.
        out: folder to write to.
        stages: agents to train, with commas between them; None is all four, or the paper's three in paper.
        seeds: the training seeds, by name: 7 8 9; each gives one agent.
        without: what is left out (Table 3): il-no-vision.
        setting: quick, for 2 CPU cores; paper, as published, for a GPU; it takes --views paper --form ctrgcn.
        teacher: the teacher that il clones.
        labels: labels for il: the best move, or each move's worth (soft).
        rounds: rounds of il; from the second on, the agent acts.
        episodes: demonstrated episodes; None is 1,536, of streams 384, or 10,000 in paper.
        frames: most frames of PPO; None is 600,000, of streams 2.4 million, or 10 million in paper.
        variations: variations of each sequence; None is 3, or 0 in paper.
        workers: processes; results do not depend on them.
        device: cpu or cuda, for PPO and our recogniser.
        tensorboard: folder for TensorBoard's logs.
    """

    conditions: Conditions
    out: Path | None = None
    stages: str | None = None
    seeds: tuple[int, ...] = (0,)
    without: Left = "none"
    setting: Scale = "quick"
    teacher: Teacher = ImitationSetting.teacher
    labels: Labels = ImitationSetting.labels
    rounds: int = ImitationSetting.rounds
    episodes: int | None = None
    frames: int | None = None
    variations: int | None = None
    workers: int = field(default_factory=cores)
    device: str = "cpu"
    tensorboard: Path | None = None

    @property
    def directory(self) -> Path:
        """Where agents are written to.

        Raises:
            UsageError: neither `models` nor `out` names a folder.
        """
        directory = self.out or self.conditions.directory
        if directory is None:
            raise UsageError("train agent: expected --models DIR, or --out DIR where the shipped recogniser is used")
        return directory

    @property
    def stage_names(self) -> tuple[Stage, ...]:
        """The stages, in the order in which they follow each other.

        Raises:
            UsageError: one is unknown.
        """
        if self.stages is None:
            return STAGES if self.setting == "quick" else PAPER_STAGES
        named = self.stages.split(",")
        for name in named:
            if name not in STAGES:
                raise UsageError(f"--stages {self.stages}: expected some of {','.join(STAGES)}, got {name!r}")
        return tuple(stage for stage in STAGES if stage in named)

    def check(self) -> None:
        """Raise a UsageError if an option makes no sense, or needs something that is missing."""
        told = self.conditions
        if self.setting == "paper" and (told.recogniser, told.views, told.form) != (None, PAPER_VIEWS, PAPER_FORM):
            own = "" if told.recogniser is None else " and your own recogniser"
            raise UsageError(
                f"--setting paper: expected the paper's recogniser, --views {PAPER_VIEWS} --form {PAPER_FORM}, "
                f"got --views {told.views} --form {told.form}{own}"
            )
        if told.in_streams:
            for option, refused in (
                (f"--setting {self.setting}", self.setting == "paper"),
                ("--without time", self.without == "time"),
            ):
                if refused:
                    raise UsageError(f"{option}: expected trimmed sequences, got streams")
        _ = self.directory
        stages = self.stage_names
        check_seeds(self.seeds)
        least = {"workers": 1, "episodes": 1, "rounds": 1, "frames": 1, "variations": 0}
        looks_ahead = any(stage != "ppo" and self.imitation(stage).teacher == "oracle-lookahead" for stage in stages)
        held = vars(self) | {"length": self.conditions.frames}
        least["length"] = LEAST_LOOKAHEAD if looks_ahead else LEAST_LENGTH
        for name, bound in least.items():
            value = held[name]
            if value is not None and value < bound:
                raise UsageError(f"--{name}: got {value}, expected at least {bound}")
        check_device(self.device)
        if self.tensorboard is not None and importlib.util.find_spec("tensorboard") is None:
            raise UsageError(f"--tensorboard {self.tensorboard}: expected TensorBoard to be installed, it is not")
        if self.tensorboard is not None:
            check_folder(self.tensorboard)

    def imitation(self, stage: Stage) -> ImitationSetting:
        """Return the imitation setting of a stage: `dagger` has its own, `il` and `il-ppo` have the one asked for."""
        usual = ImitationSetting() if self.setting == "quick" else PAPER_IMITATION
        usual_episodes = STREAM_EPISODES if self.conditions.in_streams else usual.episodes
        episodes = usual_episodes if self.episodes is None else self.episodes
        if stage == "dagger":
            return replace(DAGGER, episodes=episodes, per_seed=usual.per_seed)
        return replace(usual, teacher=self.teacher, labels=self.labels, rounds=self.rounds, episodes=episodes)

    @property
    def variations_of_each(self) -> int:
        """The number of variations of each sequence that are trained on beside it."""
        default = VARIATIONS if self.setting == "quick" else 0
        return default if self.variations is None else self.variations

    @property
    def ppo(self) -> PPOSetting:
        """The setting of policy optimisation, with the number of frames asked for."""
        flown = self.conditions.track != IDEAL
        quick = (FLOWN_PPO if flown else STREAM_PPO) if self.conditions.in_streams else PPOSetting()
        chosen = quick if self.setting == "quick" else PAPER_PPO
        return chosen if self.frames is None else replace(chosen, frames=self.frames)
