"""What the functions of smartmill take and return: frozen dataclasses in SI units, and the exceptions.

Arrays make these classes comparable by identity only. An estimated quantity is an `Estimate`: a float with a standard
deviation.
"""
from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Dict, Mapping, Optional, Tuple

import numpy as np
import numpy.typing as npt

# The compiled part finds all classes here.
from .explanation import (ChannelGap, ChannelShare, Effect, Explanation, Finding, Gap, GapResult, RecalibratedValue,
                          Resemblance, RevolutionCurve, TestGap)
from .quantities import RPM, ComplexArray, Error, Estimate, FloatArray, Progress, UsageError, _set


@dataclass(frozen=True, init=False)
class Mode:
    """One vibration mode: gain w^2 / (w^2 - W^2 + 2 i zeta w W)."""

    frequency: Estimate  #: [Hz] natural frequency
    damping_ratio: Estimate  #: [1]
    gain: Estimate  #: static share: of a receptance [m/N], of a force sensor [1]
    phase: float  #: [rad] of the gain; 0: proportional damping
    evidence: float  #: [1] Wald's statistic over what chance gives; proven from 2.5 on; NaN: unknown

    def __init__(self, frequency: float, damping_ratio: float, gain: float, phase: float = 0.0,
                 evidence: float = math.nan) -> None:
        _set(self, estimates=dict(frequency=frequency, damping_ratio=damping_ratio, gain=gain), phase=phase,
             evidence=evidence)

    @property
    def stiffness(self) -> Estimate:
        """1 / gain; of a receptance [N/m]."""
        return Estimate(1.0 / self.gain, self.gain.std / self.gain**2)

    def response(self, frequency: npt.ArrayLike) -> ComplexArray:
        """Its frequency response without the phase, in the unit of the gain, at frequencies [Hz]."""
        ratio = np.asarray(frequency, dtype=float) / float(self.frequency)
        return np.asarray(self.gain / (1.0 - ratio**2 + 2j * self.damping_ratio * ratio))


@dataclass(frozen=True)
class Tool:
    """A mill: teeth about an axis and the shape of their edges; by default a flat end mill."""

    teeth: int  #: 1..20
    diameter: float  #: [m]
    helix: float = 0.0  #: [rad]
    pitch: Tuple[float, ...] = ()  #: [rad] tooth k to tooth k + 1, summing to 2 pi; empty: even
    corner_radius: float = 0.0  #: [m] that of the tool: ball end
    edge_angle: float = 0.5 * math.pi  #: [rad] of the edge to the plane across the tool axis (KAPR)
    tooth_helix: Tuple[float, ...] = ()  #: [rad] of each tooth, in place of helix; empty: all as helix
    serration_amplitude: float = 0.0  #: [m] of the radius
    serration_wavelength: float = 0.0  #: [m] > 0 with an amplitude


@dataclass(frozen=True)
class Cut:
    """Engagement, feed and speed. Angles are immersion angles: clockwise from the left side of the feed."""

    spindle_speed: float  #: [rad/s]
    feed_per_tooth: float  #: [m]
    axial_depth: float  #: [m]
    entry: float = 0.0  #: [rad]
    exit: float = math.pi  #: [rad]
    feed_direction: float = 0.0  #: [rad] of the feed in the machine, from +x towards +y

    @classmethod
    def of(cls, *, speed_rpm: float, feed_mm: float, depth_mm: float, entry_deg: float = 0.0,
           exit_deg: float = 180.0) -> "Cut":
        """From shop units: speed [rpm], feed per tooth and axial depth [mm], immersion angles [deg]; default a slot."""
        return cls(speed_rpm * RPM, 1e-3 * feed_mm, 1e-3 * depth_mm, math.radians(entry_deg), math.radians(exit_deg))


@dataclass(frozen=True, init=False)
class Coefficients:
    """Cutting coefficients of the linear edge-force model, per tooth, acting on the tool."""

    ktc: Estimate  #: [N/m2] tangential
    krc: Estimate  #: [N/m2] radial
    kac: Estimate  #: [N/m2] axial
    kte: Estimate  #: [N/m] tangential edge
    kre: Estimate  #: [N/m] radial edge
    kae: Estimate  #: [N/m] axial edge

    def __init__(self, ktc: float, krc: float, kac: float = 0.0, kte: float = 0.0, kre: float = 0.0,
                 kae: float = 0.0) -> None:
        _set(self, estimates=dict(ktc=ktc, krc=krc, kac=kac, kte=kte, kre=kre, kae=kae))

    def __str__(self) -> str:
        """Values in N/mm2 and N/mm."""
        lines = []
        for name in ("ktc", "krc", "kac", "kte", "kre", "kae"):
            unit, text = (1e6, "N/mm2") if name.endswith("c") else (1e3, "N/mm")
            of_one = getattr(self, name)
            if math.isfinite(of_one):
                lines.append(f"{name.capitalize()} {Estimate(of_one / unit, of_one.std / unit)} {text}")
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class CoefficientResult:
    """Identified cutting coefficients."""

    source: str  #: force or load_meter
    coefficients: Coefficients
    tests: int  #: cuts used
    covariance: Optional[FloatArray] = None  #: 6x6 in the order of Coefficients, SI; load meter: None
    r_squared: Optional[Tuple[float, float, float]] = None  #: [1] of the mean forces x, y, z; load meter: None
    friction_viscous: float = math.nan  #: [N m s/rad] found in air cuts; NaN: the model's
    friction_coulomb: float = math.nan  #: [N m] found in air cuts; NaN: the model's
    misfit: float = math.nan  #: [1] load meter: chi2 per degree of freedom between the records
    terms: Tuple[str, ...] = ()  #: load meter: added by evidence, such as Stribeck friction
    notes: Tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"from the {self.source.replace('_', ' ')} in {self.tests} cuts:\n{self.coefficients}"


@dataclass(frozen=True, eq=False)
class Record:
    """One test: its channels over time, measured, simulated or compensated."""

    name: str
    kind: str  #: cut, air or tap
    rate: float  #: [Hz] sample rate
    spindle_speed: float  #: [rad/s]
    cut: Optional[Cut]  #: of a cut
    direction: str  #: of a tap: x, y or z
    time: FloatArray  #: [s]
    #: fx, fy, fz [N]; spindle_angle [rad]; load_meter [V]; hammer [N]; tool_x, tool_y [m]; acceleration [m/s2]
    channels: Mapping[str, FloatArray] = field(repr=False)

    def __getitem__(self, channel: str) -> FloatArray:
        return self.channels[channel]

    @property
    def speed_rpm(self) -> float:
        """Spindle speed [rpm]."""
        return self.spindle_speed / RPM


@dataclass(frozen=True, eq=False)
class Lobes:
    """First loss of stability over spindle speed."""

    speed: FloatArray  #: [rad/s]
    depth: FloatArray  #: [m] limit; inf: stable up to max_depth
    frequency: FloatArray  #: [Hz] of the chatter; NaN without a limit
    kind: Tuple[str, ...]  #: none, hopf or flip
    error: FloatArray  #: [m] numerical error of the limit; NaN without errors=True

    @property
    def speed_rpm(self) -> FloatArray:
        """Spindle speed [rpm]."""
        return self.speed / RPM

    @property
    def depth_mm(self) -> FloatArray:
        """Limit [mm]."""
        return 1e3 * self.depth


@dataclass(frozen=True)
class RobustPoint:
    """A cut whose probability of chatter stays below the risk, also for speeds within the margin."""

    speed: float  #: [rad/s]
    depth: float  #: [m]
    probability: float  #: [1] largest within the margin

    @property
    def speed_rpm(self) -> float:
        """Spindle speed [rpm]."""
        return self.speed / RPM

    @property
    def depth_mm(self) -> float:
        """Axial depth [mm]."""
        return 1e3 * self.depth


@dataclass(frozen=True, eq=False)
class ChatterRisk:
    """Probability of chatter, from the standard deviations of modes and coefficients."""

    speed: FloatArray  #: [rad/s]
    depth: FloatArray  #: [m]
    probability: FloatArray  #: [1] by speed and depth
    nominal: FloatArray  #: [m] limit of the model itself
    points: Tuple[RobustPoint, ...]  #: largest speed x depth first, one a pocket

    @property
    def speed_rpm(self) -> FloatArray:
        """Spindle speed [rpm]."""
        return self.speed / RPM

    @property
    def depth_std(self) -> FloatArray:
        """[m] Standard deviation of the limit at each speed, within the depths of the chart."""
        # Mean and mean square of the limit from its distribution P(limit < depth) = probability.
        stable = 1.0 - self.probability
        low = self.depth[0]
        mean = low + self._integral(stable)
        square = low**2 + self._integral(2.0 * self.depth * stable)
        return np.asarray(np.sqrt(np.maximum(square - mean**2, 0.0)))

    def _integral(self, values: FloatArray) -> FloatArray:
        return np.asarray((0.5 * (values[:, 1:] + values[:, :-1]) * np.diff(self.depth)).sum(axis=1))


@dataclass(frozen=True)
class Hit:
    """Whether a hammer hit takes part in the average, and why not."""

    name: str
    accepted: bool
    reason: str  #: empty where accepted


@dataclass(frozen=True, eq=False)
class Frf:
    """A frequency response function and the modes fitted to it."""

    frequency: FloatArray  #: [Hz]
    value: ComplexArray  #: [m/N] of a motion, [1] of a force
    std: FloatArray  #: unit of the value: root of E|error|^2; NaN: unknown
    coherence: FloatArray  #: [1]; NaN with a single hit
    unit: str  #: m/N or 1
    modes: Tuple[Mode, ...]  #: proven, lowest frequency first
    doubts: Tuple[Mode, ...]  #: not proven
    fitted: ComplexArray  #: modes, doubts and flanks at each frequency; empty without a fit
    hits: Tuple[Hit, ...]


@dataclass(frozen=True, eq=False)
class Compensated:
    """Force on the tool, recovered from a force sensor that vibrates [N]."""

    fx: FloatArray
    fy: FloatArray
    fz: FloatArray


@dataclass(frozen=True, eq=False)
class CompensatedCampaign:
    """Force on the tool of each cut of a campaign, and the sensor's modes that were used."""

    sensor: Dict[str, Tuple[Mode, ...]]  #: by axis x, y, z; gains [1]
    records: Dict[str, Record]  #: by name of the test: fx, fy, fz [N]

    def __getitem__(self, test: str) -> Record:
        return self.records[test]


@dataclass(frozen=True, eq=False)
class Chatter:
    """Verdict on a recorded cut."""

    chatter: bool
    verdict: str  #: "no_cut", "stable", "chatter" or "unsure"
    probability: float  #: [1] of chatter; NaN without a cut
    cut: bool  #: something is being cut
    frequency: float  #: [Hz] strongest line of the chatter; NaN without
    spindle_speed: float  #: [rad/s] that the harmonics show
    start: float  #: [s] of the first cut
    end: float  #: [s] of the last cut
    over_noise: float  #: [dB] of the chatter line over its surroundings
    over_air: float  #: [dB] and over the same line out of the cut; NaN: the whole recording is cut
    companions: int  #: lines an integer number of tooth passings away
    share: float  #: [1] of the chatter's lines over those of the spindle's harmonics
    mode: float  #: [Hz] nearest of the given modes; NaN: none is given
    reason: str
    text: str = field(repr=False)  #: one line, as the program prints it
    time: FloatArray = field(repr=False)  #: [s] of the spectrogram's windows
    line: FloatArray = field(repr=False)  #: [Hz] of the spectrogram's lines
    power: FloatArray = field(repr=False)  #: spectrogram by window and line, each channel over its mean square

    def __str__(self) -> str:
        return self.text

    def __bool__(self) -> bool:
        return self.chatter
