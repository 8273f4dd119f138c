"""Localisation: how well and how soon it is known where people are, and the centre that follows them."""

from ehar.localisation.following import USUAL_LOCALISATION as USUAL_LOCALISATION
from ehar.localisation.following import CentreLimits as CentreLimits
from ehar.localisation.following import CentreMotion as CentreMotion
from ehar.localisation.following import FollowedCentre as FollowedCentre
from ehar.localisation.following import Localisation as Localisation
from ehar.localisation.following import SmoothCentre as SmoothCentre
from ehar.localisation.following import smoothed as smoothed
