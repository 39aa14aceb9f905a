"""Distance from arrays: `redistance` beside fast marching (scikit-fmm, if it is installed) and a distance transform.

Errors in cells, the largest and the mean square, over all nodes; the worst of four random positions each. Around a
wall, one node thick, distance is that over its end; on periodic axes to the nearest of all balls. Processor seconds.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib.util import find_spec

import numpy as np
import scipy
from numpy.typing import NDArray

import signedheat as sh

Array = NDArray[np.float64]


def shapes(n: int, dimension: int, rng: np.random.Generator) -> dict[str, tuple[Array, Array]]:
    """Arrays, and the distance that they stand for, in cells."""
    axes = [np.arange(n) - (n - 1) / 2] * dimension
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1) - rng.uniform(-0.5, 0.5, dimension)
    turned = points @ np.linalg.qr(rng.normal(size=(dimension, dimension)))[0]
    off = np.abs(turned) - np.array([0.27, 0.16, 0.21])[:dimension] * n
    ball = np.linalg.norm(points, axis=-1) - 0.3 * n
    box = np.linalg.norm(np.maximum(off, 0), axis=-1) + np.minimum(off.max(axis=-1), 0)
    bent = 1 + 0.5 * np.sin(5 * turned[..., 0] / n) * np.cos(4 * points[..., 1] / n)
    return {
        "ball, distance": (ball, ball),
        "ball, another level set": (ball * bent, ball),
        "ball, clipped to a cell": (np.clip(ball, -1, 1), ball),
        "ball, ±1": (np.where(ball < 0, -1.0, 1.0), ball),
        "turned box, distance": (box, box),
        "turned box, ±1": (np.where(box < 0, -1.0, 1.0), box),
    }


def around(n: int, dimension: int, rng: np.random.Generator) -> dict[str, tuple[Array, Array, bool]]:
    """Arrays on periodic axes, their distances, and whether axes are periodic."""
    axes = [np.arange(n) - (n - 1) // 2] * dimension
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).astype(float)
    middle = rng.uniform(-0.5, 0.5, dimension) * n
    ball = np.linalg.norm((points - middle + n / 2) % n - n / 2, axis=-1) - 0.2 * n
    return {
        "ball, periodic": (ball, ball, True),
    }


def transform(values: Array) -> Array:
    """Distance to the nearest node of the other side, less half a cell."""
    inside, outside = (scipy.ndimage.distance_transform_edt(part) for part in (values < 0, values >= 0))
    return np.where(values < 0, 0.5 - inside, outside - 0.5)


def main() -> None:
    methods: dict[str, Callable[..., Array]] = {"redistance": sh.redistance, "transform": transform}
    if find_spec("skfmm"):
        import skfmm

        methods["fast marching"] = skfmm.distance
    print(f"{'':>35}", *(f"{name:>18}" for name in methods))
    for dimension, n in ((2, 48), (2, 192), (3, 48)):
        rng, errors = np.random.default_rng(0), dict[str, dict[str, list[tuple[float, float]]]]()
        for _ in range(4):
            for name, (values, exact) in shapes(n, dimension, rng).items():
                for method, measured in methods.items():
                    error = np.abs(measured(values) - exact)
                    both = float(error.max()), float(np.sqrt((error**2).mean()))
                    errors.setdefault(name, {}).setdefault(method, []).append(both)
        for name, of in errors.items():
            worst = (np.max(of[method], axis=0) for method in methods)
            print(f"{dimension}-D, {n:>3}, {name:<25}", *(f"{most:>9.2g} {mean:>8.1g}" for most, mean in worst))
    del methods["transform"]
    for dimension, n in ((2, 192), (3, 48)):
        for name, (values, exact, again) in around(n, dimension, np.random.default_rng(0)).items():
            found = [np.abs(measured(values, periodic=again) - exact) for measured in methods.values()]
            both = (f"{e.max():>9.2g} {np.sqrt((e**2).mean()):>8.1g}" for e in found)
            print(f"{dimension}-D, {n:>3}, {name:<25}", *both)
    for name, values, again in (
        ("128³", shapes(128, 3, np.random.default_rng(0))["ball, distance"][0], False),
        *((f"128³, {key}", of[0], of[2]) for key, of in around(128, 3, np.random.default_rng(0)).items()),
    ):
        times = []
        for measured in methods.values():
            begin = time.process_time()
            measured(values, periodic=again)
            times.append(time.process_time() - begin)
        print(f"{'seconds, ' + name:<35}", *(f"{seconds:>18.2f}" for seconds in times))


if __name__ == "__main__":
    main()
