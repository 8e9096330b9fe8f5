"""Stability lobes, probability of chatter, and chatter in recordings."""
from __future__ import annotations

import os
from typing import Optional, Sequence, Union

import numpy.typing as npt

from . import _arguments as check
from . import _smartmill
from ._arguments import Path
from ._smartmill import Model
from .quantities import RPM, Progress, UsageError
from .results import Chatter, ChatterRisk, Lobes

METHODS = ("collocation", "semi_discretization", "multi_frequency", "zero_order")


def lobes(model: Union[Path, Model], speeds_rpm: npt.ArrayLike, *, max_depth: float, entry_deg: float = 0.0,
          exit_deg: float = 180.0, method: str = "collocation", errors: bool = False,
          progress: Optional[Progress] = None) -> Lobes:
    """First loss of stability when the depth of cut grows, over spindle speed.

    model: file or Model with tool, cutting coefficients and modes of the tool tip (see machine_model).
    speeds_rpm: increasing spindle speeds [rpm]. max_depth: depths up to here [m].
    entry_deg, exit_deg: immersion angles of the cut [deg]; default a slot.
    method: collocation, semi_discretization, multi_frequency or zero_order.
    errors: estimate the numerical error of each limit by a refined solution. progress: called every 25 speeds.
    Raises Error naming what the model lacks.
    """
    speeds = check.rising("speeds_rpm", speeds_rpm)
    check.progress_function(progress)
    return _smartmill.lobes(
        check.model(model), check.number("entry_deg", entry_deg), check.number("exit_deg", exit_deg), speeds * RPM,
        check.positive("max_depth", max_depth, "m"), check.choice("method", method, METHODS), bool(errors), progress)


def chatter_risk(model: Union[Path, Model], speeds_rpm: npt.ArrayLike, depths: npt.ArrayLike, *,
                 entry_deg: float = 0.0, exit_deg: float = 180.0, draws: int = 60, seed: int = 1, risk: float = 0.05,
                 speed_margin: float = 0.02, progress: Optional[Progress] = None) -> ChatterRisk:
    """Probability of chatter over speed and depth, and cuts that stay below a risk.

    Machines are drawn from the standard deviations of modes and coefficients, or from the model's uncertainty_percent
    where it has none. speeds_rpm: increasing [rpm]. depths: increasing [m]. draws: machines. seed: of the draws.
    risk [1]: probability of chatter that a robust point may have at all of speeds_rpm within speed_margin [1] of it:
    give speeds closer together than the margin. progress: called after each draw.
    Raises Error naming what the model lacks.
    """
    speeds, depth = check.rising("speeds_rpm", speeds_rpm), check.rising("depths", depths)
    check.progress_function(progress)
    return _smartmill.chatter_risk(
        check.model(model), check.number("entry_deg", entry_deg), check.number("exit_deg", exit_deg), speeds * RPM,
        depth, check.integer("draws", draws, 1, 100000), check.integer("seed", seed, 0, 2**32 - 1),
        check.number("risk", risk, low=0.0, high=1.0), check.number("speed_margin", speed_margin, low=0.0, high=0.5),
        progress)


def detect(samples: Union[Path, npt.ArrayLike, Sequence[npt.ArrayLike]], rate: Optional[float] = None, *,
           speed_rpm: Optional[float] = None, teeth: int, speed_error: float = 0.02, modes: Sequence[float] = ()) -> Chatter:
    """Decide whether a recorded cut chatters.

    samples: one channel, rows of channels, or a sound file (WAV, FLAC). Sound, vibration, displacement or force.
    rate: sample rate [Hz] of arrays. speed_rpm: of the spindle, within speed_error [1]; None: found from the harmonics.
    teeth: of the tool.
    modes: natural frequencies of tool and spindle [Hz], if known.
    Raises Error on a recording that is too short.
    """
    speed = 0.0 if speed_rpm is None else check.positive("speed_rpm", speed_rpm, "rpm") * RPM
    count = check.integer("teeth", teeth, 1, 40)
    error = check.number("speed_error", speed_error, low=0.0, high=0.1)
    known = [check.positive("modes", mode, "Hz") for mode in modes]
    if isinstance(samples, (str, os.PathLike)):
        return _smartmill.detect_sound(check.file_name("samples", samples), speed, count, error, known)
    channels = check.series_list("samples", samples)
    if len({len(channel) for channel in channels}) > 1:
        raise UsageError("samples: expected channels of one length")
    if rate is None:
        raise UsageError("rate: expected the sample rate [Hz] of the samples")
    return _smartmill.detect(channels, check.positive("rate", rate, "Hz"), speed, count, error, known)
