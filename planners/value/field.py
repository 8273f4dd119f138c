"""The gain field: the recognition gained by looking from a viewpoint, given what is known of an episode."""

from dataclasses import dataclass

import numpy as np

from ehar.arrays import FloatArray, in_brief
from ehar.errors import ModelError
from planners.value.situation import PARTS, Situation
from planners.value.view_basis import BASIS_SIZE, turned


@dataclass(frozen=True, eq=False, repr=False)
class GainField:
    r"""A function on the sphere whose shape depends on the situation.

    .. math:: g(v; c) = \Phi(v)^T A^T f(c) + \Phi(v - r_c)^T R^T f(c)

    with the basis :math:`\Phi` of `planners.value.view_basis`, and the features f of `Situation.features` after a
    constant 1. A counts azimuths as they are. R counts them from the reference r_c, the direction that people face. If
    everybody in a data set faces the same way, A knows that before anybody has been seen. The expected gain of a path,
    in the mean probability of the true class over the frames to come, is

    .. math:: \sum_f \gamma_f g(v_f; c) - \beta |\sum_f \gamma_f u_f|^2

    with the weights of `frame_gains` and the unit vectors u towards the camera. The last term is there because views
    that spread tell more than the same view again. Only differences between paths have a meaning.

    Where something is in the way at times, a view counts as far as it shows people, by the share :math:`s_f`:

    .. math:: \sum_f \gamma_f s_f g(v_f; c) + \beta ((\sum_f \gamma_f s_f)^2 - |\sum_f \gamma_f s_f u_f|^2)

    and the weight of the basis' first function, which is constant, says what it is worth to see people at all.

    Args:
        parts: the parts of the situation that the field depends on; without "facing" there is no R.
        absolute: (1 + F, 21) A, for the constant and the features of the parts in the order of `PARTS`.
        relative: (1 + F, 21) R; zeros without "facing".
        spread: beta, at least 0.

    Raises:
        ModelError: a part is unknown, a shape is wrong, a number is not finite, or the spread is negative.
    """

    parts: tuple[str, ...]
    absolute: FloatArray
    relative: FloatArray
    spread: float

    __repr__ = in_brief

    @property
    def knows_hidden(self) -> bool:
        """Whether it knows what it is worth to see people: it was learned where something was in the way at times."""
        return bool(self.absolute[:, 0].any() or self.relative[:, 0].any())

    def __post_init__(self) -> None:
        """Check parts, shapes and numbers."""
        unknown = [part for part in self.parts if part not in PARTS]
        if unknown:
            raise ModelError(f"gain field: expected parts among {', '.join(PARTS)}, got {', '.join(unknown)}")
        shape = self.absolute.shape
        if shape != self.relative.shape or len(shape) != 2 or shape[0] == 0 or shape[1] != BASIS_SIZE:
            raise ModelError(
                f"gain field: expected two matrices (1 + features, {BASIS_SIZE}), got {shape} and {self.relative.shape}"
            )
        for weights in (self.absolute, self.relative):
            if not np.isfinite(weights).all():
                raise ModelError(f"gain field: expected finite weights, got {weights[~np.isfinite(weights)][0]}")
        if not 0 <= self.spread < np.inf:
            raise ModelError(f"gain field: expected a finite spread of at least 0, got {self.spread}")

    def weights(self, situation: Situation, beliefs: FloatArray | None = None) -> FloatArray:
        """Return the weights (B, 21) of the view basis, with azimuths as they are, for `view_basis.field_value`.

        Args:
            situation: the situation.
            beliefs: (E, B, K), beliefs in place of the situation's own, for weights (E, B, 21).

        Raises:
            ModelError: the situation has other features than the field was trained with.
        """
        columns = feature_matrix(situation, self.parts, beliefs)
        if columns.shape[-1] != len(self.absolute):
            raise ModelError(
                f"gain field: expected {len(self.absolute) - 1} features of {', '.join(self.parts)}, "
                f"got {columns.shape[-1] - 1}: was it trained for other classes, persons or another recogniser?"
            )
        return columns @ self.absolute + turned(columns @ self.relative, -situation.reference)


def feature_matrix(situation: Situation, parts: tuple[str, ...], beliefs: FloatArray | None = None) -> FloatArray:
    """Return a constant 1 and the features of some parts side by side, (B, 1 + F).

    Args:
        situation: the situation.
        parts: which parts.
        beliefs: (E, B, K), beliefs in place of the situation's own, for features (E, B, 1 + F).
    """
    features = situation.features("facing" in parts)
    if beliefs is not None:
        features["belief"] = beliefs
    columns = [features[part] for part in PARTS if part in parts and part in features]
    before = features["belief"].shape[:-1]
    return np.concatenate(
        [np.ones((*before, 1)), *(np.broadcast_to(c, (*before, c.shape[-1])) for c in columns)], axis=-1
    )
