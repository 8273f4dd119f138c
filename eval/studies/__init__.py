"""Studies: each answers a question about data, a belief, or finished runs."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from eval.studies.behaviour.analysis import Analysis as Analysis
    from eval.studies.belief.stream_report import StreamBeliefReport as StreamBeliefReport
    from eval.studies.belief.study import BeliefReport as BeliefReport
    from eval.studies.compare_table import Comparison as Comparison
    from eval.studies.deciding.deciding import Deciding as Deciding
    from eval.studies.explanation import Explanation as Explanation
    from eval.studies.folds import Folds as Folds
    from eval.studies.headroom.study import Headroom as Headroom
    from eval.studies.learning import LearningCurve as LearningCurve
    from eval.studies.overview import RunOverview as RunOverview
    from eval.studies.published import PublishedReport as PublishedReport
    from eval.studies.real_views.study import RealViewsReport as RealViewsReport
    from eval.studies.trainings import Trainings as Trainings
    from eval.studies.trials.study import TrialsReport as TrialsReport
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "Headroom": "eval.studies.headroom.study",
            "BeliefReport": "eval.studies.belief.study",
            "Deciding": "eval.studies.deciding.deciding",
            "Explanation": "eval.studies.explanation",
            "Folds": "eval.studies.folds",
            "Analysis": "eval.studies.behaviour.analysis",
            "Comparison": "eval.studies.compare_table",
            "LearningCurve": "eval.studies.learning",
            "PublishedReport": "eval.studies.published",
            "RealViewsReport": "eval.studies.real_views.study",
            "RunOverview": "eval.studies.overview",
            "StreamBeliefReport": "eval.studies.belief.stream_report",
            "Trainings": "eval.studies.trainings",
            "TrialsReport": "eval.studies.trials.study",
        },
    )
