"""The two sentences that end a benchmark: what was found, and how sure it is. A pure function of the summary."""

from collections.abc import Sequence
from typing import NamedTuple

from eval.scores.differences import excludes_zero
from eval.scores.planner_summary import NO_ACT, ORACLE, PlannerSummary
from eval.scores.resampling.statistics import Interval
from eval.scores.summary import Summary

_NAMED = 3  # planners that a sentence lists by name; more are counted


class _Rival(NamedTuple):
    """Another planner without the truth: the difference to it [points] and its corrected interval."""

    name: str
    difference: float
    ends: Interval | None

    @property
    def clear(self) -> bool:
        return self.ends is not None and excludes_zero(self.ends)


def closing_sentences(summary: Summary) -> str:
    """Return two sentences: what the run found, and how sure that is."""
    return f"{_found(summary)} {_sure(summary)}"


def _found(summary: Summary) -> str:
    """Return what the run found."""
    planners = {planner.name: planner for planner in summary.planners}
    no_act = planners.get(NO_ACT)
    if summary.lead is None:
        if no_act is None:
            return "Only planners that are handed the truth ran, so there is nobody to compare."
        right = _accuracy(no_act, summary)
        return f"Only {NO_ACT} ran without the truth, and is right in {right}: there is nothing to compare."
    lead = planners[summary.lead]
    rivals = _rivals(summary, lead.name)
    if no_act is not None and lead.acc_mean < no_act.acc_mean:
        clear = any(rival.name == NO_ACT and rival.clear for rival in rivals)
        return (
            f"No planner beats a camera that stays: the best, {lead.name}, is {no_act.acc_mean - lead.acc_mean:.1f} "
            f"points below {NO_ACT}, {'and clearly so' if clear else 'though not clearly'}."
        )
    others = len([one for one in summary.planners if not one.privileged]) - 1
    if len(rivals) < others and summary.no_intervals is None and not any(rival.clear for rival in rivals):
        # A leader that is level with a planner which was compared with everybody: that planner's standing says more.
        # Not that of a camera that stays: it is compared with everybody where nobody else is, and has found nothing.
        compared = [
            one for one in planners.values() if one.name != NO_ACT and len(_rivals(summary, one.name)) == others
        ]
        lead = max(compared, key=lambda one: one.acc_mean, default=lead)
        rivals = _rivals(summary, lead.name)
    standing = _standing(lead.name, rivals, others, summary)
    if lead.gap_closed is not None:
        ends = lead.gap_closed_ci95
        interval = "" if ends is None else f" [{100 * ends[0]:.0f}, {100 * ends[1]:.0f}]"
        return f"{lead.name} closes {100 * lead.gap_closed:.0f} % of the gap to the oracle{interval}{standing}."
    if {NO_ACT, ORACLE} <= planners.keys():
        return (
            f"There is no gap to close, as the oracle is no better than {NO_ACT}; {lead.name} is right in "
            f"{_accuracy(lead, summary)}{standing}."
        )
    return f"{lead.name} is right in {_accuracy(lead, summary)}{standing}."


def _accuracy(planner: PlannerSummary, summary: Summary) -> str:
    """Return the mean accuracy over frames, in streams over those of activities, and its interval, in percent."""
    ends = planner.acc_mean_ci95
    interval = "" if ends is None else f" [{ends[0]:.1f}, {ends[1]:.1f}]"
    of_what = "all frames" if summary.activities is None else "the frames of a mean activity"
    return f"{planner.acc_mean:.1f} % of {of_what}{interval}"


def _rivals(summary: Summary, name: str) -> list[_Rival]:
    """Return the planners that one was compared with; differences are its accuracy minus theirs."""
    rivals = []
    for pair in summary.differences:
        ends = pair.ci95_corrected
        if pair.planner == name:
            rivals.append(_Rival(pair.other, pair.acc_mean, ends))
        elif pair.other == name:
            turned = None if ends is None else (-ends[1], -ends[0])
            rivals.append(_Rival(pair.planner, -pair.acc_mean, turned))
    return rivals


def _standing(name: str, rivals: Sequence[_Rival], others: int, summary: Summary) -> str:
    """Return how a planner stands to the others without the truth, after what it reached."""
    if not others:
        return "; no other planner without the truth ran"
    planners = {one.name: one for one in summary.planners if not one.privileged}
    level = [one.name for one in planners.values() if one.name != name and one.acc_mean == planners[name].acc_mean]
    most = f", as often as {_listed(level)}" if level else ", more than any other planner without the truth"
    if summary.no_intervals is not None:
        return most
    if not rivals:
        return f"{most}, but no pair was tested"
    above = [rival.name for rival in rivals if rival.clear and rival.difference > 0]
    level = [rival.name for rival in rivals if rival.name not in above]
    every = len(rivals) == others
    if not level:
        of_whom = "every other planner without the truth" if every else _listed(above)
        return f" and is clearly above {of_whom}"
    if not above:
        of_whom = "any other planner without the truth" if every and others > 1 else _listed(level)
        return f", but is not clearly above {of_whom}"
    return f" and is clearly above {_listed(above)}, but not above {_listed(level)}"


def _listed(names: Sequence[str]) -> str:
    """Return names as a list for people; the last ones are counted if they are many."""
    shown = list(names) if len(names) <= _NAMED + 1 else [*names[:_NAMED], f"{len(names) - _NAMED} others"]
    return shown[0] if len(shown) == 1 else f"{', '.join(shown[:-1])} and {shown[-1]}"


def _sure(summary: Summary) -> str:
    """Return how sure the finding is."""
    if summary.no_intervals is not None:
        return f"How sure that is cannot be said: {summary.no_intervals}."
    basis, config = summary.basis, summary.config
    only = "only " if basis.few and basis.of_people else ""
    if config.trainings:
        more = ": other people may move them by more" if basis.few else ""
        return f"The intervals rest on {only}{basis.text} and on {config.parts} of the recogniser{more}."
    movers = "other people or another training" if basis.few else "another training"
    of_each = ", another one in each fold" if config.folds else ""
    return (
        f"The intervals rest on {only}{basis.text} and on one training of the recogniser{of_each}: {movers} may move "
        "them by more."
    )
