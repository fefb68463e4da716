"""Where tests find what they read."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CONF = ROOT / "conf"
DATA = ROOT / "tests" / "data"
SHARED = ROOT.parent / "shared" / "data"
