"""A user's own package: `--config-dir tests/faulty` with UAVEXP_TRUST=tests gives trigger=faulty."""
