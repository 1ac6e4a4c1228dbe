"""Benchmarks of speed and accuracy. Each runs on one machine at one time: compare its ratios, not its seconds."""
