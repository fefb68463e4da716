"""`python -m benchmarks`; the flights live in a module that their processes can import."""

from benchmarks.bench import main

main()
