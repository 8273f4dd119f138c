"""A benchmark on a cluster of Ray: the same bytes as here, whatever machines die and come."""

import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.errors import EpisodeError, ModelError, UsageError
from ehar.planner import Observation
from ehar.processes import Processes
from eval.running.cluster import Cluster, engine_of
from planners.heuristic import NoAct
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
    with pytest.raises(UsageError, match=r"^engine ray: Ray is not installed: pip install ehar\[cluster\]$"):
        engine_of("ray", None, 2)
