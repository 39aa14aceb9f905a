"""Every public object can be copied and pickled, after use too, and what was read-only stays read-only."""

from __future__ import annotations

import copy
import dataclasses
import pickle

import numpy as np
import pytest
from scipy import sparse

import signedheat as sh
from shapes.public_objects import OBJECTS, SOLVERS, SOURCES
from signedheat.linear import factorize
from signedheat.surfaces.surface import Surface

WAYS = {"pickle": lambda thing: pickle.loads(pickle.dumps(thing)), "copy": copy.copy, "deepcopy": copy.deepcopy}


def arrays(thing, path="", seen=None):
    """Every array that the fields of an object hold, at any depth, by the way that leads to it."""
    seen = set() if seen is None else seen
    if id(thing) in seen:
        return {}
    seen.add(id(thing))
    if isinstance(thing, np.ndarray):
        return {path: thing}
    if dataclasses.is_dataclass(thing):
        inner = {entry.name: getattr(thing, entry.name) for entry in dataclasses.fields(thing)}
    elif isinstance(thing, dict):
        inner = thing
    elif isinstance(thing, list | tuple):
        inner = dict(enumerate(thing))
    elif sparse.issparse(thing):
        inner = {"data": thing.data, "indices": thing.indices}
    else:
        return {}
    found = {}
    for name, value in inner.items():
        found.update(arrays(value, f"{path}.{name}", seen))
    return found


def test_no_public_class_is_left_out():
    modules = (sh, sh.batches, sh.results)
    public = {getattr(module, name) for module in modules for name in module.__all__} | {sh.io.LabelImage}
    classes = {thing for thing in public if isinstance(thing, type) and not issubclass(thing, BaseException)}
    assert classes == {type(make()) for make in [*OBJECTS.values(), *SOLVERS.values()]} & public


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", OBJECTS)
def test_copies_hold_the_same_and_stay_frozen(name, way):
    thing = OBJECTS[name]()
    twin = WAYS[way](thing)
    assert type(twin) is type(thing) and repr(twin) == repr(thing)
    held, copied = arrays(thing), arrays(twin)
    assert held.keys() == copied.keys()
    for path, array in held.items():
        assert copied[path].flags.writeable == array.flags.writeable, path
        np.testing.assert_array_equal(copied[path], array, err_msg=path)


@pytest.mark.parametrize("name", ["triangles", "polygons", "points", "voxels", "tets", "grid", "curve", "polyline"])
def test_shapes_cannot_be_written_after_unpickling(name):
    twin = pickle.loads(pickle.dumps(OBJECTS[name]()))
    frozen = [array for array in arrays(twin).values() if array.size]
    assert frozen
    for array in frozen:
        with pytest.raises(ValueError, match="read-only"):
            array.flat[0] = 0


@pytest.mark.parametrize("name", OBJECTS)
def test_public_objects_are_frozen(name):
    thing = OBJECTS[name]()
    for entry in dataclasses.fields(thing) if dataclasses.is_dataclass(thing) else ():
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(thing, entry.name, getattr(thing, entry.name))
    with pytest.raises(AttributeError):
        thing.of_no_meaning = 1


@pytest.mark.parametrize("way", WAYS)
def test_copies_of_used_fields_answer_the_same(way):
    band, field = OBJECTS["band"](), OBJECTS["solid"]()
    places = [[1.2, 0.1, 0.0], [0.0, 0.5, 0.6]]
    for thing in (band, field):
        twin = WAYS[way](thing)
        np.testing.assert_array_equal(twin(places), thing(places))
        np.testing.assert_array_equal(twin.offset(0.1).vertices, thing.offset(0.1).vertices)
        nearest = "closest_points" if thing.solid is None else "closest"
        np.testing.assert_array_equal(getattr(twin, nearest)(places).points, getattr(thing, nearest)(places).points)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", SOLVERS)
def test_copies_of_used_solvers_compute_the_same(name, way):
    solver = SOLVERS[name]()
    twin = WAYS[way](solver)
    sources = SOURCES[name]()
    np.testing.assert_array_equal(twin.distance(sources).values, solver.distance(sources).values)


@pytest.mark.parametrize("name", ["triangles", "tets"])
def test_the_discretization_of_a_used_solver_can_be_pickled(name):
    discretization = SOLVERS[name]().discretization
    twin = pickle.loads(pickle.dumps(discretization))
    assert (twin.integration.stiffness != discretization.integration.stiffness).nnz == 0


def test_a_copy_of_a_used_solver_outlives_it():
    solver = SOLVERS["triangles"]()
    expected = solver.distance(SOURCES["triangles"]()).values
    twin = copy.copy(solver)
    del solver
    np.testing.assert_array_equal(twin.distance(SOURCES["triangles"]()).values, expected)


def test_factors_of_pardiso_refuse_to_be_copied():
    """A copy would call into memory that is released with the original."""
    factor = factorize(sparse.identity(4, format="csr"))
    if factor.backend != "pardiso":
        pytest.skip("PARDISO is not installed")
    for way in WAYS.values():
        with pytest.raises(sh.errors.UnsupportedTypeError):
            way(factor)


def test_a_surface_that_is_no_dataclass_is_copied_whole():
    class Square(Surface):
        def __init__(self):
            self.note = "kept"

    assert copy.copy(Square()).note == "kept"
