"""The rules of a mission, one file a subject (docs/benchmark.md), its state, observations, trace and score."""
