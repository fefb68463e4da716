"""Property tests draw the same examples everywhere: a failure in one clone is one in all."""

from hypothesis import settings

settings.register_profile("same_everywhere", derandomize=True)
settings.load_profile("same_everywhere")
