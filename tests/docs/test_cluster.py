"""The job files of the page on clusters: they are parsed, and the commands in them are commands."""

import re
import shlex
import subprocess
from typing import Any

import pytest

from eval.cli.main import parse
from tests.helpers.pages import DOCS
from tests.helpers.places import ROOT

PAGE = (DOCS / "cluster.md").read_text()


def block(language: str) -> str:
    (found,) = re.findall(rf"^```{language}\n(.*?)^```", PAGE, flags=re.DOTALL | re.MULTILINE)
    return str(found)


def test_the_slurm_script_starts_a_benchmark_on_all_of_its_machines() -> None:
    script = block("bash")
    subprocess.run(["bash", "-n"], input=script, text=True, check=True)
    told = dict(re.findall(r"^#SBATCH --([a-z-]+)=(\S+)$", script, flags=re.MULTILINE))
    (line,) = [line for line in script.replace("\\\n", " ").splitlines() if line.startswith("srun")]
    starting, _, command = line.partition(" -- ")
    assert told["ntasks-per-node"] == "1"
    for option, value in (("nodes", told["nodes"]), ("ntasks", told["nodes"]), ("num-cpus", told["cpus-per-task"])):
        assert f"--{option}={value} " in f"{starting} "
    assert f"--min-nodes {told['nodes']} " in starting
    assert callable(parse(shlex.split(command)[1:]))


def test_the_options_of_ray_are_its_options() -> None:
    pytest.importorskip("ray", reason="ray is not installed")
    from ray.scripts.symmetric_run import symmetric_run

    known = {option for parameter in symmetric_run.params for option in parameter.opts}
    assert {"--address", "--min-nodes"} <= known


def test_the_kubernetes_job_runs_a_benchmark_with_the_pinned_ray() -> None:
    yaml = pytest.importorskip("yaml", reason="PyYAML comes with mkdocs, of ehar[docs]")
    job: dict[str, Any] = yaml.safe_load(block("yaml"))
    assert (job["apiVersion"], job["kind"]) == ("ray.io/v1", "RayJob")
    assert callable(parse(shlex.split(job["spec"]["entrypoint"])[1:]))
    cluster = job["spec"]["rayClusterSpec"]
    assert f"ray=={cluster['rayVersion']}\n" in (ROOT / "constraints.txt").read_text()
    head, workers = cluster["headGroupSpec"], cluster["workerGroupSpecs"][0]
    volumes = {volume["name"] for volume in head["template"]["spec"]["volumes"]}
    assert {mount["name"] for mount in head["template"]["spec"]["containers"][0]["volumeMounts"]} == volumes
    assert workers["minReplicas"] <= workers["replicas"] <= workers["maxReplicas"]
