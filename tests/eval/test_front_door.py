"""What `eval` offers at its top: functions, each imported when it is asked for."""

import pytest

import eval as ours
from eval.conformance.planner import check_planner
from eval.conformance.recogniser import check_recogniser
from eval.running.benchmark import benchmark
from eval.studies.headroom import headroom


@pytest.mark.parametrize("function", [benchmark, headroom, check_planner, check_recogniser])
def test_a_function_is_found_where_its_module_was_imported_before(function: object) -> None:
    assert getattr(ours, function.__name__) is function


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'eval' has no attribute 'benchmrk'"):
        _ = ours.benchmrk
