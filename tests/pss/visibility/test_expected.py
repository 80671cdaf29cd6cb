"""Expectations over which cameras find a point: against draws of who finds it, sums by hand, and certain detection."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

import pss
import pss.visibility.expected
from pss import Appearance, DetectionModel, PTZCamera, RangeError
from pss.riccati.covariances import from_six
from pss.visibility.expected import expected, probability_of_at_least
from pss.visibility.targets import TARGET_VISIBILITY

ROUNDING = 1e-9
# Of the sets that are drawn for many cameras: five standard errors of a share of one half, of 4096.
DRAWN = 5 * 0.5 / 64
LOOK = Appearance(0.02, 1.0, 0.1)
SURE = {"constant": 50.0, "size": 0.0, "blur": 0.0, "signal": 0.0, "incidence": 0.0, "lapse": 0.0}
RAMP = {"constant": 8.0, "size": 2.0, "blur": 3.0, "signal": 6.0, "incidence": 0.5, "lapse": 0.05}


def measured(cameras: int, points: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Information of cameras of two pixels each, (C, 6, N), and probabilities (C, N)."""
    rng = np.random.default_rng(seed)
    jacobian = rng.standard_normal((cameras, points, 2, 3)) * 300
    full = jacobian.mT @ jacobian
    six = np.stack([full[..., i, j] for i in range(3) for j in range(i, 3)], axis=1)
    return six, rng.uniform(0.05, 0.95, size=(cameras, points))


def by_hand(six, p):
    """The sums written out, set by set and point by point."""
    C, _, N = six.shape
    found, inverse, covariance, information = np.zeros(N), np.zeros(N), np.zeros((N, 3, 3)), np.zeros((N, 3, 3))
    for n in range(N):
        for chosen in itertools.product([False, True], repeat=C):
            if sum(chosen) < 2:
                continue
            weight = np.prod([p[c, n] if chosen[c] else 1 - p[c, n] for c in range(C)])
            total = sum(from_six(six[c])[n] for c in range(C) if chosen[c])
            found[n] += weight
            inverse[n] += weight / np.sqrt(np.linalg.eigvalsh(np.linalg.inv(total))[-1])
            covariance[n] += weight * np.linalg.inv(total)
            information[n] += weight * total
    return found, inverse, covariance / found[:, None, None], information / found[:, None, None]


@pytest.mark.parametrize("cameras", [2, 3, 5])
def test_all_sets_are_summed(cameras):
    six, p = measured(cameras, 6, cameras)
    p[0, 0], p[1, 1], p[0, 2] = 1.0, 0.0 if cameras > 2 else 1.0, 1.0
    found = expected(six, p)
    for value, truth in zip(
        (found.found, found.inverse_sigma, found.covariance_m2, from_six(found.information)),
        by_hand(six, p),
        strict=True,
    ):
        np.testing.assert_allclose(value, truth, rtol=1e-7)
    np.testing.assert_allclose(found.found, probability_of_at_least(p, 2)[1], rtol=ROUNDING)


def test_many_cameras_are_drawn(monkeypatch):
    """Nine cameras: sets drawn, against all 512."""
    six, p = measured(9, 20, 1)
    p *= 0.5
    drawn = expected(six, p)
    monkeypatch.setattr(pss.visibility.expected, "EXACT_CAMERAS", 9)
    exact = expected(six, p)
    assert (drawn.found != exact.found).any()
    np.testing.assert_allclose(drawn.found, exact.found, atol=DRAWN)
    np.testing.assert_allclose(drawn.inverse_sigma, exact.inverse_sigma, rtol=2 * DRAWN)
    np.testing.assert_allclose(drawn.information, exact.information, atol=2 * DRAWN * np.abs(exact.information).max())


def test_what_is_always_measured_fixes_a_point_that_nobody_finds():
    six, p = measured(3, 4, 2)
    alone = expected(six, np.zeros_like(p))
    assert not alone.found.any()
    assert not alone.inverse_sigma.any()
    assert np.isnan(alone.covariance_m2).all()
    always = np.tile([[4.0], [0.0], [0.0], [1.0], [0.0], [9.0]], 4)
    with_it = expected(six, np.zeros_like(p), always)
    np.testing.assert_allclose(with_it.found, 1)
    np.testing.assert_allclose(with_it.inverse_sigma, 1)
    np.testing.assert_allclose(with_it.covariance_m2, np.diag([1 / 4, 1, 1 / 9])[None].repeat(4, axis=0))


def test_at_least_so_many():
    """Against counts of draws and, for two cameras, by hand."""
    p = np.array([[0.3, 1.0], [0.6, 0.2]])
    np.testing.assert_allclose(probability_of_at_least(p, 3), [[1 - 0.7 * 0.4, 1.0], [0.18, 0.2], [0, 0]], atol=1e-12)
    p = np.random.default_rng(3).uniform(size=(6, 1))
    counts = (np.random.default_rng(4).uniform(size=(6, 200_000)) < p).sum(axis=0)
    np.testing.assert_allclose(
        probability_of_at_least(p, 3)[:, 0], [(counts >= m).mean() for m in (1, 2, 3)], atol=5e-3
    )


# ---- evaluate --------------------------------------------------------------------------------------------------------


def rig(cameras: int = 4) -> tuple[list[PTZCamera], np.ndarray, np.ndarray]:
    rng = np.random.default_rng(5)
    points = np.column_stack([rng.uniform(-0.6, 0.6, 30), rng.uniform(3.5, 5, 30), rng.uniform(1.0, 2.0, 30)])
    own = PTZCamera((0.0, 0.0, 1.5), 0.0, 0.0, zoom=1.5, focus_distance_m=3.0)
    places = [(-1.5, 0.2, 1.0), (1.4, 0.0, 2.2), (0.2, 0.1, 1.5), (-0.8, 0.3, 2.4), (0.9, 0.2, 0.9)][:cameras]
    found = [
        dataclasses.replace(own, position_m=p, name=str(k)).aimed_at((0.0, 4.2, 1.5)) for k, p in enumerate(places)
    ]
    return found, points, np.tile((0.0, -1.0, 0.0), (30, 1))


def test_certain_detection_changes_nothing():
    """p = 1: the same PSS, σ and C as with whole targets seen."""
    cameras, points, normals = rig()
    usual = {"appearance": LOOK, "noise": "physical"}
    hard = pss.evaluate(cameras, points, normals, visibility=TARGET_VISIBILITY, **usual)
    sure = pss.evaluate(cameras, points, normals, detection=DetectionModel(SURE), **usual)
    np.testing.assert_array_equal(sure.visible, hard.visible)
    np.testing.assert_array_equal(sure.observable, hard.observable)
    for name in ("pss", "pss_single_frame", "sigma_m", "single_frame_sigma_m", "covariance", "posterior", "found"):
        np.testing.assert_allclose(getattr(sure, name), getattr(hard, name), rtol=1e-6, err_msg=name)
    for metric in ("visible-share", "visibility-count"):
        assert pss.METRICS[metric].score(sure) == pytest.approx(pss.METRICS[metric].score(hard))


def test_the_expected_pss_is_the_mean_over_who_finds_what():
    """Cameras drawn as finding a point or not, 400 times, each configuration evaluated by itself."""
    cameras, points, normals = rig(3)
    model = DetectionModel(RAMP | {"constant": 0.5})
    usual = {"appearance": LOOK, "noise": "physical"}
    found = pss.evaluate(cameras, points, normals, detection=model, **usual)
    assert 0.2 < found.detection[found.visible].min() < found.detection.max() < 0.8
    rng, single, share, count = np.random.default_rng(6), [], [], []

    @dataclasses.dataclass(frozen=True, eq=False)
    class Drawn:
        finds: np.ndarray
        name: str = "drawn"

        def passed(self, views, candidates, occluder):
            return candidates & self.finds

    for _ in range(400):
        finds = Drawn(rng.uniform(size=found.detection.shape) < found.detection)
        one = pss.evaluate(cameras, points, normals, visibility=(*TARGET_VISIBILITY, finds), **usual)
        single.append(one.pss_single_frame)
        share.append(one.observable.mean())
        count.append(pss.METRICS["visibility-count"].score(one))
    for drawn, mean in (
        (single, found.pss_single_frame),
        (share, found.found.mean()),
        (share, pss.METRICS["visible-share"].score(found)),
        (count, pss.METRICS["visibility-count"].score(found)),
    ):
        assert np.mean(drawn) == pytest.approx(mean, abs=4 * np.std(drawn) / 20)


def test_a_batch_is_its_members():
    cameras, points, normals = rig(4)
    usual = {"appearance": LOOK, "noise": "physical", "detection": DetectionModel(RAMP)}
    chosen = [cameras[:2], cameras[1:], cameras, []]
    many = pss.evaluate_many(chosen, points, normals, **usual)
    for k, of_one in enumerate(chosen):
        one = pss.evaluate(of_one, points, normals, **usual)
        assert many.pss[k] == one.pss == many[k].pss
        assert many.pss_single_frame[k] == one.pss_single_frame
        np.testing.assert_array_equal(many[k].detection, one.detection)
    assert many.pss[3] == many.pss_single_frame[3] == 0


# The filter has the expected information in every frame in which the point is found; what it really has varies. Over
# process noise of 0.01 to 1 mm a frame and cameras that find a point with 0.3 to 0.95, 1/σ∞ is up to 6 % too large (at
# 0.01 mm and 0.3; 1 % at 0.1 mm, 0.01 % at 1 mm), of which the run itself is known to half a percent.
FILTER_SHARE = 0.07
FRAMES, FILTERS = 400, 400


@pytest.mark.parametrize("step_m", [1e-3, 1e-4, 1e-5])
@pytest.mark.parametrize("share", [0.3, 0.6, 0.95])
def test_the_filter_of_found_points_against_one_that_is_run(step_m, share):
    """A filter over frames of which each has the cameras that find the point; frames that do not fix it are left out.

    So is the measured filter (`validate.points.static_filter`), and its PSS times the share of frames that do.
    """
    cameras, points, normals = rig(4)
    six = pss.evaluate(cameras, points[:1], normals[:1], noise="physical", appearance=LOOK).camera_information[:, 0]
    rng = np.random.default_rng(7)
    sets = np.array([s for s in itertools.product([0, 1], repeat=4) if sum(s) >= 2])
    weight = np.where(sets > 0, share, 1 - share).prod(axis=1)
    prior, total = np.eye(3) * step_m**2, np.zeros((3, 3))
    prior = np.broadcast_to(prior, (FILTERS, 3, 3))
    for frame in range(FRAMES):
        member = sets[rng.choice(len(sets), p=weight / weight.sum(), size=FILTERS)]
        information = np.einsum("fc,cij->fij", member, six)
        posterior = np.linalg.inv(np.linalg.inv(prior) + information)
        prior = posterior + step_m**2 * np.eye(3)
        if frame >= FRAMES // 2:
            total += prior.mean(axis=0) / (FRAMES // 2)
    run = 1 / np.sqrt(np.linalg.eigvalsh(total)[-1])
    p = np.full((4, 1), share)
    of_expected = expected(np.stack([six[:, i, j] for i in range(3) for j in range(i, 3)], axis=1)[..., None], p)
    output = pss.steady_state_covariance(
        np.eye(3), step_m**2 * np.eye(3), np.linalg.cholesky(from_six(of_expected.information)[0]).T, np.eye(3)
    )
    ratio = 1 / np.sqrt(np.linalg.eigvalsh(output)[-1]) / run
    assert 1 - 0.01 < ratio < 1 + FILTER_SHARE


def test_what_is_no_detection_model_is_refused():
    cameras, points, normals = rig(2)
    with pytest.raises(RangeError, match=r"detection is a float; allowed: a pss\.DetectionModel, or None"):
        pss.evaluate(cameras, points, normals, detection=0.9)
    with pytest.raises(RangeError, match="no appearance; allowed: evaluate"):
        pss.evaluate(cameras, points, normals, detection=DetectionModel(RAMP))
