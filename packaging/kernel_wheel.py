"""Kernels in wheels: `make wheel` compiles everything once, for processors that most people have.

They are for one version of Python and of Numba; with others, or on other processors, kernels are compiled as without.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class KernelWheel(BuildHookInterface):
    """Adds the kernels if the environment variable SIGNEDHEAT_KERNELS is set."""

    PLUGIN_NAME = "custom"
    cache: str | None = None

    def initialize(self, version: str, build_data: dict) -> None:
        if not os.environ.get("SIGNEDHEAT_KERNELS"):
            return
        source = Path(self.root) / "src"
        sys.path.insert(0, str(source))
        from signedheat.compiled import BASELINE

        self.cache = tempfile.mkdtemp()
        environment = {
            **os.environ,
            "PYTHONPATH": str(source),
            "NUMBA_CACHE_DIR": self.cache,
            "NUMBA_CPU_NAME": BASELINE,
            "NUMBA_CPU_FEATURES": "",
            "NUMBA_DISABLE_INTEL_SVML": "1",  # a library that not everybody has
        }
        subprocess.run([sys.executable, "-m", "signedheat", "warmup"], env=environment, check=True)
        build_data["force_include"][str(Path(self.cache, "signedheat"))] = "signedheat/kernels"
        build_data["pure_python"] = False
        build_data["infer_tag"] = True

    def finalize(self, version: str, build_data: dict, artifact_path: str) -> None:
        if self.cache:
            shutil.rmtree(self.cache)
