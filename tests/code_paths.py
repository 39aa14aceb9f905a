"""How libraries compute on other processors, as environment variables: results may differ by rounding, and no more.

``python tests/code_paths.py [ARGUMENTS OF PYTEST]`` runs the suite once on each path.
"""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np


def code_paths() -> dict[str, dict[str, str]]:
    """Variables by name: what MKL, NumPy, OpenBLAS and Numba would choose on other processors, and other threads."""
    found = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    wide = [name for name in found if "512" in name or name == "X86_V4"]

    def without(names: list[str]) -> dict[str, str]:
        return {"NPY_DISABLE_CPU_FEATURES": " ".join(names)} if names else {}

    one = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    four = dict.fromkeys(one, "4")
    return {
        "AVX2, one maker": {"MKL_CBWR": "AVX2", "OPENBLAS_CORETYPE": "Haswell", **without(wide), **four},
        "AVX2, the other": {"MKL_CBWR": "COMPATIBLE", "OPENBLAS_CORETYPE": "Zen", **without(wide), **one},
        "SSE4.2": {"MKL_CBWR": "SSE4_2", "OPENBLAS_CORETYPE": "Nehalem", **without(found), "NUMBA_CPU_NAME": "generic"},
    }


if __name__ == "__main__":
    failed = []
    for name, variables in code_paths().items():
        print(f"-- {name}: {variables}", flush=True)
        command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *sys.argv[1:]]
        if subprocess.run(command, env={**os.environ, **variables}).returncode:
            failed.append(name)
    sys.exit(f"failed: {', '.join(failed)}" if failed else 0)
