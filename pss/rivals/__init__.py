"""Other metrics for camera configurations, from the literature, for comparison with PSS.

`Metric.status` states how well a formula is verified: "read" in its source, "checked" numerically besides, or "after" a
source of which only the abstract was read. `Metric.unobservable` states how a metric counts unobservable points. Those
whose sources do not define it exist twice: by their own convention (∞ as soon as there is one), and as NAME-count-zero,
the mean of 1/σ in which such points count zero (Eq. 10; higher is better). "e-optimality-count-zero" is then identical
to "pss-single-frame".

Expect near ties: quantisation volume, worst diagonal, GDOP, A-, D- and E-optimality, the planar estimator and the pair
of bearings all depend on distances and angles, and are strongly correlated where R is fixed. With R = I and one zoom,
the quantisation volume ranks configurations as D-optimality does, GDOP and the planar estimator nearly as A-optimality,
the worst diagonal nearly as E-optimality; volumes and worst directions agree least.
"""

from __future__ import annotations

from pss.metric.table import Metric
from pss.rivals.ablations import ABLATIONS
from pss.rivals.angles import ANGLE_METRICS
from pss.rivals.covariance import COVARIANCE_METRICS
from pss.rivals.coverage import COVERAGE_METRICS
from pss.rivals.entropy import ENTROPY_METRICS
from pss.rivals.nulls import NULL_METRICS
from pss.rivals.occlusion import OCCLUSION_METRICS
from pss.rivals.planar import PLANAR_METRICS

__all__ = ["RIVALS"]

RIVALS: tuple[Metric, ...] = (
    *COVERAGE_METRICS,
    *ANGLE_METRICS,
    *OCCLUSION_METRICS,
    *COVARIANCE_METRICS,
    *ENTROPY_METRICS,
    *PLANAR_METRICS,
    *NULL_METRICS,
    *ABLATIONS,
)
