"""Machine models, campaigns and the twin."""
from __future__ import annotations

from typing import Dict, Mapping, Optional, Sequence, Union, overload

from . import _arguments as check
from . import _smartmill
from ._arguments import Path
from ._smartmill import Model
from .quantities import Progress, UsageError
from .results import Coefficients, Cut, Mode, Record, Tool


def machine_model(tool: Optional[Tool] = None, cutting: Optional[Coefficients] = None, *,
                  tool_tip: Optional[Mapping[str, Sequence[Mode]]] = None,
                  force_sensor: Optional[Mapping[str, Sequence[Mode]]] = None) -> Model:
    """A model from numbers instead of a file.

    tool_tip: modes of the receptance [m/N] by axis "x", "y"; an axis left out is rigid.
    force_sensor: modes of measured over applied force [1] by axis "x", "y", "z"; an axis left out is ideal.
    Raises Error naming a number that is out of range.
    """
    return _smartmill.model_from(tool, cutting, check.modes("tool_tip", tool_tip, "xy"),
                                 check.modes("force_sensor", force_sensor, "xyz"))


def read_campaign(campaign: Path) -> Dict[str, Record]:
    """The measured records of a campaign by the name of the test, in SI units.

    campaign: folder with campaign.yaml (smartmill-campaign/1), or that file.
    Raises Error naming file, line and column.
    """
    return {r.name: r for r in _smartmill.read_campaign(check.file_name("campaign", campaign))}


@overload
def simulate(model: Union[Path, Model], what: Cut, *, duration: float = ..., rate: float = ...,
             phase: Optional[float] = ..., noise: bool = ..., seed: int = ...) -> Record: ...


@overload
def simulate(model: Union[None, Path, Model], what: Path, *, noise: bool = ..., seed: int = ...,
             progress: Optional[Progress] = ...) -> Dict[str, Record]: ...


def simulate(model: Union[None, Path, Model], what: Union[Path, Cut], *, duration: float = 0.2, rate: float = 20000.0,
             phase: Optional[float] = None, noise: bool = True, seed: int = 1,
             progress: Optional[Progress] = None) -> Union[Record, Dict[str, Record]]:
    """Simulate a cut, or every test of a campaign.

    model: model file or Model; None: the campaign's own.
    what: a Cut, or a campaign folder that gives plan, sample times, spindle phase and hammer forces.
    duration [s], rate [Hz], phase: spindle angle at the first sample [rad] (None: drawn by the seed); of a Cut.
    noise: sensor noise and rounding of the load meter. seed: of the noise.
    progress: called before each test of a campaign.
    Returns one Record, or one of each test by its name. Raises Error naming what the model lacks.
    """
    check.progress_function(progress)
    seed = check.integer("seed", seed, 0, 2**63 - 1)
    if isinstance(what, Cut):
        if model is None:
            raise UsageError("model: expected a model file or Model to simulate a Cut")
        check.positive("spindle_speed", what.spindle_speed, "rad/s")
        return _smartmill.simulate_cut(
            check.model(model), what, check.positive("duration", duration, "s"), check.positive("rate", rate, "Hz"),
            None if phase is None else check.number("phase", phase, unit="rad"), bool(noise), seed)
    records = _smartmill.simulate_campaign(check.model_or_none(model), check.file_name("campaign", what), bool(noise),
                                           seed, progress)
    return {record.name: record for record in records}
