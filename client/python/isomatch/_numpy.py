"""numpy where it is installed; else None, and arrays are lists."""

from __future__ import annotations

from typing import Any

np: Any
try:
    import numpy as np
except ImportError:
    np = None
