"""Tests that take long and try further cases of what faster ones hold: left out unless `PMG_SLOW` is 1."""

from __future__ import annotations

import os

import pytest

SLOW = os.environ.get("PMG_SLOW") == "1"
"""Whether they are run."""

slow = pytest.mark.skipif(not SLOW, reason="a further case that takes long; PMG_SLOW=1 tries it")
"""Mark of a test, or of one of its cases."""
