"""Functions as machine code, kept between runs where there is a folder to keep them in."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar, cast

from numba import njit

if TYPE_CHECKING:
    from collections.abc import Callable

F = TypeVar("F", bound="Callable[..., object]")


def compiled(function: F) -> F:
    """The function as machine code, which releases the interpreter while it works.

    Where neither the folder of its module nor one of the user's may be written to it is compiled anew in each run.
    """
    try:
        made = njit(cache=True, nogil=True, error_model="numpy")(function)
    except RuntimeError:  # numba finds no place for it
        made = njit(nogil=True, error_model="numpy")(function)
    return cast("F", made)
