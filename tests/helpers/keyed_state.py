"""A state of a scene with an object of each kind."""

from __future__ import annotations

import numpy as np

from pss import Box, Rectangle, Sphere
from pss.surrogates import Mesh
from render.world.state import Light, Marker, MarkerPrint, Panel, Room, SceneObject, SceneState

MARKER = Marker(5, "board", (0.0, -1.0, 1.3), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), 0.02)
OBJECTS = (
    SceneObject(Rectangle("board", (0.0, -1.0, 1.3), 2.4, 1.8), 0.5),
    SceneObject(Sphere("ball", (0.2, 0.1, 1.2), 0.4), 0.4),
    SceneObject(Box("plinth", (0.0, -0.1, 0.0), (0.4, 0.3, 0.8)), 0.3),
    SceneObject(
        Mesh("tent", np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]), np.array([(0, 1, 3), (0, 3, 2)])), 0.5
    ),
)
STATE = SceneState(
    Room(6.0, 6.0, 3.0, 0.55, 0.25, 0.75),
    Light(0.2, (Panel((1.0, 1.2), (0.6, 1.2)),)),
    OBJECTS,
    (MARKER,),
    MarkerPrint("DICT_4X4_100", 1.0, 0.85, 0.04),
)
