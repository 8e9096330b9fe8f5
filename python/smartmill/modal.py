"""Hammer tests: frequency response functions and modes."""
from __future__ import annotations

import os
from typing import Dict, Optional, Sequence, Union

import numpy as np
import numpy.typing as npt

from . import _arguments as check
from . import _smartmill
from ._arguments import Path
from .quantities import Progress, UsageError
from .results import Frf

RESPONSES = ("acceleration", "velocity", "displacement", "force")
AVERAGES = ("h1", "h2", "hv")


def _options(low: float, high: float, max_modes: int, real_modes: bool, average: str = "h1", weak_force: float = 0.0,
             exponential_time: float = 0.0) -> Dict[str, object]:
    options: Dict[str, object] = {
        "low": check.number("low", low, low=0.0, unit="Hz"), "high": check.number("high", high, low=0.0, unit="Hz"),
        "max_modes": check.integer("max_modes", max_modes, 0, 200), "real_modes": bool(real_modes),
        "average": check.choice("average", average, AVERAGES),
        "weak_force": check.number("weak_force", weak_force, low=0.0, unit="N"),
        "exponential_time": check.number("exponential_time", exponential_time, low=0.0, unit="s")}
    if 0.0 < high <= low:
        raise UsageError(f"high: {high:g} Hz, expected a value above low ({low:g} Hz)")
    return options


def frf(force: Union[Path, Sequence[Path], npt.ArrayLike, Sequence[npt.ArrayLike]],
        response: Union[None, npt.ArrayLike, Sequence[npt.ArrayLike]] = None, rate: Optional[float] = None, *,
        kind: str = "acceleration", low: float = 0.0, high: float = 0.0, max_modes: int = 100,
        real_modes: bool = False, average: str = "h1", weak_force: float = 0.0, exponential_time: float = 0.0,
        progress: Optional[Progress] = None) -> Frf:
    """Frequency response and modes from hammer hits of one point.

    force: hammer force [N] of one hit, or rows of hits; or files (hits, or one measured FRF; response is then left
    out). response: of the same shape, of a kind: acceleration [m/s2], velocity [m/s], displacement [m] or force [N].
    rate: sample rate [Hz]. low, high: band of the modes [Hz]; high 0: the whole record.
    max_modes: largest number of modes, of those that the data prove; 0: no fit. real_modes: proportional damping.
    average: h1, h2 or hv. weak_force: hits with a lower peak [N] are refused; 0: limit from the noise.
    exponential_time: time constant [s] of a window on both channels; 0: none.
    Raises Error when no hit is accepted, with the reason.
    """
    check.progress_function(progress)
    options = _options(low, high, max_modes, real_modes, average, weak_force, exponential_time)
    if response is None:
        files = [force] if isinstance(force, (str, os.PathLike)) else force
        if not isinstance(files, (list, tuple)) or not all(isinstance(file, (str, os.PathLike)) for file in files):
            raise UsageError("response: expected the response to each hit")
        if not files:
            raise UsageError("force: expected at least one file")
        return _smartmill.frf_of_files([check.file_name("force", file) for file in files], options, progress)
    forces = check.series_list("force", force, least=16)
    responses = check.series_list("response", response, least=16)
    if [len(f) for f in forces] != [len(r) for r in responses]:
        raise UsageError("response: expected as many hits and samples as in force")
    if rate is None:
        raise UsageError("rate: expected the sample rate [Hz] of the hits")
    column = {"force": "fx"}.get(kind, check.choice("kind", kind, RESPONSES))
    return _smartmill.frf(forces, responses, check.positive("rate", rate, "Hz"), column, options, progress)


def modes(frequency: npt.ArrayLike, value: npt.ArrayLike, std: Optional[npt.ArrayLike] = None, *, unit: str = "m/N",
          low: float = 0.0, high: float = 0.0, max_modes: int = 100, real_modes: bool = False,
          progress: Optional[Progress] = None) -> Frf:
    """Modes of a measured frequency response.

    frequency: increasing [Hz]. value: complex, of the same length. std: standard deviation of each line, in the same
    unit; None: estimated from neighbouring lines. Other arguments as in frf().
    """
    check.progress_function(progress)
    lines = check.series("frequency", frequency, least=16)
    if (np.diff(lines) <= 0.0).any():
        raise UsageError("frequency: expected increasing numbers")
    values = np.asarray(value)
    if values.dtype.kind not in "cfiu" or values.shape != lines.shape:
        raise UsageError(f"value: expected a complex array of shape {lines.shape} as frequency, "
                         f"got dtype {values.dtype}, shape {values.shape}")
    values = np.asarray(values, dtype=np.complex128, order="C")
    check.check_finite("value", values)
    deviation = None if std is None else check.series("std", std, size=len(lines))
    return _smartmill.modes(lines, values, deviation, unit, _options(low, high, max_modes, real_modes), progress)
