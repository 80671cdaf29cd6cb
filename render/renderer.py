"""One view: the image of one scene state in one camera, the unit of rendering and of storage.

A view's name is the hash of everything that determines its pixels, so that it can be found and reused.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pss import ImageSensor, PTZCamera, RangeError
from render import backend
from render.certificate import Certificate, certify
from render.keys import content_of, state_key, view_key
from render.lens import motion, thin_lens
from render.lens.sampling import RingLight, Sampling, film_samples, pixel_means, sample_image
from render.light import lit_scene
from render.random_streams import random_stream
from render.sensor import capture, expected_electrons, fixed_pattern, saturated_share, surely_saturated
from render.world.state import SceneState

__all__ = ["RenderedView", "Renderer", "ViewRequest"]


# px on the image by which the ray of a pixel's centre is shifted if it passes through a seam between triangles.
SEAM_PX = 1e-3


@dataclass(frozen=True)
class ViewRequest:
    """Everything that determines a view's pixels."""

    state: SceneState
    camera: PTZCamera
    sensor: ImageSensor
    sampling: Sampling
    renderer: str

    @cached_property
    def key(self) -> str:
        """The view's name: equal for equal pixels, in any run and on any machine of the same kind."""
        return view_key([state_key(self.state), self.camera, self.sensor, self.sampling, self.renderer])

    @property
    def content(self) -> str:
        """The part of the name that is independent of the code; random numbers depend on it."""
        return content_of(self.key)


@dataclass(frozen=True, eq=False)
class RenderedView:
    """A rendered view; images are (height, width).

    Attributes:
        radiance: W/(m² sr), noise-free up to the sampling noise that `certificate` states.
        depth_m: m along the optical axis, for each pixel's centre, from the lens; inf where nothing is hit.
        normal: (height, width, 3), unit, in the world.
        marker_id: id of the marker whose plate is visible, −1 elsewhere.
        capture_dn: one noisy capture.
    """

    key: str
    camera: PTZCamera
    sensor: ImageSensor
    radiance: NDArray[np.float32]
    depth_m: NDArray[np.float32]
    normal: NDArray[np.float32]
    marker_id: NDArray[np.int32]
    capture_dn: NDArray[np.uint16]
    certificate: Certificate

    def expected_electrons(self) -> NDArray[np.float32]:
        """Mean photoelectrons of every pixel."""
        return np.asarray(expected_electrons(self.radiance, self.camera, self.sensor), dtype=np.float32)


class Renderer:
    """Renders views of one scene state: Mitsuba's scene is loaded once, or once for each instant of an exposure."""

    def __init__(self, state: SceneState, meshes: lit_scene.GlowMeshes, chosen: backend.Backend) -> None:
        self.state = state
        self.name = chosen.identity
        self._mi = backend.start(chosen)
        self._meshes = meshes
        self._scene = lit_scene.load_scene(meshes, self._mi)
        self._ids = meshes.marker_ids
        self._at: dict[float, Any] = {}

    def request(self, camera: PTZCamera, sensor: ImageSensor, sampling: Sampling) -> ViewRequest:
        """The request for a view of this scene state by this renderer."""
        return ViewRequest(self.state, camera, sensor, sampling, self.name)

    def render(self, request: ViewRequest) -> RenderedView:
        """Render a view."""
        camera, sensor = request.camera, request.sensor
        width, height = camera.resolution
        electrons_per_radiance = np.asarray(
            expected_electrons(np.ones((height, width)), camera, sensor), dtype=np.float32
        )

        def noise(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
            sigma = sensor.noise_electrons(radiance * electrons_per_radiance) / electrons_per_radiance
            return np.asarray(sigma, dtype=np.float32)

        def saturates(radiance: NDArray[np.float32]) -> NDArray[np.bool_]:
            return surely_saturated(radiance * electrons_per_radiance, sensor)

        mitsuba_sensor = thin_lens.load_sensor(camera, self._mi)
        intensity = self.state.light.ring_w_per_sr
        ring = RingLight(camera.position_m, intensity) if intensity > 0 else None
        extra = camera.psf_sigma_um > 0 or camera.aperture_blades > 0 or any(camera.radial_distortion)
        scalar = self._mi.variant().startswith("scalar")
        if scalar and (extra or ring is not None):
            raise RangeError(
                "psf_sigma_um, aperture_blades, radial_distortion and ring lights; allowed with LLVM or CUDA alone"
            )
        samplers = [
            film_samples(scene, mitsuba_sensor, self._mi)
            if scalar
            else pixel_means(scene, mitsuba_sensor, self._mi, camera if extra else None, ring)
            for scene in self._over_exposure(camera, sensor.exposure_ms * 1e-3)
        ]
        sampler = motion.over_shutter(samplers) if len(samplers) > 1 else samplers[0]
        rng = random_stream(0, request.content, "render")
        image = sample_image(sampler, camera.resolution, noise, request.sampling, rng, saturates)
        depth, normal, marker = self._first_hits(camera, mitsuba_sensor)
        electrons = image.mean * electrons_per_radiance
        capture_rng = random_stream(0, request.content, "sample capture")
        return RenderedView(
            request.key,
            camera,
            sensor,
            image.mean,
            depth,
            normal,
            marker,
            capture(electrons, sensor, capture_rng, fixed_pattern(camera, sensor)),
            certify(image, noise, marker, saturated_share(electrons[marker >= 0], sensor), saturates(image.mean)),
        )

    def _over_exposure(self, camera: PTZCamera, exposure_s: float) -> list[Any]:
        """Mitsuba's scenes at instants of the exposure: a single one if no motion is visible to the camera."""
        if not any(item.motion for item in self.state.objects):
            return [self._scene]
        times = motion.instants(motion.travel_px(self._meshes, self.state, camera, exposure_s), exposure_s)
        if len(times) == 1:
            return [self._scene]
        for time in times:
            if time not in self._at:
                self._at[time] = lit_scene.load_scene(motion.moved(self._meshes, self.state, time), self._mi)
        return [self._at[time] for time in times]

    def _first_hits(
        self, camera: PTZCamera, mitsuba_sensor: Any
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int32]]:
        """Depth, normal and marker number along the ray from the lens centre through each pixel's centre.

        Moving objects are at their positions at the middle of the exposure.
        """
        width, height = camera.resolution
        film_x, film_y = thin_lens.straight_film(camera)
        film_x, film_y = (film_x / width).astype(np.float32), (film_y / height).astype(np.float32)
        distance, normal, plate, missed = self._hits(mitsuba_sensor, film_x, film_y)
        if missed.any():
            # In a closed room such a ray has passed through the seam between two triangles; a neighbouring one does
            # not.
            aside = np.float32(SEAM_PX / width)
            found = self._hits(mitsuba_sensor, film_x[missed] + aside, film_y[missed] + aside)
            distance[missed], normal[missed], plate[missed] = found[:3]
        shape, middle = (height, width), np.array(camera.principal_point_px)
        slopes = np.stack([film_x, film_y], axis=-1) * camera.resolution - thin_lens.film_position(middle)
        rays = slopes.reshape(*shape, 2) / camera.focal_px
        # Mitsuba's rays begin at the near clip plane.
        depth = distance.reshape(shape) / np.sqrt(1 + (rays**2).sum(axis=-1)) + thin_lens.NEAR_M
        marker = np.full(width * height, -1, dtype=np.int32)
        marker[plate >= 0] = self._ids[plate[plate >= 0]]
        return (
            depth.astype(np.float32),
            normal.astype(np.float32).reshape(*shape, 3),
            marker.reshape(shape),
        )

    def _hits(
        self, mitsuba_sensor: Any, film_x: NDArray[np.float32], film_y: NDArray[np.float32]
    ) -> tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.int64], NDArray[np.bool_]]:
        """First hits through the lens centre: distance in m (∞: none), normal, plate number (−1: none), and misses.

        A miss hits nothing or a back; shapes (N,), (N, 3), (N,), (N,).
        """
        if self._mi.variant().startswith("scalar"):
            hits = np.array([self._hit(mitsuba_sensor, film) for film in zip(film_x, film_y, strict=True)])
            return hits[:, 0], hits[:, 1:4], hits[:, 4].astype(np.int64), hits[:, 5] > 0
        distance, normal, plate, missed = map(np.array, self._hit(mitsuba_sensor, (film_x, film_y)))
        return distance, normal, plate.astype(np.int64), missed

    def _hit(self, mitsuba_sensor: Any, film: tuple[Any, Any]) -> Any:
        """The same for one place on the film, or for all at once."""
        mi = self._mi
        ray, _ = mitsuba_sensor.sample_ray(0.0, 0.5, mi.Point2f(*film), mi.Point2f(0.5, 0.5))
        hit = self._scene.ray_intersect(ray)
        plates = next((shape for shape in self._scene.shapes() if shape.id() == "plates"), None)
        if mi.variant().startswith("scalar"):
            plate = hit.prim_index // 2 if plates is not None and hit.shape == plates else -1
            missed = not (hit.is_valid() and np.dot(np.ravel(hit.n), np.ravel(ray.d)) < 0)
            return [hit.t if hit.is_valid() else np.inf, *np.array(hit.n).ravel(), plate, missed]
        import drjit as dr

        is_plate = hit.shape == mi.ShapePtr(plates) if plates is not None else mi.Bool(False)
        plate = dr.select(is_plate, mi.Int32(hit.prim_index // 2), -1)
        missed = ~(hit.is_valid() & (dr.dot(hit.n, ray.d) < 0))
        return hit.t.numpy(), hit.n.numpy().T, plate.numpy(), missed.numpy()
