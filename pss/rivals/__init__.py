"""Other metrics for camera configurations, from the literature, to set beside PSS.

`Metric.status` says how well a formula is known: "read" in its source, "checked" numerically besides, or "after" a
source of which only the abstract was read. `Metric.unobservable` says how a metric counts points that nothing fixes.
Those whose sources say nothing of such points are there twice: by their own convention (∞ as soon as there is one),
and as NAME-count-zero, the mean of 1/σ to which such points add zero (Eq. 10), of which more is better. Then
"e-optimality-count-zero" is "pss-single-frame" by another name.

Near ties are to be expected: quantisation volume, worst diagonal, GDOP, A-, D- and E-optimality, the planar estimator
and the pair of bearings are all made of distances and angles, and rise and fall together where R is fixed. With R = I
and one zoom, the quantisation volume orders configurations as D-optimality does, GDOP and the planar estimator nearly
as A-optimality, the worst diagonal nearly as E-optimality; those of a volume and of the worst direction agree least.
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
