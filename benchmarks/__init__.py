"""Benchmarks of speed and accuracy. Each runs on one machine at one time: compare its ratios, not its seconds.

A table in results/ names the commit that made it: what was measured for one decision is in that commit alone.
"""
