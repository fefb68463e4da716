"""Makes the digests of the golden flights anew."""

import json

from tests.golden.flights import DIGESTS, fly_apart

DIGESTS.write_text(json.dumps(fly_apart(), indent=1) + "\n", encoding="utf-8")
