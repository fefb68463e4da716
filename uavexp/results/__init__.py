"""Every committed study flown anew by one command: `make results`."""
