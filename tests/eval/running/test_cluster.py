"""A benchmark on a cluster of Ray: the same bytes as here, whatever machines die and come."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.conditions import Conditions
from ehar.errors import EpisodeError, ModelError, UsageError
from ehar.files import write_text
from ehar.planner import Observation
from ehar.processes import Engine, Processes
from ehar.runner import Runner
from ehar.sensors.registry import make_sensor
from eval.running import sweep
from eval.running.cluster import Cluster, engine_of
from eval.running.sweep import Stage, SweepConfig, train_sets
from eval.running.training import TrainAllConfig
from planners.heuristic import NoAct
from planners.value.collection import CollectionTask, run_batches
from tests.helpers.fakes import FakeRecogniser, tiny_data
from tests.helpers.tiny_benchmarks import Log, but_times, bytes_of, run

PLANNERS = ["no-act", "towards", "random", "oracle"]


@pytest.fixture(scope="module")
def machines() -> Iterator[Any]:
    """Return a cluster of two nodes on this machine, of one core each; the first cannot be killed."""
    pytest.importorskip("ray", reason="ray is not installed")
    from ray.cluster_utils import Cluster as Machines

    made = Machines(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    made.add_node(num_cpus=1)
    yield made
    made.shutdown()


@dataclass
class Disaster(Log):
    """Kills the second machine after three jobs, and adds a third after six."""

    machines: Any = None

    def advance(self, planner: str) -> None:
        super().advance(planner)
        if len(self.done) == 3:
            self.machines.remove_node(next(iter(self.machines.worker_nodes)), allow_graceful=False)
        if len(self.done) == 6:
            self.machines.add_node(num_cpus=1)


@pytest.mark.slow
@pytest.mark.usefixtures("fake_weights")
def test_machines_that_die_and_come_leave_the_same_bytes_as_one_process(machines: Any, tmp_path: Path) -> None:
    log = Disaster(machines=machines)
    run(PLANNERS, out=tmp_path / "cluster", engine="ray", address=machines.address, reporter=log)
    assert len(log.done) == log.jobs == 20
    assert len(machines.worker_nodes) == 1
    run(PLANNERS, out=tmp_path / "here")
    assert but_times(bytes_of(tmp_path / "cluster")) == but_times(bytes_of(tmp_path / "here"))


@pytest.mark.slow
@pytest.mark.usefixtures("fake_weights")
def test_what_a_planner_does_wrong_arrives_as_it_is(machines: Any) -> None:
    class Lost(NoAct):
        name = "lost"

        def act(self, observation: Observation) -> FloatArray:
            return observation.viewpoint * np.nan

    with pytest.raises(
        EpisodeError, match=r"^planner 'lost', episode 'sequence-\d+ from frame \d+', frame 0: "
    ) as error:
        run([Lost()], engine="ray", address=machines.address)
    assert "\n" not in str(error.value)


@pytest.mark.slow
def test_other_versions_of_packages_are_refused(machines: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eval.running.cluster.installed_versions", lambda: {"numpy": "1.0"})
    with pytest.raises(UsageError, match=rf"has numpy {np.__version__}, expected 1\.0, as on the machine that began"):
        list(Cluster(machines.address).each_batch(max, 3, [4]))


@pytest.mark.slow
def test_a_job_that_ends_its_process_each_time_ends_the_run(machines: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eval.running.cluster.LOST", 1)
    with pytest.raises(ModelError, match=r"^a job's process or machine has ended 2 times: expected it to finish"):
        list(Cluster(machines.address).each_batch(lambda status, _: os._exit(status), 3, [0]))


@pytest.mark.slow
def test_a_cluster_whose_head_ends_ends_the_run_in_one_line(machines: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eval.running.cluster.HEARD_EVERY", 0.1)
    monkeypatch.setattr("eval.running.cluster.SILENT", 0.6)
    jobs = Cluster(machines.address).each_batch(lambda _, seconds: time.sleep(seconds), None, [0, 60])
    next(jobs)
    monkeypatch.setattr("eval.running.cluster._wrong_at", lambda _: "Connection refused")
    with pytest.raises(ModelError, match=r"cluster at .*:\d+ to go on, got: Connection refused, for 1 s; what is done"):
        next(jobs)


@pytest.mark.slow
def test_stages_on_a_cluster_hand_out_their_jobs_and_hold_no_core_meanwhile(machines: Any) -> None:
    """As many stages as cores, each of which waits for jobs; and a stage that begins after another one."""

    def stage(inside: Cluster, number: int) -> int:
        return sum(result for _, result in inside.each_batch(pow, number, [1, 2]))

    def follow(number: int, result: int) -> list[int]:
        return [5] if number == 4 else []

    machine = Cluster(machines.address)
    assert dict(machine.each_batch(stage, machine, [2, 3, 4], follow)) == {2: 6, 3: 12, 4: 20, 5: 30}


@pytest.mark.slow
def test_stages_whose_machine_dies_go_on_elsewhere_from_the_files_that_they_left(machines: Any, tmp_path: Path) -> None:
    killed = tmp_path / "killed"

    def job(number: int, power: int) -> int:
        """Compute; one job is at work when the machine dies."""
        while (number, power) == (5, 1) and not killed.exists():
            time.sleep(0.02)
        return int(number**power)

    def stage(inside: Cluster, number: int) -> int:
        """Keep the result of each job, as trainings do."""
        kept = {power: tmp_path / f"{number}-{power}" for power in (1, 2, 3)}
        for power, result in inside.each_batch(job, number, [one for one in kept if not kept[one].exists()]):
            write_text(kept[power], [str(result)])
        return sum(int(path.read_text()) for path in kept.values())

    machine, done = Cluster(machines.address), dict[int, int]()
    for number, result in machine.each_batch(stage, machine, [2, 3, 4, 5]):
        if not done:
            machines.remove_node(next(iter(machines.worker_nodes)), allow_graceful=False)
            killed.touch()
        done[number] = result
    machines.add_node(num_cpus=1)
    assert done == {number: number + number**2 + number**3 for number in (2, 3, 4, 5)}


@pytest.mark.slow
def test_what_ray_says_of_machines_does_not_stand_amid_a_table() -> None:
    pytest.importorskip("ray", reason="ray is not installed")
    said = "dict(lines=['dead'], pid='raylet', is_err=False)"  # as Ray's listener prints it
    code = "from eval.running.cluster import Cluster; Cluster(); import ray._private.worker as ray; "
    code += f"ray.print_to_stdstream({said}, ignore_prefix=False)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == ""


@pytest.mark.slow
def test_a_training_whose_machine_dies_ends_in_the_same_weights(machines: Any, tmp_path: Path) -> None:
    """The other machine is busy until then, so it is known which of them trains."""
    import ray

    killed, busy = tmp_path / "killed", tmp_path / "busy"
    here = TrainAllConfig(
        conditions=Conditions(data=tiny_data(sequences=40), length=5), out=tmp_path / "here", setting="tiny"
    )
    there = replace(here, out=tmp_path / "there")

    def keep_busy() -> None:
        busy.touch()
        while not killed.exists():
            time.sleep(0.05)

    def kill() -> None:
        while not list(there.out.glob("*.checkpoint")):
            time.sleep(0.01)
        machines.remove_node(next(iter(machines.worker_nodes)), allow_graceful=False)
        killed.touch()

    def train(engine: Engine, config: TrainAllConfig) -> bytes:
        task = sweep._Task({"tiny": config}, engine, tmp_path)
        ((_, end),) = engine.each_batch(sweep.run_stage, task, [Stage("tiny", "recogniser")])
        assert end.error == ""
        (weights,) = config.out.glob("*.safetensors")
        return weights.read_bytes()

    ray.init(machines.address, log_to_driver=False)
    try:
        ray.remote(num_cpus=1, resources={"node:__internal_head__": 0.1})(keep_busy).remote()
        while not busy.exists():
            time.sleep(0.01)
        with ThreadPoolExecutor(1) as pool:
            killing = pool.submit(kill)
            trained = train(Cluster(machines.address), there)
            killing.result()
    finally:
        killed.touch()
        ray.shutdown()
        machines.add_node(num_cpus=1)
    assert trained == train(Processes(1), here)


@pytest.mark.slow
def test_a_cluster_without_room_says_so(machines: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    import ray
    from ray.exceptions import OutOfDiskError

    def full(_: object) -> None:
        raise OutOfDiskError("a\nlong\nstory")

    monkeypatch.setattr(ray, "put", full)
    with pytest.raises(UsageError, match=r"^engine ray: 0 MB for all jobs cannot be put where .*: OutOfDiskError; is"):
        list(Cluster(machines.address).each_batch(max, 3, [4]))


@pytest.mark.slow
def test_a_sweep_on_a_cluster_goes_on_where_a_set_fails(
    machines: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("eval.running.sweep.step_seconds", lambda _: 0.5)
    sets = tuple(replace(tiny_data(sequences=40), name=name) for name in ("one", "two"))
    for name in ("one", "two"):
        write_text(tmp_path / name / "causal-perfect-moving.json", ["damaged"])
        write_text(tmp_path / name / "causal-perfect-moving.safetensors", ["damaged"])
    told = SweepConfig(
        conditions=Conditions(length=10), data=sets, out=tmp_path, engine="ray", address=machines.address
    )
    trained = train_sets(told)
    assert trained.failed
    assert [line.partition(" failed: ")[0] for line in sorted(trained.lines)[1:]] == [
        "one, recogniser",
        "two, recogniser",
    ]
    assert min(trained.lines) == "left out, as they need these: 16 stages"


@pytest.mark.slow
def test_rollouts_for_trainings_are_the_same_on_a_cluster(machines: Any) -> None:
    data = tiny_data(sequences=40)
    runner = Runner(data, FakeRecogniser(), make_sensor("estimator", data))
    task = CollectionTask(runner=runner, sequences=np.arange(6), length=10, pairs=np.array([[1, 2]]), seed=3)
    ((_, there),) = run_batches(task, [1], engine=Cluster(machines.address))
    ((_, here),) = run_batches(task, [1])
    for name, values in vars(here).items():
        np.testing.assert_array_equal(values, getattr(there, name))


def test_an_address_where_nobody_answers_is_refused_at_once() -> None:
    pytest.importorskip("ray", reason="ray is not installed")
    with pytest.raises(
        UsageError, match=r"^address 127\.0\.0\.1:1: expected a Ray cluster that answers, got: Connection"
    ):
        list(Cluster("127.0.0.1:1").each_batch(max, 3, [4]))


def test_engines_that_there_are_not_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    assert engine_of("processes", None, 2) == Processes(2)
    with pytest.raises(UsageError, match=r"^unknown engine 'steam'; expected processes or ray$"):
        engine_of("steam", None, 2)
    with pytest.raises(UsageError, match=r"^address auto: expected none with engine processes; engine ray has one$"):
        engine_of("processes", "auto", 2)
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(UsageError, match=r"^engine ray: Ray is not installed: pip install -e '\.\[cluster\]'$"):
        engine_of("ray", None, 2)
