"""Numbers that the functions of smartmill take and return, and the exceptions."""
from __future__ import annotations

import math
from typing import Callable, Mapping, Optional, Tuple

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
#: Called as progress(share, line): share of the work done 0..1, and a line of text that may be empty.
Progress = Callable[[float, str], Optional[bool]]

RPM = 2.0 * math.pi / 60.0  # [rad/s]


class Error(RuntimeError):
    """Bad file, data or parameter: one line with what is wrong and where, as the program `smartmill` prints it."""


class UsageError(Error, ValueError):
    """An argument that cannot be used."""


class Estimate(float):
    """A float with a standard deviation in the same unit; NaN where it is unknown.

    Arithmetic gives plain floats. `str()` and an empty format show both: 1074.2 +- 0.3.
    """

    __slots__ = ("std",)
    std: float

    def __new__(cls, value: float, std: float = math.nan) -> "Estimate":
        self = super().__new__(cls, value)
        self.std = float(std)
        return self

    @property
    def value(self) -> float:
        """The value as a plain float."""
        return float(self)

    def __repr__(self) -> str:
        return f"Estimate({float(self)!r}, std={self.std!r})"

    def __str__(self) -> str:
        if not math.isfinite(self.std):
            return f"{float(self):g}"
        digits = max(0, 1 - math.floor(math.log10(self.std))) if self.std > 0.0 else 6
        if digits > 6 or abs(self) >= 1e7:
            return f"{float(self):.6g} +- {self.std:.2g}"
        return f"{float(self):.{digits}f} +- {self.std:.{digits}f}"

    def __format__(self, spec: str) -> str:
        return float(self).__format__(spec) if spec else str(self)

    def __reduce__(self) -> Tuple[type, Tuple[float, float]]:
        return (type(self), (float(self), self.std))


def _set(result: object, *, estimates: Mapping[str, float], **values: float) -> None:
    """Set the fields of a frozen dataclass; plain numbers become estimates without a standard deviation."""
    for name, value in estimates.items():
        object.__setattr__(result, name, value if isinstance(value, Estimate) else Estimate(value))
    for name, value in values.items():
        object.__setattr__(result, name, value)
