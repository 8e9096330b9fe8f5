"""SmartMill: what a milling machine does, why it differs from its model, and how to cut without chatter.

    import smartmill
    why = smartmill.explain("my_campaign")
    print(why)

Functions take NumPy arrays, campaign folders and model files, and return frozen dataclasses in SI units.
An estimated quantity is a float with a standard deviation: mode.frequency, mode.frequency.std.
Errors are smartmill.Error with the one line that the programs print.
"""
import atexit as _atexit

from . import _smartmill
from ._smartmill import Model
from .discrepancy import explain, gap
from .explanation import (ChannelGap, ChannelShare, Effect, Explanation, Finding, Gap, GapResult, RecalibratedValue,
                          Resemblance, RevolutionCurve, TestGap)
from .force import coefficients, coefficients_of_means, compensate
from .machine import machine_model, read_campaign, simulate
from .modal import frf, modes
from .quantities import Error, Estimate, UsageError
from .results import (Chatter, ChatterRisk, CoefficientResult, Coefficients, Compensated, CompensatedCampaign, Cut, Frf,
                      Hit, Lobes, Mode, Record, RobustPoint, Tool)
from .stability import chatter_risk, detect, lobes

__all__ = [
    "simulate", "gap", "explain", "lobes", "chatter_risk", "frf", "modes", "coefficients", "coefficients_of_means",
    "compensate", "detect", "read_campaign", "machine_model", "Model",
    "ChannelGap", "ChannelShare", "Chatter", "ChatterRisk", "CoefficientResult", "Coefficients", "Compensated",
    "CompensatedCampaign", "Cut", "Effect", "Error", "Estimate", "Explanation", "Finding", "Frf", "Gap", "GapResult",
    "Hit", "Lobes", "Mode", "Record", "RecalibratedValue", "Resemblance", "RevolutionCurve", "RobustPoint", "TestGap", "Tool",
    "UsageError"]

_atexit.register(_smartmill.wait_for_abandoned)
