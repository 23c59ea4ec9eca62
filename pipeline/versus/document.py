"""A comparison of two campaigns as JSON."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.nulls import plain
from pmg.pipeline.versus.statement import alike, statement

if TYPE_CHECKING:
    from pmg.pipeline.versus.constants import ConstantDifference
    from pmg.pipeline.versus.difference import PointDifference, Versus
    from pmg.pipeline.versus.judged import GroupResult, Judged
    from pmg.pipeline.versus.matching import Unmatched
    from pmg.pipeline.versus.side import Side
    from pmg.sim.grid import Grid

SCHEMA = "pmg.versus/1"
