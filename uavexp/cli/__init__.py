"""The command line in parts: options, overrides, composition, trust, flights, output."""
