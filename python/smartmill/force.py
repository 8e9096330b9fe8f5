"""Force compensation and cutting coefficients."""
from __future__ import annotations

import os
from typing import Mapping, Optional, Sequence, Union, overload

import numpy.typing as npt

from . import _arguments as check
from . import _smartmill
from ._arguments import Path
from ._smartmill import Model
from .quantities import RPM, FloatArray, Progress, UsageError
from .results import CoefficientResult, Compensated, CompensatedCampaign, Cut, Mode, Tool

COMPENSATIONS = ("kalman", "delay", "smoother", "fixed-lag", "inverse")


def coefficients(campaign: Path, model: Union[None, Path, Model] = None, *, source: str = "force",
                 means: str = "all") -> CoefficientResult:
    """Cutting coefficients with standard deviations from the cuts of a campaign.

    model: model file or Model with the tool; None: the campaign's own. Its cutting section is not used.
    source: force (dynamometer: all six), or load_meter (Ktc and Kte).
    means: force: all samples in cut, or over whole revolutions.
    Raises Error naming the file and what is missing.
    """
    path, chosen = check.file_name("campaign", campaign), check.model_or_none(model)
    check.choice("means", means, ("all", "revolutions"))
    if check.choice("source", source, ("force", "load_meter")) == "load_meter":
        return _smartmill.coefficients_of_load_meter(path, chosen)
    return _smartmill.coefficients_of_forces(path, chosen, means == "revolutions")


def coefficients_of_means(tool: Tool, cuts: Sequence[Cut], force: npt.ArrayLike,
                          std: Optional[npt.ArrayLike] = None) -> CoefficientResult:
    """Cutting coefficients from the mean forces of cuts at two feeds or more.

    force: mean fx, fy, fz on the tool of each cut [N], shape (cuts, 3), over whole revolutions.
    std: standard deviations of the means [N], the same shape; None: unweighted, from the residuals.
    Raises Error when the cuts do not separate the coefficients.
    """
    def rows(name: str, value: npt.ArrayLike) -> FloatArray:
        array = check.real_array(name, value)
        if array.shape != (len(cuts), 3):
            raise UsageError(f"{name}: expected an array of shape {(len(cuts), 3)} (cuts, 3), got {array.shape}")
        check.check_finite(name, array)
        return array

    return _smartmill.coefficients_of_means(tool, list(cuts), rows("force", force),
                                            None if std is None else rows("std", std))


@overload
def compensate(fx: npt.ArrayLike, fy: npt.ArrayLike, fz: npt.ArrayLike, *, rate: float,
               sensor: Mapping[str, Sequence[Mode]], speed_rpm: float, method: str = ..., bandwidth: float = ...,
               noise_rms: float = ..., lag: float = ...) -> Compensated: ...


@overload
def compensate(fx: Path, *, model: Union[None, Path, Model] = ..., identify: bool = ..., method: str = ...,
               bandwidth: float = ..., noise_rms: float = ..., lag: float = ...,
               progress: Optional[Progress] = ...) -> CompensatedCampaign: ...


def compensate(fx: Union[Path, npt.ArrayLike], fy: Optional[npt.ArrayLike] = None, fz: Optional[npt.ArrayLike] = None,
               *, rate: Optional[float] = None, sensor: Optional[Mapping[str, Sequence[Mode]]] = None,
               speed_rpm: Optional[float] = None, model: Union[None, Path, Model] = None, identify: bool = False,
               method: str = "kalman", bandwidth: float = 5000.0, noise_rms: float = 1.0, lag: float = 0.05,
               progress: Optional[Progress] = None) -> Union[Compensated, CompensatedCampaign]:
    """Force on the tool from a force sensor whose own vibration distorts it.

    fx, fy, fz: measured force on the tool [N]; or fx: a campaign folder, all of whose cuts are compensated.
    rate: sample rate [Hz]. sensor: modes by axis "x", "y", "z" (gain [1]; an axis left out is ideal).
    speed_rpm: of the spindle [rpm].
    Of a campaign: model with the sensor (None: the campaign's own), or identify=True: by its own taps.
    method: kalman (causal), delay, smoother (uses the whole record), fixed-lag or inverse.
    bandwidth [Hz] of the force. noise_rms [N] of one sample. lag [s] of fixed-lag.
    Raises Error naming file and cause.
    """
    check.progress_function(progress)
    check.choice("method", method, COMPENSATIONS)
    filters = (method, check.positive("bandwidth", bandwidth, "Hz"), check.positive("noise_rms", noise_rms, "N"),
               check.number("lag", lag, low=0.0, high=10.0, unit="s"))
    if isinstance(fx, (str, os.PathLike)):
        used, records = _smartmill.compensate_campaign(check.file_name("campaign", fx), check.model_or_none(model),
                                                       bool(identify), *filters, progress)
        return CompensatedCampaign(used, {record.name: record for record in records})
    if fy is None or fz is None or rate is None or sensor is None or speed_rpm is None:
        raise UsageError("compensate: arrays need fx, fy, fz, rate, sensor and speed_rpm")
    first = check.series("fx", fx)
    measured = [first, check.series("fy", fy, size=len(first)), check.series("fz", fz, size=len(first))]
    modes = check.modes("sensor", sensor, "xyz")
    axes = [modes.get(axis) for axis in "xyz"]
    speed = check.positive("speed_rpm", speed_rpm, "rpm") * RPM
    return Compensated(*_smartmill.compensate(measured, axes, check.positive("rate", rate, "Hz"), speed, *filters))
