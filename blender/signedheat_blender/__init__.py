"""Blender add-on: offsets, watertight meshes and distance fields of the selected object, by the command signedheat."""

import os
import shutil
import tempfile
from pathlib import Path

import bpy
import numpy as np

from .protocol import CommandError, field_of, surface_at


class Preferences(bpy.types.AddonPreferences):
    """Where the command is."""

    bl_idname = __package__

    command: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Command", subtype="FILE_PATH", description="Path of signedheat; empty: the one that is found"
    )

    def draw(self, context):
        self.layout.prop(self, "command")


def command() -> str:
    """Path of the command: of the preferences, of the environment, or the one that is found."""
    addon = bpy.context.preferences.addons.get(__package__)
    chosen = addon.preferences.command if addon is not None and addon.preferences is not None else ""
    return chosen or os.environ.get("SIGNEDHEAT") or shutil.which("signedheat") or "signedheat"


def mesh_of(item):
    """Vertices in the world and polygons of an object, its modifiers applied."""
    evaluated = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    places = np.empty(3 * len(mesh.vertices))
    mesh.vertices.foreach_get("co", places)
    polygons = [list(polygon.vertices) for polygon in mesh.polygons]
    evaluated.to_mesh_clear()
    world = np.array(item.matrix_world)
    return places.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3], polygons


class OfMesh:
    """What the operators share."""

    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012  as Blender has it

    @classmethod
    def poll(cls, context):
        return context.active_object is not None and context.active_object.type == "MESH"

    def execute(self, context):
        item = context.active_object
        vertices, polygons = mesh_of(item)
        if not polygons:
            self.report({"ERROR"}, "the object has no faces")
            return {"CANCELLED"}
        try:
            made = self.make(item.name, vertices, polygons)
        except CommandError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        context.collection.objects.link(made)
        item.select_set(False)
        made.select_set(True)
        context.view_layer.objects.active = made
        return {"FINISHED"}


def new_object(name, vertices, triangles):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices.tolist(), [], triangles.tolist())
    mesh.validate()
    return bpy.data.objects.new(name, mesh)


class Offset(OfMesh, bpy.types.Operator):
    """Closed surface at a distance from the mesh, broken or not"""

    bl_idname, bl_label = "object.signedheat_offset", "Offset"
    distance: bpy.props.FloatProperty(name="Distance", default=0.1, subtype="DISTANCE")  # type: ignore[valid-type]
    resolution: bpy.props.IntProperty(name="Resolution", default=128, min=16, max=1024)  # type: ignore[valid-type]

    def make(self, name, vertices, polygons):
        return new_object(f"{name} offset", *surface_at(command(), vertices, polygons, self.distance, self.resolution))


class Watertight(OfMesh, bpy.types.Operator):
    """The mesh without holes, turned faces and overlaps"""

    bl_idname, bl_label = "object.signedheat_watertight", "Make watertight"
    resolution: bpy.props.IntProperty(name="Resolution", default=128, min=16, max=1024)  # type: ignore[valid-type]

    def make(self, name, vertices, polygons):
        return new_object(f"{name} watertight", *surface_at(command(), vertices, polygons, 0.0, self.resolution))


class Field(OfMesh, bpy.types.Operator):
    """Signed distance around the mesh, as an OpenVDB volume"""

    bl_idname, bl_label = "object.signedheat_field", "Distance field"
    resolution: bpy.props.IntProperty(name="Resolution", default=128, min=16, max=2048)  # type: ignore[valid-type]

    def make(self, name, vertices, polygons):
        folder = Path(bpy.data.filepath).parent if bpy.data.filepath else Path(tempfile.mkdtemp())
        path = folder / f"{bpy.path.clean_name(name)}_distance.vdb"
        field_of(command(), vertices, polygons, self.resolution, str(path))
        volume = bpy.data.volumes.new(f"{name} distance")
        volume.filepath = str(path)
        return bpy.data.objects.new(f"{name} distance", volume)


OPERATORS = (Offset, Watertight, Field)
CLASSES = (Preferences, *OPERATORS)


def menu(self, context):
    self.layout.separator()
    for operator in OPERATORS:
        self.layout.operator(operator.bl_idname, text=f"Signed heat: {operator.bl_label}")


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.VIEW3D_MT_object.append(menu)


def unregister():
    bpy.types.VIEW3D_MT_object.remove(menu)
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
