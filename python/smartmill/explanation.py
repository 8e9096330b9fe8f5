"""What smartmill.gap and smartmill.explain return: frozen dataclasses."""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Dict, Optional, Tuple

from .quantities import Estimate, FloatArray

if TYPE_CHECKING:
    from ._smartmill import Model


@dataclass(frozen=True)
class ChannelGap:
    """Gap of one channel of one test."""

    test: str
    channel: str
    gap: float  #: [1] RMS of (measured - simulated) over the noise; 1 is the noise floor
    residual_rms: float  #: unit of the channel


@dataclass(frozen=True)
class GapResult:
    """Difference between a campaign's records and the twin."""

    overall: float  #: [1] RMS over all samples and channels, each over its noise
    channels: Tuple[ChannelGap, ...]
    noise: Dict[str, float]  #: RMS by channel, in its unit
    notes: Tuple[str, ...]

    @property
    def largest(self) -> Dict[str, float]:
        """[1] Largest gap of each channel."""
        return {c: max(row.gap for row in self.channels if row.channel == c) for c in
                dict.fromkeys(row.channel for row in self.channels)}

    def __str__(self) -> str:
        rows = [f"{row.test:24s} {row.channel:12s} {row.gap:8.3f}" for row in self.channels]
        return "\n".join(rows + [f"overall gap {self.overall:.4f}"])


@dataclass(frozen=True)
class Gap:
    """Gap over all tests of a kind [1]; 1 is the noise floor."""

    fit: float  #: tests that the model was fitted to
    heldout: float  #: tests that took no part in any fit


@dataclass(frozen=True)
class Effect:
    """An effect that the model lacked."""

    name: str  #: as in the catalogue (docs/effects.md)
    variant: str
    words: Dict[str, str]  #: channel, axis
    parameters: Dict[str, Estimate]  #: by key of the model file, in the unit that the key names
    modulo: Dict[str, float]  #: deg: angles known up to multiples of it, since no spindle angle was recorded
    confidence: float  #: [1] that it (or what not_separable lists with it) reduces the gap of held-out tests
    delta_bic: float  #: [1] BIC that is lost without it
    heldout_gap_reduction: float  #: [1] share of the held-out squares above the noise that it removes
    alternatives: Dict[str, float]  #: other effects in its place: delta_bic of each


@dataclass(frozen=True)
class Finding:
    """Structure in the residual that is not noise."""

    channel: str
    tests: Tuple[str, ...]
    domain: str  #: order, frequency, level or time
    location: Dict[str, float]  #: order [1], frequency_hz [Hz] or time_s [s]
    depends_on: Tuple[str, ...]  #: cutting, speed, chip_load, depth, immersion, time
    amplitude: float  #: unit of the channel
    share_of_gap: float  #: [1]
    p_value: float  #: [1]


@dataclass(frozen=True)
class Resemblance:
    """An effect of the catalogue that resembles the residual and was rejected."""

    name: str
    variant: str
    reason: str


@dataclass(frozen=True)
class TestGap:
    """Gap of one channel of one test before and after."""

    __test__ = False  # no test case
    test: str
    channel: str
    heldout: bool
    before: float  #: [1]
    after: float  #: [1]
    std: float  #: [1] of a gap at the noise floor, by chance alone


@dataclass(frozen=True)
class RecalibratedValue:
    """A nominal value that the records determine differently than the model states."""

    name: str  #: key in the model file
    before: float  #: unit of the key: stated
    after: float  #: unit of the key
    std: float  #: unit of the key, of the value after
    deviations: float  #: [1] change over the stated uncertainty


@dataclass(frozen=True)
class ChannelShare:
    """One channel over all cuts: how much of its variance the models explain."""

    channel: str
    explained_before: float  #: [1]
    explained_after: float  #: [1]
    explained_heldout: Optional[float]  #: [1] after, held-out cuts alone
    repeats: Optional[float]  #: [1] share that is synchronous with the spindle
    floor: float  #: unit of the channel: RMS of what is not synchronous
    floor_gap: float  #: [1] the same over the noise


@dataclass(frozen=True, eq=False)
class RevolutionCurve:
    """One channel of one test over the spindle angle, mean of the revolutions; in the unit of the channel."""

    test: str
    channel: str
    angle_deg: FloatArray  #: [deg]
    measured: FloatArray
    nominal: FloatArray
    improved: FloatArray


@dataclass(frozen=True, eq=False)
class Explanation:
    """Why measurement and model differ."""

    verdict: str  #: no_disagreement, recalibrated, explained, partly_explained or unknown_effect
    sentence: str  #: for the machinist; may be empty
    effects: Tuple[Effect, ...]
    recalibrated: Tuple[RecalibratedValue, ...]  #: of this verdict; most deviations first
    gap_before: Gap
    gap_after: Gap
    gap_named_only: Optional[Gap]  #: without the effects that have no name, where there are any
    where: Tuple[Finding, ...]  #: where measurement and nominal model differ
    unexplained: Tuple[Finding, ...]  #: and where they still do
    resembles: Tuple[Resemblance, ...]
    not_separable: Tuple[Tuple[str, ...], ...]  #: effects that these tests cannot distinguish
    suggested_test: Optional[str]
    gaps: Tuple[TestGap, ...]
    channels: Tuple[ChannelShare, ...]
    revolutions: Tuple[RevolutionCurve, ...]
    model: "Model" = field(repr=False)  #: the improved model
    notes: Tuple[str, ...]
    interrupted: bool  #: progress returned False: found until then
    spent_budget: Optional[float]  #: [s] budget that ended a stage: found until then
    not_tried: Tuple[str, ...]  #: effects that either has left untried
    seconds: float  #: [s] of computing
    summary: str = field(repr=False)  #: as the program prints it

    def __str__(self) -> str:
        return self.summary
