"""Checks of arguments: what is wrong, and what was expected."""
from __future__ import annotations

import math
import os
from numbers import Real
from typing import Dict, List, Mapping, Optional, Sequence, Tuple, Union

import numpy as np

from ._smartmill import Model
from .quantities import ComplexArray, FloatArray, UsageError
from .results import Mode

Path = Union[str, "os.PathLike[str]"]


def file_name(name: str, value: object) -> str:
    """A path as the libraries take it."""
    try:
        text = os.fspath(value)  # type: ignore[call-overload]
    except TypeError:
        raise UsageError(f"{name}: expected a path, got {type(value).__name__}") from None
    return text if isinstance(text, str) else os.fsdecode(text)


def model(value: Union[Path, Model]) -> Model:
    """A model, read where a file is named."""
    return value if isinstance(value, Model) else Model(file_name("model", value))


def model_or_none(value: Union[None, Path, Model]) -> Optional[Model]:
    return None if value is None else model(value)


def number(name: str, value: object, *, low: float = -math.inf, high: float = math.inf, unit: str = "",
           low_open: bool = False) -> float:
    """A finite number between bounds; low_open: low itself is not allowed."""
    if not isinstance(value, Real) or isinstance(value, bool):
        raise UsageError(f"{name}: expected a number, got {type(value).__name__}")
    result = float(value)
    if not math.isfinite(result) or result < low or result > high or (low_open and result == low):
        if high < math.inf:
            expected = f"{low:g}..{high:g}"
        elif low > -math.inf:
            expected = f"{'>' if low_open else '>='} {low:g}"
        else:
            expected = "finite"
        raise UsageError(f"{name}: {result:g}{' ' + unit if unit else ''}, expected a value {expected}")
    return result


def positive(name: str, value: object, unit: str = "") -> float:
    return number(name, value, low=0.0, low_open=True, unit=unit)


def integer(name: str, value: object, low: int, high: int) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise UsageError(f"{name}: expected an integer, got {type(value).__name__}")
    if not low <= value <= high:
        raise UsageError(f"{name}: {value}, expected an integer {low}..{high}")
    return int(value)


def choice(name: str, value: object, words: Sequence[str]) -> str:
    if value not in words:
        raise UsageError(f"{name}: {value!r}, expected one of {', '.join(words)}")
    return str(value)


def real_array(name: str, value: object) -> FloatArray:
    """A C-contiguous float64 array; one that already is stays as it is, without a copy."""
    try:
        array = np.asarray(value)
    except ValueError:
        raise UsageError(f"{name}: expected an array of numbers, got rows of different lengths") from None
    if array.dtype.kind not in "fiu":
        raise UsageError(f"{name}: expected an array of real numbers (float64), got dtype {array.dtype}")
    return np.asarray(array, dtype=np.float64, order="C")


def check_finite(name: str, array: Union[FloatArray, ComplexArray]) -> None:
    places = np.argwhere(~np.isfinite(array))
    if len(places) > 0:
        place = tuple(int(i) for i in places[0])
        where = ", ".join(str(i) for i in place)
        raise UsageError(f"{name}: {array[place]} at index {where}, expected finite numbers")


def series(name: str, value: object, *, least: int = 2, size: Optional[int] = None) -> FloatArray:
    """A 1-D array of finite numbers."""
    array = real_array(name, value)
    if array.ndim != 1:
        raise UsageError(f"{name}: expected a 1-D array of float64, got shape {array.shape}")
    if len(array) < least:
        raise UsageError(f"{name}: expected at least {least} samples, got {len(array)}")
    if size is not None and len(array) != size:
        raise UsageError(f"{name}: expected {size} samples as in the others, got {len(array)}")
    check_finite(name, array)
    return array


def rising(name: str, value: object, *, least: int = 1) -> FloatArray:
    """A 1-D array of increasing positive numbers."""
    array = series(name, value, least=least)
    if array[0] <= 0.0 or (np.diff(array) <= 0.0).any():
        raise UsageError(f"{name}: expected positive numbers, each above the one before")
    return array


def series_list(name: str, value: object, *, least: int = 2) -> List[FloatArray]:
    """One series, rows of a 2-D array, or a sequence of series."""
    if isinstance(value, (list, tuple)) and len(value) > 0 and np.ndim(value[0]) == 1:
        return [series(f"{name}[{i}]", row, least=least) for i, row in enumerate(value)]
    array = real_array(name, value)
    if array.ndim == 2:
        if len(array) == 0:
            raise UsageError(f"{name}: expected at least one row, got shape {array.shape}")
        return [series(f"{name}[{i}]", row, least=least) for i, row in enumerate(array)]
    return [series(name, array, least=least)]


def modes(name: str, value: Optional[Mapping[str, Sequence[Mode]]], axes: str) -> Dict[str, Tuple[Mode, ...]]:
    """Modes by axis."""
    result = {}
    for axis, of_axis in (value or {}).items():
        choice(f"{name} axis", axis, tuple(axes))
        result[axis] = tuple(of_axis)
        for i, mode in enumerate(of_axis):
            place = f"{name}[{axis!r}][{i}]"
            positive(f"{place}.frequency", mode.frequency, "Hz")
            number(f"{place}.damping_ratio", mode.damping_ratio, low=0.0, high=1.0, low_open=True)
            number(f"{place}.gain", mode.gain)
    return result


def progress_function(value: object) -> None:
    if value is not None and not callable(value):
        raise UsageError(f"progress: expected a function of share and line, got {type(value).__name__}")
