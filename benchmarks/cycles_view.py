"""Views of an exported glowing scene by Blender's Cycles, in an environment of its own that has `bpy`.

    python cycles_view.py SCENE.npz OUT THRESHOLD:SAMPLES:SEED ...

Each job writes OUT-<number>.npy, the image (height, width) in the scene's unit, and prints one line of JSON with the
seconds of the render alone, by the clock and of all cores. A threshold of 0 switches adaptive sampling off.
`benchmarks/rendering.py` writes SCENE.npz and calls this file.
"""

from __future__ import annotations

import json
import math
import sys
import tempfile
import time
from pathlib import Path

import bpy
import numpy as np

THREADS = 2
# Cycles stops by the error over the square root of the light, so the light is scaled until paper is about this bright.
PAPER = 1.0


def main() -> None:
    """Build the scene and render the jobs."""
    archive, out, *jobs = sys.argv[1:]
    data = dict(np.load(archive))
    scale = PAPER / float(data["textures"].max())
    bpy.ops.wm.read_factory_settings(use_empty=True)
    build_surfaces(data, scale)
    build_plates(data, scale)
    build_camera(data)
    scene = bpy.context.scene
    settle(scene, data)
    with tempfile.TemporaryDirectory() as folder:
        for number, job in enumerate(jobs):
            threshold, samples, seed = job.split(":")
            scene.cycles.use_adaptive_sampling = float(threshold) > 0
            scene.cycles.adaptive_threshold = float(threshold) or 0.01
            scene.cycles.samples, scene.cycles.seed = int(samples), int(seed)
            scene.render.filepath = str(Path(folder, f"{number}.exr"))
            begin, used = time.perf_counter(), time.process_time()
            bpy.ops.render.render(write_still=True)
            seconds, used = time.perf_counter() - begin, time.process_time() - used
            np.save(f"{out}-{number}.npy", pixels(scene.render.filepath) / scale)
            print(json.dumps({"job": job, "seconds": seconds, "cpu_seconds": used}), flush=True)


def settle(scene: bpy.types.Scene, data: dict[str, np.ndarray]) -> None:
    """Box filter, no bounces, no denoising, nothing clamped, on two threads."""
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = (int(n) for n in data["resolution"])
    render.resolution_percentage = 100
    render.threads_mode, render.threads = "FIXED", THREADS
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth, render.image_settings.color_mode = "32", "RGB"
    render.image_settings.exr_codec = "NONE"
    render.use_persistent_data = True
    cycles.device = "CPU"
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    cycles.max_bounces = 0
    cycles.use_denoising = False
    cycles.use_auto_tile = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.adaptive_min_samples = 0  # its own choice, by the threshold


def glowing(name: str, colour: str, **settings: object) -> bpy.types.Material:
    """A material that emits, from its front alone, the colour of a node of the type `colour` with `settings`.

    No lamp: Cycles would build a tree to sample it by.
    """
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    source = tree.nodes.new(colour)
    for key, value in settings.items():
        setattr(source, key, value)
    emission, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(source.outputs["Color"], emission.inputs["Color"])
    geometry, front = tree.nodes.new("ShaderNodeNewGeometry"), tree.nodes.new("ShaderNodeMath")
    front.operation, front.inputs[0].default_value = "SUBTRACT", 1.0
    tree.links.new(geometry.outputs["Backfacing"], front.inputs[1])
    tree.links.new(front.outputs["Value"], emission.inputs["Strength"])
    tree.links.new(emission.outputs["Emission"], output.inputs["Surface"])
    material.cycles.emission_sampling = "NONE"
    return material


def add_mesh(name: str, vertices: np.ndarray, faces: np.ndarray, material: bpy.types.Material) -> bpy.types.Mesh:
    """A mesh of `vertices` (V, 3) and `faces` (F, 3) in the scene."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    mesh.materials.append(material)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new(name, mesh))
    return mesh


def build_surfaces(data: dict[str, np.ndarray], scale: float) -> None:
    """The surfaces with their radiance at the vertices."""
    material = glowing("surfaces", "ShaderNodeAttribute", attribute_name="radiance")
    mesh = add_mesh("surfaces", data["vertices_m"], data["faces"], material)
    colours = np.ones((len(data["radiance"]), 4), dtype=np.float32)
    colours[:, :3] = scale * data["radiance"][:, None]
    mesh.attributes.new("radiance", "FLOAT_COLOR", "POINT").data.foreach_set("color", colours.ravel())


def build_plates(data: dict[str, np.ndarray], scale: float) -> None:
    """The markers' plates as one mesh with one atlas."""
    plates, textures = data["plates_m"], data["textures"]
    count, texels = len(plates), textures.shape[-1]
    columns = math.ceil(math.sqrt(count))
    rows = -(-count // columns)
    atlas = np.zeros((rows * texels, columns * texels), dtype=np.float32)
    uv = np.empty((count, 4, 2))
    for number, texture in enumerate(textures):
        row, column = divmod(number, columns)
        atlas[row * texels : (row + 1) * texels, column * texels : (column + 1) * texels] = texture
        left, right = column / columns, (column + 1) / columns
        # Blender's v runs upwards.
        top, bottom = 1 - row / rows, 1 - (row + 1) / rows
        uv[number] = [(left, top), (right, top), (right, bottom), (left, bottom)]
    image = bpy.data.images.new("atlas", atlas.shape[1], atlas.shape[0], float_buffer=True, is_data=True)
    image.colorspace_settings.name = "Non-Color"
    colours = np.ones((*atlas.shape, 4), dtype=np.float32)
    colours[..., :3] = scale * atlas[::-1, :, None]
    image.pixels.foreach_set(colours.ravel())
    image.update()
    image.pack()
    material = glowing("plates", "ShaderNodeTexImage", image=image, interpolation="Closest", extension="EXTEND")
    order = np.array([[0, 3, 2], [0, 2, 1]])
    faces = (4 * np.arange(count)[:, None, None] + order).reshape(-1, 3)
    mesh = add_mesh("plates", plates.reshape(-1, 3), faces, material)
    mesh.uv_layers.new(name="uv").uv.foreach_set("vector", uv.reshape(-1, 2)[faces.ravel()].astype(np.float32).ravel())


def build_camera(data: dict[str, np.ndarray]) -> None:
    """The thin lens: same field of view, aperture and plane of focus."""
    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit, camera.angle = "HORIZONTAL", float(data["fov"])
    camera.clip_start, camera.clip_end = 1e-2, 1e3
    camera.dof.use_dof = True
    camera.dof.focus_distance = float(data["focus_distance_m"])
    # Cycles reads the focal length in millimetres of a 36 mm sensor; its aperture is that over the f-number.
    camera.dof.aperture_fstop = camera.lens * 1e-3 / float(data["aperture_diameter_m"])
    right, down, forward = data["rotation"]
    place = np.eye(4)
    place[:3, :3] = np.column_stack([right, -down, -forward])
    place[:3, 3] = data["position_m"]
    found = bpy.data.objects.new("camera", camera)
    bpy.context.scene.collection.objects.link(found)
    found.matrix_world = place.T.tolist()
    bpy.context.scene.camera = found


def pixels(path: str) -> np.ndarray:
    """A saved image's first channel, (height, width), first row at the top."""
    image = bpy.data.images.load(path)
    width, height = image.size
    values = np.empty(width * height * 4, dtype=np.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    return values.reshape(height, width, 4)[::-1, :, 0].copy()


if __name__ == "__main__":
    main()
