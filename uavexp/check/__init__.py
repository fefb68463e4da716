"""The promises of every group, which each of its options keeps, as functions that anyone can call."""
