"""Where measurement and model differ, and why."""
from __future__ import annotations

import tempfile
from typing import Optional, Union

from . import _arguments as check
from . import _smartmill
from ._arguments import Path
from ._smartmill import Model
from .explanation import Explanation, GapResult
from .quantities import Progress


def gap(campaign: Path, model: Union[None, Path, Model] = None, *, threads: int = 2) -> GapResult:
    """RMS of (measured - simulated) over the noise, test by test; 1 is the noise floor.

    campaign: folder with campaign.yaml. model: model file or Model; None: the campaign's own. threads: 1..64.
    Raises Error naming file and cause.
    """
    return _smartmill.gap(check.file_name("campaign", campaign), check.model_or_none(model),
                          check.integer("threads", threads, 1, 64))


def explain(campaign: Path, model: Union[None, Path, Model] = None, *, out: Optional[Path] = None, threads: int = 2,
            prior: Optional[Path] = None, budget: Optional[float] = None, progress: Optional[Progress] = None) -> Explanation:
    """Find which effects the model lacks, how large they are and what remains unexplained.

    campaign: folder with campaign.yaml. model: model file or Model; None: the campaign's own. threads: 1..64.
    out: folder for the report (report.html, report.json, model.yaml, pictures); None: no report.
    prior: file with the odds of each effect on other machines (smartmill-causes/1).
    budget: [s] > 0, after which the best result so far is judged and returned; None: no limit.
    progress: called as progress(share, line); returning False ends the search, and what has been found is returned.
    Ctrl-C raises KeyboardInterrupt. Other Python threads run meanwhile.
    Raises Error naming file and cause.
    """
    check.progress_function(progress)
    path, chosen = check.file_name("campaign", campaign), check.model_or_none(model)
    count = check.integer("threads", threads, 1, 64)
    odds = None if prior is None else check.file_name("prior", prior)
    seconds = None if budget is None else check.positive("budget", budget)
    if out is not None:
        return _smartmill.explain(path, chosen, check.file_name("out", out), True, count, odds, seconds, progress)
    folder = tempfile.TemporaryDirectory(prefix="smartmill_", ignore_cleanup_errors=True)
    with folder:
        return _smartmill.explain(path, chosen, folder.name, False, count, odds, seconds, progress)
