"""What every refusal must carry: tests ask for its parts, never for its sentences."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import signedheat as sh


@contextmanager
def refused(
    kind: type[sh.errors.SignedHeatError], element: str | None = None, *, file: str | None = None
) -> Iterator[pytest.ExceptionInfo[sh.errors.SignedHeatError]]:
    """Expect an error of this kind, about this element of the input, or about the file of this name.

    Beside its cause it must say what it is about, or what to do.
    """
    with pytest.raises(kind) as caught:
        yield caught
    error = caught.value
    assert error.cause
    assert error.element or error.remedy or error.path, error
    assert element is None or error.element == element
    assert file is None or (error.path is not None and Path(error.path).name == file)
