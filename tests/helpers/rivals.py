"""Configurations for metrics of other works."""

from __future__ import annotations

import math

import numpy as np

from pss import Appearance, FieldOfView, PTZCamera, Rectangle, Sphere, evaluate
from pss.rivals import RIVALS

BALL = Sphere("ball", (0.25, 0.1, 1.25), 0.45)
BOARD = Rectangle("board", (0.0, -1.4, 1.3), 2.4, 1.8)
PLACES = [(-2.8, 0.2), (-2.8, 1.6), (-1.7, 2.8), (0.0, 2.8), (1.7, 2.8), (2.8, 1.6), (2.8, 0.2)]
CAMERAS = [PTZCamera((x, y, 2.8), 0, 0, zoom=2, focus_distance_m=3.8).aimed_at((0, -0.7, 1.3)) for x, y in PLACES]
# Small and dim, so that contrast matters.
APPEARANCE = Appearance(0.01, 0.01, 0.001)
BY_NAME = {metric.name: metric for metric in RIVALS}


def scene_points():
    """A board and the ball that hides a part of it; some points are unobservable."""
    on_board, on_ball = BOARD.grid(6, 4), BALL.spiral(20)
    points = np.concatenate([on_board[0] + 5e-4 * on_board[1], on_ball[0] + 5e-4 * on_ball[1]])
    return points, np.concatenate([on_board[1], on_ball[1]])


def scene(cameras, points=None, normals=None, **models):
    if points is None:
        points, normals = scene_points()
    return evaluate(cameras, points, normals, **{"appearance": APPEARANCE, "occluder": [BALL], **models})


def single(x, y, **settings):
    return PTZCamera((x, y, 1), 0, 0, **settings).aimed_at((0, 0, 1))


def ring(*azimuths_deg, distance_m=4.0, **settings):
    """Cameras round (0, 0, 1), level with it."""
    return [
        single(distance_m * math.cos(math.radians(a)), distance_m * math.sin(math.radians(a)), **settings)
        for a in azimuths_deg
    ]


TARGET = np.array([0.0, 0.0, 1.0])


def look(cameras, points=(TARGET,), **models):
    """An evaluation in which nothing hides a point: normals do not count."""
    points = np.asarray(points, dtype=float)
    return evaluate(cameras, points, np.tile([0, 0, 1.0], (len(points), 1)), visibility=(FieldOfView(),), **models)


def score(name, evaluation):
    return BY_NAME[name].score(evaluation)


def random_cameras(rng, count=6):
    """Anywhere round the target, not level with it."""
    places = rng.standard_normal((count, 3)) * [3, 3, 1] + TARGET
    return [PTZCamera(tuple(place), 0, 0).aimed_at(TARGET) for place in places]


def towards(camera, point=TARGET):
    away = np.array(camera.position_m) - point
    return away / np.linalg.norm(away)
