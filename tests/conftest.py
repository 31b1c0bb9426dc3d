"""Tests run side by side: threads within matrix products would only be in each other's way."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
