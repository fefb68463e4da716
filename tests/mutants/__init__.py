"""One-line mutations of the core that the tests must notice: `make mutants`."""
